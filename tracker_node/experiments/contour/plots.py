"""Charts of the experiments on contours, like Fig. 3 of Knossow, Ronfard, Horaud & Devernay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from ...report.document import BLACK, BLUE, GREEN, GREY, ORANGE, RED
from ..plots import Profile, body_box, plain_axes
from .errors import PUBLISHED, TITLES

_MARGIN_PX = 45  # around what is shown of an image
COLORS = {"silhouette": BLUE, "edges": ORANGE, "sum": RED, "split": GREEN, "region": BLACK}


@dataclass(frozen=True, eq=False)
class RowPicture:
    """One part of a body before one camera, and a row of its image.

    Attributes
    ----------
    silhouette, edges : (h, w) bool, as seen; ``row`` is a row of them, ``middle`` the part's column in it.
    distances : by `PUBLISHED`, the distance (px) of every pixel of that row.
    errors : title of a model of the part -> by `PUBLISHED`, its error (px) against its shift along the row (px).
    """

    silhouette: np.ndarray
    edges: np.ndarray
    row: int
    middle: float
    distances: Mapping[str, np.ndarray]
    errors: Mapping[str, Mapping[str, Profile]]


def row_figure(picture: RowPicture) -> Figure:
    """Fig. 3: edges and silhouette of one part; for each kind of distance, that along the row, and the error of the part moved
    along it."""
    figure = Figure(figsize=(12.0, 3.5), layout="constrained")
    axes = figure.subplots(1, 5, width_ratios=(0.8, 0.8, 1.5, 1.5, 1.5))
    top, bottom, left, right = body_box(picture.silhouette, _MARGIN_PX)
    for ax, image, title in zip(axes, (picture.edges, picture.silhouette), ("edges", "silhouette"), strict=False):
        ax.imshow(image[top:bottom, left:right], cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        ax.axhline(picture.row - top, color=RED, lw=1.0)
        ax.set_title(title, fontsize=10)
        ax.set_xticks([])
        ax.set_yticks([])
    reach = max(float(np.abs(of[key].changes).max()) for of in picture.errors.values() for key in of)
    columns = np.arange(picture.silhouette.shape[1]) - picture.middle
    for ax, key in zip(axes[2:], PUBLISHED, strict=True):
        ax.plot(columns, picture.distances[key], color=BLUE, lw=1.0, label="distance of a pixel of the row")
        for (title, errors), line in zip(picture.errors.items(), ("-", "--"), strict=False):
            ax.plot(errors[key].changes, errors[key].scores, line, color=RED, lw=2.0, label=f"error of {title}")
        plain_axes(ax, TITLES[key].partition(" (")[0], "from the part's middle [px]")
        ax.set_xlim(-reach, reach)
    highest = 1.05 * max(float(np.nanmax(of[key].scores)) for of in picture.errors.values() for key in of)
    for ax in axes[2:]:
        ax.set_ylim(0.0, highest)
    axes[2].set_ylabel("px", fontsize=9)
    handles, labels = axes[2].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower right", ncols=3, frameon=False, fontsize=9)
    return figure


def variables_figure(panels: Mapping[str, Mapping[str, Profile]]) -> Figure:
    """The error of a whole body as one variable leaves the truth: a panel for each, its title "name [unit]"."""
    figure = Figure(figsize=(3.3 * len(panels), 3.5), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for ax, (title, errors) in zip(axes, panels.items(), strict=True):
        for key, profile in errors.items():
            ax.plot(profile.changes, profile.scores, color=COLORS[key], lw=1.6, label=TITLES[key])
        ax.axvline(0.0, color=GREY, lw=0.7, ls=":")
        name, _, unit = title.partition(" [")
        plain_axes(ax, name, f"from the truth [{unit}")
        ax.set_ylim(bottom=0.0)
    axes[0].set_ylabel("rms distance of contours [px]", fontsize=9)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def tracking_figure(panels: Mapping[str, tuple[Sequence[float], Mapping[str, np.ndarray]]]) -> Figure:
    """Joint error over time: a panel for each clip, with its times (n,) s and the errors (n,) mm of the methods to track it."""
    figure = Figure(figsize=(4.4 * len(panels), 3.7), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    for ax, (title, (times, errors)) in zip(axes, panels.items(), strict=True):
        for key, values in errors.items():
            ax.plot(times, values, color=COLORS[key], lw=1.5, label=TITLES[key])
        plain_axes(ax, title, "time [s]")
        ax.set_yscale("log")
    axes[0].set_ylabel("mean joint error [mm]", fontsize=9)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure
