"""What objectives of several cameras share: a camera's constants as kernels take them, and the map that needs no threads."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..camera.rig import Camera


def camera_constants(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(params, R_cam_world (3, 3), t_cam_world (3,), center in the world (3,)), contiguous."""
    T = camera.T_cam_world
    return (
        camera.model.params,
        np.ascontiguousarray(T[:3, :3]),
        np.ascontiguousarray(T[:3, 3]),
        np.ascontiguousarray(camera.center),
    )


def serial(function: Callable, items: list) -> list:
    """Map ``function`` over cameras on the calling thread."""
    return [function(item) for item in items]
