"""Every table and chart of a report as CSV and JSON: ``figures/<key>.csv`` and ``figures/<key>.json``."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..loaders.csv_file import CsvWriter
from .document import Bars, Block, Cell, Chart, Curves, Document, HeatMap, Line, Pictures, Scene, Strips, Table

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
