"""Pictures of a body's contours over images, like Figs 4 to 6 of Knossow, Ronfard, Horaud & Devernay. Images are BGR uint8."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...camera.rig import Camera
from ...model.configuration import Configuration
from ...objective.visible_samples import samples_seen
from ...observation.chamfer.observer import Observer
from ...render.contour.samples import CLASS, OUTER, U, V
from ...render.overlay import draw_overlay
from ...render.raycast.raycaster import render_labels
from ...render.shape_arrays import ShapeArrays
from ...report.document import ORANGE
from ...tracking.config import TrackerConfig
from ..plots import body_box

_SAMPLES = 40  # on a generator line
_OUTLINE, _WITHIN = "#ffe14d", ORANGE
_MARGIN_PX = 24
_CAMERAS_IN_ROW = 3


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
    camera: Camera, bgr: np.ndarray, before: Configuration, found: Configuration, plate: np.ndarray | list,
    config: TrackerConfig, margin_px: int,
) -> Shot | None:  # fmt: skip
    """Look at an image as the tracker does, up to ``margin_px`` around where the body was in the image ``before``;
    None where it was out of the image. What body and scene look like is learnt in the very image."""
    seen = render_labels(before, camera, margin_px)
    if seen is None:
        return None
    observer = Observer(camera.name, (camera.model.width, camera.model.height), config.chamfer, config.background, plate)
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


def evidence_figure(shot: Shot) -> Figure:
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


def cameras_figure(shots: Sequence[Shot]) -> Figure:
    """One instant in several cameras (Fig. 5), with the contours of the body where it was found."""
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
    """A sequence in one camera (Fig. 6): contours predicted from the pose before, silhouettes, edges within them, poses."""
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
