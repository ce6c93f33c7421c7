"""People from MediaPipe's landmarks, which everybody writes down in a file of their own: JSON or CSV of x, y, visibility.

x and y are fractions of the image's width and height. JSON is a list of images (or has one in ``frames``), each a mapping with
``pose_landmarks`` or ``landmarks`` and maybe its number in ``frame``, or these landmarks alone: a list of 33 mappings x, y,
visibility or of 33 lists x, y, z, visibility, or a list of such lists, one a person. CSV has a row an image with columns
``nose_x, nose_y, nose_visibility`` or ``x1, y1, z1, v1``, or a row a landmark with columns ``frame, landmark, x, y, visibility``
and maybe ``person``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileFormatError
from ..csv_file import CsvCells, CsvTable
from .camera_people import FoundPerson, PeopleOfImages, found_points
from .files import check_names, is_number, number_or_nan, read_points_json

_NUMBERS = ("frame", "frame_id", "frame_number", "frame_idx", "image")
_LANDMARKS = ("pose_landmarks", "landmarks")
_MOST = 100.0  # widths of an image: what is beyond is no fraction
_NAMED = re.compile(r"(.+)_(x|y|z|visibility|v|presence)")
_COUNTED = re.compile(r"(x|y|z|v|visibility)_?(\d{1,4})")
_SHORT = {"v": "visibility"}


def is_landmarks(content: Any) -> bool:
    """Whether the content of a JSON file is such a list of images."""
    frames = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(frames, list) or not frames:
        return False
    first = frames[0]
    if isinstance(first, dict):
        return any(key in first for key in _LANDMARKS)
    return isinstance(content, dict) or isinstance(first, list)


def is_header(header: Sequence[str]) -> bool:
    """Whether a line is the header of such a CSV file."""
    return {"landmark", "x", "y"} <= set(header) or bool(_columns(header))


def of_json(file: Path) -> PeopleOfImages:
    """The people of one camera, in fractions of the image: see `CameraPeople.for_images`."""
    content, images = read_points_json(file), _images(file)
    frames = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(frames, list):
        raise FileFormatError(file, "frames", "a list of images with landmarks", content)
    for i, frame in enumerate(frames):
        image, key, listed = i, "", frame
        if isinstance(frame, dict):
            image = next((frame[name] for name in _NUMBERS if name in frame), i)
            key = next((name for name in _LANDMARKS if name in frame), "landmarks")
            listed = frame.get(key)
        where = f"[{i}].{key}".rstrip(".")
        if not isinstance(image, int) or isinstance(image, bool):
            raise FileFormatError(file, f"[{i}].frame", "the number of an image", image)
        if listed is not None and not isinstance(listed, list):
            raise FileFormatError(file, where, "a list of landmarks", listed)
        images.look(image, str(file), where)
        for n, person in enumerate(_persons(listed or [])):
            here = f"{where}[{n}]"
            images.add(image, _person([_landmark(each, file, here) for each in person], str(file), here), str(file), here)
    return images


def _images(file: Path) -> PeopleOfImages:
    return PeopleOfImages(str(file), ("blazepose_33",), normalized=True)


def _persons(listed: list[Any]) -> list[list[Any]]:
    """Lists of landmarks, one a person."""
    several = bool(listed) and all(isinstance(each, list) and (not each or isinstance(each[0], (dict, list))) for each in listed)
    persons = listed if several else [listed]
    return [person for person in persons if person]


def _landmark(value: Any, file: Path, where: str) -> tuple[float, float, float]:
    if isinstance(value, dict):
        numbers = [value.get("x"), value.get("y"), value.get("visibility", value.get("presence", 1.0))]
    elif isinstance(value, list) and len(value) >= 3:
        numbers = [value[0], value[1], value[-1]]
    else:
        numbers = [None]
    if not all(is_number(number) or number is None for number in numbers) or len(numbers) != 3:
        raise FileFormatError(file, where, "landmarks of x, y, visibility", value)
    try:
        x, y, visibility = (np.nan if number is None else float(number) for number in numbers)
    except OverflowError:
        raise FileFormatError(file, where, "landmarks of x, y, visibility", value) from None
    return x, y, visibility


def _person(rows: Sequence[Sequence[float]], file: str, where: str) -> FoundPerson:
    values = np.array(rows, dtype=np.float64).reshape(-1, 3)
    if np.nanmax(np.abs(values[:, :2]), initial=0.0) > _MOST:
        raise FileFormatError(file, where, "x and y as fractions of the image's width and height", values[0, :2].tolist())
    return FoundPerson(found_points(values, file, where))


def of_csv(file: Path) -> PeopleOfImages:
    """As `of_json`."""
    table = CsvTable(file)
    return _of_landmark_rows(table) if "landmark" in table.header else _of_image_rows(table)


def _columns(header: Sequence[str]) -> dict[str, dict[str, int]]:
    """Point -> column of x, y, visibility; points without x and y are left out."""
    found: dict[str, dict[str, int]] = {}
    for i, title in enumerate(header):
        counted, named = _COUNTED.fullmatch(title.lower()), _NAMED.fullmatch(title.lower())
        if counted is not None:
            found.setdefault(counted[2], {})[_SHORT.get(counted[1], counted[1])] = i
        elif named is not None:
            found.setdefault(named[1], {})[_SHORT.get(named[2], named[2])] = i
    return {name: columns for name, columns in found.items() if {"x", "y"} <= set(columns)}


def _of_image_rows(table: CsvTable) -> PeopleOfImages:
    columns, file = _columns(table.header), str(table.path)
    if not columns:
        expected = "columns nose_x, nose_y, nose_visibility, or x1, y1, z1, v1"
        raise FileFormatError(file, "header", expected, list(table.header[:6]))
    number = next((table.header.index(name) for name in _NUMBERS if name in table.header), None)
    images = _images(table.path)
    for i, row in enumerate(table.rows()):
        image = i if number is None else row.integer(number)
        where = f"line {row.line}"
        images.look(image, file, where)
        person = _person([_of_row(row, at) for at in columns.values()], file, where)
        if (person.points[:, 2] > 0.0).any():
            images.add(image, person, file, where)
    if not all(name.isdecimal() for name in columns):
        images.names = check_names(tuple(columns), file, "header")
    return images


def _of_row(row: CsvCells, at: dict[str, int]) -> tuple[float, float, float]:
    certain = at.get("visibility", at.get("presence"))
    return number_or_nan(row, at["x"]), number_or_nan(row, at["y"]), 1.0 if certain is None else number_or_nan(row, certain)


def _of_landmark_rows(table: CsvTable) -> PeopleOfImages:
    file, header = str(table.path), table.header
    number = next((header.index(name) for name in _NUMBERS if name in header), None)
    lacking = [name for name in ("x", "y", "visibility") if name not in header]
    if number is None or lacking:
        raise FileFormatError(file, "header", "columns frame, landmark, x, y, visibility", list(header))
    at = {name: header.index(name) for name in ("x", "y", "visibility")}
    rows: dict[tuple[int, str], dict[str, tuple[float, float, float]]] = {}
    for row in table.rows():
        person = row.text[header.index("person")] if "person" in header else ""
        points = rows.setdefault((row.integer(number), person), {})
        if row.text[header.index("landmark")] in points:
            raise FileFormatError(file, f"line {row.line}", "each landmark of a person once", row.text[header.index("landmark")])
        points[row.text[header.index("landmark")].lower()] = _of_row(row, at)
    found = dict.fromkeys(name for points in rows.values() for name in points)
    counted = all(name.isdecimal() and len(name) < 5 for name in found)
    order = sorted(found, key=int) if counted else list(found)
    images, missing = _images(table.path), (np.nan, np.nan, np.nan)
    for (image, person), points in rows.items():
        where = f"frame {image}, person {person}" if person else f"frame {image}"
        images.add(image, _person([points.get(name, missing) for name in order], file, where), file, where)
    if not counted:
        images.names = check_names(tuple(order), file, "landmark")
    return images
