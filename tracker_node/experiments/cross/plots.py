"""Images of the wooden cross, like Figs 7 to 10 of Trewartha, Yeadon & Knight. Images are BGR uint8."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import N_ROOT, ROOT_NAMES, Configuration, State, to_variables
from ...render.overlay import masked_image
from ...report.document import BLUE, GRAY, GREEN, ORANGE, PURPLE
from ..rigid_tracking import UNITS, VARIABLES

_STYLES = ((GRAY, "-", 3.5), (BLUE, "-", 1.4), (GREEN, "--", 1.4), (ORANGE, ".", 1.0), (PURPLE, ":", 1.4))
_MARGIN = 14  # pixels around what an image shows


def through_mask_figure(
    model: ArticulatedModel, rig: CameraRig, image_sets: Mapping[int, Sequence[np.ndarray]], states: Mapping[int, Sequence[State]]
) -> Figure:
    """Targets through the masks of the tracked body (Figs 7 and 8): a row for each camera, a column for each field.

    Parameters
    ----------
    model : the cross.
    rig : the cameras.
    image_sets : number of the field -> its images, in the order of the rig.
    states : number of the field -> the tracked state, as each camera sees it.

    Returns
    -------
    The figure.
    """
    figure = Figure(figsize=(1.75 * len(image_sets), 1.9 * len(rig)), layout="constrained")
    axes = figure.subplots(len(rig), len(image_sets), squeeze=False)
    for row, camera in enumerate(rig):
        images = {
            field: masked_image(images[row], Configuration(model, states[field][row]), camera)
            for field, images in image_sets.items()
        }
        half = max(_half_size(image) for image in images.values())
        for ax, (field, image) in zip(axes[row], images.items(), strict=True):
            ax.imshow(_window(image, half)[:, :, ::-1], interpolation="nearest")
            ax.set_xticks([])
            ax.set_yticks([])
            if row == 0:
                ax.set_title(f"field {field + 1}", fontsize=9)
        axes[row, 0].set_ylabel(camera.name, fontsize=9)
    return figure


def pose_figure(curves: Mapping[str, Sequence[State | None]]) -> Figure:
    """The six variables against the number of the field (Figs 9 and 10); the first curve is the truth.

    Parameters
    ----------
    curves : title -> a state for each field, or None where there is none.
    """
    truth = _unwrapped(next(iter(curves.values())))
    values = {title: _unwrapped(states, truth) for title, states in curves.items()}
    return _six_panels(values, "{name} [{unit}]")


def error_figure(curves: Mapping[str, np.ndarray]) -> Figure:
    """Errors (n, 6), mm and degrees, of several ways to track against the number of the field."""
    return _six_panels({"": np.zeros((0, N_ROOT)), **curves}, "error of {name} [{unit}]")


def _six_panels(curves: Mapping[str, np.ndarray], label: str) -> Figure:
    figure = Figure(figsize=(10.0, 5.4), layout="constrained")
    for column, ax in enumerate(figure.subplots(2, 3, sharex=True).ravel()):
        for (title, values), (color, line, width) in zip(curves.items(), _STYLES, strict=False):
            fields = np.arange(1, len(values) + 1)
            ax.plot(fields, values[:, column], line, color=color, lw=width, ms=5, label=title)
        ax.set_ylabel(label.format(name=VARIABLES[column].replace("ap", "A-P"), unit=UNITS[column]), fontsize=9)
        ax.spines[["top", "right"]].set_visible(False)
        ax.grid(axis="y", color="#e3e3e3", lw=0.7)
        ax.tick_params(labelsize=8)
        if column >= 3:
            ax.set_xlabel("field", fontsize=9)
    handles, titles = figure.axes[0].get_legend_handles_labels()
    shown = [(h, t) for h, t in zip(handles, titles, strict=True) if t]
    figure.legend(*zip(*shown, strict=True), loc="outside upper center", ncols=len(shown), frameon=False, fontsize=9)
    return figure


def _unwrapped(states: Sequence[State | None], near: np.ndarray | None = None) -> np.ndarray:
    """(n, 6) in the order of `VARIABLES`, mm and degrees; full turns count on, or near ``near``; nan where there is no state."""
    columns = [ROOT_NAMES.index(name) for name in ("z", "x", "y", "somersault", "tilt", "twist")]
    scales = np.array([1e3] * 3 + [np.degrees(1.0)] * 3)
    rows = np.full((len(states), N_ROOT), np.nan)
    last = None
    for i, state in enumerate(states):
        if state is not None:
            if near is not None:
                last = np.empty(N_ROOT)
                last[columns] = near[i] / scales
            last = to_variables(state, last)[:N_ROOT]
            rows[i] = last[columns] * scales
    return rows


def _half_size(image: np.ndarray) -> int:
    rows, columns = np.nonzero(image.max(axis=2))
    return max(int(np.ptp(rows)), int(np.ptp(columns))) // 2 + _MARGIN if len(rows) else _MARGIN


def _window(image: np.ndarray, half: int) -> np.ndarray:
    """The square of ``half`` the width around what is not black; black beyond the image."""
    rows, columns = np.nonzero(image.max(axis=2))
    v, u = ((int(r.min()) + int(r.max())) // 2 if len(r) else half for r in (rows, columns))
    padded = np.pad(image, ((half, half), (half, half), (0, 0)))
    return padded[v : v + 2 * half, u : u + 2 * half]
