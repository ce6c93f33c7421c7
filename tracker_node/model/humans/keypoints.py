"""Which landmarks of the human a detector's points are, and how far they are from them.

A network's hip is where people clicked in the pictures that it has learned from, not the joint's center: each point has an offset
in the frame of its landmark's link, known on average, with a spread among people, clothes and views.

Tables of detectors other than BlazePose on the human, by the names that `loaders.keypoints.files` gives their points.

Offsets of joints are not measured: their means are zero, and they are found while tracking. Points of the face are where they are
on the head, whoever finds them. Eyes, the middle of the hips, fingers beyond their knuckles and the rest of the face have no
landmark; knuckles have one on bodies whose hands turn.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ...errors import UnknownNameError
from ..articulated import ArticulatedModel
from ..configuration import Configuration, State
from .human import human_model
from .measures import mirrored_name


@dataclass(frozen=True)
class LandmarkPoint:
    """A detector's point on a body.

    Attributes
    ----------
    landmark : of the body.
    offset : (3,) meters from it, in the axes of its link, on average.
    sigma : (3,) meters, standard deviation of the offset in these axes.
    by_leg : meters along z that the offset grows by the logarithm of the ratio of thigh and shank, beside the default body's.
    """

    landmark: str
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sigma: tuple[float, float, float] = (0.03, 0.03, 0.03)
    by_leg: float = 0.0


KeypointTable = Mapping[str, LandmarkPoint]
"""Name of a detector's point -> what it is on the body."""


def _both_sides(rows: Mapping[str, LandmarkPoint]) -> dict[str, LandmarkPoint]:
    """Points of the left side, and their mirror images."""
    found = {}
    for name, point in rows.items():
        x, y, z = point.offset
        found[f"left_{name}"] = replace(point, landmark=f"left_{point.landmark}")
        found[f"right_{name}"] = replace(point, landmark=f"right_{point.landmark}", offset=(x, -y, z))
    return found


# Means and spreads over eight rendered people in clothes, both sides together, of a body of the default size; a point's place
# relative to the joint's center of their skeletons (`benchmark/clothed/_fit.py`). Spreads are a quarter larger than measured.
# Knees are marked where they are on average between hip and ankle, whoever's they are: over these and sixteen more people they
# spread by 19 mm along the leg, and by 9 beside the ratio of thigh and shank
BLAZEPOSE: KeypointTable = {
    "nose": LandmarkPoint("nose", (-0.024, 0.000, 0.023), (0.019, 0.013, 0.010)),
    "left_ear": LandmarkPoint("nose", (-0.094, 0.052, 0.029), (0.010, 0.010, 0.010)),
    "right_ear": LandmarkPoint("nose", (-0.094, -0.052, 0.029), (0.010, 0.010, 0.010)),
    **_both_sides(
        {
            "shoulder": LandmarkPoint("shoulder", (0.004, -0.004, 0.027), (0.015, 0.011, 0.013)),
            "elbow": LandmarkPoint("elbow", (0.007, 0.005, 0.017), (0.010, 0.010, 0.012)),
            "wrist": LandmarkPoint("wrist", (0.007, -0.006, -0.019), (0.010, 0.010, 0.012)),
            "index": LandmarkPoint("index", (-0.011, -0.020, 0.012), (0.010, 0.010, 0.011)),
            "pinky": LandmarkPoint("pinky", (0.033, -0.011, 0.005), (0.010, 0.010, 0.012)),
            "thumb": LandmarkPoint("thumb", (-0.025, -0.013, 0.013), (0.010, 0.010, 0.012)),
            "hip": LandmarkPoint("hip", (0.033, -0.014, -0.014), (0.016, 0.018, 0.018)),
            "knee": LandmarkPoint("knee", (-0.009, -0.005, 0.011), (0.012, 0.012, 0.011), 0.205),
            "ankle": LandmarkPoint("ankle", (0.006, 0.002, 0.026), (0.010, 0.010, 0.010)),
            "heel": LandmarkPoint("heel", (0.024, -0.005, 0.013), (0.011, 0.011, 0.010)),
            "foot_index": LandmarkPoint("big_toe", (0.026, 0.032, -0.012), (0.015, 0.013, 0.010)),
        }
    ),
}


