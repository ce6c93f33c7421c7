"""Center of mass of a person from the joints' places.

Shares of the body's mass, and where each segment's center lies on the line between two points: P. de Leva, *Adjustments to
Zatsiorsky-Seluyanov's segment inertia parameters*, J. Biomech. 29 (1996) 1223-1230, table 4; the mean of women and men, who
differ by 2 % of the height in the trunk and less elsewhere. Points as there, but for the head, which is taken from its top to the
base of the neck, and hands, whose centers lie a quarter of the forearm beyond the wrist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_HAND_BEYOND = 1.25  # of the way from elbow to wrist


@dataclass(frozen=True)
class _Segment:
    """Share of the mass; its center's share of the way from the mean of some landmarks to that of others."""

    mass: float
    share: float
    first: tuple[str, ...]
    last: tuple[str, ...]


def _of_side(side: str) -> tuple[_Segment, ...]:
    shoulder, elbow, wrist = f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"
    hip, knee, ankle, heel, toe = f"{side}_hip", f"{side}_knee", f"{side}_ankle", f"{side}_heel", f"{side}_big_toe"
    return (
        _Segment(0.0263, 0.576, (shoulder,), (elbow,)),
        _Segment(0.0150, 0.457, (elbow,), (wrist,)),
        _Segment(0.0058, _HAND_BEYOND, (elbow,), (wrist,)),
        _Segment(0.1447, 0.385, (hip,), (knee,)),
        _Segment(0.0457, 0.437, (knee,), (ankle,)),
        _Segment(0.0133, 0.421, (heel,), (toe,)),
    )


_SEGMENTS = (
    _Segment(0.0681, 0.492, ("head",), ("neck",)),
    _Segment(0.4302, 0.405, ("left_shoulder", "right_shoulder"), ("left_hip", "right_hip")),
    *_of_side("left"),
    *_of_side("right"),
)


def mass_center(names: Sequence[str], points: np.ndarray) -> np.ndarray | None:
    """Where the body's center of mass is.

    Parameters
    ----------
    names : of the landmarks.
    points : (..., n_landmarks, 3) meters.

    Returns
    -------
    (..., 3) meters; None of a body that has not all of the landmarks.
    """
    rows = {name: row for row, name in enumerate(names)}
    if any(name not in rows for segment in _SEGMENTS for name in (*segment.first, *segment.last)):
        return None
    total, center = 0.0, np.zeros((*points.shape[:-2], 3))
    for segment in _SEGMENTS:
        first, last = (points[..., [rows[name] for name in ends], :].mean(axis=-2) for ends in (segment.first, segment.last))
        center += segment.mass * (first + segment.share * (last - first))
        total += segment.mass
    return center / total
