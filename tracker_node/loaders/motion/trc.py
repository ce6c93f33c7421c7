"""Marker trajectories in TRC files (tab-separated text of motion capture, read by OpenSim and Pose2Sim).

Named numbers over time in OpenSim's tables: motions (``.mot``) and storages (``.sto``).

A header of lines ``key=value`` that ends in ``endheader``, a line of column names, the first of them ``time``, and a row per
time step. ``inDegrees`` is for angles; lengths have no unit in the file and are meters in OpenSim.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileFormatError, UnknownNameError, repeated
from ..whole_file import TABLE_BYTES, read_text, write_whole

METERS_PER_UNIT = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_N_HEADER = 5


@dataclass(frozen=True, eq=False)
class MarkerTrajectories:
    """Named points over time, in world axes with z up.

    Parameters
    ----------
    names : of the m markers.
    times_s : (n,) seconds.
    positions_m : (n, m, 3) meters; zeros where not valid.
    rate_hz : images per second as the file states it.
    valid : (n, m) bool.
    """

    names: tuple[str, ...]
    times_s: np.ndarray
    positions_m: np.ndarray
    rate_hz: float
    valid: np.ndarray

    def index(self, name: str) -> int:
        """Column of a marker."""
        if name not in self.names:
            raise UnknownNameError("marker", name, self.names)
        return self.names.index(name)

    def __len__(self) -> int:
        return len(self.times_s)


def load_trc(path: str | Path, y_up: bool = True) -> MarkerTrajectories:
    """Markers of a TRC file.

    A cell that is empty, missing at the end of a row or not a finite number makes its marker invalid in that row, as do
    three zeros, which several programs write for a marker not seen.

    Parameters
    ----------
    path : TRC file.
    y_up : the file's axes are those of OpenSim (x forward, y up, z right); they are turned to z up by
        ``X_world = trc[..., [2, 0, 1]]``. With False the file's axes are taken as the world's.

    Returns
    -------
    Markers in meters.

    Raises
    ------
    FileFormatError : header, unit, marker names, a cell that is no number, times that do not increase.
    """
    lines = read_text(path, TABLE_BYTES).splitlines()
    if len(lines) < _N_HEADER or not lines[0].startswith("PathFileType"):
        raise FileFormatError(path, "line 1", "a TRC file (PathFileType ...)", lines[0] if lines else "nothing")
    header = dict(zip(lines[1].split(), lines[2].split(), strict=False))
    scale = METERS_PER_UNIT.get(header.get("Units", ""))
    if scale is None:
        raise FileFormatError(path, "Units", f"one of {sorted(METERS_PER_UNIT)}", header.get("Units"))
    names = _marker_names(path, lines[3])
    rows = [(number, line) for number, line in enumerate(lines[_N_HEADER:], _N_HEADER + 1) if line.strip()]
    if not rows:
        raise FileFormatError(path, f"line {_N_HEADER + 1}", "rows of markers", "nothing")
    values = np.array([_row(path, number, line, 1 + 3 * len(names)) for number, line in rows])
    times = values[:, 0]
    if not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0.0):
        raise FileFormatError(path, "Time", "times that increase from row to row", "others")
    positions = values[:, 1:].reshape(len(values), len(names), 3) * scale
    valid = np.all(np.isfinite(positions), axis=2) & np.any(positions != 0.0, axis=2)
    positions[~valid] = 0.0
    if y_up:
        positions = positions[..., [2, 0, 1]]
    return MarkerTrajectories(without_subject(names), times, positions, _rate(path, header, times), valid)


def without_subject(names: Sequence[str]) -> tuple[str, ...]:
    """Names of markers without the subject's (``Anna:LKnee``), where there is one only; those without any stay."""
    subjects = {name.rpartition(":")[0] for name in names if ":" in name}
    short = tuple(name.rpartition(":")[2] for name in names)
    return tuple(names) if len(subjects) != 1 or repeated(short) or not all(short) else short


