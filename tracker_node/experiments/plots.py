"""Images of the color experiments, like the figures of Trewartha, Yeadon & Knight. Images are BGR uint8."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..camera.rig import Camera, CameraRig
from ..model.configuration import Configuration
from ..render.palette import CYCLE, GRAY
from ..render.raycast.raycaster import render_color
from ..render.renderer import ColoredView

_BACKGROUND = 255


@dataclass(frozen=True, eq=False)
class Profile:
    """Scores (n,) against the changes (n,) of one variable around the truth."""

    changes: np.ndarray
    scores: np.ndarray


def save(figure: Figure, path: str | Path, dpi: int = 130) -> None:
    """Write a figure as PNG; folders are made.

    Parameters
    ----------
    figure : of matplotlib.
    path : of the PNG.
    dpi : pixels per inch.
    """
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=dpi, facecolor="white")


def bgr_of(view: ColoredView, camera: Camera) -> np.ndarray:
    """A drawn body on black, as large as the camera's images.

    Parameters
    ----------
    view : the drawing.
    camera : gives the size.

    Returns
    -------
    (height, width, 3) uint8.
    """
    image = np.zeros((camera.model.height, camera.model.width, 3), dtype=np.uint8)
    u0, v0, u1, v1 = view.region
    image[v0:v1, u0:u1] = np.rint(view.rgb[:, :, ::-1]).clip(0, 255)
    return image


def convergence_figure(panels: Mapping[str, Mapping[str, Profile]], unit: str) -> Figure:
    """Score against variables (Figs 5 and 6): one panel for each pair of bodies, one curve for each variable.

    Parameters
    ----------
    panels : title -> variable -> its profile.
    unit : of the changes.

    Returns
    -------
    The figure.
    """
    figure = Figure(figsize=(4.9 * len(panels), 3.8), layout="constrained")
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for ax, (title, profiles) in zip(axes, panels.items(), strict=True):
        for (name, profile), color in zip(profiles.items(), CYCLE, strict=False):
            ax.plot(profile.changes, profile.scores, color=color, lw=1.6, label=name)
        ax.axvline(0.0, color=GRAY, lw=0.7, ls=":")
        plain_axes(ax, title, f"difference from the true value [{unit}]")
        ax.set_ylim(bottom=0)
    axes[0].set_ylabel("rms RGB difference [gray levels]")
    axes[0].legend(frameon=False, fontsize=8)
    return figure


def success_figure(starts: Sequence[str], rates: Mapping[str, Sequence[float]]) -> Figure:
    """Fraction of starts that end near the truth, for each optimizer, against the size of the start's error.

    Parameters
    ----------
    starts : labels of the sizes.
    rates : optimizer -> a fraction for each size.

    Returns
    -------
    The figure.
    """
    figure = Figure(figsize=(6.6, 3.6), layout="constrained")
    ax = figure.subplots()
    for i, ((name, values), color) in enumerate(zip(rates.items(), CYCLE, strict=False)):
        ax.plot(np.arange(len(starts)), values, "os^Dv"[i % 5] + "-", color=color, lw=1.6, ms=5, label=name)
    ax.set_xticks(np.arange(len(starts)), starts)
    ax.set_ylim(-0.03, 1.03)
    ax.set_ylabel("fraction that arrives")
    plain_axes(ax, "", "error of the start")
    ax.legend(frameon=False, fontsize=8, loc="lower left")
    return figure


def bias_figure(floors: Mapping[str, np.ndarray], names: Sequence[str], units: Sequence[str]) -> Figure:
    """Signed errors of several methods: a bar for the mean, a dot for each image set; one panel for each unit.

    Parameters
    ----------
    floors : title -> errors (n, n_variables).
    names, units : of the variables.

    Returns
    -------
    The figure.
    """
    kinds = list(dict.fromkeys(units))
    figure = Figure(figsize=(4.9 * len(kinds), 3.6), layout="constrained")
    width = 0.8 / len(floors)
    for ax, kind in zip(figure.subplots(1, len(kinds), squeeze=False)[0], kinds, strict=True):
        columns = [i for i, unit in enumerate(units) if unit == kind]
        for k, ((title, errors), color) in enumerate(zip(floors.items(), CYCLE, strict=False)):
            places = np.arange(len(columns)) + (k + 0.5) * width - 0.4
            ax.bar(places, errors[:, columns].mean(axis=0), 0.9 * width, color=color, alpha=0.6, label=title)
            ax.plot(np.tile(places, len(errors)), errors[:, columns].ravel(), "o", ms=2.2, color=color)
        ax.set_xticks(np.arange(len(columns)), [names[i] for i in columns])
        plain_axes(ax, "", "")
        ax.set_ylabel(f"estimate - truth [{kind}]", fontsize=9)
    ax.legend(frameon=False, fontsize=8)
    return figure


def cost_figure(differences: Mapping[str, np.ndarray]) -> Figure:
    """Where a drawn body differs from its target, one panel for each camera.

    Parameters
    ----------
    differences : title -> (h, w) gray levels, nan where the body does not cover.

    Returns
    -------
    The figure.
    """
    figure = Figure(figsize=(3.3 * len(differences) + 0.8, 3.9), layout="constrained")
    axes = figure.subplots(1, len(differences), squeeze=False)[0]
    for ax, (title, difference) in zip(axes, differences.items(), strict=True):
        top, bottom, left, right = body_box(~np.isnan(difference), margin=8)
        shown = ax.imshow(difference[top:bottom, left:right], cmap="magma_r", vmin=0.0, vmax=150.0, interpolation="nearest")
        ax.set_title(title, fontsize=9)
        ax.set_axis_off()
    figure.colorbar(shown, ax=axes, label="rms RGB difference [gray levels]", shrink=0.8)
    return figure


def valley_figure(valleys: Mapping[str, Profile], lateral_mm: np.ndarray, found: Sequence[np.ndarray]) -> Figure:
    """Scores over lateral position and twist, one panel for each score.

    Parameters
    ----------
    valleys : title -> profile over twist, degrees, whose scores (n, m) have a column for each lateral position.
    lateral_mm : (m,).
    found : for each panel (lateral, twist) of its floor.

    Returns
    -------
    The figure.
    """
    figure = Figure(figsize=(4.6 * len(valleys), 3.9), layout="constrained")
    axes = figure.subplots(1, len(valleys), sharey=True, squeeze=False)[0]
    for ax, (title, valley), (x, y) in zip(axes, valleys.items(), found, strict=True):
        rise = 100.0 * (valley.scores / valley.scores.min() - 1.0)
        lines = ax.contour(lateral_mm, valley.changes, rise, levels=[0.2, 0.5, 1, 2, 4, 8, 16], colors=GRAY, linewidths=0.8)
        ax.clabel(lines, fmt="%g %%", fontsize=7)
        ax.plot(0.0, 0.0, "+", color=CYCLE[0], ms=10, label="truth")
        ax.plot(x, y, "o", color=CYCLE[1], ms=5, label="floor")
        plain_axes(ax, title, "lateral error [mm]")
    axes[0].set_ylabel("twist error [degrees]", fontsize=9)
    axes[0].legend(frameon=False, fontsize=8)
    return figure


def sequence_figure(rows: Mapping[str, Sequence[np.ndarray]]) -> Figure:
    """Image sequences under each other (Fig. 4).

    Parameters
    ----------
    rows : title -> BGR images on black, of one size within a row. Every image is cut to the widest body of its row and keeps
        its height in the image.
    """
    strips = {title: _strip(images) for title, images in rows.items()}
    width = max(strip.shape[1] for strip in strips.values())
    heights = [strip.shape[0] * 10.5 / width for strip in strips.values()]
    figure = Figure(figsize=(10.5, sum(heights) + 0.32 * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
    for ax, (title, strip) in zip(axes, strips.items(), strict=True):
        ax.imshow(strip[:, :, ::-1], interpolation="lanczos")
        ax.set_title(title, fontsize=9, loc="left")
        ax.set_axis_off()
    return figure


def matching_figure(target: np.ndarray, view: ColoredView, camera: Camera) -> Figure:
    """The five panels of one match (Fig. 2): target, generated image, mask, target through the mask, quality of the match.

    Parameters
    ----------
    target : (h, w, 3) uint8 BGR.
    view : the drawn body.
    camera : of both.

    Returns
    -------
    The figure.
    """
    generated, mask = bgr_of(view, camera), np.zeros(target.shape[:2], dtype=bool)
    u0, v0, u1, v1 = view.region
    mask[v0:v1, u0:u1] = view.labels > 0
    difference = np.sqrt(np.mean((generated.astype(float) - target.astype(float)) ** 2, axis=2))
    match = np.where(mask, 255.0 - np.clip(2.0 * difference, 0.0, 255.0), 0.0)
    panels = (
        ("(a) target", target), ("(b) generated", generated), ("(c) mask", np.where(mask, 255, 0)),
        ("(d) target through mask", np.where(mask[:, :, None], target, 0)), ("(e) match, white is good", match),
    )  # fmt: skip
    cut = body_box((target.max(axis=2) > 0) | mask if _is_on_black(target) else mask, margin=25)
    figure = Figure(figsize=(11.5, 11.5 / 5 * (cut[1] - cut[0]) / (cut[3] - cut[2]) + 0.35), layout="constrained")
    for ax, (title, panel) in zip(figure.subplots(1, 5), panels, strict=True):
        piece = panel[cut[0] : cut[1], cut[2] : cut[3]]
        ax.imshow(piece[:, :, ::-1] if piece.ndim == 3 else piece, cmap="gray", vmin=0, vmax=255)
        ax.set_title(title, fontsize=9)
        ax.set_xticks([])
        ax.set_yticks([])
    return figure


def bodies_figure(bodies: Mapping[str, Configuration], rig: CameraRig) -> Figure:
    """Bodies side by side in one pose, from every camera (Fig. 1).

    Parameters
    ----------
    bodies : title -> body in a pose.
    rig : the cameras, with lights.

    Returns
    -------
    The figure.
    """
    images = {
        (title, camera.name): bgr_of(render_color(body, camera, rig.lights), camera)
        for title, body in bodies.items()
        for camera in rig
    }
    boxes = {camera.name: body_box(_any_body([images[t, camera.name] for t in bodies]), margin=12) for camera in rig}
    top, bottom = min(box[0] for box in boxes.values()), max(box[1] for box in boxes.values())
    widths = [boxes[camera][3] - boxes[camera][2] for _, camera in images]
    figure = Figure(figsize=(5.6 * sum(widths) / (bottom - top), 6.0), layout="constrained")
    axes = figure.subplots(1, len(images), squeeze=False, gridspec_kw={"width_ratios": widths})[0]
    for ax, ((title, camera), image) in zip(axes, images.items(), strict=True):
        ax.imshow(_on_white(image)[top:bottom, boxes[camera][2] : boxes[camera][3], ::-1])
        ax.set_title(f"{title},\n{camera}", fontsize=9)
        ax.set_axis_off()
    return figure


def plan_figure(rig: CameraRig, paths: Mapping[str, np.ndarray]) -> Figure:
    """The scene from above (Fig. 3): cameras with their fields of view, lights, and paths of objects.

    Parameters
    ----------
    rig : cameras and lights.
    paths : title -> (n, 3) positions.

    Returns
    -------
    The figure.
    """
    figure = Figure(figsize=(6.4, 5.6), layout="constrained")
    ax = figure.subplots()
    everything = [np.asarray(path)[:, :2] for path in paths.values()]
    middle = np.concatenate(everything).mean(axis=0) if everything else np.zeros(2)
    for camera in rig:
        _draw_camera(ax, camera, middle)
    for light in rig.lights:
        if light.position is not None:
            ax.plot(*light.position[:2], marker="*", ms=13, color=CYCLE[1], ls="")
            ax.annotate(light.kind, light.position[:2], textcoords="offset points", xytext=(7, -10), fontsize=8)
    for (name, path), color in zip(paths.items(), (CYCLE[3], CYCLE[4], CYCLE[2]), strict=False):
        ax.plot(*np.asarray(path)[:, :2].T, "o-", ms=2.5, lw=1.0, color=color, label=name)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.12)
    plain_axes(ax, "", "x [m]")
    ax.set_ylabel("y [m]")
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, fontsize=8)
    return figure


def _draw_camera(ax: Axes, camera: Camera, middle: np.ndarray) -> None:
    """A camera's place and the edges of its field of view; one that looks down is a square."""
    place = camera.center[:2]
    lens, rotation = camera.model, camera.T_world_cam[:3, :3]
    ax.annotate(camera.name, (place[0], place[1]), textcoords="offset points", xytext=(7, 7), fontsize=9)
    if np.linalg.norm(rotation[:2, 2]) < 0.5:
        ax.plot(*place, marker="s", ms=9, color=CYCLE[0], mfc="none", ls="")
        return
    ax.plot(*place, marker="o", ms=7, color=CYCLE[0], ls="")
    reach = 1.15 * float(np.linalg.norm(middle - place))
    for u in (-0.5, lens.width - 0.5):
        ray, _ = lens.rays(np.array([u, 0.5 * lens.height]))
        horizontal = (rotation @ ray)[:2]
        ax.plot(*np.stack([place, place + reach * horizontal / np.linalg.norm(horizontal)]).T, color=CYCLE[0], lw=0.8, alpha=0.6)


