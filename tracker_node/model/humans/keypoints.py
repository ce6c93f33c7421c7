"""Which landmarks of the human a detector's points are, and how far they are from them.

A network's hip is where people clicked in the pictures that it has learned from, not the joint's center: each point has an offset
in the frame of its landmark's link, known on average, with a spread among people, clothes and views.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class LandmarkPoint:
    """A detector's point on a body.

    Attributes
    ----------
    landmark : of the body.
    offset : (3,) meters from it, in the axes of its link, on average.
    sigma : (3,) meters, standard deviation of the offset in these axes.
    """

    landmark: str
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sigma: tuple[float, float, float] = (0.03, 0.03, 0.03)


KeypointTable = Mapping[str, LandmarkPoint]
"""Name of a detector's point -> what it is on the body."""


def _both_sides(rows: Mapping[str, LandmarkPoint]) -> dict[str, LandmarkPoint]:
    """Points of the left side, and their mirror images."""
    found = {}
    for name, point in rows.items():
        x, y, z = point.offset
        found[f"left_{name}"] = LandmarkPoint(f"left_{point.landmark}", point.offset, point.sigma)
        found[f"right_{name}"] = LandmarkPoint(f"right_{point.landmark}", (x, -y, z), point.sigma)
    return found


BLAZEPOSE: KeypointTable = {
    "nose": LandmarkPoint("nose"),
    "left_ear": LandmarkPoint("nose", (-0.10, 0.075, 0.01), (0.04, 0.04, 0.04)),
    "right_ear": LandmarkPoint("nose", (-0.10, -0.075, 0.01), (0.04, 0.04, 0.04)),
    **_both_sides(
        {
            "shoulder": LandmarkPoint("shoulder"),
            "elbow": LandmarkPoint("elbow"),
            "wrist": LandmarkPoint("wrist"),
            "hip": LandmarkPoint("hip"),
            "knee": LandmarkPoint("knee"),
            "ankle": LandmarkPoint("ankle"),
            "heel": LandmarkPoint("heel"),
            "foot_index": LandmarkPoint("big_toe", (0.0, 0.0, 0.0), (0.05, 0.05, 0.05)),
        }
    ),
}
