"""People as a tracker may use them, whatever a detector has said: finite numbers, and covariances that are some."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .people import Person

_FAR_PX = 1e6  # no point is farther from the image than this


def checked(person: Person) -> Person:
    """A person of whose points the impossible ones are as if they had not been found: score 0.

    Covariances are symmetric after that to the last bit, so messages need one half of them.

    Parameters
    ----------
    person : of any detector.

    Returns
    -------
    person : with finite numbers.

    Raises
    ------
    ValueError : score or box are not finite, or a name comes twice.
    """
    if len(set(person.names)) != len(person.names):
        raise ValueError("expected each name of a point once")
    if not np.isfinite([*person.box, person.score]).all():
        raise ValueError(f"expected finite numbers for score and box, got {person.score}, {list(person.box)}")
    uu, uv, vv = (person.covariances[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
    with np.errstate(invalid="ignore", over="ignore"):
        found = np.isfinite(person.covariances).all(axis=(1, 2)) & (np.abs(person.pixels) < _FAR_PX).all(axis=1)
        found &= (person.scores >= 0.0) & (person.scores <= 1.0)
        found &= (uu >= 0.0) & (vv >= 0.0) & (uv * uv <= uu * vv * (1.0 + 1e-9))
    covariances = np.stack([uu, uv, uv, vv], axis=1).reshape(-1, 2, 2)
    return replace(
        person,
        pixels=np.where(found[:, None], person.pixels, 0.0),
        covariances=np.where(found[:, None, None], covariances, np.eye(2)),
        scores=np.where(found, person.scores, 0.0),
    )
