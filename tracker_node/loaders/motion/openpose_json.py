"""Two-dimensional joints per image as OpenPose writes them: one JSON file an image, one folder a camera.

The pixels are those of the images that OpenPose was given. Several people may be in an image, in no particular order.
"""

from __future__ import annotations

import lzma
import re
import struct
import zipfile
import zlib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from ...errors import FileFormatError, UnknownNameError
from ..json_values import parse_json
from ..whole_file import ARCHIVE_BYTES, MB, read_bytes

_LARGEST = 4 * MB  # of one file; an image with a hundred people has a tenth of a megabyte

# What zipfile raises for archives that are damaged, encrypted, or packed in a way that it does not know
_DAMAGED = (
    OSError, zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, NotImplementedError, RuntimeError,
    ValueError,
)  # fmt: skip


@dataclass(frozen=True)
class ImagePoints:
    """People found in the images of one camera.

    Parameters
    ----------
    source : folder (or folder in an archive) that they come from.
    people : one array (n_people, n_joints, 3) per image, in the order of the image numbers: u, v, confidence; confidence 0
        where a joint was not found.
    numbers : of the images, by the last number in the name of each file; empty where these do not differ.
    """

    source: str
    people: tuple[np.ndarray, ...]
    numbers: tuple[int, ...] = ()


def load_openpose(path: str | Path) -> dict[str, ImagePoints]:
    """Joints of all cameras below a folder, or in a zip file.

    Returns
    -------
    One `ImagePoints` per folder that holds JSON files, keyed by the folder's name (its path below ``path`` where a name
    occurs twice).

    Raises
    ------
    FileFormatError : when there are no JSON files, or one is not OpenPose's.
    """
    path = Path(path)
    groups: dict[str, list[tuple[list[int], str, np.ndarray]]] = defaultdict(list)
    for name, text in _json_files(path):
        entry = PurePosixPath(name)
        groups[str(entry.parent)].append((_numbers(entry.stem), entry.name, _people(f"{path}/{name}", text)))
    if not groups:
        raise FileFormatError(path, "(content)", "folders or a zip file with OpenPose JSON files, one folder a camera", "none")
    short = [PurePosixPath(folder).name for folder in groups]
    keys = short if len(set(short)) == len(short) else list(groups)
    result = {}
    for key, (folder, entries) in sorted(zip(keys, groups.items(), strict=True)):
        entries.sort(key=lambda entry: entry[:2])
        numbers = tuple(numbers[-1] for numbers, _, _ in entries if numbers)
        numbers = numbers if len(set(numbers)) == len(entries) else ()
        result[key] = ImagePoints(folder, tuple(people for _, _, people in entries), numbers)
    return result


def match_cameras(groups: dict[str, ImagePoints], cameras: tuple[str, ...]) -> dict[str, ImagePoints]:
    """Folders of 2D points by camera: equal names first (``cam01`` or ``cam01_json``), then equal last numbers (``cam1_json``).

    Parameters
    ----------
    groups, cameras : folder -> points; names of the cameras.

    Returns
    -------
    Camera -> points.

    Raises
    ------
    UnknownNameError : for a camera without a folder, with the folders that there are.
    """
    result = {}
    for camera in cameras:
        named = [key for key in groups if key in (camera, f"{camera}_json")]
        numbers = _numbers(camera)[-1:]
        numbered = [key for key in groups if numbers and _numbers(key)[-1:] == numbers]
        found = named or (numbered if len(numbered) == 1 else [])
        if not found:
            raise UnknownNameError("folder of 2D points for camera", camera, groups)
        result[camera] = groups[found[0]]
    return result


def _json_files(path: Path) -> Iterator[tuple[str, str | bytes]]:
    """Name relative to ``path`` and text of every JSON file."""
    if path.is_dir():
        for file in sorted(path.rglob("*.json")):
            yield file.relative_to(path).as_posix(), read_bytes(file, _LARGEST)
        return
    try:
        with zipfile.ZipFile(path) as archive:
            members = sorted((each for each in archive.infolist() if each.filename.endswith(".json")), key=_name_of)
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


def _name_of(member: zipfile.ZipInfo) -> str:
    return member.filename


def _people(file: str, text: str | bytes) -> np.ndarray:
    content = parse_json(text, file)
    if not isinstance(content, dict) or not isinstance(content.get("people"), list):
        raise FileFormatError(file, "people", "a list of people", content)
    found: list[np.ndarray] = []
    for index, person in enumerate(content["people"]):
        field = f"people[{index}].pose_keypoints_2d"
        values = person.get("pose_keypoints_2d") if isinstance(person, dict) else None
        try:
            points = np.array(values, dtype=np.float64).reshape(-1, 3)
        except (TypeError, ValueError, OverflowError) as error:
            raise FileFormatError(file, field, "numbers u, v, confidence of every joint", values) from error
        if len(points) == 0 or not np.all(np.abs(points) <= 1e6) or (found and len(points) != len(found[0])):
            raise FileFormatError(file, field, "finite u, v, confidence, as many joints for all people", values)
        found.append(points)
    return np.array(found) if found else np.zeros((0, 0, 3))


def _numbers(text: str) -> list[int]:
    return [int(digits) for digits in re.findall(r"\d{1,300}", text)]  # of thousands Python reads none
