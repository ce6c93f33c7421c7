"""People in COCO's orders of points: result files of COCO and COCO-WholeBody, and JSON of MMPose and RTMPose.

Results are a list of ``image_id``, the number of the image or a name with it, ``keypoints`` (u, v, score, ...) and ``score``;
COCO-WholeBody's have feet, face and hands in fields of their own.

MMPose writes a file an image (``predictions/``), or a file a video (``instance_info``). A file an image is a list of instances;
images are numbered as those of OpenPose. A file a video is a list of ``frame_id`` and ``instances``, as the inferencer writes it,
or has that list in ``instance_info``, as the demos write it, beside ``meta_info`` with the names of the points; images are
numbered from the first ``frame_id`` on.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileFormatError
from ..source_address import last_number
from .camera_people import FoundPerson, PeopleOfImages, found_points
from .files import (
    by_folder,
    camera_keys,
    check_names,
    files_of,
    is_number,
    numbered_files,
    probability,
    read_points_json,
)

_ORDERS = ("coco_17", "halpe_26", "coco_wholebody_133")


def of_mmpose(path: Path) -> dict[str, PeopleOfImages]:
    """People by file of a video or folder of images: in one such file, a folder of such files, or one of such folders.

    Raises
    ------
    FileFormatError : no such files, or one that is not MMPose's.
    """
    files = files_of(path, (".json",))
    if is_video(read_points_json(files[0])):
        return {key: _video(file) for key, file in camera_keys(files).items()}
    return {key: _images(found[0].parent, found) for key, found in by_folder(files, path.name).items()}


def is_video(content: Any) -> bool:
    """Whether a file is that of a video."""
    listed = content.get("instance_info") if isinstance(content, dict) else content
    if isinstance(content, dict):
        return isinstance(listed, list)
    return isinstance(listed, list) and bool(listed) and isinstance(listed[0], dict) and "instances" in listed[0]


def _video(file: Path) -> PeopleOfImages:
    content = read_points_json(file)
    images, first = PeopleOfImages(str(file), _ORDERS), None
    if not is_video(content):
        raise FileFormatError(file, "(content)", "frame_id and instances of each image, as in the other files", content)
    listed = content["instance_info"] if isinstance(content, dict) else content
    for i, entry in enumerate(listed):
        where = f"[{i}]"
        if not isinstance(entry, dict) or not isinstance(entry.get("instances"), list):
            raise FileFormatError(file, f"{where}.instances", "a list of people", entry)
        number = entry.get("frame_id", i)
        number = last_number(number) if isinstance(number, str) else number
        if not isinstance(number, int) or isinstance(number, bool):
            raise FileFormatError(file, f"{where}.frame_id", "the number of an image", entry.get("frame_id"))
        first = number if first is None else first
        _add(images, number - first, entry["instances"], str(file), f"{where}.instances")
    images.names = _names_in(content, str(file))
    return images


def _images(folder: Path, files: Sequence[Path]) -> PeopleOfImages:
    images = PeopleOfImages(str(folder), _ORDERS)
    for number, file in numbered_files(files):
        content = read_points_json(file)
        listed = content.get("instances") if isinstance(content, dict) else content
        if not isinstance(listed, list):
            raise FileFormatError(file, "(content)", "a list of people with keypoints and keypoint_scores", content)
        _add(images, number, listed, str(file), "")
    return images


def _names_in(content: Any, file: str) -> tuple[str, ...]:
    """Names of ``meta_info``; none where there are none."""
    meta = content.get("meta_info") if isinstance(content, dict) else None
    names = meta.get("keypoint_id2name") if isinstance(meta, dict) else None
    if not isinstance(names, dict) or not names:
        return ()
    found = [names.get(str(i)) for i in range(len(names))]
    if not all(isinstance(name, str) for name in found):
        raise FileFormatError(file, "meta_info.keypoint_id2name", 'names by number, from "0" on', names)
    return check_names([str(name) for name in found], file, "meta_info.keypoint_id2name")


def _add(images: PeopleOfImages, image: int, instances: list[Any], file: str, where: str) -> None:
    images.look(image, file, where or "(file)")
    for i, instance in enumerate(instances):
        here = f"{where}[{i}]"
        if not isinstance(instance, dict):
            raise FileFormatError(file, here, "keypoints and keypoint_scores of a person", instance)
        points = _numbers(instance.get("keypoints"), file, f"{here}.keypoints", (-1, 2))
        scores = _numbers(instance.get("keypoint_scores"), file, f"{here}.keypoint_scores", (-1,))
        if len(points) != len(scores):
            expected = f"{len(points)} scores, one for each point"
            raise FileFormatError(file, f"{here}.keypoint_scores", expected, f"{len(scores)} scores")
        values = found_points(np.column_stack([points, scores]), file, f"{here}.keypoints")
        person = FoundPerson(values, probability(instance.get("bbox_score")), _box(instance.get("bbox")))
        images.add(image, person, file, here)


def _numbers(values: Any, file: str, where: str, shape: tuple[int, ...]) -> np.ndarray:
    """float64 of a shape; NaN for null."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(())
    if array.ndim != len(shape) or array.shape[1:] != shape[1:]:
        expected = "u and v of each point" if len(shape) == 2 else "a number for each point"
        raise FileFormatError(file, where, expected, values)
    return array


def _box(values: Any) -> tuple[float, float, float, float] | None:
    """Of ``bbox``, which is a list within a list; None where there is none that could be one."""
    while isinstance(values, list) and len(values) == 1:
        values = values[0]
    if not isinstance(values, list) or len(values) < 4 or not all(is_number(value) for value in values[:4]):
        return None
    left, top, right, bottom = (min(max(float(value), -1e6), 1e6) for value in values[:4])
    return (left, top, right, bottom) if left < right and top < bottom else None


_FIELDS = ("keypoints", "foot_kpts", "face_kpts", "lefthand_kpts", "righthand_kpts")


def is_result(content: Any) -> bool:
    """Whether a file is a list of results."""
    return isinstance(content, list) and bool(content) and isinstance(content[0], dict) and "image_id" in content[0]


def of_coco(file: Path) -> PeopleOfImages:
    """The people of one camera."""
    content, images = read_points_json(file), PeopleOfImages(str(file), _ORDERS)
    if not isinstance(content, list):
        raise FileFormatError(file, "(content)", "a list of results with image_id, keypoints, score", content)
    for i, entry in enumerate(content):
        number = entry.get("image_id") if isinstance(entry, dict) else None
        image = last_number(number) if isinstance(number, str) else number
        if not isinstance(image, int) or isinstance(image, bool):
            raise FileFormatError(file, f"[{i}].image_id", "the number of an image", entry if number is None else number)
        parts = [_coco_points(entry[field], file, f"[{i}].{field}") for field in _FIELDS if field in entry]
        values = np.concatenate([np.zeros((0, 3)), *parts])
        person = FoundPerson(found_points(values, str(file), f"[{i}].keypoints"), probability(entry.get("score")))
        images.add(image, person, str(file), f"[{i}].keypoints")
    return images


def _coco_points(values: Any, file: Path, where: str) -> np.ndarray:
    """(n, 3) u, v, score."""
    try:
        return np.array(values, dtype=np.float64).reshape(-1, 3)
    except (TypeError, ValueError, OverflowError):
        raise FileFormatError(file, where, "numbers u, v, score of every point", values) from None
