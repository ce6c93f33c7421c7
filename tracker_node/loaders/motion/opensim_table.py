"""Named numbers over time in OpenSim's tables: motions (``.mot``) and storages (``.sto``).

A header of lines ``key=value`` that ends in ``endheader``, a line of column names, the first of them ``time``, and a row per
time step. ``inDegrees`` is for angles; lengths have no unit in the file and are meters in OpenSim.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..whole_file import TABLE_BYTES, read_text, write_whole

_TRUE, _FALSE = ("yes", "y", "true", "1"), ("no", "n", "false", "0")


@dataclass(frozen=True, eq=False)
class NumberTable:
    """Columns over time.

    Parameters
    ----------
    names : of the k columns.
    times_s : (n,) seconds, increasing.
    values : (n, k) as they stand in the file; zeros where not valid.
    valid : (n, k) bool.
    in_degrees : True where angles are degrees, False where they are radians.
    """

    names: tuple[str, ...]
    times_s: np.ndarray
    values: np.ndarray
    valid: np.ndarray
    in_degrees: bool


def dump_table(table: NumberTable, path: str | Path, title: str = "Coordinates") -> None:
    """Write a ``.mot`` or ``.sto``; values that are not valid become ``nan``.

    Parameters
    ----------
    table, path : columns over time; file.
    title : first line of the file.
    """
    n, k = table.values.shape
    header = [title, "version=1", f"nRows={n}", f"nColumns={k + 1}", f"inDegrees={'yes' if table.in_degrees else 'no'}"]
    lines = [*header, "endheader", "\t".join(("time", *table.names))]
    for time_s, values, valid in zip(table.times_s, table.values, table.valid, strict=True):
        cells = [repr(float(value)) if good else "nan" for value, good in zip(values, valid, strict=True)]
        lines.append("\t".join([repr(float(time_s)), *cells]))
    write_whole(path, "\n".join(lines) + "\n")


def load_table(path: str | Path) -> NumberTable:
    """A table of a ``.mot`` or ``.sto`` file. A cell that is not a finite number is not valid.

    Raises
    ------
    FileFormatError : no ``endheader``, ``inDegrees`` neither yes nor no, no column ``time``, a name given twice, a row of another
        length or with text, times that do not increase.
    """
    lines = read_text(path, TABLE_BYTES).splitlines()
    ends = [i for i, line in enumerate(lines) if line.strip().lower() == "endheader"]
    if not ends:
        raise FileFormatError(path, "header", "lines that end with 'endheader'", lines[0] if lines else "nothing")
    in_degrees = _in_degrees(path, lines[: ends[0]])
    body = [(number, _cells(line)) for number, line in enumerate(lines, 1) if number > ends[0] + 1 and line.strip()]
    names = tuple(body[0][1]) if body else ()
    if len(names) < 2 or names[0].lower() != "time":
        raise FileFormatError(path, "column names", "time and at least one other", " ".join(names) or "nothing")
    if len(set(names)) != len(names):
        raise FileFormatError(path, "column names", "each once", sorted({n for n in names if names.count(n) > 1}))
    if len(body) < 2:
        raise FileFormatError(path, "rows", "at least one", "none")
    numbers = np.array([_row(path, number, cells, len(names)) for number, cells in body[1:]])
    times = numbers[:, 0]
    if not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0.0):
        raise FileFormatError(path, "time", "times that increase from row to row", "others")
    valid = np.isfinite(numbers[:, 1:])
    return NumberTable(names[1:], times, np.where(valid, numbers[:, 1:], 0.0), valid, in_degrees)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().split("\t")] if "\t" in line else line.split()


def _in_degrees(path: str | Path, header: list[str]) -> bool:
    pairs = dict(line.split("=", 1) for line in header if "=" in line)
    said = {key.strip().lower(): value.strip().lower() for key, value in pairs.items()}.get("indegrees")
    if said not in _TRUE + _FALSE:
        raise FileFormatError(path, "inDegrees", "yes or no", said)
    return said in _TRUE


def _row(path: str | Path, number: int, cells: list[str], n: int) -> list[float]:
    if len(cells) != n:
        raise FileFormatError(path, f"line {number}", f"{n} numbers", len(cells))
    try:
        return [float(cell) if cell else math.nan for cell in cells]
    except ValueError:
        raise FileFormatError(path, f"line {number}", "numbers", " ".join(cells)) from None
