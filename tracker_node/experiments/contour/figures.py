"""Figures of the contour experiment: bodies over images, and charts (Knossow, Ronfard, Horaud & Devernay, Figs 3 to 6).

Images are BGR uint8.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...camera.rig import Camera
from ...model.configuration import Configuration
from ...objective.per_camera import samples_seen
from ...observation.chamfer.observer import Observer
from ...observation.image_set import ImageSet
from ...render.contour.samples import CLASS, OUTER, U, V
from ...render.overlay import draw_overlay
from ...render.palette import BLACK, BLUE, GRAY, GREEN, ORANGE, RED
from ...render.raycast.raycaster import render_labels
from ...render.shape_arrays import ShapeArrays
from ...report.html import PageSection
from ...tracking.config import TrackerConfig
from ..plots import Profile, body_box, plain_axes, save
from .clips import Clip, TrackedClip
from .errors import PUBLISHED, TITLES, by_method

_SAMPLES = 40  # on a generator line
_OUTLINE, _WITHIN = "#ffe14d", ORANGE
_MARGIN_PX = 24
_CAMERAS_IN_ROW = 3
_ROW_MARGIN_PX = 45  # around what is shown of an image
COLORS = {"silhouette": BLUE, "edges": ORANGE, "sum": RED, "split": GREEN, "region": BLACK}
DRAWN = "split"  # the method whose poses are drawn: those of the paper lose a quick body
_TIME_STEPS = 6


@dataclass(frozen=True, eq=False)
class Shot:
    """One camera's image of a body, with what was seen in it, (h, w) each and as large as the image.

    Attributes
    ----------
    before, found : the body as it was in the image before, and as it was found in this one.
    silhouette, edges : bool, edges those within the silhouette.
    distance : float32 pixels, the paper's sum of those to both; NaN where nobody looked.
    """

    camera: Camera
    bgr: np.ndarray
    before: Configuration
    found: Configuration
    silhouette: np.ndarray
    edges: np.ndarray
    distance: np.ndarray


def shoot(
    camera: Camera, bgr: np.ndarray, before: Configuration, found: Configuration, known: np.ndarray | list,
    config: TrackerConfig, margin_px: int,
) -> Shot | None:  # fmt: skip
    """Observe an image as the tracker does; colors of body and scene are learned in the very image.

    Parameters
    ----------
    camera : that took the image.
    bgr : (h, w, 3) uint8.
    before, found : the body in the image before, and as found in this one.
    known : images of the background.
    config : parameters of the tracker.
    margin_px : how far around ``before`` the image is processed.

    Returns
    -------
    None where the body was out of the image.
    """
    seen = render_labels(before, camera, margin_px)
    if seen is None:
        return None
    observer = Observer(camera.name, (camera.model.width, camera.model.height), config.chamfer, config.background, known)
    there = render_labels(found, camera, margin_px)
    if there is not None:
        observer.begin(bgr, *there, config.background.body_margin_px)
    observation = observer.observe(bgr, *seen)
    silhouette, edges = (np.zeros(bgr.shape[:2], dtype=bool) for _ in range(2))
    distance = np.full(bgr.shape[:2], np.nan, dtype=np.float32)
    u0, v0, u1, v1 = observation.region
    silhouette[v0:v1, u0:u1], edges[v0:v1, u0:u1] = observation.silhouette > 0, observation.edges > 0
    distance[v0:v1, u0:u1] = np.maximum(observation.silhouette_distance, 0.0) + observation.edge_distance
    return Shot(camera, bgr, before, found, silhouette, edges, distance)


def _evidence_figure(shot: Shot) -> Figure:
    """What the tracker makes of an image (Fig. 4): the image, silhouette, edges within it, and the
    sum of the distances to both."""
    box = _box([shot])
    figure, axes = _panels(1, 4, box)
    for ax, title in zip(axes[0], ("image", "silhouette", "edges within it", "sum of distances [px]"), strict=True):
        ax.set_title(title, fontsize=9)
    _show(axes[0, 0], shot.bgr, box)
    _show(axes[0, 1], shot.silhouette, box)
    _show(axes[0, 2], shot.edges, box)
    drawn = axes[0, 3].imshow(_cut(shot.distance, box), cmap="gray", vmin=0.0)
    figure.colorbar(drawn, ax=axes[0, 3], shrink=0.8, pad=0.02).ax.tick_params(labelsize=7)
    return figure


def _cameras_figure(shots: Sequence[Shot]) -> Figure:
    """One time step in several cameras (Fig. 5), with the contours of the body where it was found."""
    boxes = [_box([shot]) for shot in shots]
    height, width = (max(box[i + 1] - box[i] for box in boxes) for i in (0, 2))
    n_rows = -(-len(shots) // _CAMERAS_IN_ROW)
    figure, axes = _panels(n_rows, min(len(shots), _CAMERAS_IN_ROW), (0, height, 0, width))
    for ax in axes.ravel()[len(shots) :]:
        ax.set_axis_off()
    for ax, shot, box in zip(axes.ravel(), shots, boxes, strict=False):
        _show(ax, shot.bgr, box)
        _draw_contours(ax, shot.found, shot.camera, box)
        ax.set_title(shot.camera.name, fontsize=9)
    return figure


def sequence_figure(shots: Sequence[Shot], titles: Sequence[str]) -> Figure:
    """A sequence in one camera (Fig. 6): contours predicted from the pose before, silhouettes, edges within them, poses.

    Parameters
    ----------
    shots : of one camera, in order of time.
    titles : one a shot.

    Returns
    -------
    The figure.
    """
    box = _box(shots)
    figure, axes = _panels(4, len(shots), box)
    for column, (shot, title) in enumerate(zip(shots, titles, strict=True)):
        contours, silhouette, edges, pose = axes[:, column]
        contours.set_title(title, fontsize=9)
        _show(contours, shot.bgr, box)
        _draw_contours(contours, shot.before, shot.camera, box)
        _show(silhouette, shot.silhouette, box)
        _show(edges, shot.edges, box)
        _show(pose, draw_overlay(shot.bgr, shot.found, shot.camera, skeleton=False), box)
    for ax, title in zip(axes[:, 0], ("contours of the pose before", "silhouette", "edges within it", "pose found"), strict=True):
        ax.set_ylabel(title, fontsize=9)
    return figure


def _draw_contours(ax: Axes, body: Configuration, camera: Camera, box: tuple[int, int, int, int]) -> None:
    """Samples of the outline bright, those of contours within it dark."""
    seen = samples_seen(body, ShapeArrays.from_model(body.model, caps=False), camera, _SAMPLES)
    u, v = seen.pixels[:, U] - box[2], seen.pixels[:, V] - box[0]
    shown = (u > 0) & (u < box[3] - box[2] - 1) & (v > 0) & (v < box[1] - box[0] - 1)
    outline = seen.info[:, CLASS] == OUTER
    for which, color in ((~outline, _WITHIN), (outline, _OUTLINE)):
        ax.plot(u[shown & which], v[shown & which], ".", color=color, ms=2.2, mew=0.0)


def _box(shots: Sequence[Shot]) -> tuple[int, int, int, int]:
    """Rows and columns (top, bottom, left, right) that hold the body of all ``shots``, of cameras of one size."""
    anywhere = np.zeros(shots[0].bgr.shape[:2], dtype=bool)
    for shot in shots:
        for body in (shot.before, shot.found):
            seen = render_labels(body, shot.camera, 0)
            if seen is not None:
                (u0, v0, u1, v1), labels = seen
                anywhere[v0:v1, u0:u1] |= labels > 0
    return body_box(anywhere, _MARGIN_PX)


def _cut(image: np.ndarray, box: tuple[int, int, int, int]) -> np.ndarray:
    return image[box[0] : box[1], box[2] : box[3]]


def _show(ax: Axes, image: np.ndarray, box: tuple[int, int, int, int]) -> None:
    """Part of a BGR image, or of a mask (white on black)."""
    piece = _cut(image, box)
    if piece.ndim == 3:
        ax.imshow(piece[:, :, ::-1], interpolation="lanczos")
    else:
        ax.imshow(piece, cmap="gray", vmin=0, vmax=1, interpolation="antialiased")


def _panels(n_rows: int, n_columns: int, box: tuple[int, int, int, int]) -> tuple[Figure, np.ndarray]:
    """Empty panels (n_rows, n_columns) of the shape of ``box``, without ticks."""
    width = min(2.6, 11.0 / n_columns)
    height = width * (box[1] - box[0]) / (box[3] - box[2])
    figure = Figure(figsize=(n_columns * width + 0.4, n_rows * height + 0.3), layout="constrained")
    axes = figure.subplots(n_rows, n_columns, squeeze=False)
    for ax in axes.ravel():
        ax.set_xticks([])
        ax.set_yticks([])
    return figure, axes


@dataclass(frozen=True, eq=False)
class RowFigure:
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


def row_figure(of_row: RowFigure) -> Figure:
    """Fig. 3: edges and silhouette of one part; for each kind of distance, that along the row, and the error of the part moved
    along it."""
    figure = Figure(figsize=(12.0, 3.5), layout="constrained")
    axes = figure.subplots(1, 5, width_ratios=(0.8, 0.8, 1.5, 1.5, 1.5))
    top, bottom, left, right = body_box(of_row.silhouette, _ROW_MARGIN_PX)
    for ax, image, title in zip(axes, (of_row.edges, of_row.silhouette), ("edges", "silhouette"), strict=False):
        ax.imshow(image[top:bottom, left:right], cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        ax.axhline(of_row.row - top, color=RED, lw=1.0)
        ax.set_title(title, fontsize=10)
        ax.set_xticks([])
        ax.set_yticks([])
    reach = max(float(np.abs(of[key].changes).max()) for of in of_row.errors.values() for key in of)
    columns = np.arange(of_row.silhouette.shape[1]) - of_row.middle
    for ax, key in zip(axes[2:], PUBLISHED, strict=True):
        ax.plot(columns, of_row.distances[key], color=BLUE, lw=1.0, label="distance of a pixel of the row")
        for (title, errors), line in zip(of_row.errors.items(), ("-", "--"), strict=False):
            ax.plot(errors[key].changes, errors[key].scores, line, color=RED, lw=2.0, label=f"error of {title}")
        plain_axes(ax, TITLES[key].partition(" (")[0], "from the part's middle [px]")
        ax.set_xlim(-reach, reach)
    highest = 1.05 * max(float(np.nanmax(of[key].scores)) for of in of_row.errors.values() for key in of)
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
        ax.axvline(0.0, color=GRAY, lw=0.7, ls=":")
        name, _, unit = title.partition(" [")
        plain_axes(ax, name, f"from the truth [{unit}")
        ax.set_ylim(bottom=0.0)
    axes[0].set_ylabel("rms distance of contours [px]", fontsize=9)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def tracking_figure(panels: Mapping[str, tuple[np.ndarray, Mapping[str, np.ndarray]]]) -> Figure:
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


def evidence_figures(folder: Path, clip: Clip, run: TrackedClip) -> list[PageSection]:
    """Figs 4 and 5, of the image set in the middle of the clip.

    Parameters
    ----------
    folder : of the results.
    clip : the recording.
    run : its estimates.

    Returns
    -------
    Sections of the report.
    """
    middle = len(run.estimates) // 2
    (image_set,) = clip.sets_at([middle])
    shots = [shot for camera in clip.rig if (shot := _shot(clip, run, camera, middle, image_set)) is not None]
    if not shots:
        return []
    evidence, cameras = folder / "fig4_evidence.png", folder / "fig5_cameras.png"
    save(_evidence_figure(shots[0]), evidence)
    save(_cameras_figure(shots), cameras)
    return [
        PageSection("What is made of an image (Fig. 4)", f"{clip.name}, camera {shots[0].camera.name}.", image=evidence),
        PageSection(
            "Contours in all cameras (Fig. 5)", f"{clip.name}; outline yellow, contours within it orange.", image=cameras
        ),
    ]


def sequence_figures(folder: Path, clip: Clip, run: TrackedClip) -> list[PageSection]:
    """Fig. 6, of time steps over the whole clip, in its first camera.

    Parameters
    ----------
    folder : of the results.
    clip : the recording.
    run : its estimates.

    Returns
    -------
    Sections of the report.
    """
    n, camera = len(run.estimates), clip.rig.cameras[0]
    numbers = sorted({round(i) for i in np.linspace(n / (2 * _TIME_STEPS), n - 1, _TIME_STEPS)})
    shots, titles = _sequence(clip, run, camera, numbers)
    if not shots:
        return []
    path = folder / f"fig6_{clip.name}.png"
    save(sequence_figure(shots, titles), path)
    text = f"{clip.name}, camera {camera.name}, by {TITLES[DRAWN]}: contours of the pose before, what was seen, the pose."
    return [PageSection("A sequence (Fig. 6)", text, image=path)]


def _sequence(clip: Clip, run: TrackedClip, camera: Camera, numbers: Sequence[int]) -> tuple[list[Shot], list[str]]:
    shots, titles = [], []
    for number, image_set in zip(numbers, clip.sets_at(numbers), strict=True):
        shot = _shot(clip, run, camera, number, image_set)
        if shot is not None:
            shots.append(shot)
            titles.append(f"image {number + 1}")
    return shots, titles


def _shot(clip: Clip, run: TrackedClip, camera: Camera, number: int, image_set: ImageSet) -> Shot | None:
    image, known = image_set.get(camera.name), clip.backgrounds.get(camera.name)
    if image is None or known is None:
        return None
    before, found = (Configuration(clip.model, run.estimates[i].state) for i in (max(number - 1, 0), number))
    config = by_method(clip.config, DRAWN)
    return shoot(camera, image.bgr, before, found, known, config, config.chamfer.margin_px)
