"""People from result files of COCO and COCO-WholeBody: a list of ``image_id``, ``keypoints`` (u, v, score, ...) and ``score``.

``image_id`` is the number of the image, or a name with it. COCO-WholeBody's results have feet, face and hands in fields of their
own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileFormatError
from .camera_people import FoundPerson, PeopleOfImages, found_points
from .files import image_number, probability, read_points_json

_ORDERS = ("coco_17", "halpe_26", "coco_wholebody_133")
_FIELDS = ("keypoints", "foot_kpts", "face_kpts", "lefthand_kpts", "righthand_kpts")


def is_result(content: Any) -> bool:
    """Whether a file is a list of results."""
    return isinstance(content, list) and bool(content) and isinstance(content[0], dict) and "image_id" in content[0]


def of_json(file: Path) -> PeopleOfImages:
    """The people of one camera."""
    content, images = read_points_json(file), PeopleOfImages(str(file), _ORDERS)
    if not isinstance(content, list):
        raise FileFormatError(file, "(content)", "a list of results with image_id, keypoints, score", content)
    for i, entry in enumerate(content):
        number = entry.get("image_id") if isinstance(entry, dict) else None
        image = image_number(number) if isinstance(number, str) else number
        if not isinstance(image, int) or isinstance(image, bool):
            raise FileFormatError(file, f"[{i}].image_id", "the number of an image", entry if number is None else number)
        parts = [_points(entry[field], file, f"[{i}].{field}") for field in _FIELDS if field in entry]
        values = np.concatenate([np.zeros((0, 3)), *parts])
        person = FoundPerson(found_points(values, str(file), f"[{i}].keypoints"), probability(entry.get("score")))
        images.add(image, person, str(file), f"[{i}].keypoints")
    return images


def _points(values: Any, file: Path, where: str) -> np.ndarray:
    """(n, 3) u, v, score."""
    try:
        return np.array(values, dtype=np.float64).reshape(-1, 3)
    except (TypeError, ValueError, OverflowError):
        raise FileFormatError(file, where, "numbers u, v, score of every point", values) from None