def _strip(images: Sequence[np.ndarray]) -> np.ndarray:
    """Images side by side on white, cut about their bodies."""
    boxes = [body_box(image.max(axis=2) > 0, margin=6) for image in images]
    top, bottom = min(b[0] for b in boxes), max(b[1] for b in boxes)
    half = max(b[3] - b[2] for b in boxes) // 2 + 1
    pieces = []
    for image, box in zip(images, boxes, strict=True):
        wide = cv2.copyMakeBorder(_on_white(image), 0, 0, half, half, cv2.BORDER_CONSTANT, value=(_BACKGROUND,) * 3)
        middle = (box[2] + box[3]) // 2 + half
        pieces.append(wide[top:bottom, middle - half : middle + half])
    return np.hstack(pieces)


def _on_white(image: np.ndarray) -> np.ndarray:
    return np.where(image.max(axis=2, keepdims=True) > 0, image, np.uint8(_BACKGROUND))


def _any_body(images: Sequence[np.ndarray]) -> np.ndarray:
    return np.any([image.max(axis=2) > 0 for image in images], axis=0)


def _is_on_black(image: np.ndarray) -> bool:
    return bool(np.mean(image.max(axis=2) == 0) > 0.5)


def body_box(mask: np.ndarray, margin: int) -> tuple[int, int, int, int]:
    """Rows and columns around what is set in a mask.

    Parameters
    ----------
    mask : (h, w) bool.
    margin : pixels around it.

    Returns
    -------
    (top, bottom, left, right); the whole image where nothing is set.
    """
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return 0, mask.shape[0], 0, mask.shape[1]
    return (
        max(0, rows[0] - margin), min(mask.shape[0], rows[-1] + 1 + margin),
        max(0, columns[0] - margin), min(mask.shape[1], columns[-1] + 1 + margin),
    )  # fmt: skip


def plain_axes(ax: Axes, title: str, x_label: str) -> None:
    """A light grid, no frame, small labels.

    Parameters
    ----------
    ax : axes of matplotlib.
    title, x_label : texts; no title if empty.
    """
    ax.grid(color="#e3e3e3", lw=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=8)
    ax.set_xlabel(x_label, fontsize=9)
    if title:
        ax.set_title(title, fontsize=10)
