"""People or animals from DeepLabCut's CSV and H5, with one or several individuals; anipose keeps its 2D points in the same form.

Columns have names on several levels: scorer, individuals (where there are several), bodyparts, coords (x, y, likelihood). A row
is an image; its index is the number of the image, or a name with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..csv_file import CsvTable
from .camera_people import FoundPerson, PeopleOfImages, found_points
from .files import image_number, number_or_nan
from .hdf5 import open_hdf5
from .names import check_names

_LEVELS = ("scorer", "individuals", "bodyparts", "coords")
_COORDINATES = ("x", "y", "likelihood")
_MOST_INDIVIDUALS = 1000


def of_csv(file: Path) -> PeopleOfImages:
    """The individuals of one camera."""
    table = CsvTable(file)
    levels, first = {"scorer": table.header}, None
    rows = iter(table.rows())
    for first in rows:
        if first.text[0] not in _LEVELS:
            break
        levels[first.text[0]] = tuple(first.text)
        first = None
    if table.header[:1] != ("scorer",) or "bodyparts" not in levels or "coords" not in levels:
        raise FileFormatError(file, "header", "lines scorer, bodyparts, coords", list(levels))
    at = next((i for i, cell in enumerate(levels["coords"]) if i and cell), 1)  # behind the index, which may have several columns
    columns = [tuple(levels[level][i] if level in levels else "" for level in _LEVELS) for i in range(at, len(table.header))]
    places, images = _Places(columns, str(file)), PeopleOfImages(str(file))
    images.names = places.names
    for row in (*(() if first is None else (first,)), *rows):
        where = f"line {row.line}"
        number = image_number(row.text[at - 1])
        if number is None:
            raise FileFormatError(file, where, "the number of an image", row.text[at - 1])
        places.add(images, number, np.array([number_or_nan(row, i) for i in range(at, len(row.text))]), where)
    return images


def of_hdf5(path: Path) -> PeopleOfImages:
    """The individuals of one camera, from a table as pandas writes it."""
    with open_hdf5(path) as opened:
        group = next((key for key in opened.keys() if opened.has(f"{key}/table")), None)  # noqa: SIM118
        if group is None:
            expected = "a table of DeepLabCut, as pandas writes it with format='table'; or save it as CSV"
            raise FileFormatError(path, "(content)", expected, list(opened.keys()))
        table = opened.array(f"{group}/table")
        blocks = [name for name in table.dtype.names or () if name.startswith("values_block_")]
        if "index" not in (table.dtype.names or ()) or not blocks:
            raise FileFormatError(path, f"{group}/table", "fields index and values_block_0", list(table.dtype.names or ()))
        kinds = [opened.attribute(f"{group}/table", f"{block}_kind") for block in blocks]
    labels, values = [], []
    for block, kind in zip(blocks, kinds, strict=True):
        if not isinstance(kind, list) or not all(_is_label(label) for label in kind):
            raise FileFormatError(path, f"{group}/table.{block}_kind", "columns of scorer, bodyparts, coords", kind)
        numbers = table[block].reshape(len(table), -1)
        if numbers.dtype.kind not in "fiu" or numbers.shape[1] != len(kind):
            raise FileFormatError(path, f"{group}/table.{block}", f"{len(kind)} columns of numbers", str(numbers.dtype))
        labels += [("", *label) if len(label) == 3 else tuple(label) for label in kind]
        values.append(numbers.astype(np.float64))
    columns = [label if label[0] else ("", "", *label[2:]) for label in labels]
    places, images, rows = _Places(columns, str(path)), PeopleOfImages(str(path)), np.hstack(values)
    images.names = places.names
    for index, row in zip(table["index"], rows, strict=True):
        name = index.decode("utf-8", "replace") if isinstance(index, bytes) else str(index)
        number = image_number(name)
        if number is None:
            raise FileFormatError(path, f"{group}/table.index", "the numbers of images", name)
        places.add(images, number, row, f"image {number}")
    return images


def _is_label(label: object) -> bool:
    return isinstance(label, tuple) and len(label) in (3, 4) and all(isinstance(name, str) for name in label)


class _Places:
    """Where the columns of a table go: individual, point, coordinate.

    Parameters
    ----------
    columns : names on the levels of `_LEVELS`.
    file : for messages.
    """

    def __init__(self, columns: Iterable[Sequence[str]], file: str):
        columns = list(columns)
        others = sorted({column[3] for column in columns} - set(_COORDINATES))
        if others:
            raise FileFormatError(file, "coords", f"of {', '.join(_COORDINATES)}", others[:5])
        self._file = file
        self.names = check_names(tuple(dict.fromkeys(column[2] for column in columns)), file, "bodyparts")
        individuals = list(dict.fromkeys(column[1] for column in columns))
        if len(individuals) > _MOST_INDIVIDUALS or len(individuals) * len(self.names) > 1_000_000:
            raise FileFormatError(file, "individuals", f"at most {_MOST_INDIVIDUALS} individuals", len(individuals))
        self._shape = len(individuals), len(self.names), 3
        numbers = {name: i for i, name in enumerate(self.names)}, {name: i for i, name in enumerate(individuals)}
        self._at = (
            [numbers[1][column[1]] for column in columns],
            [numbers[0][column[2]] for column in columns],
            [_COORDINATES.index(column[3]) for column in columns],
        )
        if len(set(zip(*self._at, strict=True))) != len(columns):
            raise FileFormatError(file, "bodyparts", "each coordinate of a body part once", "one of them twice")
        self._likely = "likelihood" in {column[3] for column in columns}

    def add(self, images: PeopleOfImages, image: int, row: np.ndarray, where: str) -> None:
        """The individuals of one row, as far as they were found.

        Parameters
        ----------
        images, image : get them; number of the image.
        row : (n_columns,) numbers.
        where : field, for messages.
        """
        values = np.full(self._shape, np.nan)
        if not self._likely:  # a person has marked the points
            values[:, :, 2] = 1.0
        values[self._at] = row
        images.look(image, self._file, where)
        for individual in values:
            points = found_points(individual, self._file, where)
            if (points[:, 2] > 0.0).any():
                images.add(image, FoundPerson(points), self._file, where)
