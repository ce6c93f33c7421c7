"""A document as a PDF of A4 pages: the same tables, charts and pictures as on the page, in print form."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import cv2
import matplotlib
import numpy as np
from fpdf import FPDF, FontFace
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from ..render.palette import BLACK, BLUE, GRAY, GREEN, ORANGE, RED, color_name
from . import charts as plots
from .document import Block, Cell, Column, Curve, Curves, Document, Pictures, Table, Value, cell_text

_MARGIN_IN, WIDTH_IN = 0.6, 7.06
_LINE = 1.4 * 0.0138  # inches, of the size of letters in points
SMALLEST, _TABLE_SIZE, _SMALL = 6.0, 6.8, 7.0
_GAP_IN = 0.16  # beside the cells of a table
_NARROWEST_IN, _TITLE_IN = 0.9, 1.5  # of a column whose text is broken; of a title that is not
_CURVES_ACROSS, _CURVE_IN = 3, 0.95
_MARKS = {"good": GREEN, "bad": RED, "warn": ORANGE, "better": BLUE, "worse": RED, "code": GRAY}
_WORDS = {"good": " (met)", "bad": " (missed)", "warn": " (warning)"}  # what is a light on a page


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
    pages = _Pages(document.title)
    pages.text_of(document.title, 15, bold=True)
    pages.text_of(document.date, 7.5, GRAY)
    for label, value in document.facts:
        pages.text_of(f"{label}: {value}", 7.5, GRAY)
    for problem in document.problems:
        pages.text_of(f"! {problem}", 8, RED)
    for section in document.sections:
        progress(f"printing: {section.title}")
        pages.heading(section.title, section.blocks[0])
        for block in section.blocks:
            pages.block(block, "" if block.title == section.title else block.title)
    pages.heading("What the metrics mean")
    for term, meaning in document.meanings:
        pages.text_of(f"{term}: {meaning}", 8)
    pages.heading("How this was made")
    for label, value in document.made:
        pages.text_of(f"{label}: {value}", 7.5, GRAY)
    pages.output(str(path))
    return len(pages.pages)


class _Pages(FPDF):
    """Pages that fill from top to bottom; a new one begins where something does not fit."""

    def __init__(self, title: str):
        super().__init__(unit="in", format="A4")
        for style, file in (("", "DejaVuSans.ttf"), ("B", "DejaVuSans-Bold.ttf")):
            self.add_font("sans", style, Path(matplotlib.get_data_path(), "fonts/ttf", file))
        self.set_title(title)
        self.set_margin(_MARGIN_IN)
        self.c_margin = 0.0
        self.set_auto_page_break(True, _MARGIN_IN)
        self.add_page()

    def footer(self) -> None:
        """The document's title and the number of the page."""
        self.set_y(-0.42)
        self._letters(6.5, GRAY)
        self.cell(0, 0.1, f"{self.title} · page {self.page_no()}", align="C")

    def _letters(self, size: float, color: str = BLACK, bold: bool = False) -> None:
        self.set_font("sans", "B" if bold else "", size)
        self.set_text_color(color)

    def text_of(self, text: str, size: float, color: str = BLACK, bold: bool = False) -> None:
        """A paragraph."""
        self._letters(size, color, bold)
        self.multi_cell(0, _LINE * size, text, align="L", new_x="LMARGIN", new_y="NEXT")

    def heading(self, title: str, first: Block | None = None) -> None:
        """Of a section; on a page with the ``first`` of what stands below it."""
        self._room(0.5 + (0.3 if first is None else _needed_in(first)))
        self.ln(0.15)
        self.set_draw_color(GRAY)
        self.set_line_width(0.008)
        self.line(_MARGIN_IN, self.y, _MARGIN_IN + WIDTH_IN, self.y)
        self.ln(0.06)
        self.text_of(title, 11.5, bold=True)

    def block(self, block: Block, title: str) -> None:
        """A table, chart, curves or pictures, with its title (none where it is empty) and note."""
        self._room(_needed_in(block))
        if title:
            self.ln(0.06)
            self.text_of(title, 9, bold=True)
        if block.note:
            self.text_of(block.note, _SMALL, GRAY)
        if isinstance(block, Table):
            for part, folded, rows in block.split():
                if folded or not rows:
                    continue
                if part:
                    self._room(0.6)
                    self.text_of(part, 8, bold=True)
                self._table(replace(block, rows=rows, parts=()))
        elif isinstance(block, Curves):
            self._curves(block)
        elif isinstance(block, Pictures):
            self._pictures(block)
        else:
            height, left = plots.height_in(block), plots.label_in(block)
            figure = Figure(figsize=(WIDTH_IN, height))
            width = (WIDTH_IN - left - 0.05) / WIDTH_IN
            plots.draw(block, figure.add_axes((left / WIDTH_IN, 0.42 / height, width, (height - 0.64) / height)))
            self._figure(figure)

    def _table(self, table: Table) -> None:
        """With many columns in several parts, the first column in each; without keys, which nobody copies from paper."""
        kept = [i for i, column in enumerate(table.columns) if column.title != "key"]
        columns, rows = [table.columns[i] for i in kept], [[row[i] for i in kept] for row in table.rows]
        texts = [[_marked(cell, column) for cell, column in zip(row, columns, strict=True)] for row in rows]
        self._letters(_TABLE_SIZE)
        widest = [
            max([min(self.get_string_width(column.title), _TITLE_IN), *(self.get_string_width(row[i]) for row in texts)])
            for i, column in enumerate(columns)
        ]
        for part in _together(columns, widest):
            chosen = [columns[i] for i in part]
            widths, size = _widths_of(chosen, [widest[i] for i in part])
            self._part(chosen, [[row[i] for i in part] for row in rows], [[row[i] for i in part] for row in texts], widths, size)
            self.ln(0.06)

    def _part(
        self, columns: Sequence[Column], rows: Sequence[Sequence[Value]], texts: Sequence[Sequence[str]],
        widths: Sequence[float], size: float,
    ) -> None:  # fmt: skip
        grouped = any(column.group for column in columns)
        self._letters(size)
        with self.table(
            col_widths=tuple(widths), width=sum(widths), align="LEFT", borders_layout="SINGLE_TOP_LINE", line_height=_LINE * size,
            text_align=tuple("LEFT" if column.is_text else "RIGHT" for column in columns), v_align="TOP",
            padding=(0.01, _GAP_IN / 2, 0.01, _GAP_IN / 2), headings_style=FontFace(color=GRAY), num_heading_rows=1 + grouped,
        ) as table:  # fmt: skip
            if grouped:
                head = table.row()
                for group, members in groupby(columns, key=lambda column: column.group):
                    head.cell(group, colspan=len(list(members)), align="LEFT", style=FontFace(emphasis="BOLD", color=GRAY))
            head = table.row()
            for column in columns:
                head.cell(column.title)
            for row, cells in zip(rows, texts, strict=True):
                line = table.row()
                for value, text in zip(row, cells, strict=True):
                    mark = value.mark if isinstance(value, Cell) else ""
                    line.cell(text, style=FontFace(color=_MARKS[mark]) if mark in _MARKS else None)

    def _curves(self, block: Curves) -> None:
        lines = {line.label: line.color for curve in block.curves for _, of in curve.panels for line in of}
        names = {label: "black, dashed" if color == BLACK else color_name(color) for label, color in lines.items()}
        self.text_of("Lines: " + ", ".join(f"{label} ({name})" for label, name in names.items()), _SMALL, GRAY)
        for (group, filtered), curves in groupby(block.curves, key=lambda curve: (curve.group, curve.filter)):
            said = f"{group[:1].upper()}{group[1:]}" + (f" (filter: {filtered})" if filtered else "")
            self._room(0.3 + _CURVE_IN)
            self.text_of(said, _SMALL, bold=True)
            self._panels([(curve, i) for curve in curves for i in range(len(curve.panels))])

    def _panels(self, panels: Sequence[tuple[Curve, int]]) -> None:
        width = WIDTH_IN / _CURVES_ACROSS
        for first in range(0, len(panels), _CURVES_ACROSS):
            figure = Figure(figsize=(WIDTH_IN, _CURVE_IN))
            for place, (curve, panel) in enumerate(panels[first : first + _CURVES_ACROSS]):
                left, right, height = place * width + 0.28, (width - 0.34) / WIDTH_IN, (_CURVE_IN - 0.36) / _CURVE_IN
                plots.draw_curve(curve, panel, figure, (left / WIDTH_IN, 0.16 / _CURVE_IN, right, height))
            self._figure(figure)

    def _figure(self, figure: Figure) -> None:
        """A drawing as wide as the text."""
        height = float(figure.get_figheight())
        self._room(height)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        drawn = Image.fromarray(np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3]))  # no opacity to print, either
        self.image(drawn, w=WIDTH_IN, h=height)

    def _pictures(self, block: Pictures) -> None:
        self.ln(0.07)
        for row in block.rows:
            aspects = [image.shape[1] / image.shape[0] for _, image in row]
            height = min((WIDTH_IN - 0.05 * len(row)) / sum(aspects), 2.2)
            self._room(height + 0.2)
            left, top = _MARGIN_IN, self.y
            self._letters(SMALLEST, GRAY)
            for (caption, image), aspect in zip(row, aspects, strict=True):
                self.image(io.BytesIO(_for_print(image, height)), left, top, height * aspect, height)
                self.text(left, top + height + 0.1, caption)
                left += height * aspect + 0.05
            self.set_y(top + height + 0.14)

    def _room(self, height: float) -> None:
        if self.will_page_break(height):
            self.add_page()


