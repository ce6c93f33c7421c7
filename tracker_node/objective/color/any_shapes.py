"""Scores and sums of bodies of any shapes in one camera: the ray-caster, then the kernels of `any_shape_kernels`."""

from __future__ import annotations

import numpy as np

from ...camera.rig import Camera
from ...model.configuration import Configuration
from ...render.raycast.lighting import lights_in_camera
from ...render.raycast.raycaster import cast
from ...render.raycast.surface_arrays import surface_arrays
from .any_shape_kernels import linearize_any, recolor, score_any
from .constants import ColorConstants
from .views import ColorViews


def _arguments(
    configuration: Configuration, camera: Camera, constants: ColorConstants, index: int, views: ColorViews, weights: np.ndarray
) -> tuple:
    """What both kernels take."""
    found = cast(configuration, camera, (0, 0, camera.model.width, camera.model.height))
    if constants.recolored:
        recolor(found.frames, constants.colors_rgb[index])
    surfaces, (u0, v0, u1, _) = surface_arrays(configuration.model), found.region
    return (
        found.buffer, found.numbers, found.column, found.table.xs, found.table.ys, u0, v0, u1,
        found.coefficients, found.frames, found.triangles, surfaces.corners, surfaces.levels, surfaces.texels,
        lights_in_camera(constants.lights, camera.T_cam_world), np.array(camera.gain, dtype=np.float32),
        np.float32(1.0 / camera.gamma), views.planes, views.views[index], weights,
    )  # fmt: skip


def score_with_cast(
    configuration: Configuration,
    camera: Camera,
    constants: ColorConstants,
    index: int,
    views: ColorViews,
    weights: np.ndarray,
    total: np.ndarray,
) -> None:
    """Squares and pixels of camera ``index`` into ``total``."""
    score_any(*_arguments(configuration, camera, constants, index, views, weights), total)


def linearize_with_cast(
    configuration: Configuration,
    camera: Camera,
    constants: ColorConstants,
    index: int,
    views: ColorViews,
    weights: np.ndarray,
    sums: np.ndarray,
) -> None:
    """Sums of the shapes in camera ``index``."""
    sums[:] = 0.0
    linearize_any(*_arguments(configuration, camera, constants, index, views, weights), sums)
