"""Fits to detected points alone: from blunt to sharp, Levenberg-Marquardt, with the priors of motion and of the neutral pose."""

from __future__ import annotations

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.constraints.prior import Prior
from ...optimize.fitter import Fit, Fitter, Stage
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions
from ..config import TrackerConfig
from ..constraints import constraints_of, resting, staying
from ..engine import Solver
from .modality import KeypointModality

# Factors of what the points say: the first reach bodies that are far off, and what is no outlier is told at the end
_FIRST, _LATER = (0.003, 0.03, 0.3, 1.0), (0.1, 1.0)
_FIRST_ITERATIONS, _ITERATIONS = 30, 8
_HELD = 1e6  # information of what may not move
_CLEARLY = 4.0  # cost by which a limb has to be better elsewhere


class KeypointFitting(Solver):
    """How bodies are fitted to the points of a `KeypointModality`.

    Parameters
    ----------
    model, config : as for the `Tracker`.
    modality : has the points.
    """

    def __init__(self, model: ArticulatedModel, config: TrackerConfig, modality: KeypointModality):
        self._config, self.modality, self._chain = config, modality, model.chain
        self._fitter, self._rest = Fitter(model, constraints_of(model, config)), resting(model, config.motion)

    def fit(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """Blunt points, then sharp ones."""
        sharpness = _FIRST if first else _LATER
        options = LevenbergMarquardtOptions(_FIRST_ITERATIONS if first else _ITERATIONS)
        stages = [Stage(each, options, compares=each == sharpness[-1]) for each in sharpness]
        return self._fitter.fit(start, self.modality, stages, [prior or staying(start, self._config.motion), self._rest])

    def limb_elsewhere(self, state: State, dofs: np.ndarray) -> State | None:
        """A limb where its points are, from wherever it is.

        Parameters
        ----------
        state : of the body, which is held but for the limb.
        dofs : (n_dof,) mask of the limb's own.

        Returns
        -------
        The state with the limb elsewhere; None where the points do not clearly speak for that.
        """
        joints = dofs[N_ROOT_DOF:]
        held = Prior(state, np.where(dofs, 0.0, _HELD))
        here, rest = state.joint_positions, np.array([axis.neutral for axis in self._chain.axes])
        lower, upper = self._chain.lower, self._chain.upper
        limited = np.isfinite(lower) & np.isfinite(upper)
        middle = np.where(limited, 0.5 * (np.where(limited, lower, 0.0) + np.where(limited, upper, 0.0)), rest)
        tried = [np.where(joints, angles, here) for angles in (here, middle, rest)]
        best = min((self.fit(State(state.T_world_root, angles), True, held).state for angles in tried), key=self._cost)
        return best if self._cost(best) < self._cost(state) - _CLEARLY else None

    def _cost(self, state: State) -> float:
        cost = self.modality.correspond(state, 1.0).at(state).equations.cost
        return cost if np.isfinite(cost) else np.inf
