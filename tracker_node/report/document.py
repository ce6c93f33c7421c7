"""What a report consists of: tables, charts, pictures. A page, a PDF and CSV files are made from it.

`write_figure_files`: every table and chart as CSV and JSON, ``figures/<key>.csv`` and ``figures/<key>.json``.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..loaders.csv_file import CsvWriter
from ..render.palette import BLUE

TIME = "time since image 0 [s]"


@dataclass(frozen=True)
class Column:
    """Of a table; ``group`` stands above neighbors that share it, ``digits`` behind the point of numbers."""

    title: str
    digits: int = 1
    group: str = ""
    is_text: bool = False


@dataclass(frozen=True)
class Cell:
    """A value with a mark: ``good``, ``warn`` and ``bad`` for targets and trials, ``better`` and ``worse`` for differences,
    ``code`` for keys.

    ``link``: address that a page leads to from there.
    """

    value: str | float | int | None
    mark: str = ""
    digits: int | None = None
    link: str = ""


Value = str | float | int | None | Cell


@dataclass(frozen=True, eq=False)
class Block:
    """What all parts of a report have: ``key`` names files and anchors."""

    key: str
    title: str
    note: str = ""


@dataclass(frozen=True, eq=False)
class Table(Block):
    """Rows, maybe in ``parts`` (title, how many of the rows, folded: on a page behind the title, on paper left out)."""

    columns: Sequence[Column] = ()
    rows: Sequence[Sequence[Value]] = ()
    parts: Sequence[tuple[str, int, bool]] = ()

    def split(self) -> list[tuple[str, bool, Sequence[Sequence[Value]]]]:
        """(title, folded, rows) of each part; of a table without parts one without a title."""
        rows = list(self.rows)
        found: list[tuple[str, bool, Sequence[Sequence[Value]]]] = []
        for title, n, folded in self.parts or [("", len(rows), False)]:
            found.append((title, folded, rows[:n]))
            rows = rows[n:]
        return found

    def texts(self) -> list[list[str]]:
        """Rows of text, numbers rounded as their columns say."""
        return [[cell_text(cell, column) for cell, column in zip(row, self.columns, strict=True)] for row in self.rows]


def cell_text(cell: Value, column: Column) -> str:
    """A value as people read it; a dash for what is not known.

    Parameters
    ----------
    cell : a value, with a mark or without.
    column : says how many digits, unless the cell does.

    Returns
    -------
    One line.
    """
    digits, value = column.digits, cell
    if isinstance(cell, Cell):
        value, digits = cell.value, column.digits if cell.digits is None else cell.digits
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    return f"{value:z.{digits}f}" if isinstance(value, (float, np.floating)) else str(value)


def sign_of(unit: str) -> str:
    """A unit as tables show it."""
    return "°" if unit == "deg" else unit


@dataclass(frozen=True, eq=False)
class Line:
    """Points (k,) over (k,); NaN breaks a line. ``spread`` (k,): half the height of a band around it."""

    label: str
    x: np.ndarray
    y: np.ndarray
    color: str = BLUE
    width: float = 1.6
    dashed: bool = False
    points: bool = False
    spread: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Chart(Block):
    """Lines; ``bands`` (start, end) on the x axis are shaded, ``levels`` (y, label) drawn across, ``filter`` said below."""

    x_label: str = TIME
    y_label: str = ""
    lines: Sequence[Line] = ()
    bands: Sequence[tuple[float, float]] = ()
    levels: Sequence[tuple[float, str]] = ()
    y_min: float | None = 0.0
    y_max: float | None = None
    log_y: bool = False
    filter: str = ""


@dataclass(frozen=True, eq=False)
class Bars(Block):
    """A group of bars for each category, one of each series (label, values, color)."""

    categories: Sequence[str] = ()
    series: Sequence[tuple[str, np.ndarray, str]] = ()
    y_label: str = ""


@dataclass(frozen=True)
class Strip:
    """A stretch of time in one row; ``label`` is what holds in it."""

    row: str
    start: float
    end: float
    label: str
    color: str


@dataclass(frozen=True, eq=False)
class Strips(Block):
    """What holds when: rows from top to bottom, strips along time."""

    rows: Sequence[str] = ()
    strips: Sequence[Strip] = ()


@dataclass(frozen=True, eq=False)
class HeatMap(Block):
    """Values (n, m) over times (n,) for m rows."""

    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rows: Sequence[str] = ()
    values: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    label: str = ""
    top: float = 1.0


@dataclass(frozen=True, eq=False)
class Curve:
    """One quantity over time: lines of the runs and of the truth, one list of them per panel (x, y, z; or a single one).

    ``filter`` says what was done against noise.
    """

    group: str
    name: str
    unit: str
    panels: Sequence[tuple[str, Sequence[Line]]]
    filter: str = ""


@dataclass(frozen=True, eq=False)
class Curves(Block):
    """Many quantities in groups, of which a page shows one at a time."""

    curves: Sequence[Curve] = ()


@dataclass(frozen=True, eq=False)
class Pictures(Block):
    """Rows of (caption, image (h, w, 3) BGR)."""

    rows: Sequence[Sequence[tuple[str, np.ndarray]]] = ()


@dataclass(frozen=True, eq=False)
class Moving:
    """What moves in a scene: points (n, m, 3) meters, NaN where it is not, and what is drawn between them.

    Attributes
    ----------
    rods : (from, to, radius in meters at either end, color), a limb each.
    wires : (from, to, color), thin lines.
    dots : (point, color).
    """

    label: str
    points: np.ndarray
    rods: Sequence[tuple[int, int, float, float, str]] = ()
    wires: Sequence[tuple[int, int, str]] = ()
    dots: Sequence[tuple[int, str]] = ()


@dataclass(frozen=True, eq=False)
class Scene(Block):
    """Bodies in space over time, which a page plays and turns; z is up.

    Attributes
    ----------
    times : (n,) seconds.
    states : (n,) what holds at each time, and its color.
    cameras : name -> (5, 3) meters: center, and four corners of a small image before it.
    """

    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    bodies: Sequence[Moving] = ()
    states: Sequence[tuple[str, str]] = ()
    cameras: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class DocumentSection:
    """A heading with what stands below it."""

    key: str
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True, eq=False)
class Document:
    """A whole report: ``facts`` (label, text) stand at its top, ``problems`` below, ``footnotes`` and ``made`` at its end."""

    title: str
    date: str
    facts: Sequence[tuple[str, str]]
    problems: Sequence[str]
    sections: Sequence[DocumentSection]
    meanings: Sequence[tuple[str, str]] = ()
    made: Sequence[tuple[str, str]] = ()

    @property
    def blocks(self) -> list[Block]:
        return [block for section in self.sections for block in section.blocks]


def strips_of(row: str, labels: Sequence[str], times: np.ndarray, period: float, colors: dict[str, str]) -> list[Strip]:
    """A strip for every series of equal labels; none between sets that are further apart.

    Parameters
    ----------
    row : that the strips are in.
    labels : (n,) what holds at each time.
    times : (n,) seconds.
    period : between two image sets, seconds.
    colors : by label.

    Returns
    -------
    In order of time.
    """
    strips: list[Strip] = []
    for label, time in zip(labels, times, strict=True):
        last = strips[-1] if strips else None
        if last is not None and last.label == label and time - last.end < period:
            strips[-1] = Strip(row, last.start, time + period / 2, label, last.color)
        else:
            strips.append(Strip(row, time - period / 2, time + period / 2, label, colors[label]))
    return strips


FOLDER = "figures"
DIGITS = 9  # significant ones


def write_figure_files(output: Path, document: Document) -> list[Path]:
    """Two files for every table and chart, in the folder ``figures``; pictures and scenes have none.

    Parameters
    ----------
    output : folder in which that folder is made.
    document : whose blocks are written.

    Returns
    -------
    Paths of the files.
    """
    folder = output / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    for block in document.blocks:
        if isinstance(block, (Pictures, Scene)):
            continue
        header, rows = columns_of(block)
        path = folder / f"{file_name(block.key)}.csv"
        if path in written:  # of runs whose names differ in what files cannot have
            path = folder / f"{file_name(block.key)}_{len(written) // 2}.csv"
        with CsvWriter(path, header) as writer:
            writer.write_rows([["" if value is None else value for value in row] for row in rows])
        content = {"title": block.title, "note": block.note, "columns": header, "rows": rows}
        path.with_suffix(".json").write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        written += [path, path.with_suffix(".json")]
    return written


def file_name(key: str) -> str:
    """A key as part of a file's name: letters, digits, dot, dash and underscore; never a dot at its start."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", key).lstrip(".") or "figure"


