"""A document as one page with everything inside: tables, pictures, and charts that plotly draws in the browser.

Charts are made as plain dictionaries: plotly's Python objects are not needed for them. `write_page` makes simpler pages of tables
and images: what an experiment or a calibration leaves for its reader.
"""

from __future__ import annotations

import base64
import json
import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import cv2
import jinja2
import numpy as np
from markupsafe import Markup

from ..loaders.whole_file import write_whole
from ..render.palette import BLACK, BLUE, GRAY, RED, STATES
from .document import (
    TIME,
    Bars,
    Block,
    Cell,
    Chart,
    Column,
    Curve,
    Curves,
    Document,
    HeatMap,
    Line,
    Pictures,
    Scene,
    Strips,
    Table,
    Value,
    cell_text,
)
from .metrics_file import command_line, cpu, today, versions

JPEG_QUALITY = 80
# The bundle of npm's plotly.js-cartesian-dist-min: a third of the whole library, which a browser takes a second longer to read
PLOTLY = "plotly-cartesian.min.js"


def render_html(document: Document) -> str:
    """The page; it asks for nothing from anywhere."""
    charts = {block.key: figure for block in document.blocks if (figure := figure_of(block)) is not None}
    scenes = {block.key: scene_data(block) for block in document.blocks if isinstance(block, Scene)}
    times: dict[tuple[float | None, ...], int] = {}
    curves = [curve_data(curve, times) for block in document.blocks if isinstance(block, Curves) for curve in block.curves]
    return _page_template("report.html.j2").render(
        document=document,
        kind_of=_kind_of,
        head_of=_head_of,
        cells_of=_cells_of,
        sheet_of=_sheet_of,
        charts=_json(charts),
        curves=_json({"times": list(times), "curves": curves}),
        scenes=_json(scenes),
        colors={"good": STATES["tracking"], "bad": STATES["lost"], "warn": STATES["degraded"], "blue": BLUE, "ink": BLACK},
        script=Markup(_template("scene.js") + _template("report.js")),
        plotly=Markup(_template(PLOTLY) if charts or curves else ""),
    )


def _page_template(name: str) -> jinja2.Template:
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(_template(name))


def _template(name: str) -> str:
    return files(__package__).joinpath(f"templates/{name}").read_text(encoding="utf-8")


