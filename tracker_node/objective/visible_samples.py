"""The contours of a body that one camera sees, sample by sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..camera.rig import Camera
from ..model.configuration import Configuration
from ..render.contour import samples as cs
from ..render.contour.generators import N_COLUMNS, world_spheres
from ..render.shape_arrays import ShapeArrays
from .per_camera import camera_constants


@dataclass(frozen=True, eq=False)
class SeenSamples:
    """n samples, those of one shape together: ``rows`` (n, 12) as in `generators`, ``pixels`` (n, 11) and ``info`` (n, 4) as
    in `render.contour.samples`."""

    rows: np.ndarray
    pixels: np.ndarray
    info: np.ndarray


def samples_seen(
    configuration: Configuration, arrays: ShapeArrays, camera: Camera, n_samples: int, outward_px: float = 3.0
) -> SeenSamples:
    """All contour samples that a camera sees.

    Parameters
    ----------
    configuration, arrays : the body in its state, and its shapes.
    camera : that sees it.
    n_samples : on a generator line.
    outward_px : how far beyond a contour it is decided what lies there.

    Returns
    -------
    The samples, those of one shape together.
    """
    Ts = configuration.Ts_world_shape
    spheres = np.empty((len(Ts), 4))
    world_spheres(Ts, arrays.bounds, spheres)
    most = cs.most_samples(arrays.packed, n_samples)
    rows, pixels = np.empty((most, N_COLUMNS)), np.empty((most, cs.N_PIXEL_COLUMNS))
    info = np.empty((most, cs.N_INFO_COLUMNS), dtype=np.int32)
    place = camera_constants(camera)
    n = cs.collect_samples(arrays.packed, Ts, spheres, place, n_samples, outward_px, rows, pixels, info)
    return SeenSamples(rows[:n], pixels[:n], info[:n])
