"""Where points of unknown place were seen, or clicked on, in the images: a CSV file ``camera,point,u,v``, pixels."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..csv_file import CsvTable, CsvWriter, exact

COLUMNS = ("camera", "point", "u", "v")


def load_clicks(path: str | Path) -> dict[str, dict[str, np.ndarray]]:
    """Camera -> point -> its pixel (2,), in the order of the file.

    Raises
    ------
    FileFormatError : naming line and column; also for a point that a camera has twice.
    """
    table = CsvTable(path)
    table.expect_prefix(COLUMNS)
    found: dict[str, dict[str, np.ndarray]] = {}
    for row in table.rows():
        camera, point = row.text[0], row.text[1]
        if not camera or not point:
            raise FileFormatError(path, f"line {row.line}", "names of a camera and a point", f"{camera!r}, {point!r}")
        if point in found.setdefault(camera, {}):
            raise FileFormatError(path, f"line {row.line}", f"each point once for camera '{camera}'", f"'{point}' again")
        found[camera][point] = row.numbers(2, 4)
    if not found:
        raise FileFormatError(path, "(file)", "one line at least", "none")
    return found


def dump_clicks(clicks: Mapping[str, Mapping[str, np.ndarray]], path: str | Path) -> None:
    """Write camera -> point -> its pixel (2,)."""
    with CsvWriter(path, COLUMNS) as writer:
        for camera, points in clicks.items():
            writer.write_rows([[camera, point, *map(exact, pixel)] for point, pixel in points.items()])
