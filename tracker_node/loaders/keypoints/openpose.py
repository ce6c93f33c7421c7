"""People from OpenPose's JSON files, one an image, one folder a camera; Pose2Sim keeps those of other detectors in the same form.

Images are numbered by the last number in the name of a file, from that of the folder's first file on.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..motion.openpose_json import ImagePoints
from ..motion.openpose_json import load_openpose as load_arrays
from .camera_people import CameraPeople, FoundPerson, PeopleOfImages, PointsByCamera, found_points
from .names import BODY_25, BODY_25B, names_of

_ORDERS = ("body_25b", "coco_17", "coco_18", "halpe_26", "coco_wholebody_133")
_CHAIN = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"), ("ankle", "heel"))
_BONES = (("nose", "neck"), *((f"{side}_{a}", f"{side}_{b}") for side in ("left", "right") for a, b in _CHAIN))


def load_openpose(path: str | Path, names: Sequence[str] = ()) -> PointsByCamera:
    """People of all cameras below a folder, or in a zip file.

    Parameters
    ----------
    path : folder of folders with JSON files, such as Pose2Sim's ``pose``; or a zip file of it.
    names : of the points; empty: by their number. BODY_25 and BODY_25B are told apart by the lengths of the bones.

    Returns
    -------
    Folder's name -> people by image.

    Raises
    ------
    FileFormatError : no JSON files, one that is not OpenPose's, or points of an unknown detector.
    """
    groups = load_arrays(path)
    return {key or Path(path).name: _camera(f"{path}/{group.source}", group, names) for key, group in groups.items()}


def _camera(source: str, group: ImagePoints, names: Sequence[str]) -> CameraPeople:
    images = PeopleOfImages(source)
    numbers = group.numbers or tuple(range(len(group.people)))
    for number, people in zip(numbers, group.people, strict=True):
        image = number - min(numbers)
        file = f"{source}, file number {number}"
        images.look(image, file, "people")
        for i, person in enumerate(people):
            where = f"people[{i}].pose_keypoints_2d"
            images.add(image, FoundPerson(found_points(person, file, where)), file, where)
    if images.n_points is None:
        return images.camera(tuple(names))
    order = names_of(images.n_points, _ORDERS, names, source, "pose_keypoints_2d")
    if order == BODY_25B and not names and _is_body_25(images):
        order = BODY_25
    return images.camera(order)


def _is_body_25(images: PeopleOfImages) -> bool:
    """Whether bones are shorter where points are taken for BODY_25's than where they are taken for BODY_25B's, in most people."""
    votes = 0
    for people in images.found.values():
        for person in people:
            one, other = (_mean_bone_px(person.points, order) for order in (BODY_25, BODY_25B))
            votes += int(one < other) - int(other < one)
    return votes > 0


def _mean_bone_px(points: np.ndarray, order: Sequence[str]) -> float:
    """Mean length of the bones of which both ends were found; infinite where there are none."""
    at = np.array([[order.index(end) for end in bone] for bone in _BONES])
    found = (points[at, 2] > 0.0).all(axis=1)
    lengths = np.linalg.norm(points[at[:, 0], :2] - points[at[:, 1], :2], axis=1)
    return float(lengths[found].mean()) if found.any() else np.inf
