"""Where a detector should look: a square around the body in each image, its head up."""

from __future__ import annotations

import math

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State, configured
from ...observation.keypoints.crop import Crop
from ..limbs.tree import limbs_of

_MARGIN = 1.25  # of the square around the circle about the body
_UP_M = 0.5  # length of the arrow, along the root's z axis, whose direction in the image is up
_LEAST_PX = 16.0
_LEAST_ABOVE_M = 0.1  # of a landmark that tells which way is up


def crops_of(model: ArticulatedModel, rig: CameraRig, state: State) -> list[Crop | None]:
    """Squares around a body, one a camera.

    Parameters
    ----------
    model, rig, state : the body before the cameras.

    Returns
    -------
    Pixels of each camera's image; None where it does not see the body.
    """
    body, top = configured(model, state), _top_of_trunk(model)
    root = state.T_world_root[:3, 3]
    up = root + _UP_M * state.T_world_root[:3, 2] if top is None else body.landmarks_world[top]
    points = np.vstack([root, up, body.landmarks_world, body.Ts_world_shape[:, :3, 3]])
    return [_crop(camera, points) for camera in rig]


def _top_of_trunk(model: ArticulatedModel) -> int | None:
    """Index of the trunk's landmark that is highest above the root in neutral: a person who bends down is turned by the trunk,
    not by the pelvis. None where there is none."""
    above = Configuration(model, State.neutral(model)).landmarks_world[:, 2]
    on_trunk = limbs_of(model)[0].links[model.landmark_links] & (above > _LEAST_ABOVE_M)
    return int(np.argmax(np.where(on_trunk, above, -np.inf))) if on_trunk.any() else None


def _crop(camera: Camera, points: np.ndarray) -> Crop | None:
    """Around the first point, the second above it, all within."""
    pixels, seen = camera.project(points)
    if not seen[0] or not seen[1]:
        return None
    center, (du, dv) = pixels[0], pixels[1] - pixels[0]
    radius = float(np.linalg.norm(pixels[seen] - center, axis=1).max())
    width, height = camera.model.width, camera.model.height
    beside = not (-radius < center[0] < width + radius and -radius < center[1] < height + radius)
    if beside or radius < _LEAST_PX:
        return None
    return Crop((float(center[0]), float(center[1])), 2.0 * _MARGIN * radius, math.atan2(du, -dv))
