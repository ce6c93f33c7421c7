"""Angles over time without the jumps of a full turn."""

from __future__ import annotations

import numpy as np


def continuous_angles(angles: np.ndarray) -> np.ndarray:
    """(n,) radians, each within half a turn of the finite one before; others stay as they are."""
    found, sound = np.array(angles), np.isfinite(angles)
    found[sound] = np.unwrap(angles[sound])
    return found


def continuous_rotations(vectors: np.ndarray) -> np.ndarray:
    """(n, 3) rotation vectors, radians, of the same rotations, each nearest to the finite one before; others stay as they are.

    One rotation has a vector for every number of full turns about its axis, so the components cannot be treated one by one.
    """
    found, before = np.array(vectors), np.zeros(3)
    for i in np.flatnonzero(np.isfinite(vectors).all(axis=1)):
        angle = np.linalg.norm(vectors[i])
        along = vectors[i] if angle > 0.0 else before  # after full turns no axis is left but that of the turns
        axis = along / max(np.linalg.norm(along), np.finfo(float).tiny)
        turns = np.round((before @ axis - angle) / (2.0 * np.pi))
        found[i] = before = vectors[i] + 2.0 * np.pi * turns * axis
    return found
