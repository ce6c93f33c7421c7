"""Manual digitizing, simulated: a person clicks on points of a body in every image, and its pose is computed from them.

As in the laboratory: each point is reconstructed from the cameras that show it by DLT, and the rigid body is laid into the
points by least squares. Whoever digitizes knows nothing of when a camera exposed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import Camera
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...render.raycast import raycaster
from . import dlt


@dataclass(frozen=True, eq=False)
class Clicks:
    """Points of one image set: ``pixels`` (n_points, n_cameras, 2) and where they were ``visible`` (n_points, n_cameras)."""

    pixels: np.ndarray
    visible: np.ndarray


def click(
    model: ArticulatedModel, states: Sequence[State], cameras: Sequence[Camera], sigma_px: float, rng: np.random.Generator,
    depth_margin: float = 0.06,
) -> Clicks:  # fmt: skip
    """What a person clicks on: the model's landmarks, with errors.

    Parameters
    ----------
    states : the body at the instant of each camera.
    sigma_px : standard deviation of the person's error along u and v.
    depth_margin : metres that the body may lie in front of a landmark in it without hiding it: half its thickness, a little more.
    """
    n_points = len(model.landmark_names)
    pixels, visible = np.zeros((n_points, len(cameras), 2)), np.zeros((n_points, len(cameras)), dtype=bool)
    for i, (camera, state) in enumerate(zip(cameras, states, strict=True)):
        configuration = Configuration(model, state)
        points = configuration.landmarks_world
        seen, valid = camera.project(points)
        valid = valid & camera.model.in_image(seen)
        depth = raycaster.render_view(configuration, camera).depth
        column, row = np.rint(np.where(valid[:, None], seen, 0.0)).astype(int).T
        in_front = depth[row, column] < se3.apply(camera.T_cam_world, points)[:, 2] - depth_margin
        visible[:, i] = valid & ~in_front
        pixels[:, i] = seen + sigma_px * rng.standard_normal((n_points, 2))
    return Clicks(pixels, visible)


def digitized_state(model: ArticulatedModel, clicks: Clicks, parameters: np.ndarray) -> State | None:
    """Pose of a rigid ``model`` from clicks on its landmarks and the DLT parameters (n_cameras, 11) of the cameras.

    None where fewer than three points could be reconstructed, or all of them lie on a line.
    """
    points, valid = dlt.reconstruct(parameters, clicks.pixels, clicks.visible.astype(np.float64))
    neutral = State.neutral(model)
    own = Configuration(model, neutral).landmarks_world[valid]
    if len(own) < 3 or np.linalg.svd(own - own.mean(axis=0), compute_uv=False)[1] < 1e-6:
        return None
    return State(se3.rigid_fit(own, points[valid]) @ neutral.T_world_root, neutral.joint_positions)
