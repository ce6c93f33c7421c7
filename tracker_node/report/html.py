"""A document as one page with everything inside: tables, pictures, and charts that plotly draws in the browser."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import cv2
import jinja2
import numpy as np
from markupsafe import Markup

from .document import Block, Cell, Column, Curves, Document, Pictures, Table, Value, cell_text
from .plotly import curve_data, figure_of

JPEG_QUALITY = 80
# The bundle of npm's plotly.js-cartesian-dist-min: a third of the whole library, which a browser takes a second longer to read
PLOTLY = "plotly-cartesian.min.js"


def render_html(document: Document) -> str:
    """The page; it asks for nothing from anywhere."""
    source = _template("report.html.j2")
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    charts = {block.key: figure for block in document.blocks if (figure := figure_of(block)) is not None}
    curves = [curve_data(curve) for block in document.blocks if isinstance(block, Curves) for curve in block.curves]
    return environment.from_string(source).render(
        document=document,
        kind_of=_kind_of,
        head_of=_head_of,
        cells_of=_cells_of,
        sheet_of=_sheet_of,
        charts=_json(charts),
        curves=_json(curves),
        script=Markup(_template("report.js")),
        plotly=Markup(_template(PLOTLY) if charts or curves else ""),
    )


def _template(name: str) -> str:
    return files(__package__).joinpath(f"templates/{name}").read_text(encoding="utf-8")


def _json(content: Any) -> Markup:
    """JSON that may stand inside of a script element, whatever names there are in it."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029"))


def _kind_of(block: Block) -> str:
    return {Table: "table", Pictures: "pictures", Curves: "curves"}.get(type(block), "chart")


def _head_of(table: Table) -> list[tuple[str, int]]:
    """(group, columns) from left to right; empty for a table without groups."""
    found: list[tuple[str, int]] = []
    for column in table.columns:
        if found and found[-1][0] == column.group:
            found[-1] = (column.group, found[-1][1] + 1)
        else:
            found.append((column.group, 1))
    return found if any(column.group for column in table.columns) else []


def _cells_of(table: Table, row: Sequence[Value]) -> list[tuple[str, str, Column]]:
    """(text, mark, column)."""
    return [
        (cell_text(cell, column), cell.mark if isinstance(cell, Cell) else "", column)
        for cell, column in zip(row, table.columns, strict=True)
    ]


def _sheet_of(block: Pictures) -> list[list[tuple[str, str, str]]]:
    """(caption, data URI, width over height) in rows."""
    rows = []
    for row in block.rows:
        cells = []
        for caption, image in row:
            aspect = f"{image.shape[1] / image.shape[0]:.4f}"
            cells.append((caption, _jpeg_uri(image), aspect))
        rows.append(cells)
    return rows


def _jpeg_uri(bgr: np.ndarray) -> str:
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return f"data:image/jpeg;base64,{base64.b64encode(data.tobytes()).decode()}"
