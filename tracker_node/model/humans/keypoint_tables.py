"""Tables of detectors other than BlazePose on the human, by the names that `loaders.keypoints.names` gives their points.

Offsets of joints are not measured: their means are zero, and they are found while tracking. Points of the face are where they are
on the head, whoever finds them. Eyes, the middle of the hips, fingers and the rest of the face have no landmark.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from ...errors import UnknownNameError
from .keypoints import BLAZEPOSE, KeypointTable, LandmarkPoint

_JOINT, _HIP, _FACE = (0.03, 0.03, 0.03), (0.04, 0.04, 0.05), (0.025, 0.025, 0.025)
_SIDES = ("left", "right")


def _paired(sigmas: Mapping[str, tuple[float, float, float]]) -> dict[str, LandmarkPoint]:
    """Points of both sides that are at the landmarks of their names."""
    return {f"{side}_{name}": LandmarkPoint(f"{side}_{name}", sigma=sigma) for name, sigma in sigmas.items() for side in _SIDES}


_ON_HEAD = {name: replace(BLAZEPOSE[name], sigma=_FACE) for name in ("nose", "left_ear", "right_ear")}
_LIMBS = _paired({"shoulder": _JOINT, "elbow": _JOINT, "wrist": _JOINT, "hip": _HIP, "knee": _JOINT, "ankle": _JOINT})
_FEET = _paired({"big_toe": _JOINT, "small_toe": _JOINT, "heel": _JOINT})
_NECK = {"neck": LandmarkPoint("neck", sigma=(0.05, 0.03, 0.05))}
_HEAD = {"head": LandmarkPoint("head", sigma=(0.04, 0.03, 0.04))}

COCO_17: KeypointTable = {**_ON_HEAD, **_LIMBS}
BODY_25: KeypointTable = {**COCO_17, **_NECK, **_FEET}
BODY_25B: KeypointTable = {**COCO_17, **_NECK, **_HEAD, **_FEET}
HALPE_26: KeypointTable = BODY_25B
COCO_WHOLEBODY: KeypointTable = {**COCO_17, **_FEET}

TABLES: dict[str, KeypointTable] = {
    "blazepose": BLAZEPOSE,
    "body_25b": BODY_25B,
    "halpe_26": HALPE_26,
    "body_25": BODY_25,
    "coco_wholebody": COCO_WHOLEBODY,
    "coco_17": COCO_17,
}
"""Name of a detector -> its table."""


def table_of(names: Iterable[str]) -> KeypointTable:
    """The built-in table that belongs to a detector's points: the largest of which the detector has every point.

    Raises
    ------
    UnknownNameError : the detector lacks points of each.
    """
    known = set(names)
    fitting = [table for table in TABLES.values() if set(table) <= known]
    if not fitting:
        others = ", ".join(sorted(known)[:6])
        raise UnknownNameError("detector, for which a keypoint table is needed, with the points", f"{others}, ...", TABLES)
    return max(fitting, key=len)  # the first of several
