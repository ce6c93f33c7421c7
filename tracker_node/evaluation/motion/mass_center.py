"""Center of mass of a person from the joints' places, with the segments of `model.humans.masses`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...model.humans.masses import present


def mass_center(names: Sequence[str], points: np.ndarray) -> np.ndarray | None:
    """Where the body's center of mass is.

    Parameters
    ----------
    names : of the landmarks.
    points : (..., n_landmarks, 3) meters.

    Returns
    -------
    (..., 3) meters; None of a body that has not all of the landmarks, but for limbs that one side lacks.
    """
    segments = present(names)
    if not segments:
        return None
    rows = {name: row for row, name in enumerate(names)}
    total, center = 0.0, np.zeros((*points.shape[:-2], 3))
    for segment in segments:
        first, last = (points[..., [rows[name] for name in ends], :].mean(axis=-2) for ends in (segment.first, segment.last))
        center += segment.mass * (first + segment.center * (last - first))
        total += segment.mass
    return center / total