def _needed_in(block: Block) -> float:
    """Inches that must be left on a page to begin a block there."""
    if isinstance(block, Pictures):
        return 2.9
    return 0.55 + (plots.height_in(block) or 0.7)


def _marked(cell: Value, column: Column) -> str:
    return cell_text(cell, column) + (_WORDS.get(cell.mark, "") if isinstance(cell, Cell) else "")


def _together(columns: Sequence[Column], widest: Sequence[float]) -> list[list[int]]:
    """Numbers of the columns that stand beside each other: as many as fit, of a group together, the first before all of them."""

    def fit(part: list[int]) -> bool:
        return sum(_widths_of([columns[i] for i in part], [widest[i] for i in part])[0]) <= WIDTH_IN + 1e-6

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
    size = min(_TABLE_SIZE, max(SMALLEST, _TABLE_SIZE * (WIDTH_IN - _GAP_IN * len(columns)) / max(sum(widest), 0.1)))
    widths = [width * size / _TABLE_SIZE + _GAP_IN + 1e-3 for width in widest]
    texts = [i for i, column in enumerate(columns) if column.is_text]
    beyond = sum(widths) - WIDTH_IN
    if beyond > 1e-6 and texts:
        i = max(texts, key=lambda i: widths[i])
        widths[i] = max(widths[i] - beyond, _NARROWEST_IN)
    return widths, size


def _for_print(bgr: np.ndarray, height_in: float) -> bytes:
    """A JPEG at 130 dots per inch, or as it is where that is less."""
    rows = min(round(130 * height_in), bgr.shape[0])
    small = cv2.resize(bgr, (max(round(bgr.shape[1] * rows / bgr.shape[0]), 1), rows), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