def _json(content: Any) -> Markup:
    """JSON that may stand inside of a script element, whatever names there are in it."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029"))


def _kind_of(block: Block) -> str:
    return {Table: "table", Pictures: "pictures", Curves: "curves", Scene: "scene"}.get(type(block), "chart")


def _head_of(table: Table) -> list[tuple[str, int]]:
    """(group, columns) from left to right; empty for a table without groups."""
    found: list[tuple[str, int]] = []
    for column in table.columns:
        if found and found[-1][0] == column.group:
            found[-1] = (column.group, found[-1][1] + 1)
        else:
            found.append((column.group, 1))
    return found if any(column.group for column in table.columns) else []


def _cells_of(table: Table, row: Sequence[Value]) -> list[tuple[str, Cell, Column]]:
    """(text, cell, column)."""
    return [
        (cell_text(cell, column), cell if isinstance(cell, Cell) else Cell(cell), column)
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


DIGITS = 5  # significant ones: far more than a screen shows
X_DIGITS = 9  # those of times, which one zooms into
SAMPLES = 1500  # at most, of a line among the curves: a page of a long run stays small
COLUMNS = 400  # of a heat map
_GRID = "#e8ecef"
_FONT = {"family": "system-ui, Segoe UI, Roboto, DejaVu Sans, sans-serif", "size": 12, "color": BLACK}


def figure_of(block: Block) -> dict[str, Any] | None:
    """``{"data": [...], "layout": {...}}`` of a chart; None for other blocks."""
    if isinstance(block, Chart):
        return _chart(block)
    if isinstance(block, Bars):
        return _bars(block)
    if isinstance(block, Strips):
        return _strips(block)
    return _heat_map(block) if isinstance(block, HeatMap) else None


def curve_data(curve: Curve, times: dict[tuple[float | None, ...], int]) -> dict[str, Any]:
    """One curve as the page's script draws it, of long ones every n-th sample.

    Parameters
    ----------
    curve : of any length.
    times : every series of times so far and its number; gets those of the curve.

    Returns
    -------
    Lines have the number of their times as ``x``.
    """
    panels = []
    for title, lines in curve.panels:
        traces = [trace for line in lines for trace in _traces(_thinned(line))]
        for trace in traces:
            trace["x"] = times.setdefault(tuple(trace["x"]), len(times))
        panels.append({"title": title, "lines": traces})
    return {"group": curve.group, "name": curve.name, "unit": curve.unit, "panels": panels, "filter": _filter_lines(curve.filter)}


def scene_data(scene: Scene) -> dict[str, Any]:
    """A scene as the page's script plays it: places in whole millimeters, none where a body is not."""
    bodies = []
    for body in scene.bodies:
        places = 1e3 * body.points.reshape(len(body.points), -1)
        frames = [[_whole(x) for x in row] if np.isfinite(row).any() else None for row in places.tolist()]
        rods = [[a, b, round(1e3 * ra), round(1e3 * rb), color] for a, b, ra, rb, color in body.rods]
        bodies.append({
            "label": body.label, "frames": frames, "rods": rods, "wires": list(body.wires), "dots": list(body.dots),
        })  # fmt: skip
    cameras = [{"name": name, "points": np.rint(1e3 * corners).astype(int).tolist()} for name, corners in scene.cameras.items()]
    return {"times": plain(scene.times, X_DIGITS), "states": list(scene.states), "bodies": bodies, "cameras": cameras}


def _plain_times(values: np.ndarray) -> list[float | None]:
    """As `plain`; lines of a page share few series of times."""
    return list(_plain_bytes(np.ascontiguousarray(values, dtype=float).tobytes()))


@lru_cache(maxsize=16)
def _plain_bytes(values: bytes) -> tuple[float | None, ...]:
    return tuple(plain(np.frombuffer(values), X_DIGITS))


def _whole(value: float) -> int | None:
    return round(value) if math.isfinite(value) else None


def plain(values: Iterable[float], digits: int = DIGITS) -> list[float | None]:
    """Numbers rounded for JSON.

    Parameters
    ----------
    values : any numbers.
    digits : significant ones.

    Returns
    -------
    None for what JSON has not.
    """
    return [None if not math.isfinite(value) else float(f"{value:.{digits}g}") for value in map(float, values)]


def _chart(chart: Chart) -> dict[str, Any]:
    layout = _layout(320)
    layout["xaxis"] |= {"title": {"text": chart.x_label}}
    layout["yaxis"] |= {"title": {"text": chart.y_label}}
    if chart.log_y:
        layout["yaxis"] |= {"type": "log", "exponentformat": "none", "dtick": _log_ticks(chart)}
    elif chart.y_max is not None:
        layout["yaxis"]["range"] = [chart.y_min, chart.y_max * 1.03]
    elif chart.y_min == 0:
        layout["yaxis"]["rangemode"] = "tozero"
    layout["shapes"] = [_band(*band) for band in chart.bands] + [_level(y) for y, _ in chart.levels]
    layout["annotations"] = [_level_label(y, text, chart.log_y) for y, text in chart.levels]
    if chart.filter:
        lines = _filter_lines(chart.filter)
        layout["annotations"].append(_filter_label(lines))
        layout["margin"]["b"] += FILTER_PX + FILTER_LINE_PX * (len(lines) - 1)
    return {"data": [trace for line in chart.lines for trace in _traces(line)], "layout": layout}


def _log_ticks(chart: Chart) -> str | int:
    """A tick for each decade; at 2 and 5 of it as well where there are few decades."""
    values = np.concatenate([line.y[np.isfinite(line.y) & (line.y > 0)] for line in chart.lines])
    few = len(values) and math.log10(values.max() / values.min()) < 2.5
    return "D2" if few else 1


