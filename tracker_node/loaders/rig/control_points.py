"""Points clicked on in the images, of known place (control points) or unknown place (clicks), as CSV; DLT coefficients as text.

Control points have columns ``camera,point,x,y,z,u,v``: one line for each camera that shows a point; meters in the world, pixels
of the images. Before anybody has clicked on them, only their places are known: a file ``point,x,y,z``. Clicks on points of
unknown place have columns ``camera,point,u,v``.

Coefficients are eleven lines, perhaps below a header, a column per camera, commas, semicolons (numbers may have decimal commas
then) or blanks between (as Argus and DLTdv write them):
``u = (L1 x + L2 y + L3 z + L4) / (L9 x + L10 y + L11 z + 1)`` and so on, with ``v`` downward as everywhere here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ...errors import FileFormatError
from ..csv_file import CsvCells, CsvTable, CsvWriter, exact
from ..whole_file import read_text, write_whole

COLUMNS = ("camera", "point", "x", "y", "z", "u", "v")
PLACE_COLUMNS = ("point", "x", "y", "z")
CLICK_COLUMNS = ("camera", "point", "u", "v")


@dataclass(frozen=True, eq=False)
class ControlPoints:
    """What one camera shows: ``names`` of the points, their ``points`` (n, 3) in meters and ``pixels`` (n, 2)."""

    names: tuple[str, ...]
    points: np.ndarray
    pixels: np.ndarray


def load_control_points(path: str | Path) -> dict[str, ControlPoints]:
    """Camera name -> its points, in the order of the file.

    Raises
    ------
    FileFormatError : naming line and column; also for a point that a camera has twice, or that has two places.
    """
    found: dict[str, dict[str, np.ndarray]] = {}
    places: dict[str, np.ndarray] = {}
    for row, camera, point in _named_rows(path, COLUMNS):
        values = row.numbers(2, 7)
        if not np.allclose(places.setdefault(point, values[:3]), values[:3], rtol=0.0, atol=1e-9):
            expected = f"point '{point}' in one place, {places[point].tolist()}"
            raise FileFormatError(path, f"line {row.line}", expected, values[:3].tolist())
        found.setdefault(camera, {})[point] = values
    return {
        camera: ControlPoints(tuple(points), np.array(list(points.values()))[:, :3], np.array(list(points.values()))[:, 3:])
        for camera, points in found.items()
    }


def dump_control_points(seen: Mapping[str, ControlPoints], path: str | Path) -> None:
    """Write control points for `load_control_points`.

    Parameters
    ----------
    seen, path : camera -> its points; CSV file.
    """
    with CsvWriter(path, COLUMNS) as writer:
        for camera, of_camera in seen.items():
            triples = zip(of_camera.names, of_camera.points, of_camera.pixels, strict=True)
            writer.write_rows([[camera, name, *map(exact, point), *map(exact, pixel)] for name, point, pixel in triples])


def load_places(path: str | Path) -> dict[str, np.ndarray]:
    """Point -> its place (3,), meters in the world, from columns ``point,x,y,z`` or a file of control points clicked on.

    Raises
    ------
    FileFormatError : naming line and column; also for a point that is listed twice.
    """
    if CsvTable(path).header[: len(COLUMNS)] == COLUMNS:
        seen = load_control_points(path).values()
        return {name: point for points in seen for name, point in zip(points.names, points.points, strict=True)}
    places: dict[str, np.ndarray] = {}
    for row in CsvTable(path, PLACE_COLUMNS).rows():
        name = row.text[0]
        if not name or name in places:
            raise FileFormatError(path, f"line {row.line}", "the name of a point, each once", name)
        places[name] = row.numbers(1, 4)
    if not places:
        raise FileFormatError(path, "(file)", "one line at least", "none")
    return places


def load_clicks(path: str | Path) -> dict[str, dict[str, np.ndarray]]:
    """Camera -> point -> its pixel (2,), in the order of the file.

    Raises
    ------
    FileFormatError : naming line and column; also for a point that a camera has twice.
    """
    found: dict[str, dict[str, np.ndarray]] = {}
    for row, camera, point in _named_rows(path, CLICK_COLUMNS):
        found.setdefault(camera, {})[point] = row.numbers(2, 4)
    return found


def dump_clicks(clicks: Mapping[str, Mapping[str, np.ndarray]], path: str | Path) -> None:
    """Write clicks for `load_clicks`.

    Parameters
    ----------
    clicks, path : camera -> point -> its pixel (2,); CSV file.
    """
    with CsvWriter(path, CLICK_COLUMNS) as writer:
        for camera, points in clicks.items():
            writer.write_rows([[camera, point, *map(exact, pixel)] for point, pixel in points.items()])


def _named_rows(path: str | Path, columns: Sequence[str]) -> Iterator[tuple[CsvCells, str, str]]:
    """Rows with their camera and point, each pair once, and at least one."""
    seen: set[tuple[str, str]] = set()
    for row in CsvTable(path, columns).rows():
        camera, point = row.text[0], row.text[1]
        if not camera or not point:
            raise FileFormatError(path, f"line {row.line}", "names of a camera and a point", f"{camera!r}, {point!r}")
        if (camera, point) in seen:
            raise FileFormatError(path, f"line {row.line}", f"each point once for camera '{camera}'", f"'{point}' again")
        seen.add((camera, point))
        yield row, camera, point
    if not seen:
        raise FileFormatError(path, "(file)", "one line at least", "none")


N_COEFFICIENTS = 11


def dlt_lines(text: str) -> dict[int, list[str]]:
    """Cells of each line of coefficients, by the numbers of the lines; a header, in which no cell is a number, is left out."""
    decimal = "." if ";" in text else " "
    lines = {i: line.replace(",", decimal).replace(";", " ").split() for i, line in enumerate(text.splitlines(), 1)}
    lines = {i: cells for i, cells in lines.items() if cells}
    first = next(iter(lines), 0)
    return {i: cells for i, cells in lines.items() if i != first or any(map(is_decimal, cells))}


def is_decimal(text: str) -> bool:
    """True for what `float` reads."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def load_dlt(path: str | Path) -> np.ndarray:
    """L1..L11 of each camera, (n_cameras, 11).

    Raises
    ------
    FileFormatError : naming the line.
    """
    rows = dlt_lines(read_text(path))
    if len(rows) != N_COEFFICIENTS:
        expected = f"{N_COEFFICIENTS} lines, one per coefficient, a column per camera"
        raise FileFormatError(path, "(file)", expected, f"{len(rows)} lines")
    columns = len(next(iter(rows.values())))
    values = np.empty((columns, N_COEFFICIENTS))
    for i, (line, row) in enumerate(rows.items()):
        try:
            numbers = np.array(row, dtype=np.float64)
        except ValueError as error:
            raise FileFormatError(path, f"line {line}", "numbers", " ".join(row)) from error
        if len(numbers) != columns or not np.isfinite(numbers).all():
            raise FileFormatError(path, f"line {line}", f"{columns} numbers, one per camera", " ".join(row))
        values[:, i] = numbers
    return values


def dump_dlt(coefficients: ArrayLike, path: str | Path) -> None:
    """Write DLT coefficients, in place of what was there.

    Parameters
    ----------
    coefficients, path : L1..L11 (n_cameras, 11); text file.
    """
    lines = [",".join(repr(float(value)) for value in row) for row in np.asarray(coefficients).T]
    write_whole(path, "\n".join(lines) + "\n")
