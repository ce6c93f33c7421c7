"""Contours of single shapes."""

import numpy as np

from tracker_node.render.contour.generators import N_COLUMNS, SAMPLES, draw_contour
from tracker_node.render.contour.picks import N_PICK_COLUMNS


def contour_points(arrays, Ts_world_shape: np.ndarray, shape: int, center: np.ndarray, n_samples: int) -> np.ndarray:
    """Contour samples of one shape for a camera at ``center`` (3,) in the world.

    Returns (n, `N_COLUMNS`): position, unit normal, sliding direction d and normal m, all in world axes, meters.
    """
    picks, n_picks = np.empty((SAMPLES * n_samples, N_PICK_COLUMNS)), np.zeros(shape + 1, dtype=np.int64)
    out = np.empty((SAMPLES * n_samples, N_COLUMNS))
    center = np.asarray(center, dtype=np.float64)
    n = draw_contour(arrays.packed, shape, Ts_world_shape[shape], center, n_samples, True, picks, n_picks, out)
    return out[:n]
