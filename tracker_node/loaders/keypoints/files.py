"""Files of several cameras in a folder: one file a camera, or one folder a camera with a file an image."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path, PurePath
from typing import Any, TypeVar

import numpy as np

from ...errors import FileFormatError
from ..csv_file import CsvCells
from ..json_values import parse_json
from ..whole_file import MB, read_text

POINTS_BYTES = 256 * MB
"""JSON with the points of a whole recording."""
AnyPath = TypeVar("AnyPath", bound=PurePath)
_NUMBER = re.compile(r"\d{1,18}")
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


def image_number(text: str) -> int | None:
    """The last number in a name, such as 12 of ``cam1_000012.json``; None where there is none."""
    numbers = _NUMBER.findall(text)
    return int(numbers[-1]) if numbers else None


def numbered_files(files: Sequence[AnyPath]) -> Iterator[tuple[int, AnyPath]]:
    """Files of one camera, one an image, with the numbers of their images: from the first file's on, or, where their last numbers
    are not their own, in the order of all numbers in their names."""
    numbers = [image_number(file.stem) for file in files]
    known = [number for number in numbers if number is not None]
    if len(set(known)) != len(files):
        yield from enumerate(sorted(files, key=lambda file: ([int(n) for n in _NUMBER.findall(file.stem)], file.name)))
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
