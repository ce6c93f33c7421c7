"""The degrees of freedom as people read and set them: meters, degrees, roll, pitch and yaw, grouped by joint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import FileFormatError
from ...geometry import se3, so3
from ...loaders.model.model_yaml import transform_of
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, Axis
from ...optimize.levenberg_marquardt import clip_to_limits

ROOT_NAMES = ("x", "y", "z", "roll", "pitch", "yaw")
_REACH_M = 1.5  # of the sliders of the root, about where it is at first


def values_of(state: State, model: ArticulatedModel) -> list[float]:
    """The degrees of freedom as people read them.

    Parameters
    ----------
    state : of the body.
    model : the body.

    Returns
    -------
    (n_dof,): position in meters, fixed-axis roll, pitch, yaw in degrees, then the axes in degrees or meters.
    """
    joints = state.joint_positions * _per_unit(model)
    rpy_deg = np.rad2deg(so3.to_roll_pitch_yaw(state.T_world_root[:3, :3])) + 0.0
    return [*state.T_world_root[:3, 3].tolist(), *rpy_deg.tolist(), *joints.tolist()]


def state_of(values: Sequence[float], model: ArticulatedModel) -> State:
    """Inverse of `values_of`; joints are put within their limits, and driven ones where their leaders put them.

    Parameters
    ----------
    values : (n_dof,), as of `values_of`.
    model : the body.

    Returns
    -------
    The state.

    Raises
    ------
    FileFormatError : another number of values than the model has degrees of freedom.
    """
    if len(values) != model.n_dof:
        raise FileFormatError("request", "values", f"{model.n_dof} numbers, for model '{model.name}'", len(values))
    root = transform_of((0.0, 0.0, 0.0), tuple(values[3:N_ROOT_DOF]))
    T = se3.from_rotation_translation(root[:3, :3], np.array(values[:3]))
    joints = np.array(values[N_ROOT_DOF:], dtype=np.float64) / _per_unit(model)
    return clip_to_limits(State(T, model.chain.followed(joints)), model.chain)


def dof_groups(model: ArticulatedModel, values: Sequence[float]) -> list[dict[str, Any]]:
    """The root, then every joint that moves.

    Parameters
    ----------
    model : the body.
    values : (n_dof,), the pose about which the sliders of the root reach.

    Returns
    -------
    ``name``, ``link`` (what it moves), and ``dofs`` with name, unit, limits, neutral of each.
    """
    around = [(x - _REACH_M, x + _REACH_M) for x in values[:3]] + 3 * [(-180.0, 180.0)]
    units = 3 * ["m"] + 3 * ["deg"]
    root = [_dof(name, i, units[i], around[i], None, False) for i, name in enumerate(ROOT_NAMES)]
    groups = [{"name": "root", "link": model.chain.links[0], "dofs": root}]
    joint_of = {joint.child: joint for joint in model.chain.joints}
    chain = model.chain
    for link, name in enumerate(chain.links):
        first = int(chain.axis_start[link])
        axes = chain.axes[first : first + int(chain.axis_count[link])]
        if axes:
            dofs = [_axis_dof(axis, N_ROOT_DOF + first + i) for i, axis in enumerate(axes)]
            groups.append({"name": joint_of[name].name, "link": name, "dofs": dofs})
    return groups


def _axis_dof(axis: Axis, index: int) -> dict[str, Any]:
    per = 1.0 if axis.prismatic else 180.0 / np.pi
    limits = (-180.0, 180.0) if axis.endless else (axis.lower * per, axis.upper * per)
    return _dof(axis.name, index, "m" if axis.prismatic else "deg", limits, axis.neutral * per, axis.mimic is not None)


def _dof(name: str, index: int, unit: str, limits: tuple[float, float], neutral: float | None, driven: bool) -> dict[str, Any]:
    lower, upper = limits
    return {"name": name, "index": index, "unit": unit, "lower": lower, "upper": upper, "neutral": neutral, "driven": driven}


def _per_unit(model: ArticulatedModel) -> np.ndarray:
    """(n_axes,) what to multiply radians and meters by for degrees and meters."""
    return np.array([1.0 if axis.prismatic else 180.0 / np.pi for axis in model.chain.axes])