@dataclass(frozen=True)
class GuessedBone:
    """How BlazePose guesses a bone's depth: how much farther from the camera its far end is than its near one.

    Attributes
    ----------
    near, far : the middle of these points.
    share : of the depth, what is guessed of it on average.
    sigma : standard deviation of the guess, in lengths of the bone.
    """

    near: tuple[str, ...]
    far: tuple[str, ...]
    share: float
    sigma: float


_SHOULDERS, _HIPS = ("left_shoulder", "right_shoulder"), ("left_hip", "right_hip")
# Over eight rendered people in clothes before four cameras (`benchmark/clothed/_fit.py`)
GUESSED_BONES: tuple[GuessedBone, ...] = (
    GuessedBone(_HIPS[:1], _HIPS[1:], 1.10, 0.20),
    GuessedBone(_SHOULDERS[:1], _SHOULDERS[1:], 0.93, 0.16),
    GuessedBone(_HIPS, _SHOULDERS, 0.75, 0.13),
    *(
        GuessedBone((f"{side}_{near}",), (f"{side}_{far}",), share, sigma)
        for near, far, share, sigma in (
            ("shoulder", "elbow", 0.47, 0.21),
            ("elbow", "wrist", 0.55, 0.31),
            ("hip", "knee", 0.72, 0.19),
            ("knee", "ankle", 0.78, 0.20),
        )
        for side in ("left", "right")
    ),
)
GUESSED_SIZE, GUESSED_SIZE_SIGMA = 1.055, 0.045  # meters of a body of the default size for one that is guessed

_SIZED_BY = (("left_hip", "left_knee"), ("left_knee", "left_ankle"), ("left_hip", "left_shoulder"))
_SIZED_BY_RIGHT = tuple((mirrored_name(one), mirrored_name(other)) for one, other in _SIZED_BY)  # of who has lost the left leg


def relative_size(model: ArticulatedModel) -> float:
    """Size of a person's body in that of the default one, by trunk and leg; 1 of a body without these landmarks."""
    return float(_lengths(model).sum() / _default_lengths().sum())


def expected_offsets(model: ArticulatedModel, points: Sequence[LandmarkPoint]) -> np.ndarray:
    """(n, 3) meters: offsets that points have on a body, on average.

    Parameters
    ----------
    model : the body.
    points : of a table.

    Returns
    -------
    In the axes of the points' links.
    """
    means = np.array([point.offset for point in points], dtype=np.float64).reshape(-1, 3)
    means[:, 2] += leg_ratio(model) * np.array([point.by_leg for point in points])
    return relative_size(model) * means


def leg_ratio(model: ArticulatedModel) -> float:
    """Logarithm of the ratio of thigh and shank, beside the default body's; 0 of a body without legs and trunk."""
    (thigh, shank, _), (thigh_default, shank_default, _) = _lengths(model), _default_lengths()
    return float(np.log(thigh / shank * shank_default / thigh_default))


@cache
def _default_lengths() -> np.ndarray:
    return _lengths(human_model())


def _lengths(model: ArticulatedModel) -> np.ndarray:
    """(3,) meters: thigh, shank and trunk, stretched; the default body's of one without these landmarks on either side."""
    pairs = next((p for p in (_SIZED_BY, _SIZED_BY_RIGHT) if {n for pair in p for n in pair} <= set(model.landmark_names)), None)
    if pairs is None:
        model, pairs = human_model(), _SIZED_BY
    places = Configuration(model, State.neutral(model)).landmarks_world
    rows = np.array([[model.landmark_index(name) for name in pair] for pair in pairs])
    return np.linalg.norm(places[rows[:, 0]] - places[rows[:, 1]], axis=1)


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


def is_person(model: ArticulatedModel) -> bool:
    """Whether a body has the face, shoulders and hips of a person, whose points the built-in detector finds."""
    return {"nose", "left_shoulder", "right_shoulder", "left_hip", "right_hip"} <= set(model.landmark_names)


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
