"""Control points, places of which are known, as they were clicked on in the images: a CSV file.

Columns ``camera,point,x,y,z,u,v``: one line for each camera that shows a point; metres in the world, pixels of the
images.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import FileFormatError
from .csv_file import CsvTable

COLUMNS = ("camera", "point", "x", "y", "z", "u", "v")


@dataclass(frozen=True, eq=False)
class ControlPoints:
    """What one camera shows: ``names`` of the points, their ``points`` (n, 3) in metres and ``pixels`` (n, 2)."""

    names: tuple[str, ...]
    points: np.ndarray
    pixels: np.ndarray


def load_control_points(path: str | Path) -> dict[str, ControlPoints]:
    """Camera name -> its points, in the order of the file.

    Raises
    ------
    FileFormatError : naming line and column; also for a point that a camera has twice, or that has two places.
    """
    table = CsvTable(path)
    table.expect_prefix(COLUMNS)
    found: dict[str, dict[str, np.ndarray]] = {}
    places: dict[str, np.ndarray] = {}
    for row in table.rows():
        camera, point, values = row.text[0], row.text[1], row.numbers(2, 7)
        where = f"line {row.line}"
        if not camera or not point:
            raise FileFormatError(path, where, "names of a camera and a point", f"{camera!r}, {point!r}")
        if point in found.setdefault(camera, {}):
            raise FileFormatError(path, where, f"each point once for camera '{camera}'", f"'{point}' again")
        if not np.allclose(places.setdefault(point, values[:3]), values[:3], rtol=0.0, atol=1e-9):
            raise FileFormatError(path, where, f"point '{point}' in one place, {places[point].tolist()}", values[:3].tolist())
        found[camera][point] = values
    if not found:
        raise FileFormatError(path, "(file)", "one line at least", "none")
    return {
        camera: ControlPoints(tuple(points), np.array(list(points.values()))[:, :3], np.array(list(points.values()))[:, 3:])
        for camera, points in found.items()
    }
