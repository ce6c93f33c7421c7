"""Text and tables in print: how wide they are, where lines end, and which columns stand beside each other."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import groupby

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextToPath

from .document import Cell, Column, Table, Value, cell_text

PAGE_IN = (8.27, 11.69)  # A4
MARGIN_IN = 0.6
WIDTH_IN = PAGE_IN[0] - 2 * MARGIN_IN
SMALLEST = 6.0  # points
_GAP_IN = 0.16  # beside the cells of a table
_TEXT_SIZE = 6.8
_NARROWEST_IN, _TITLE_IN = 0.9, 1.5  # of a column whose text is broken; of a title that is not
_WORDS = {"good": " (met)", "bad": " (missed)"}


@dataclass(frozen=True)
class TablePart:
    """Columns of a table that stand beside each other; titles and cells (by row) as lines.

    ``widths`` are in inches, ``size`` is that of the text, in points.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[Value]]
    titles: Sequence[Sequence[str]]
    cells: Sequence[Sequence[Sequence[str]]]
    widths: Sequence[float]
    size: float


def table_parts(table: Table) -> list[TablePart]:
    """A table as wide as the page at most: with many columns in several parts, the first column in each."""
    columns, rows = _without_keys(table)
    texts = [[_marked(cell, column) for cell, column in zip(row, columns, strict=True)] for row in rows]
    widest = _widest_of(columns, texts)
    return [_part(part, columns, rows, texts, widest) for part in _together(columns, widest)]


def _part(
    part: Sequence[int],
    columns: Sequence[Column],
    rows: Sequence[Sequence[Value]],
    texts: Sequence[Sequence[str]],
    widest: Sequence[float],
) -> TablePart:
    chosen = [columns[i] for i in part]
    widths, size = _widths_of(chosen, [widest[i] for i in part])

    def lines(cells: Sequence[str]) -> list[list[str]]:
        return [wrapped(cell, size, width - _GAP_IN) for cell, width in zip(cells, widths, strict=True)]

    titles, cells = lines([column.title for column in chosen]), [lines([row[i] for i in part]) for row in texts]
    return TablePart(chosen, [[row[i] for i in part] for row in rows], titles, cells, widths, size)


def _marked(cell: Value, column: Column) -> str:
    """Text of a cell; what is a light on a page is a word in print."""
    return cell_text(cell, column) + (_WORDS.get(cell.mark, "") if isinstance(cell, Cell) else "")


def _without_keys(table: Table) -> tuple[list[Column], list[list[Value]]]:
    """Columns and rows without those of keys, which nobody copies from paper; what is left is legible."""
    kept = [i for i, column in enumerate(table.columns) if column.title != "key"]
    return [table.columns[i] for i in kept], [[row[i] for i in kept] for row in table.rows]


def _widest_of(columns: Sequence[Column], texts: Sequence[Sequence[str]]) -> list[float]:
    """Inches of the widest text of every column; long titles are broken."""
    titles = [min(width_in(column.title, _TEXT_SIZE), _TITLE_IN) for column in columns]
    return [max([title, *(width_in(row[i], _TEXT_SIZE) for row in texts)]) for i, title in enumerate(titles)]


def _together(columns: Sequence[Column], widest: Sequence[float]) -> list[list[int]]:
    """Numbers of the columns that stand beside each other: as many as fit, of a group together, the first before all of them."""

    def fit(part: list[int]) -> bool:
        widths, _ = _widths_of([columns[i] for i in part], [widest[i] for i in part])
        return sum(widths) <= WIDTH_IN + 1e-6

    parts = [[0]]
    for _, group in groupby(range(1, len(columns)), key=lambda i: columns[i].group or i):
        run = list(group)
        if len(parts[-1]) > 1 and not fit([*parts[-1], *run]):
            parts.append([0])
        for i in run:
            if len(parts[-1]) > 1 and not fit([*parts[-1], i]):
                parts.append([0])
            parts[-1].append(i)
    return parts


def _widths_of(columns: Sequence[Column], widest: Sequence[float]) -> tuple[list[float], float]:
    """Inches of every column, and the size of the text: smaller for a wide table, and then its widest column in several lines."""
    size = min(_TEXT_SIZE, max(SMALLEST, _TEXT_SIZE * (WIDTH_IN - _GAP_IN * len(columns)) / max(sum(widest), 0.1)))
    widths = [width * size / _TEXT_SIZE + _GAP_IN for width in widest]
    texts_ = [i for i, column in enumerate(columns) if column.is_text]
    beyond = sum(widths) - WIDTH_IN
    if beyond > 1e-6 and texts_:
        i = max(texts_, key=lambda i: widths[i])
        widths[i] = max(widths[i] - beyond, _NARROWEST_IN)
    return widths, size


@lru_cache(maxsize=20_000)
def width_in(text: str, size: float, bold: bool = False) -> float:
    """Width of text in one line.

    Parameters
    ----------
    text : without line breaks.
    size : of the letters, points.
    bold : whether they are.

    Returns
    -------
    Inches.
    """
    font = FontProperties(size=size, weight="bold" if bold else "normal")
    return float(TextToPath().get_text_width_height_descent(text, font, ismath=False)[0]) / 72.0


def _width_of_part(text: str, size: float, bold: bool, n: int) -> float:
    return width_in(text[:n], size, bold)


def wrapped(text: str, size: float, across_in: float, bold: bool = False) -> list[str]:
    """Text in lines; a word that is wider than a line is broken.

    Parameters
    ----------
    text : one paragraph.
    size : of the letters, points.
    across_in : width of a line, inches.
    bold : whether the letters are.

    Returns
    -------
    At least one line.
    """
    lines, across_in = [""], across_in + 1e-6
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if width_in(longer, size, bold) <= across_in:
            lines[-1] = longer
            continue
        lines += [word] if lines[-1] else []
        lines[-1] = word
        while width_in(lines[-1], size, bold) > across_in and len(lines[-1]) > 1:
            rest = lines[-1]
            fits = max(bisect_right(range(1, len(rest)), across_in, key=partial(_width_of_part, rest, size, bold)), 1)
            lines[-1:] = [rest[:fits], rest[fits:]]
    return lines
