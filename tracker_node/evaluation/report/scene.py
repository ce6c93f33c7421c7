"""The bodies of runs in space, over time, with the cameras that saw them and the truth where it is known."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone
from ...render.palette import BLACK, CYCLE, SIDES, color_name
from ...report.document import Moving, Scene
from ...tracking.estimate import Status
from ..review import Review
from .charts import STATUS_COLORS

MOST_FRAMES = 400  # of a longer run every n-th set is shown
_CAMERA_M = 0.25  # how large cameras are drawn, at most a quarter of the way to the body
_MIDDLE = "#b4bdc4"


def scene(reviews: Sequence[Review]) -> Scene | None:
    """What the page plays first; None where no run has a state.

    Parameters
    ----------
    reviews : the first run says when, and has its parts in colors of left and right; others have one color each.

    Returns
    -------
    All runs at the sets of the first one, or of another at the same time.
    """
    first = reviews[0]
    if not any(review.run.has_state.any() for review in reviews) or not len(first.run):
        return None
    sets = np.arange(0, len(first.run), -(-len(first.run) // MOST_FRAMES))
    times = first.times_s[sets]
    bodies: list[Moving] = []
    for i, review in enumerate(reviews):
        chosen = _nearest(review.times_s, times, review.period_s)
        colors = None if len(reviews) == 1 else CYCLE[i % len(CYCLE)]
        bodies.append(_moving(review, chosen, colors))
    truth = first.joints
    if truth is not None:
        points = truth.truth_m[sets].copy()
        points[~truth.raw.valid[sets]] = np.nan
        bodies.append(Moving("truth", points, dots=[(k, BLACK) for k in range(points.shape[1])]))
    said = [Status(int(first.run.status[k])) for k in sets]
    states = [(status.name.lower(), STATUS_COLORS[status]) for status in said]
    note = "The tracked body, and where the cameras stand. Left limbs are blue, right limbs orange."
    if len(reviews) > 1:
        note = "Each run in a color: " + ", ".join(f"{r.name} {color_name(CYCLE[i % len(CYCLE)])}" for i, r in enumerate(reviews))
        note += f"; the status is that of {first.name}."
    if truth is not None:
        note += " Black dots are the joints of the truth."
    return Scene("view", "The motion", note, times, bodies, states, _cameras(first.rig, bodies))


def _nearest(times: np.ndarray, wanted: np.ndarray, period_s: float) -> np.ndarray:
    """Number of the set at each of the wanted times; -1 where none is within half a period."""
    after = np.clip(np.searchsorted(times, wanted), 0, len(times) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(times[before] - wanted) < np.abs(times[after] - wanted), before, after)
    return np.where(np.abs(times[nearest] - wanted) <= 0.51 * period_s, nearest, -1)


def _moving(review: Review, sets: np.ndarray, color: str | None) -> Moving:
    """A run's body at some of its sets, -1 for none."""
    model = review.model
    of_shape: list[tuple[int, np.ndarray]] = []
    rods: list[tuple[int, int, float, float, str]] = []
    wires: list[tuple[int, int, str]] = []
    for k, shape in enumerate(model.shapes):
        ends, radii, edges = _drawn(shape.primitive)
        at = sum(len(points) for _, points in of_shape)
        own = color or _color_of(model, k)
        rods += [(at, at + 1, radii[0], radii[1], own)] if radii else []
        wires += [(at + a, at + b, own) for a, b in edges]
        of_shape.append((k, ends))
    points = np.full((len(sets), sum(len(ends) for _, ends in of_shape), 3), np.nan)
    for i, number in enumerate(sets):
        if number >= 0 and review.run.has_state[number]:
            Ts = review.run.configuration(model, int(number)).Ts_world_shape
            points[i] = np.concatenate([ends @ Ts[k, :3, :3].T + Ts[k, :3, 3] for k, ends in of_shape])
    return Moving(review.name, points, rods, wires)


def _color_of(model: ArticulatedModel, shape: int) -> str:
    """As overlays have it: left blue, right orange."""
    link = model.shapes[shape].link
    return next((color for side, color in SIDES.items() if link.startswith(side)), _MIDDLE)


def _drawn(primitive: TruncatedCone | Ellipsoid | Box | Mesh) -> tuple[np.ndarray, tuple[float, ...], list[tuple[int, int]]]:
    """Points in the shape's frame; radii at the first two where it is drawn as a rod; pairs of points where as wires."""
    if isinstance(primitive, TruncatedCone):
        width = 0.5 * (primitive.a + primitive.b)
        ends = np.array([[0.0, 0.0, primitive.z1], [0.0, 0.0, primitive.z2]])
        return ends, tuple(width * (1.0 + primitive.k * z) for z in ends[:, 2]), []
    if isinstance(primitive, Ellipsoid):
        radii = np.array(primitive.radii)
        long, width = int(radii.argmax()), float(np.sort(radii)[:2].mean())
        ends = np.zeros((2, 3))
        ends[:, long] = (-(radii[long] - width), radii[long] - width)
        return ends, (width, width), []
    low, high = _box_of(primitive)
    corners = np.array(list(product(*zip(low, high, strict=True))))
    edges = [(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1]
    return corners, (), edges


def _box_of(primitive: Box | Mesh) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(primitive, Box):
        half = 0.5 * np.array(primitive.size)
        return -half, half
    return primitive.vertices.min(axis=0), primitive.vertices.max(axis=0)


def _cameras(rig: CameraRig | None, bodies: Sequence[Moving]) -> dict[str, np.ndarray]:
    """Centers of the cameras, and corners of their images before them."""
    if rig is None:
        return {}
    middle = np.nanmean(np.concatenate([body.points.reshape(-1, 3) for body in bodies]), axis=0)
    found = {}
    for camera in rig:
        lens = camera.model
        corners = np.array([[0.0, 0.0], [lens.width - 1.0, 0.0], [lens.width - 1.0, lens.height - 1.0], [0.0, lens.height - 1.0]])
        rays = (corners - lens.K[:2, 2]) / np.diag(lens.K)[:2]
        depth = min(_CAMERA_M, 0.25 * float(np.linalg.norm(camera.center - middle)))
        before = depth * np.column_stack([rays, np.ones(4)]) @ camera.T_world_cam[:3, :3].T + camera.center
        found[camera.name] = np.vstack([camera.center, before])
    return found
