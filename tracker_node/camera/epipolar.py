"""Where one camera's pixel can be in another camera's image."""

from __future__ import annotations

import numpy as np

from ..geometry import se3
from .rig import Camera

_NEAREST_M, _FARTHEST_M, _N_DEPTHS = 0.05, 200.0, 400


def epipolar_curve(camera: Camera, pixel: np.ndarray, other: Camera) -> np.ndarray:
    """(k, 2) pixels of ``other`` along the ray of ``pixel`` (2,) of ``camera``, from near to far; bent as its lens is.

    Depths along the ray go from 5 cm to 200 m in steps of two percent, of which the longest stretch that is on the image is
    given, and one place beyond each of its ends. Empty where the ray is not in view.
    """
    rays, ok = camera.model.rays(np.asarray(pixel, dtype=np.float64)[None])
    if not ok[0]:
        return np.zeros((0, 2))
    depths = np.geomspace(_NEAREST_M, _FARTHEST_M, _N_DEPTHS)
    pixels, valid = other.project(se3.apply(camera.T_world_cam, depths[:, None] * rays))
    first, last = _longest_run(valid & other.model.in_image(pixels))
    if first == last:
        return np.zeros((0, 2))
    first -= first > 0 and bool(valid[first - 1])
    last += last < len(valid) and bool(valid[last])
    return pixels[first:last]


def _longest_run(inside: np.ndarray) -> tuple[int, int]:
    """Start and end (exclusive) of the longest stretch of True; (0, 0) without any."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int)))
    if not len(edges):
        return 0, 0
    starts, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - starts))
    return int(starts[longest]), int(ends[longest])
