"""Charts of a document drawn with matplotlib, for print."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullFormatter

from ..render.palette import GRAY, RED
from .document import TIME, Bars, Block, Chart, Curve, HeatMap, Line, Scene, Strips

_SMALL = 7
_INSTANTS = 6  # of a scene, on paper
_POINTS_PER_M = 30.0


def height_in(block: Block) -> float:
    """How tall a chart is drawn, inches, its labels included; 0 for a block that is no chart."""
    if isinstance(block, Chart):
        return 2.5
    if isinstance(block, Bars):
        return 2.9
    if isinstance(block, Scene):
        return 2.4
    if isinstance(block, Strips):
        return 0.85 + 0.2 * len(block.rows)
    return 0.75 + 0.17 * len(block.rows) if isinstance(block, HeatMap) else 0.0


def label_in(block: Block) -> float:
    """How wide the labels beside the vertical axis are, inches."""
    rows = block.rows if isinstance(block, (Strips, HeatMap)) else ()
    return max(0.55, 0.2 + 0.052 * max((len(row) for row in rows), default=0))


def draw(block: Block, ax: Axes) -> None:
    """Draw a chart.

    Parameters
    ----------
    block : a chart of any kind.
    ax : is drawn into.

    Raises
    ------
    ValueError : a block that is no chart.
    """
    if isinstance(block, Chart):
        _draw_chart(block, ax)
    elif isinstance(block, Bars):
        _draw_bars(block, ax)
    elif isinstance(block, Strips):
        _draw_strips(block, ax)
    elif isinstance(block, HeatMap):
        _draw_heat_map(block, ax)
    elif isinstance(block, Scene):
        _draw_scene(block, ax)
    else:
        raise ValueError(f"expected a chart, got {type(block).__name__}")


def draw_curve(curve: Curve, panel: int, figure: Figure, box: tuple[float, float, float, float]) -> None:
    """One panel of a curve, small, into a part of a page: the ends of both axes are its labels.

    Pages hold some dozens of these, and axes with all that belongs to them would take a second each dozen.

    Parameters
    ----------
    curve : of one or more panels.
    panel : number of the panel.
    figure : the page.
    box : left, bottom, width, height as fractions of the page.
    """
    title, lines = curve.panels[panel]
    left, bottom, width, height = box
    (x0, x1), (y0, y1) = _span([line.x for line in lines]), _span([line.y for line in lines])
    frame = Line2D([left, left, left + width], [bottom + height, bottom, bottom], color="#9aa5ad", lw=0.5)
    figure.add_artist(frame)
    for line in lines:
        along, up = (line.x - x0) / (x1 - x0), (line.y - y0) / (y1 - y0)
        style: dict[str, Any] = {"color": line.color, "lw": 0.6 * line.width, "ls": "--" if line.dashed else "-"}
        figure.add_artist(Line2D(left + width * along, bottom + height * up, **style))
    name = f"{curve.name} {title} [{curve.unit}]".replace("  ", " ")
    figure.text(left, bottom + 1.06 * height, name, size=6, ha="left", va="bottom", parse_math=False)
    for text, x, y, align in (
        (f"{y1:.4g}", left - 0.004, bottom + height, ("right", "center")),
        (f"{y0:.4g}", left - 0.004, bottom, ("right", "center")),
        (f"{x0:.3g}", left, bottom - 0.002, ("left", "top")),
        (f"{x1:.3g} s", left + width, bottom - 0.002, ("right", "top")),
    ):
        figure.text(x, y, text, size=6, color=GRAY, ha=align[0], va=align[1], parse_math=False)


def _span(values: Sequence[np.ndarray]) -> tuple[float, float]:
    """Least and greatest finite value, apart by something."""
    found = np.concatenate([v[np.isfinite(v)] for v in values]) if len(values) else np.zeros(0)
    low, high = (float(found.min()), float(found.max())) if len(found) else (0.0, 1.0)
    return (low, high) if high - low > 1e-9 else (low - 0.5, high + 0.5)


def _draw_chart(chart: Chart, ax: Axes) -> None:
    _style(ax)
    for start, end in chart.bands:
        ax.axvspan(start, end, color=RED, alpha=0.15, lw=0)
    for line in chart.lines:
        _draw_line(line, ax)
    if chart.log_y:
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
    for y, text in chart.levels:
        ax.axhline(y, color=GRAY, lw=0.8, ls=":")
        ax.annotate(text, (1.0, y), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=6, color=GRAY)
    if not chart.log_y:
        ax.set_ylim(bottom=chart.y_min, top=None if chart.y_max is None else 1.03 * chart.y_max)
    ax.set_xlabel(chart.x_label, fontsize=_SMALL, loc="left" if chart.filter else "center")
    if chart.filter:
        ax.annotate(
            f"Filter: {chart.filter}", (1.0, 0.0), xytext=(0, -27), xycoords="axes fraction", textcoords="offset points",
            ha="right", va="center", fontsize=6, color=GRAY,
        )  # fmt: skip
    ax.set_ylabel(chart.y_label, fontsize=_SMALL)
    ax.margins(x=0.01)
    _legend(ax)


def _draw_line(line: Line, ax: Axes) -> None:
    style = "--" if line.dashed else "-"
    marker = "o" if line.points else ""
    if line.spread is not None:
        ax.fill_between(line.x, line.y - line.spread, line.y + line.spread, color=line.color, alpha=0.18, lw=0)
    ax.plot(line.x, line.y, style, marker=marker, ms=3, color=line.color, lw=0.75 * line.width, label=line.label)


def _draw_bars(bars: Bars, ax: Axes) -> None:
    _style(ax)
    at, width = np.arange(len(bars.categories)), 0.8 / max(len(bars.series), 1)
    for i, (label, values, color) in enumerate(bars.series):
        ax.bar(at + (i - (len(bars.series) - 1) / 2) * width, np.nan_to_num(values), 0.92 * width, label=label, color=color)
    ax.set_xticks(at, [name.replace(" ", "\n", 1) for name in bars.categories], rotation=45 if len(at) > 18 else 0)
    ax.set_ylabel(bars.y_label, fontsize=_SMALL)
    _legend(ax)


def _draw_strips(block: Strips, ax: Axes) -> None:
    _style(ax)
    ax.grid(False)
    for i, row in enumerate(block.rows):
        own = [strip for strip in block.strips if strip.row == row]
        ax.broken_barh([(s.start, s.end - s.start) for s in own], (i - 0.4, 0.8), color=[s.color for s in own], lw=0)
    kinds = dict.fromkeys((strip.label, strip.color) for strip in block.strips)
    ax.legend(handles=[Patch(color=color, label=label) for label, color in kinds], **_LEGEND)
    ax.set_yticks(range(len(block.rows)), block.rows)
    ax.set_ylim(len(block.rows) - 0.4, -0.6)
    ax.set_xlabel(TIME, fontsize=_SMALL)
    ax.margins(x=0.01)


def _draw_heat_map(block: HeatMap, ax: Axes) -> None:
    _style(ax)
    ax.grid(False)
    period = float(np.median(np.diff(block.times))) if len(block.times) > 1 else 1.0
    edges = np.append(block.times - period / 2, block.times[-1] + period / 2)
    mesh = ax.pcolormesh(
        edges, np.arange(len(block.rows) + 1), block.values.T, cmap="viridis", vmin=0, vmax=block.top, rasterized=True
    )
    ax.set_yticks(np.arange(len(block.rows)) + 0.5, block.rows)
    ax.invert_yaxis()
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.01, fraction=0.07, aspect=30)
    bar.set_label(block.label, fontsize=_SMALL)
    bar.ax.tick_params(labelsize=6)
    ax.set_xlabel(TIME, fontsize=_SMALL)


_LEGEND: dict[str, Any] = {
    "loc": "lower left", "bbox_to_anchor": (0, 1.0), "ncols": 7, "frameon": False, "fontsize": 6.5, "borderaxespad": 0.2,
}  # fmt: skip


def _draw_scene(scene: Scene, ax: Axes) -> None:
    """A few instants beside each other, seen from the side of the first camera, each from the lowest point up."""
    ax.axis("off")
    ax.set_aspect("equal")
    seen = np.flatnonzero([any(np.isfinite(body.points[i]).any() for body in scene.bodies) for i in range(len(scene.times))])
    if not len(seen):
        return
    chosen = np.unique(seen[np.linspace(0, len(seen) - 1, _INSTANTS).round().astype(int)])
    every = np.concatenate([body.points[chosen].reshape(-1, 3) for body in scene.bodies])
    toward = next((corners[0] for corners in scene.cameras.values()), np.array([1.0, -1.0, 0.0])) - np.nanmean(every, axis=0)
    right = np.array([-toward[1], toward[0]]) / max(float(np.hypot(*toward[:2])), 1e-9)
    floor, apart = float(np.nanmin(every[:, 2])), 0.0
    height = float(np.nanmax(every[:, 2])) - floor
    for i in chosen:
        here = np.concatenate([body.points[i] for body in scene.bodies])
        middle, width = np.nanmean(here[:, :2], axis=0), float(np.ptp((here[:, :2] @ right)[np.isfinite(here[:, 0])]))
        apart += 0.5 * width
        for body in scene.bodies:
            at = np.column_stack([(body.points[i, :, :2] - middle) @ right + apart, body.points[i, :, 2] - floor])
            for a, b, ra, rb, color in body.rods:
                ax.plot(*at[[a, b]].T, color=color, lw=max(_POINTS_PER_M * (ra + rb), 0.8), solid_capstyle="round", alpha=0.85)
            for a, b, color in body.wires:
                ax.plot(*at[[a, b]].T, color=color, lw=0.8)
            for k, color in body.dots:
                ax.plot(*at[k], ".", color=color, ms=2)
        ax.text(apart, -0.12 * height, f"{scene.times[i]:.2f} s", size=_SMALL, ha="center", va="top")
        apart += 0.5 * width + 0.25 * height


def _legend(ax: Axes) -> None:
    if ax.get_legend_handles_labels()[0]:
        ax.legend(**_LEGEND)


def _style(ax: Axes) -> None:
    ax.grid(axis="y", color="#e3e3e3", lw=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=6.5)
