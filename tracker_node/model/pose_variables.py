"""The variables of a pose in the words of biomechanics: position, somersault, tilt, twist, joint angles.

Trewartha et al. describe orientation by successive rotations of the pelvis about a lateral horizontal, a frontal and a
longitudinal axis. With x forward, y to the left and z up, R = Ry(somersault) Rx(tilt) Rz(twist); forward somersaults count up.
Stepping and simplex walk these variables one by one; they are ambiguous only where the tilt is 90 degrees.
"""

from __future__ import annotations

import math

import numpy as np

from ..geometry import se3, so3
from .articulated import ArticulatedModel
from .configuration import State

ROOT_NAMES = ("x", "y", "z", "somersault", "tilt", "twist")
N_ROOT = len(ROOT_NAMES)


def angles_of(rotation: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
    """Somersault, tilt, twist (3,) in radians.

    Parameters
    ----------
    near : (3,) angles to stay close to: full turns are added, and the other of the two solutions taken, so that a somersault may
        count beyond 180 degrees. Without it the tilt lies within +-90 degrees.
    """
    first = np.array(so3.to_somersault_tilt_twist(rotation))
    if near is None:
        return first
    other = first * [1.0, -1.0, 1.0] + math.pi
    turns = [angles + 2.0 * math.pi * np.round((near - angles) / (2.0 * math.pi)) for angles in (first, other)]
    return min(turns, key=lambda angles: float(np.abs(angles - near).sum()))


def variable_names(model: ArticulatedModel) -> tuple[str, ...]:
    """Names of the variables, in order."""
    return (*ROOT_NAMES, *(axis.name for axis in model.chain.axes))


def to_variables(state: State, near: np.ndarray | None = None) -> np.ndarray:
    """(6 + n_axes,): position in metres, then angles in radians; ``near`` (variables) settles full turns, see `angles_of`."""
    angles = angles_of(state.T_world_root[:3, :3], None if near is None else near[3:6])
    return np.concatenate([state.T_world_root[:3, 3], angles, state.joint_positions])


def from_variables(variables: np.ndarray) -> State:
    """Inverse of `to_variables`."""
    variables = np.asarray(variables, dtype=np.float64)
    rotation = so3.from_somersault_tilt_twist(variables[3], variables[4], variables[5])
    return State(se3.from_rotation_translation(rotation, variables[:3]), variables[N_ROOT:].copy())