def columns_of(block: Block) -> tuple[list[str], list[list[Any]]]:
    """Header and rows of what a block shows; None for what is not known.

    Raises
    ------
    ValueError : a block that shows no numbers.
    """
    if isinstance(block, Table):
        header = [f"{c.group}: {c.title}" if c.group else c.title for c in block.columns]
        return header, [[_plain(cell.value if isinstance(cell, Cell) else cell) for cell in row] for row in block.rows]
    if isinstance(block, Chart):
        return ["line", block.x_label, block.y_label or "value"], _points(block.lines)
    if isinstance(block, Bars):
        bars = [[name, label, _plain(values[i])] for label, values, _ in block.series for i, name in enumerate(block.categories)]
        return ["category", "series", block.y_label], bars
    if isinstance(block, Strips):
        return ["row", "start_s", "end_s", "label"], [[s.row, _plain(s.start), _plain(s.end), s.label] for s in block.strips]
    if isinstance(block, HeatMap):
        pairs = zip(block.times, np.asarray(block.values), strict=True)
        return ["time_s", *block.rows], [[_plain(time), *map(_plain, row)] for time, row in pairs]
    if isinstance(block, Curves):
        return ["group", "name", "unit", "panel", "line", "time_s", "value"], [
            [curve.group, curve.name, curve.unit, panel, *point]
            for curve in block.curves
            for panel, lines in curve.panels
            for point in _points(lines)
        ]
    raise ValueError(f"expected a table or a chart, got {type(block).__name__}")


def _points(lines: Sequence[Line]) -> list[list[Any]]:
    drawn = [(line.label, line.x, line.y) for line in lines]
    drawn += [(f"{line.label} SD", line.x, line.spread) for line in lines if line.spread is not None]
    return [[label, _plain(x), _plain(y)] for label, along, values in drawn for x, y in zip(along, values, strict=True)]


def _plain(value: Any) -> Any:
    """A number that CSV and JSON have, with `DIGITS` significant digits; text as it is."""
    if value is None or isinstance(value, (str, int, np.integer)):
        return int(value) if isinstance(value, np.integer) else value
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
