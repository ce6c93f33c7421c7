"""What a body may not do, as objectives beside those of the images, and the pose it is taken for where they are silent."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..model.articulated import ArticulatedModel
from ..model.configuration import Neighbor, State
from ..model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ..objective.constraints.collision import CollisionObjective, FloorObjective
from ..objective.constraints.prior import CouplingObjective, Prior
from ..objective.normal_equations import LeastSquaresObjective
from .config import MotionConfig, TrackerConfig

PX2_PER_INFORMATION = 18.0  # of the priors of `MotionConfig`, which are stated in squared pixels


def neutral_information(chain: KinematicChain, motion: MotionConfig) -> np.ndarray:
    """Information of the prior of the neutral pose.

    Parameters
    ----------
    chain, motion : stiffness of each axis, and that of all.

    Returns
    -------
    (n_dof,) in units of information; 0 of the root.
    """
    weights = np.zeros(chain.n_dof)
    weights[N_ROOT_DOF:] = [motion.neutral_angle * axis.stiffness for axis in chain.axes]
    return weights / PX2_PER_INFORMATION


def resting(model: ArticulatedModel, motion: MotionConfig) -> Prior:
    """The prior of the neutral pose, wherever the root is.

    Parameters
    ----------
    model, motion : body, and how strong its prior is.

    Returns
    -------
    In units of information.
    """
    return Prior(State.neutral(model), neutral_information(model.chain, motion))


def staying(expected: State, motion: MotionConfig) -> Prior:
    """The prior of a state that somebody has given, where nothing is predicted.

    Parameters
    ----------
    expected : the state given.
    motion : parameters.

    Returns
    -------
    In information units.
    """
    stay = np.full(N_ROOT_DOF + len(expected.joint_positions), motion.stay_angle)
    stay[:3] = motion.stay_position
    return Prior(expected, stay / PX2_PER_INFORMATION)


def given_sigmas(given: State, motion: MotionConfig) -> np.ndarray:
    """How well a state is known that somebody has given: as `staying`, and the place of a fixed base.

    Parameters
    ----------
    given, motion : the state; parameters.

    Returns
    -------
    (n_dof,) standard deviations, at most 1 m and 1 rad.
    """
    sigmas = np.maximum(staying(given, motion).information, 1.0) ** -0.5
    if motion.base == "fixed":
        sigmas[:3], sigmas[3:N_ROOT_DOF] = motion.base_position_sigma_m, np.radians(motion.base_angle_sigma_deg)
    return sigmas


def constraints_of(
    model: ArticulatedModel, config: TrackerConfig, others: Callable[[], Sequence[Neighbor]] | None = None
) -> list[LeastSquaresObjective]:
    """Parts that may not pass through each other, other bodies or the floor, and axes that follow others, where there are such.

    Parameters
    ----------
    model, config : body, and which of its constraints hold.
    others : the other bodies that stand about at present; None: there are never any.

    Returns
    -------
    Objectives in units of information; empty where there are none.
    """
    result: list[LeastSquaresObjective] = []
    if config.collision.enabled:
        collisions = CollisionObjective(model, config.collision.sigma_m, others or tuple)
        result += [collisions] if len(collisions.pairs) or others is not None else []
    if config.floor.enabled:
        result.append(FloorObjective(model, config.floor.height_m, config.floor.sigma_m))
    if model.chain.couplings:
        result.append(CouplingObjective(model.chain))
    return result
