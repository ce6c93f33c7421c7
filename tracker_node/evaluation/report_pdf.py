"""A document as a PDF of A4 pages: the same tables, charts and pictures as on the page, in print form."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.textpath import TextToPath

from . import plots
from .document import Block, Cell, Column, Curves, Document, Pictures, Table, Value, cell_text
from .palette import BLACK, BLUE, GREEN, GREY, ORANGE, RED

PAGE_IN = (8.27, 11.69)  # A4
MARGIN_IN = 0.6
_WIDTH_IN = PAGE_IN[0] - 2 * MARGIN_IN
_ROW_IN, _TEXT_SIZE, _SMALLEST = 0.152, 6.8, 6.0
_GAP_IN, _NARROWEST_IN = 0.16, 0.9  # beside the cells of a table; of a column whose text is broken
_CURVES_ACROSS, _CURVE_IN = 3, 0.95
_MARKS = {"good": GREEN, "bad": RED, "better": BLUE, "worse": RED, "code": GREY}
_WORDS = {"good": " (met)", "bad": " (missed)"}


def write_pdf(path: str | Path, document: Document, progress: Callable[[str], None] = lambda text: None) -> int:
    """Write the document; the number of its pages."""
    with PrintedPages(path, document.title) as pages:
        pages.text(document.title, 15, bold=True)
        pages.text(document.date, 7.5, GREY)
        for label, value in document.facts:
            pages.text(f"{label}: {value}", 7.5, GREY)
        for problem in document.problems:
            pages.text(f"! {problem}", 8, RED)
        for section in document.sections:
            progress(f"printing: {section.title}")
            pages.heading(section.title, section.blocks[0])
            for block in section.blocks:
                pages.block(block, "" if block.title == section.title else block.title)
        pages.heading("What the figures mean")
        for term, meaning in document.meanings:
            pages.text(f"{term}: {meaning}", 8)
        pages.heading("How this was made")
        for label, value in document.made:
            pages.text(f"{label}: {value}", 7.5, GREY)
    return pages.count


class PrintedPages:
    """Pages that fill from top to bottom; a new one begins where something does not fit."""

    def __init__(self, path: str | Path, title: str):
        self._title = title
        self._file = PdfPages(path, metadata={"Title": title, "CreationDate": None})
        self.count = 0
        self._page: Figure | None = None
        self._y_in = 0.0  # what is left above the lower margin

    def text(self, text: str, size: float, color: str = BLACK, bold: bool = False) -> None:
        """A paragraph."""
        for line in wrapped(text, size, _WIDTH_IN, bold):
            height = 0.0138 * size * 1.4
            self._room(height)
            self._y_in -= height
            self._write(0.0, line, size, color, bold)

    def heading(self, title: str, first: Block | None = None) -> None:
        """Of a section; on a page with the ``first`` of what stands below it."""
        self._room(0.5 + (0.3 if first is None else _needed_in(first)))
        self._y_in -= 0.15
        self._line(0.6, GREY, _WIDTH_IN)
        self._y_in -= 0.24
        self._write(0.0, title, 11.5, BLACK, True)
        self._y_in -= 0.06

    def block(self, block: Block, title: str) -> None:
        """A table, chart, curves or pictures, with its title (none where it is empty) and note."""
        chart_in = plots.height_in(block)
        self._room(_needed_in(block))
        if title:
            self._y_in -= 0.22
            self._write(0.0, title, 9, BLACK, True)
        if block.note:
            self.text(block.note, 7, GREY)
        if isinstance(block, Table):
            self._table(block)
        elif isinstance(block, Curves):
            self._curves(block)
        elif isinstance(block, Pictures):
            self._pictures(block)
        else:
            left = plots.label_in(block)
            plots.draw(block, self._axes(left, _WIDTH_IN - left - 0.05, chart_in, above=0.22, below=0.42))

    def _table(self, table: Table) -> None:
        columns, rows = _without_keys(table)
        texts = [[_marked(cell, column) for cell, column in zip(row, columns, strict=True)] for row in rows]
        widths, size = _widths(columns, texts)
        self._room((2 if any(column.group for column in columns) else 1) * _ROW_IN + 3 * _ROW_IN)
        self._table_head(columns, widths, size)
        for row, cells in zip(rows, texts, strict=True):
            parts = [wrapped(cell, size, width - _GAP_IN) for cell, width in zip(cells, widths, strict=True)]
            lines = max(map(len, parts), default=1)
            if self._y_in < lines * _ROW_IN:
                self._new_page()
                self._table_head(columns, widths, size)
            colors = [_MARKS.get(cell.mark, BLACK) if isinstance(cell, Cell) else BLACK for cell in row]
            for i in range(lines):
                self._y_in -= _ROW_IN
                self._cells([part[i] if i < len(part) else "" for part in parts], columns, widths, size, colors)
        self._y_in -= 0.06

    def _table_head(self, columns: Sequence[Column], widths: Sequence[float], size: float) -> None:
        if any(column.group for column in columns):
            self._y_in -= _ROW_IN
            left = 0.0
            for i, column in enumerate(columns):
                if column.group and (i == 0 or columns[i - 1].group != column.group):
                    self._write(left + 0.12, column.group, size, GREY, True)
                left += widths[i]
        self._y_in -= _ROW_IN
        self._cells([column.title for column in columns], columns, widths, size, [GREY] * len(columns))
        self._y_in -= 0.045
        self._line(0.5, GREY, sum(widths))

    def _cells(
        self, cells: Sequence[str], columns: Sequence[Column], widths: Sequence[float], size: float, colors: Sequence[str]
    ) -> None:
        left = 0.0
        for cell, column, width, color in zip(cells, columns, widths, colors, strict=True):
            if column.is_text:
                self._write(left + (0.1 if left else 0.0), cell, size, color)
            else:
                self._write(left + width, cell, size, color, align="right")
            left += width

    def _curves(self, block: Curves) -> None:
        lines = {line.label: line.color for curve in block.curves for _, of in curve.panels for line in of}
        self.text("Lines: " + ", ".join(f"{label} ({_color_name(color)})" for label, color in lines.items()), 7, GREY)
        panels = [(curve, i) for curve in block.curves for i in range(len(curve.panels))]
        width = _WIDTH_IN / _CURVES_ACROSS
        for first in range(0, len(panels), _CURVES_ACROSS):
            self._room(_CURVE_IN)
            for place, (curve, panel) in enumerate(panels[first : first + _CURVES_ACROSS]):
                box = self._box(place * width + 0.28, width - 0.34, _CURVE_IN, above=0.2, below=0.16)
                plots.draw_curve(curve, panel, self._on(), box)
            self._y_in -= _CURVE_IN

    def _pictures(self, block: Pictures) -> None:
        self._y_in -= 0.07
        for row in block.rows:
            aspects = [image.shape[1] / image.shape[0] for _, image in row]
            height = min((_WIDTH_IN - 0.05 * len(row)) / sum(aspects), 2.2)
            self._room(height + 0.2)
            left = 0.0
            for (caption, image), aspect in zip(row, aspects, strict=True):
                ax = self._axes(left, height * aspect, height, above=0.0, below=0.0, keep=True)
                ax.imshow(_for_print(image, height), aspect="auto", interpolation="none")
                ax.axis("off")
                self._write(left, caption, _SMALLEST, GREY, below=height + 0.09)
                left += height * aspect + 0.05
            self._y_in -= height + 0.14

    def _axes(self, left: float, width: float, height: float, *, above: float, below: float, keep: bool = False) -> Axes:
        """Axes below the point reached, which moves on unless it is to be kept."""
        box = self._box(left, width, height, above, below)
        if not keep:
            self._y_in -= height
        return self._on().add_axes(box)

    def _box(self, left: float, width: float, height: float, above: float, below: float) -> tuple[float, float, float, float]:
        """Shares of the page, for inches below the point reached; ``above`` and ``below`` are left free for labels."""
        bottom = MARGIN_IN + self._y_in - height + below
        return ((MARGIN_IN + left) / PAGE_IN[0], bottom / PAGE_IN[1], width / PAGE_IN[0], (height - above - below) / PAGE_IN[1])

    def _write(
        self, left: float, text: str, size: float, color: str, bold: bool = False, align: str = "left", below: float = 0.0
    ) -> None:
        x, y = (MARGIN_IN + left) / PAGE_IN[0], (MARGIN_IN + self._y_in - below) / PAGE_IN[1]
        weight = "bold" if bold else "normal"
        self._on().text(x, y, text, size=size, color=color, weight=weight, ha=align, va="baseline", parse_math=False)

    def _line(self, width: float, color: str, length: float) -> None:
        y = (MARGIN_IN + self._y_in) / PAGE_IN[1]
        ends = (MARGIN_IN / PAGE_IN[0], (MARGIN_IN + length) / PAGE_IN[0])
        self._on().add_artist(Line2D(ends, (y, y), color=color, lw=width))

    def _room(self, height: float) -> None:
        if self._page is None or self._y_in < height:
            self._new_page()

    def _on(self) -> Figure:
        if self._page is None:
            self._new_page()
        assert self._page is not None
        return self._page

    def _new_page(self) -> None:
        self._finish_page()
        self._page, self._y_in = Figure(figsize=PAGE_IN), PAGE_IN[1] - 2 * MARGIN_IN
        self.count += 1
        foot = f"{self._title} · page {self.count}"
        self._page.text(0.5, 0.35 / PAGE_IN[1], foot, size=6.5, color=GREY, ha="center", parse_math=False)

    def _finish_page(self) -> None:
        if self._page is not None:
            self._file.savefig(self._page, dpi=110)

    def __enter__(self) -> PrintedPages:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is None:
            self._finish_page()
        self._file.close()


def _needed_in(block: Block) -> float:
    """Inches that must be left on a page to begin a block there."""
    if isinstance(block, Pictures):
        return 2.9
    return 0.55 + (plots.height_in(block) or 0.7)


def _marked(cell: Value, column: Column) -> str:
    """Text of a cell; what is a light on a page is a word in print."""
    return cell_text(cell, column) + (_WORDS.get(cell.mark, "") if isinstance(cell, Cell) else "")


def _without_keys(table: Table) -> tuple[list[Column], list[list[Value]]]:
    """Columns and rows without those of keys, which nobody copies from paper; what is left is legible."""
    kept = [i for i, column in enumerate(table.columns) if column.title != "key"]
    return [table.columns[i] for i in kept], [[row[i] for i in kept] for row in table.rows]


def _widths(columns: Sequence[Column], texts: Sequence[Sequence[str]]) -> tuple[list[float], float]:
    """Inches of every column, and the size of the text: smaller for a wide table, and then its widest column in several lines."""
    cells = [[column.title, *(row[i] for row in texts)] for i, column in enumerate(columns)]
    widest = [max(width_in(text, _TEXT_SIZE) for text in of) for of in cells]
    size = min(_TEXT_SIZE, max(_SMALLEST, _TEXT_SIZE * (_WIDTH_IN - _GAP_IN * len(columns)) / max(sum(widest), 0.1)))
    widths = [width * size / _TEXT_SIZE + _GAP_IN for width in widest]
    texts_ = [i for i, column in enumerate(columns) if column.is_text]
    beyond = sum(widths) - _WIDTH_IN
    if beyond > 1e-6 and texts_:
        i = max(texts_, key=lambda i: widths[i])
        widths[i] = max(widths[i] - beyond, _NARROWEST_IN)
    if sum(widths) > _WIDTH_IN + 1e-6:  # of very many runs
        size *= (_WIDTH_IN - _GAP_IN * len(columns)) / (sum(widths) - _GAP_IN * len(columns))
        widths = [width * _WIDTH_IN / sum(widths) for width in widths]
    return widths, size


@lru_cache(maxsize=20_000)
def width_in(text: str, size: float, bold: bool = False) -> float:
    """Inches that a line of text takes."""
    font = FontProperties(size=size, weight="bold" if bold else "normal")
    return float(TextToPath().get_text_width_height_descent(text, font, ismath=False)[0]) / 72.0


def _width_of_part(text: str, size: float, bold: bool, n: int) -> float:
    return width_in(text[:n], size, bold)


def wrapped(text: str, size: float, across_in: float, bold: bool = False) -> list[str]:
    """Lines no wider than ``across_in``; a word that is wider is broken."""
    lines = [""]
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


def _for_print(bgr: np.ndarray, height_in: float) -> np.ndarray:
    """RGB at 130 dots per inch, or as it is where that is less."""
    rows = min(round(130 * height_in), bgr.shape[0])
    small = cv2.resize(bgr, (max(round(bgr.shape[1] * rows / bgr.shape[0]), 1), rows), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_BGR2RGB)


def _color_name(color: str) -> str:
    return {BLACK: "black, dashed", BLUE: "blue", ORANGE: "orange", GREEN: "green", RED: "red"}.get(color, color)
