"""A document as a PDF of A4 pages: the same tables, charts and pictures as on the page, in print form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from . import charts as plots
from .document import BLACK, BLUE, GRAY, GREEN, ORANGE, RED, Block, Cell, Curves, Document, Pictures, Table
from .print_layout import MARGIN_IN, PAGE_IN, SMALLEST, WIDTH_IN, TablePart, table_parts, wrapped

_ROW_IN = 0.152
_CURVES_ACROSS, _CURVE_IN = 3, 0.95
_MARKS = {"good": GREEN, "bad": RED, "better": BLUE, "worse": RED, "code": GRAY}


def write_pdf(path: str | Path, document: Document, progress: Callable[[str], None] = lambda text: None) -> int:
    """Write a document as a PDF.

    Parameters
    ----------
    path : of the file.
    document : what is printed.
    progress : is given a sentence for each section.

    Returns
    -------
    How many pages it has.
    """
    with _PrintedPages(path, document.title) as pages:
        pages.text(document.title, 15, bold=True)
        pages.text(document.date, 7.5, GRAY)
        for label, value in document.facts:
            pages.text(f"{label}: {value}", 7.5, GRAY)
        for problem in document.problems:
            pages.text(f"! {problem}", 8, RED)
        for section in document.sections:
            progress(f"printing: {section.title}")
            pages.heading(section.title, section.blocks[0])
            for block in section.blocks:
                pages.block(block, "" if block.title == section.title else block.title)
        pages.heading("What the metrics mean")
        for term, meaning in document.meanings:
            pages.text(f"{term}: {meaning}", 8)
        pages.heading("How this was made")
        for label, value in document.made:
            pages.text(f"{label}: {value}", 7.5, GRAY)
    return pages.count


class _PrintedPages:
    """Pages that fill from top to bottom; a new one begins where something does not fit."""

    def __init__(self, path: str | Path, title: str):
        self._title = title
        self._file = PdfPages(path, metadata={"Title": title, "CreationDate": None})
        self.count = 0
        self._page: Figure | None = None
        self._y_in = 0.0  # what is left above the lower margin

    def text(self, text: str, size: float, color: str = BLACK, bold: bool = False) -> None:
        """A paragraph."""
        for line in wrapped(text, size, WIDTH_IN, bold):
            height = 0.0138 * size * 1.4
            self._room(height)
            self._y_in -= height
            self._write(0.0, line, size, color, bold)

    def heading(self, title: str, first: Block | None = None) -> None:
        """Of a section; on a page with the ``first`` of what stands below it."""
        self._room(0.5 + (0.3 if first is None else _needed_in(first)))
        self._y_in -= 0.15
        self._line(0.6, GRAY, WIDTH_IN)
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
            self.text(block.note, 7, GRAY)
        if isinstance(block, Table):
            self._table(block)
        elif isinstance(block, Curves):
            self._curves(block)
        elif isinstance(block, Pictures):
            self._pictures(block)
        else:
            left = plots.label_in(block)
            plots.draw(block, self._axes(left, WIDTH_IN - left - 0.05, chart_in, above=0.22, below=0.42))

    def _table(self, table: Table) -> None:
        for part in table_parts(table):
            self._table_part(part)

    def _table_part(self, part: TablePart) -> None:
        self._room(_ROW_IN * (any(column.group for column in part.columns) + max(map(len, part.titles)) + 3))
        self._table_head(part)
        for row, cells in zip(part.rows, part.cells, strict=True):
            lines = max(map(len, cells), default=1)
            if self._y_in < lines * _ROW_IN:
                self._new_page()
                self._table_head(part)
            colors = [_MARKS.get(cell.mark, BLACK) if isinstance(cell, Cell) else BLACK for cell in row]
            for i in range(lines):
                self._y_in -= _ROW_IN
                self._cells([cell[i] if i < len(cell) else "" for cell in cells], part, colors)
        self._y_in -= 0.06

    def _table_head(self, part: TablePart) -> None:
        columns, lines = part.columns, max(map(len, part.titles))
        if any(column.group for column in columns):
            self._y_in -= _ROW_IN
            left = 0.0
            for i, column in enumerate(columns):
                if column.group and (i == 0 or columns[i - 1].group != column.group):
                    self._write(left + 0.12, column.group, part.size, GRAY, True)
                left += part.widths[i]
        for line in zip(*([""] * (lines - len(title)) + [*title] for title in part.titles), strict=True):
            self._y_in -= _ROW_IN
            self._cells(line, part, [GRAY] * len(columns))
        self._y_in -= 0.045
        self._line(0.5, GRAY, sum(part.widths))

    def _cells(self, cells: Sequence[str], part: TablePart, colors: Sequence[str]) -> None:
        left = 0.0
        for cell, column, width, color in zip(cells, part.columns, part.widths, colors, strict=True):
            if column.is_text:
                self._write(left + (0.1 if left else 0.0), cell, part.size, color)
            else:
                self._write(left + width, cell, part.size, color, align="right")
            left += width

    def _curves(self, block: Curves) -> None:
        lines = {line.label: line.color for curve in block.curves for _, of in curve.panels for line in of}
        self.text("Lines: " + ", ".join(f"{label} ({_color_name(color)})" for label, color in lines.items()), 7, GRAY)
        panels = [(curve, i) for curve in block.curves for i in range(len(curve.panels))]
        width = WIDTH_IN / _CURVES_ACROSS
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
            height = min((WIDTH_IN - 0.05 * len(row)) / sum(aspects), 2.2)
            self._room(height + 0.2)
            left = 0.0
            for (caption, image), aspect in zip(row, aspects, strict=True):
                ax = self._axes(left, height * aspect, height, above=0.0, below=0.0, keep=True)
                ax.imshow(_for_print(image, height), aspect="auto", interpolation="none")
                ax.axis("off")
                self._write(left, caption, SMALLEST, GRAY, below=height + 0.09)
                left += height * aspect + 0.05
            self._y_in -= height + 0.14

    def _axes(self, left: float, width: float, height: float, *, above: float, below: float, keep: bool = False) -> Axes:
        """Axes below the point reached, which moves on unless it is to be kept."""
        box = self._box(left, width, height, above, below)
        if not keep:
            self._y_in -= height
        return self._on().add_axes(box)

    def _box(self, left: float, width: float, height: float, above: float, below: float) -> tuple[float, float, float, float]:
        """Fractions of the page, for inches below the point reached; ``above`` and ``below`` are left free for labels."""
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
        self._page.text(0.5, 0.35 / PAGE_IN[1], foot, size=6.5, color=GRAY, ha="center", parse_math=False)

    def _finish_page(self) -> None:
        if self._page is not None:
            self._file.savefig(self._page, dpi=110)

    def __enter__(self) -> _PrintedPages:
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


def _for_print(bgr: np.ndarray, height_in: float) -> np.ndarray:
    """RGB at 130 dots per inch, or as it is where that is less."""
    rows = min(round(130 * height_in), bgr.shape[0])
    small = cv2.resize(bgr, (max(round(bgr.shape[1] * rows / bgr.shape[0]), 1), rows), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_BGR2RGB)


def _color_name(color: str) -> str:
    return {BLACK: "black, dashed", BLUE: "blue", ORANGE: "orange", GREEN: "green", RED: "red"}.get(color, color)