def _traces(line: Line) -> list[dict[str, Any]]:
    """A line, after the band around it."""
    if line.spread is None:
        return [_trace(line)]
    known = np.isfinite(line.y) & np.isfinite(line.spread)
    x, y, spread = line.x[known], line.y[known], line.spread[known]
    edge = {
        "type": "scatter", "mode": "lines", "x": plain([*x, *x[::-1]], X_DIGITS),
        "y": plain([*(y + spread), *(y - spread)[::-1]]), "fill": "toself", "fillcolor": f"{line.color}2e", "line": {"width": 0},
        "hoverinfo": "skip", "showlegend": False, "legendgroup": line.label, "name": f"{line.label} ± SD",
    }  # fmt: skip
    return [edge, {**_trace(line), "legendgroup": line.label}]


def _thinned(line: Line) -> Line:
    step = -(-len(line.x) // SAMPLES)
    spread = None if line.spread is None else line.spread[::step]
    return line if step <= 1 else replace(line, x=line.x[::step], y=line.y[::step], spread=spread)


FILTER_PX, FILTER_LINE_PX = 28, 12  # for what stands below an axis on how its signals were filtered
_FILTER_LETTERS = 76  # of a line, that a telephone shows


def _filter_lines(text: str) -> list[str]:
    return textwrap.wrap(f"Filter: {text}", _FILTER_LETTERS) if text else []


def _filter_label(lines: list[str]) -> dict[str, Any]:
    return {
        "xref": "paper", "yref": "paper", "x": 0, "y": 0, "xshift": -54, "yshift": -56, "xanchor": "left", "yanchor": "top",
        "text": "<br>".join(lines), "align": "left", "showarrow": False, "font": {"size": 10, "color": GRAY},
    }  # fmt: skip


def _trace(line: Line) -> dict[str, Any]:
    mode = "lines+markers" if line.points else "lines"
    style = {"color": line.color, "width": line.width, "dash": "dash" if line.dashed else "solid"}
    return {"type": "scatter", "mode": mode, "name": line.label, "x": _plain_times(line.x), "y": plain(line.y), "line": style}


def _bars(bars: Bars) -> dict[str, Any]:
    data = [
        {"type": "bar", "name": label, "x": list(bars.categories), "y": plain(values), "marker": {"color": color}}
        for label, values, color in bars.series
    ]
    layout = _layout(340) | {"barmode": "group", "bargap": 0.25}
    layout["yaxis"] |= {"title": {"text": bars.y_label}}
    layout["xaxis"] |= {"showgrid": False, "automargin": True}
    return {"data": data, "layout": layout}


def _strips(block: Strips) -> dict[str, Any]:
    """One trace for every kind of strip, so that the legend names each once."""
    data = []
    for label, color in dict.fromkeys((strip.label, strip.color) for strip in block.strips):
        of = [strip for strip in block.strips if (strip.label, strip.color) == (label, color)]
        data.append({
            "type": "bar", "orientation": "h", "name": label, "marker": {"color": color, "line": {"width": 0}},
            "y": [strip.row for strip in of], "base": plain((strip.start for strip in of), X_DIGITS),
            "x": plain((strip.end - strip.start for strip in of), X_DIGITS),
            "customdata": plain((strip.end for strip in of), X_DIGITS),
            "hovertemplate": f"{label}, %{{base:.2f}} to %{{customdata:.2f}} s<extra>%{{y}}</extra>",
        })  # fmt: skip
    layout = _layout(110 + 30 * len(block.rows)) | {"barmode": "overlay", "bargap": 0.25, "hovermode": "closest"}
    layout["xaxis"] |= {"title": {"text": TIME}, "showgrid": False}
    layout["yaxis"] |= {
        "categoryorder": "array",
        "categoryarray": list(block.rows)[::-1],
        "showgrid": False,
        "fixedrange": True,
        "automargin": True,
    }
    return {"data": data, "layout": layout}


def _heat_map(block: HeatMap) -> dict[str, Any]:
    """At most `COLUMNS` columns, for a browser draws each cell by itself: the largest value of neighboring times in each."""
    step = -(-len(block.times) // COLUMNS)
    firsts = np.arange(0, len(block.times), step)
    values = np.fmax.reduceat(block.values, firsts, axis=0)
    data = {
        "type": "heatmap", "x": plain(block.times[firsts], X_DIGITS), "y": list(block.rows),
        "z": [plain(row) for row in values.T],
        "colorscale": "Viridis", "zmin": 0, "zmax": block.top, "colorbar": {"title": {"text": block.label}, "thickness": 12},
        "hovertemplate": "%{y}, %{x:.2f} s: %{z:.1f}<extra></extra>",
    }  # fmt: skip
    layout = _layout(110 + 20 * len(block.rows)) | {"hovermode": "closest"}
    layout["xaxis"] |= {"title": {"text": TIME}, "showgrid": False}
    layout["yaxis"] |= {"autorange": "reversed", "showgrid": False, "fixedrange": True, "automargin": True}
    return {"data": [data], "layout": layout}


def _layout(height: int) -> dict[str, Any]:
    axis: dict[str, Any] = {"gridcolor": _GRID, "zeroline": False, "linecolor": "#b8c1c8", "ticks": "outside"}
    return {
        "height": height, "margin": {"l": 60, "r": 12, "t": 30, "b": 44}, "font": _FONT, "hovermode": "x unified",
        "paper_bgcolor": "#fff", "plot_bgcolor": "#fff", "xaxis": dict(axis), "yaxis": dict(axis), "showlegend": True,
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0}, "hoverlabel": {"namelength": -1},
    }  # fmt: skip


def _band(start: float, end: float) -> dict[str, Any]:
    edges = plain([start, end], X_DIGITS)
    return {"type": "rect", "xref": "x", "yref": "paper", "x0": edges[0], "x1": edges[1], "y0": 0, "y1": 1,
            "fillcolor": RED, "opacity": 0.15, "line": {"width": 0}, "layer": "below"}  # fmt: skip


def _level(y: float) -> dict[str, Any]:
    line = {"color": GRAY, "width": 1, "dash": "dot"}
    return {"type": "line", "xref": "paper", "yref": "y", "x0": 0, "x1": 1, "y0": y, "y1": y, "line": line}


def _level_label(y: float, text: str, log: bool) -> dict[str, Any]:
    return {"xref": "paper", "yref": "y", "x": 1, "y": math.log10(y) if log else y, "text": text, "showarrow": False,
            "xanchor": "right", "yanchor": "bottom", "font": {"size": 11, "color": GRAY}}  # fmt: skip


@dataclass(frozen=True, eq=False)
class PageSection:
    """A heading with a sentence, then a table, an image, or plain text; what is empty is left out.

    Parameters
    ----------
    table : rows of texts, the first of them the headings.
    image : a PNG file, or pixels (h, w, 3) BGR.
    """

    title: str = ""
    text: str = ""
    table: Sequence[Sequence[str]] = ()
    image: Path | np.ndarray | None = None
    preformatted: str = ""


def write_page(path: str | Path, title: str, sections: Sequence[PageSection]) -> None:
    """Write a page as HTML; folders are made.

    Parameters
    ----------
    path : of the page.
    title : its heading.
    sections : from top to bottom.
    """
    page = _page_template("page.html.j2").render(
        title=title, sections=[(section, _data_uri(section.image)) for section in sections], command=command_line(),
        versions=versions(), cpu=cpu(), made=today(),
    )  # fmt: skip
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, page)


def text_table(rows: Sequence[Sequence[str]]) -> str:
    """Rows of text in columns; all but the first column to the right."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True))]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def _data_uri(image: Path | np.ndarray | None) -> str:
    if image is None:
        return ""
    png = image.read_bytes() if isinstance(image, Path) else cv2.imencode(".png", image)[1].tobytes()
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
