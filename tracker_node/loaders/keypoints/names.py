"""Names and order of the points of known detectors, where a file has numbers only.

One name stands for one point in all of them: ``left_`` and ``right_`` are the person's own sides.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import FileFormatError
from ...observation.keypoints.blazepose import NAMES as BLAZEPOSE_33

_COCO_PAIRS = ("eye", "ear", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")


def _sides(*names: str) -> tuple[str, ...]:
    """Of each name the left one, then the right one."""
    return tuple(f"{side}_{name}" for name in names for side in ("left", "right"))


def _side(side: str, *names: str) -> tuple[str, ...]:
    return tuple(f"{side}_{name}" for name in names)


def _numbered(name: str, n: int) -> tuple[str, ...]:
    return tuple(f"{name}_{i}" for i in range(n))


_LEG, _ARM, _FOOT = ("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist"), ("big_toe", "small_toe", "heel")
_HANDS = (*_numbered("left_hand", 21), *_numbered("right_hand", 21))

COCO_17 = ("nose", *_sides(*_COCO_PAIRS))
COCO_18 = (
    "nose", "neck", *_side("right", *_ARM), *_side("left", *_ARM), *_side("right", *_LEG), *_side("left", *_LEG),
    "right_eye", "left_eye", "right_ear", "left_ear",
)  # fmt: skip
BODY_25 = (
    "nose", "neck", *_side("right", *_ARM), *_side("left", *_ARM), "mid_hip", *_side("right", *_LEG), *_side("left", *_LEG),
    "right_eye", "left_eye", "right_ear", "left_ear", *_side("left", *_FOOT), *_side("right", *_FOOT),
)  # fmt: skip
BODY_25B = (*COCO_17, "neck", "head", *_side("left", *_FOOT), *_side("right", *_FOOT))
HALPE_26 = (*COCO_17, "head", "neck", "mid_hip", *_sides("big_toe", "small_toe", "heel"))
COCO_WHOLEBODY_133 = (*COCO_17, *_side("left", *_FOOT), *_side("right", *_FOOT), *_numbered("face", 68), *_HANDS)

ORDERS: dict[str, tuple[str, ...]] = {
    "coco_17": COCO_17,
    "coco_18": COCO_18,
    "body_25": BODY_25,
    "body_25b": BODY_25B,
    "halpe_26": HALPE_26,
    "blazepose_33": BLAZEPOSE_33,
    "coco_wholebody_133": COCO_WHOLEBODY_133,
}


def names_of(n: int, orders: Sequence[str], names: Sequence[str], file: str, where: str) -> tuple[str, ...]:
    """Names of the points in a file that has none.

    Parameters
    ----------
    n : number of points of a person.
    orders : keys of `ORDERS` that the format may have; the first with as many points counts.
    names : of the points, by the user; empty: none are given.
    file, where : file and field, for messages.

    Returns
    -------
    n names.

    Raises
    ------
    FileFormatError : no known order has as many points, or not as many names are given.
    """
    if names:
        if len(names) != n:
            raise FileFormatError(file, where, f"{len(names)} points, for which the table has names", f"{n} points")
        return tuple(names)
    for key in orders:
        if len(ORDERS[key]) == n:
            return ORDERS[key]
    known = ", ".join(f"{len(ORDERS[key])} ({key})" for key in orders)
    raise FileFormatError(file, where, f"points of a known detector: {known}; or a keypoint table with 'names'", f"{n} points")


def check_names(names: Sequence[str], file: str, where: str) -> tuple[str, ...]:
    """Names of points as a file gives them.

    Parameters
    ----------
    names : of the points.
    file, where : file and field, for messages.

    Returns
    -------
    The same names.

    Raises
    ------
    FileFormatError : none, an empty one, or one that occurs twice.
    """
    if not names or not all(names) or len(set(names)) != len(names):
        raise FileFormatError(file, where, "names of points, each once", list(names))
    return tuple(names)
