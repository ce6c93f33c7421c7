"""People from OpenPose's JSON files, one an image, one folder a camera; Pose2Sim keeps those of other detectors in the same form.

Images are numbered by the last number in the name of a file, from that of the folder's first file on.
"""

from __future__ import annotations

import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ...errors import FileFormatError
from ..json_values import parse_json
from ..whole_file import ARCHIVE_BYTES, MB, read_bytes
from .camera_people import PeopleOfImages
from .files import BODY_25, BODY_25B, by_folder, numbered_files

_ORDERS = ("body_25b", "coco_17", "coco_18", "halpe_26", "coco_wholebody_133")
_CHAIN = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"), ("ankle", "heel"))
_BONES = (("nose", "neck"), *((f"{side}_{a}", f"{side}_{b}") for side in ("left", "right") for a, b in _CHAIN))
_LARGEST = 4 * MB  # of one file; an image with a hundred people has a tenth of a megabyte

# What zipfile raises for archives that are damaged, encrypted, or packed in a way that it does not know
_DAMAGED = (
    OSError, zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, NotImplementedError, RuntimeError,
    ValueError,
)  # fmt: skip


def read(path: Path) -> dict[str, PeopleOfImages]:
    """People by folder, below a folder or in a zip file of it; BODY_25 and BODY_25B are told apart by the lengths of the bones.

    Raises
    ------
    FileFormatError : no JSON files, or one that is not OpenPose's.
    """
    people = {PurePosixPath(name): _people(f"{path}/{name}", text) for name, text in _json_files(path)}
    if not people:
        raise FileFormatError(path, "(content)", "folders or a zip file with OpenPose JSON files, one folder a camera", "none")
    return {key: _images(path, files, people) for key, files in by_folder(people, path.name).items()}


def _images(path: Path, files: list[PurePosixPath], people: dict[PurePosixPath, list[np.ndarray]]) -> PeopleOfImages:
    images = PeopleOfImages(f"{path}/{files[0].parent}", _ORDERS)
    for number, file in numbered_files(files):
        images.look(number, f"{path}/{file}", "people")
        for i, points in enumerate(people[file]):
            images.add_points(number, points, f"{path}/{file}", f"people[{i}].pose_keypoints_2d")
    if images.n_points == len(BODY_25) and _is_body_25(images):
        images.orders = ("body_25",)
    return images


def _json_files(path: Path) -> Iterator[tuple[str, str | bytes]]:
    """Name relative to ``path`` and text of every JSON file."""
    if path.is_dir():
        for file in sorted(path.rglob("*.json")):
            yield file.relative_to(path).as_posix(), read_bytes(file, _LARGEST)
        return
    try:
        with zipfile.ZipFile(path) as archive:
            members = [each for each in archive.infolist() if each.filename.endswith(".json")]
            for member in members:
                if member.file_size > _LARGEST:
                    said = f"{member.file_size / MB:.0f} MB"
                    raise FileFormatError(path, member.filename, f"at most {_LARGEST // MB} MB of JSON", said)
            total = sum(member.file_size for member in members)
            if total > ARCHIVE_BYTES:
                raise FileFormatError(path, "(file)", f"at most {ARCHIVE_BYTES // MB} MB unpacked", f"{total // MB} MB")
            for member in members:
                yield member.filename, archive.read(member)
    except _DAMAGED as error:
        raise FileFormatError(path, "(file)", "a folder or a zip file of OpenPose JSON files", str(error)) from error


def _people(file: str, text: str | bytes) -> list[np.ndarray]:
    """(n_points, 3) u, v, score of each person in an image."""
    content = parse_json(text, file)
    if not isinstance(content, dict) or not isinstance(content.get("people"), list):
        raise FileFormatError(file, "people", "a list of people", content)
    return [_points(person, file, f"people[{i}].pose_keypoints_2d") for i, person in enumerate(content["people"])]


def _points(person: Any, file: str, where: str) -> np.ndarray:
    values = person.get("pose_keypoints_2d") if isinstance(person, dict) else None
    try:
        return np.array(values, dtype=np.float64).reshape(-1, 3)
    except (TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(file, where, "numbers u, v, confidence of every joint", values) from error


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
