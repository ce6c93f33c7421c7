"""The other ways in which a rigid body may be turned, seen by few cameras: its outline is nearly the same.

What a single camera sees of a box that shows it one face hardly tells to which side that face is tilted. A fit that has taken the
wrong one looks for contours where none are; some of them it finds, on edges of other faces, and its lines no longer agree.
"""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...geometry import so3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State

ANGLES = (np.radians(8.0), np.radians(20.0))
_AXES = 6


def tilted(model: ArticulatedModel, rig: CameraRig, state: State) -> list[State]:
    """States whose root is tilted about axes across the line of sight of the nearest camera, its middle staying in place.

    Parameters
    ----------
    model, rig : body and cameras.
    state : that is tilted.

    Returns
    -------
    One for each angle and axis.
    """
    middle = Configuration(model, state).Ts_world_shape[:, :3, 3].mean(axis=0)
    camera = min(rig, key=lambda camera: float(np.linalg.norm(camera.center - middle)))
    sight = camera.T_cam_world[:3, :3] @ (middle - camera.center)
    across = np.cross(sight, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    other = np.cross(sight / np.linalg.norm(sight), across)
    states = []
    for angle in ANGLES:
        for turn in np.arange(_AXES) * (2.0 * np.pi / _AXES):
            axis = camera.T_world_cam[:3, :3] @ (np.cos(turn) * across + np.sin(turn) * other)
            rotation = so3.exp(angle * axis)
            T = state.T_world_root.copy()
            T[:3, :3] = rotation @ T[:3, :3]
            T[:3, 3] = middle + rotation @ (T[:3, 3] - middle)
            states.append(State(T, state.joint_positions))
    return states


class Misfit:
    """Whether the lines of a fit disagree much more than they used to."""

    SUDDEN = 2.5  # times the usual misfit
    RATE = 0.1
    PATIENCE = 3  # sudden misfits in a row, after which they are usual: what is tried against them has not helped

    def __init__(self):
        self._usual: float | None = None
        self._in_a_row = 0

    def is_sudden(self, misfit: float) -> bool:
        """``misfit``: mean robust cost of a line; what is not sudden is usual from now on."""
        if self._usual is not None and misfit > self.SUDDEN * self._usual:
            self._in_a_row += 1
            if self._in_a_row <= self.PATIENCE:
                return True
            self._usual = misfit
        self._in_a_row = 0
        self._usual = misfit if self._usual is None else (1.0 - self.RATE) * self._usual + self.RATE * misfit
        return False
