"""People or animals from DeepLabCut's CSV and H5, and from SLEAP's analysis files, H5 and CSV, where a track is an individual.

Anipose keeps its 2D points in DeepLabCut's form.

Columns have names on several levels: scorer, individuals (where there are several), bodyparts, coords (x, y, likelihood). A row
is an image; its index is the number of the image, or a name with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..csv_file import CsvTable
from ..source_address import last_number
from .camera_people import FoundPerson, PeopleOfImages, found_points
from .files import check_names, number_or_nan
from .hdf5 import Hdf5File, open_hdf5

_LEVELS = ("scorer", "individuals", "bodyparts", "coords")
_COORDINATES = ("x", "y", "likelihood")
_MOST_INDIVIDUALS = 1000


def of_deeplabcut_csv(file: Path) -> PeopleOfImages:
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
        number = last_number(row.text[at - 1])
        if number is None:
            raise FileFormatError(file, where, "the number of an image", row.text[at - 1])
        places.add(images, number, np.array([number_or_nan(row, i) for i in range(at, len(row.text))]), where)
    return images


def of_deeplabcut_hdf5(path: Path) -> PeopleOfImages:
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
        number = last_number(name)
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


_FIRST = ("track", "frame_idx", "instance.score")


def is_analysis(opened: Hdf5File) -> bool:
    """Whether an H5 file is an analysis of SLEAP."""
    return opened.has("tracks") and opened.has("node_names")


def of_sleap_hdf5(path: Path) -> PeopleOfImages:
    """The individuals of one camera, from an analysis."""
    with open_hdf5(path) as opened:
        names = check_names(opened.names("node_names"), str(path), "node_names")
        tracks = opened.numbers("tracks", 4)
        told = opened.numbers("point_scores", 3) if opened.has("point_scores") else None
    if tracks.shape[1:3] != (2, len(names)):
        tracks = tracks.transpose()  # as Matlab has it
    n_tracks, n_axes, n_names, n_images = tracks.shape
    if (n_axes, n_names) != (2, len(names)):
        raise FileFormatError(path, "tracks", f"individuals x 2 x {len(names)} points x images", str(tracks.shape[::-1]))
    scores = np.ones((n_tracks, n_names, n_images))
    if told is not None:
        if told.shape not in (scores.shape, scores.shape[::-1]):
            raise FileFormatError(path, "point_scores", f"a number for each point {scores.shape}", str(told.shape))
        told = told if told.shape == scores.shape else told.transpose()
        scores = np.where(np.isnan(told), 1.0, told)  # a person has marked the point
    images = PeopleOfImages(str(path))
    images.names = names
    values = np.concatenate([tracks, scores[:, None]], axis=1).transpose(3, 0, 2, 1)
    for image in range(n_images):
        where = f"tracks, image {image}"
        images.look(image, str(path), where)
        for track in values[image]:
            if not np.isnan(track[:, :2]).all():
                images.add_points(image, track, str(path), where)
    return images


def of_sleap_csv(file: Path) -> PeopleOfImages:
    """The individuals of one camera."""
    table = CsvTable(file, _FIRST)
    columns = {name: i for i, name in enumerate(table.header)}
    parts = tuple(dict.fromkeys(name.rpartition(".")[0] for name in table.header[len(_FIRST) :]))
    names = check_names(parts, str(file), "header")
    wanted = [f"{name}.{end}" for name in names for end in ("x", "y", "score")]
    lacking = [name for name in wanted if name not in columns]
    if lacking:
        raise FileFormatError(file, "header", "columns x, y, score of each point", f"no {lacking[0]}")
    at, images = [columns[name] for name in wanted], PeopleOfImages(str(file))
    images.names = names
    for row in table.rows():
        where = f"line {row.line}"
        values = np.array([number_or_nan(row, i) for i in at]).reshape(-1, 3)
        values[:, 2] = np.where(np.isnan(values[:, 2]), 1.0, values[:, 2])
        score = number_or_nan(row, 2)
        known = None if np.isnan(score) or score <= 0.0 else min(score, 1.0)
        person = FoundPerson(found_points(values, str(file), where), known)
        images.add(row.integer(1), person, str(file), where)
    return images
