"""What may hide the body: fixed things, rendered once, and other bodies, rendered for each image set; read pixel by pixel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..camera.model import CameraModel
from ..camera.rig import Camera, CameraRig
from ..compiled.kernels import compiled
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, Neighbor, State
from ..parallel import serial
from .contour.samples import DEPTH, NU, NV, U, V
from .raycast.raycaster import render_labels, render_view, render_where_seen
from .renderer import Region, RenderedView
from .shape_arrays import MadeOnce

NOTHING = np.empty((0, 0), dtype=np.float32)
SAYS_NOTHING = 255  # label of a pixel in which another body stands before this one, or may
PackedNeighbors = tuple[np.ndarray, np.ndarray]
"""(h, w) uint8 of the image: 1 + color class of the other body that is seen there behind this one, 0 without, or `SAYS_NOTHING`;
and (n_classes, n_colors) float32 densities of those classes. Of size zero where there are no others."""
NO_NEIGHBORS: PackedNeighbors = np.zeros((0, 0), np.uint8), np.zeros((0, 0), np.float32)
_TOUCH_M = 0.01  # what comes in less than this before the body does not hide it: feet stand on floors, hands lie on tables
_AROUND_PX, _RIM_PX = 15, 3


@dataclass(frozen=True, eq=False)
class BodyRegion:
    """Where a body is in an image.

    Attributes
    ----------
    region : (u0, v0, u1, v1).
    labels : (h, w) uint8 on the region, as of `RenderedView`; 0 also where the body is hidden.
    occlusion : (h, w) bool, mask: pixels of what hides the body, of other bodies, and of their borders; None: nothing hides it.
    every : so many pixels a side have one label.
    others : (h, w) bool, mask: pixels of other bodies, before or behind it, and of their borders; None without any.
    """

    region: Region
    labels: np.ndarray
    occlusion: np.ndarray | None = None
    every: int = 1
    others: np.ndarray | None = None


class Occluders:
    """What stands about in every camera.

    Parameters
    ----------
    scene : fixed shapes, the root at the world's origin and joints neutral; None: nothing is in the way.
    rig : cameras that do not move.
    parallel : maps a function over cameras.

    Attributes
    ----------
    depths : per camera (h, w) float32 meters along the optical axis, infinite where nothing is; (0, 0) without anything.
    neighbors : per camera, the other bodies, for kernels.
    others : these bodies.
    """

    def __init__(self, scene: ArticulatedModel | None, rig: CameraRig, parallel: Callable[[Callable, list], list] = serial):
        self._rig, self._parallel = rig, parallel
        self._fixed: list[np.ndarray] = [NOTHING] * len(rig)
        if scene is not None:
            configuration = Configuration(scene, State.neutral(scene))
            self._fixed = [render_view(configuration, camera).depth for camera in rig]
        self.depths, self.neighbors = list(self._fixed), [NO_NEIGHBORS] * len(rig)
        self.others: Sequence[Neighbor] = ()
        self._boxes: list[Region] = [(0, 0, 0, 0)] * len(rig)  # where the neighbors are, as last drawn
        self._drawn: list[tuple[np.ndarray, np.ndarray] | None] = [None] * len(rig)
        self._small: dict[tuple[int, int], tuple[CameraModel, CameraModel]] = {}

    def show(self, neighbors: Sequence[Neighbor], own: Neighbor | None) -> None:
        """Have other bodies stand about, in place of those before; who holds ``depths`` and ``neighbors`` sees them.

        Parameters
        ----------
        neighbors : where they are expected.
        own : where this body is expected; None: it is not known.
        """

        if not neighbors and not self.others:
            return
        self.others = neighbors

        def show(i: int) -> None:
            views = [(neighbor, _seen(neighbor, i, self._rig.cameras[i])) for neighbor in neighbors]
            drawn = [(neighbor, view) for neighbor, view in views if view is not None]
            if drawn:
                self._draw(i, self._rig.cameras[i], drawn, own)
            else:
                self.depths[i], self.neighbors[i] = self._fixed[i], NO_NEIGHBORS

        self._parallel(show, list(range(len(self._rig))))

    def _draw(self, i: int, camera: Camera, drawn: list[tuple[Neighbor, RenderedView]], own: Neighbor | None) -> None:
        fixed, colors = self._fixed[i], list[np.ndarray]()
        labels, depth = self._cleared(i, camera.model)
        for neighbor, view in drawn:
            known, table = neighbor.colors[i], np.full(256, SAYS_NOTHING, np.uint8)
            if known is not None:
                table[1 : len(neighbor.classes) + 1] = 1 + sum(map(len, colors)) + neighbor.classes
                colors.append(known)
            _add(view.labels, view.depth, table, labels[_on(view.region)], depth[_on(view.region)])
        root, near = np.inf, None
        if own is not None:
            root, near = float((camera.T_cam_world @ own.body.state.T_world_root[:, 3])[2]), _seen(own, i, camera)
        # The body is not exactly where it is expected: about it as near as it is close by
        around = _NOWHERE if near is None else cv2.erode(near.depth, np.ones((2 * _AROUND_PX + 1,) * 2, np.uint8))
        corner = (0, 0) if near is None else near.region[:2]
        for _, view in drawn:
            _hush(view.region, around, corner, np.float32(root), labels, depth)
        if fixed.size:
            labels[fixed < depth] = 0
        corners = np.array([view.region for _, view in drawn])
        self._boxes[i] = (*corners[:, :2].min(axis=0).tolist(), *corners[:, 2:].max(axis=0).tolist())
        self._drawn[i] = labels, depth
        self.depths[i] = np.minimum(depth, fixed) if fixed.size else depth
        self.neighbors[i] = labels, np.concatenate(colors) if colors else NO_NEIGHBORS[1]

    def _cleared(self, i: int, lens: CameraModel) -> tuple[np.ndarray, np.ndarray]:
        """Labels and depth of nobody: those of the last image set, since to fill large images takes as long as to draw bodies."""
        drawn = self._drawn[i]
        if drawn is None:
            size = lens.height, lens.width
            return np.zeros(size, np.uint8), np.full(size, np.inf, np.float32)
        labels, depth = drawn
        labels[_on(self._boxes[i])], depth[_on(self._boxes[i])] = 0, np.inf
        return labels, depth

    def look(
        self, index: int, configuration: Configuration, camera: Camera, margin_px: int = 0, every: int = 1
    ) -> BodyRegion | None:
        """Where the body is in one camera.

        Parameters
        ----------
        index : of the camera in the rig.
        configuration : the posed body.
        camera : that camera.
        margin_px : how far around the body the region reaches.
        every : pixels a side that have one label: of a large image it is drawn in a fraction of the time.

        Returns
        -------
        The region, its labels and what is hidden; None when no part of the body is in the image.
        """
        if every > 1:
            camera = replace(camera, model=self._shrunk(index, camera.model, every))
        found = render_labels(configuration, camera, -(-margin_px // every))
        if found is None:
            return None
        (u0, v0, u1, v1), labels = found
        region, depth = (u0 * every, v0 * every, u1 * every, v1 * every), self.depths[index]
        if not depth.size:
            return BodyRegion(region, labels, every=every)
        cover = depth[every // 2 :: every, every // 2 :: every][v0:v1, u0:u1]
        body = render_view(configuration, camera, found[0]).depth
        hidden, rim = (labels > 0) & (cover < body - _TOUCH_M), -(-_RIM_PX // every)
        others = None
        if self.neighbors[index][0].size:
            others = _grown(self.neighbors[index][0][every // 2 :: every, every // 2 :: every][v0:v1, u0:u1] > 0, rim)
        if not hidden.any():
            return BodyRegion(region, labels, others, every, others)
        labels[hidden] = 0
        # The body is not exactly where it is expected: around what is hidden, whatever stands before it may hide it
        near = _grown(hidden, -(-_AROUND_PX // every)) & (cover < body[hidden].max())
        occlusion = _grown(near, rim)
        return BodyRegion(region, labels, occlusion if others is None else occlusion | others, every, others)

    def with_neighbors(self, index: int, body: BodyRegion) -> BodyRegion:
        """Where everybody is in one camera.

        Parameters
        ----------
        index : of the camera in the rig.
        body : of `look`.

        Returns
        -------
        The region around all bodies, with labels that are not zero wherever one of them is.
        """
        shown, box, every = self.neighbors[index][0], self._boxes[index], body.every
        if not shown.size:
            return body
        u0, v0, u1, v1 = (corner // every for corner in body.region)
        first = min(u0, box[0] // every), min(v0, box[1] // every)
        last = (max(u1, min(-(-box[2] // every), shown.shape[1] // every)),
                max(v1, min(-(-box[3] // every), shown.shape[0] // every)))  # fmt: skip
        labels = shown[every // 2 :: every, every // 2 :: every][first[1] : last[1], first[0] : last[0]].copy()
        labels[v0 - first[1] : v1 - first[1], u0 - first[0] : u1 - first[0]] |= body.labels
        region = first[0] * every, first[1] * every, last[0] * every, last[1] * every
        return BodyRegion(region, labels, every=every)

    def _shrunk(self, index: int, lens: CameraModel, every: int) -> CameraModel:
        """A lens of every ``every``-th pixel of another one, from the middle of the first so many on."""
        known = self._small.get((index, every))
        if known is None or known[0] is not lens:
            shift = -(every // 2) / every
            to_small = np.array([[1.0 / every, 0.0, shift], [0.0, 1.0 / every, shift]])
            known = self._small[index, every] = lens, lens.mapped(to_small, lens.width // every, lens.height // every)
        return known[1]


def _on(region: Region) -> tuple[slice, slice]:
    return slice(region[1], region[3]), slice(region[0], region[2])


_NOWHERE = np.full((1, 1), np.inf, np.float32)


def _no_views(neighbor: Neighbor) -> dict[int, RenderedView | None]:
    return {}


_views: Callable[[Neighbor], dict[int, RenderedView | None]] = MadeOnce(_no_views)


def _seen(neighbor: Neighbor, index: int, camera: Camera) -> RenderedView | None:
    """Where a body is seen, drawn once for all who ask."""
    views = _views(neighbor)
    if index not in views:
        views[index] = render_where_seen(neighbor.body, camera)
    return views[index]


@compiled
def _add(their_labels, their_depth, table, labels, depth):
    """Put a body into labels and depth (h, w), where it is nearer; ``table`` (256,) says what its labels become."""
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            if their_depth[i, j] < depth[i, j]:
                depth[i, j], labels[i, j] = their_depth[i, j], table[their_labels[i, j]]


@compiled
def _hush(region, around, corner, root, labels, depth):
    """Say `SAYS_NOTHING` in a region where others stand before the body.

    That is at the depth of ``around`` (h, w), whose first pixel is at ``corner`` (u, v), where that is finite; at ``root``
    elsewhere.
    """
    for v in range(region[1], region[3]):
        for u in range(region[0], region[2]):
            if labels[v, u] == 0:
                continue
            i, j, own = v - corner[1], u - corner[0], root
            if 0 <= i < around.shape[0] and 0 <= j < around.shape[1] and around[i, j] < np.inf:
                own = around[i, j]
            if depth[v, u] < own - np.float32(_TOUCH_M):
                labels[v, u] = SAYS_NOTHING


def _grown(mask: np.ndarray, by_px: int) -> np.ndarray:
    return cv2.dilate(mask.view(np.uint8), np.ones((2 * by_px + 1,) * 2, dtype=np.uint8)) > 0


@compiled
def _is_covered(depth, u, v, nu, nv, body_depth, reach_px):
    """Whether something stands before a contour sample at (u, v), or ``reach_px`` to either side of it along its normal."""
    for side in range(-1, 2):
        column, row = int(np.floor(u + side * reach_px * nu + 0.5)), int(np.floor(v + side * reach_px * nv + 0.5))
        if 0 <= row < depth.shape[0] and 0 <= column < depth.shape[1] and depth[row, column] < body_depth - _TOUCH_M:
            return True
    return False


@compiled
def drop_covered(depth, rows, pixels, info, n, reach_px):
    """Take out the contour samples that something stands before.

    Parameters
    ----------
    depth : (h, w) of `Occluders`, meters.
    rows, pixels, info : of `collect_samples`, changed in place.
    n : how many of them are in use.
    reach_px : how far to both sides of a sample, along its normal, nothing may stand before the body.

    Returns
    -------
    int : how many are left.
    """
    left = 0
    for j in range(n):
        pixel = pixels[j]
        if _is_covered(depth, pixel[U], pixel[V], pixel[NU], pixel[NV], pixel[DEPTH], reach_px):
            continue
        if left < j:
            rows[left] = rows[j]
            pixels[left] = pixels[j]
            info[left] = info[j]
        left += 1
    return left