def dump_trc(markers: MarkerTrajectories, path: str | Path, y_up: bool = True, unit: str = "m") -> None:
    """Write a TRC file; invalid markers become empty cells (``nan`` in a row's last).

    Parameters
    ----------
    markers, path : in meters; TRC file.
    y_up : turn the axes to those of OpenSim.
    unit : m, cm or mm.
    """
    positions = markers.positions_m[..., [1, 2, 0]] if y_up else markers.positions_m
    if unit != "m":
        positions = positions / METERS_PER_UNIT[unit]
    n, m = markers.valid.shape
    rate = f"{markers.rate_hz:.10g}"
    path = Path(path)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{n}\t{m}\t{unit}\t{rate}\t1\t{n}",
        "Frame#\tTime\t" + "\t\t\t".join(markers.names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{i}" for i in range(1, m + 1) for axis in "XYZ"),
    ]
    for i in range(n):
        cells = [str(i + 1), repr(float(markers.times_s[i]))]
        for j in range(m):
            cells += [repr(float(v)) for v in positions[i, j]] if markers.valid[i, j] else ["", "", ""]
        cells[-1] = cells[-1] or "nan"  # OpenSim takes no notice of an empty cell at the end of a row, and misses it
        lines.append("\t".join(cells))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, "\n".join(lines) + "\n")


def _marker_names(path: str | Path, line: str) -> tuple[str, ...]:
    cells = [cell.strip() for cell in (line.split("\t") if "\t" in line else line.split())]
    names = tuple(cell for cell in cells[2:] if cell)
    if not names:
        raise FileFormatError(path, "line 4", "Frame#, Time and marker names", line)
    if twice := repeated(names):
        raise FileFormatError(path, "line 4", "each marker name once", twice)
    return names


def _row(path: str | Path, number: int, line: str, n_values: int) -> list[float]:
    cells = line.split("\t") if "\t" in line else line.split()
    values = []
    for cell in cells[1 : 1 + n_values]:
        try:
            values.append(float(cell) if cell.strip() else math.nan)
        except ValueError:
            raise FileFormatError(path, f"line {number}", "numbers", cell) from None
    if any(cell.strip() for cell in cells[1 + n_values :]):
        raise FileFormatError(path, f"line {number}", f"{1 + n_values} cells", len(cells))
    return values + [math.nan] * (n_values - len(values))


def _rate(path: str | Path, header: dict[str, str], times: np.ndarray) -> float:
    try:
        rate = float(header.get("DataRate", "0"))
    except ValueError:
        raise FileFormatError(path, "DataRate", "a number", header["DataRate"]) from None
    if 0.0 < rate < math.inf:
        return rate
    if len(times) < 2:
        raise FileFormatError(path, "DataRate", "a positive number", rate)
    return float(1.0 / np.median(np.diff(times)))


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


def dump_table(table: NumberTable, path: str | Path) -> None:
    """Write a ``.mot`` or ``.sto``; values that are not valid become ``nan``.

    Parameters
    ----------
    table, path : columns over time; file.
    """
    n, k = table.values.shape
    header = ["Coordinates", "version=1", f"nRows={n}", f"nColumns={k + 1}", f"inDegrees={'yes' if table.in_degrees else 'no'}"]
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
    if twice := repeated(names):
        raise FileFormatError(path, "column names", "each once", twice)
    if len(body) < 2:
        raise FileFormatError(path, "rows", "at least one", "none")
    numbers = np.array([_table_row(path, number, cells, len(names)) for number, cells in body[1:]])
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


def _table_row(path: str | Path, number: int, cells: list[str], n: int) -> list[float]:
    if len(cells) != n:
        raise FileFormatError(path, f"line {number}", f"{n} numbers", len(cells))
    try:
        return [float(cell) if cell else math.nan for cell in cells]
    except ValueError:
        raise FileFormatError(path, f"line {number}", "numbers", " ".join(cells)) from None
