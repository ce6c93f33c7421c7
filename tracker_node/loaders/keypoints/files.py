"""Files of several cameras in a folder, a file a camera or a folder a camera; names of their points where they have numbers only.

One name stands for one point in all detectors: ``left_`` and ``right_`` are the person's own sides.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path, PurePath
from typing import Any, TypeVar

import numpy as np

from ...errors import FileFormatError
from ...observation.keypoints.blazepose import NAMES as BLAZEPOSE_33
from ..csv_file import CsvCells
from ..json_values import parse_json
from ..source_address import last_number, numbers_in
from ..whole_file import MB, read_text

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


POINTS_BYTES = 256 * MB
"""JSON with the points of a whole recording."""
AnyPath = TypeVar("AnyPath", bound=PurePath)
_ENDS = re.compile(r"(DLC_.*|\.analysis|\.predictions|_keypoints|_json)$")  # of names, added by programs


def read_points_json(path: str | Path) -> Any:
    """Content of a JSON file with points.

    Raises
    ------
    FileFormatError : it cannot be read, is larger than `POINTS_BYTES`, or is no JSON.
    """
    return parse_json(read_text(path, POINTS_BYTES), path)


def files_of(path: str | Path, suffixes: Sequence[str]) -> list[Path]:
    """A file, or the files in a folder and below, in the order of their names.

    Parameters
    ----------
    path, suffixes : file or folder; ends of names, such as ``.json``.

    Returns
    -------
    At least one file.

    Raises
    ------
    FileFormatError : the folder has none.
    """
    path = Path(path)
    if not path.is_dir():
        return [path]
    files = sorted(file for file in path.rglob("*") if file.suffix.lower() in suffixes and file.is_file())
    if not files:
        raise FileFormatError(path, "(content)", f"files {', '.join(f'*{suffix}' for suffix in suffixes)}", "none")
    return files


def camera_keys(files: Iterable[Path]) -> dict[str, Path]:
    """Files by the names of their cameras: what their programs add is left out.

    ``cam01DLC_resnet50_walkMay1shuffle1_100000.h5`` is ``cam01``, ``cam01.analysis.h5`` too.

    Raises
    ------
    FileFormatError : two files of one name.
    """
    found: dict[str, Path] = {}
    for file in files:
        key = _ENDS.sub("", file.stem) or file.stem
        if key in found:
            raise FileFormatError(file, "(file)", f"one file for camera '{key}'", f"{found[key].name} as well")
        found[key] = file
    return found


def by_folder(files: Iterable[AnyPath], name: str) -> dict[str, list[AnyPath]]:
    """Files by the names of their folders, which are those of cameras; by whole paths where two folders have one name.

    Parameters
    ----------
    files : paths below a common folder.
    name : of that folder.

    Returns
    -------
    In the order of the names.
    """
    folders: dict[PurePath, list[AnyPath]] = defaultdict(list)
    for file in files:
        folders[file.parent].append(file)
    short = [folder.name or name for folder in folders]
    keys = short if len(set(short)) == len(short) else map(str, folders)
    return dict(sorted(zip(keys, folders.values(), strict=True)))


def numbered_files(files: Sequence[AnyPath]) -> Iterator[tuple[int, AnyPath]]:
    """Files of one camera, one an image, with the numbers of their images: from the first file's on, or, where their last numbers
    are not their own, in the order of all numbers in their names."""
    numbers = [last_number(file.stem) for file in files]
    known = [number for number in numbers if number is not None]
    if len(set(known)) != len(files):
        yield from enumerate(sorted(files, key=lambda file: (numbers_in(file.stem), file.name)))
        return
    yield from sorted((number - min(known), file) for number, file in zip(known, files, strict=True))


def is_number(value: Any) -> bool:
    """True for a number of JSON; NaN and infinity, which Python reads, too."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def probability(value: Any) -> float | None:
    """A score as a probability; None for what is none."""
    return min(max(float(value), 0.0), 1.0) if is_number(value) and abs(value) < 1e12 else None


def number_or_nan(row: CsvCells, column: int) -> float:
    """A number of a table.

    Parameters
    ----------
    row, column : line and column.

    Returns
    -------
    NaN where the cell is empty or says so.

    Raises
    ------
    FileFormatError : it is no finite number.
    """
    text = row.text[column].strip()
    return np.nan if text.lower() in ("", "nan") else row.number(column)
