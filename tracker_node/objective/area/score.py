"""Poses of a body scored by the area that they cover: many poses at a time, on small images.

Meshes count as their bounding boxes, cameras as exposing together, what stands before the body as not there: this is for finding
where a body or limb is, not for how exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...camera.rig import Camera
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.shapes.primitives import Box, Mesh
from ...parallel import Workers
from ...render.raycast.coefficients import BOX, N_COEFFICIENTS
from ...render.shape_arrays import CONE, ELLIPSOID, ShapeArrays, ray_table
from ..color.drawing import LABEL_BITS, LANES, N_SURFACE
from ..color.views import ColorViews
from .kernels import draw_rest, place_shapes, score_poses

_FEW = 4  # poses a thread; of fewer, threads share the cameras
_LITTLE = 100  # shapes to draw in all cameras and poses, below which one thread is as quick


class AreaScore:
    """Sums of maps under a posed body, or under a part of it.

    Parameters
    ----------
    model : the body.
    cameras : as large as the maps are.
    workers : threads that share poses or cameras.
    """

    def __init__(self, model: ArticulatedModel, cameras: Sequence[Camera], workers: Workers | None = None):
        if len(model.shapes) >= LABEL_BITS:
            raise ValueError(f"expected fewer than {LABEL_BITS} shapes, got {len(model.shapes)}")
        self.model, self.cameras, self._workers = model, tuple(cameras), workers or Workers(1)
        self._views = ColorViews(self.cameras)
        self._tables = [ray_table(camera.model) for camera in self.cameras]
        self._Ts_cam_world = [np.ascontiguousarray(camera.T_cam_world) for camera in self.cameras]
        self._shapes = _Shapes.of(model)
        self._map_of_shape = np.zeros(len(model.shapes), dtype=np.int64)
        self._maps: list[np.ndarray | None] = [None] * len(self.cameras)
        largest = max(((c.model.width // LANES + 2) * LANES * c.model.height for c in self.cameras), default=0)
        tallest = max((c.model.height for c in self.cameras), default=0)
        self._work = [_Work.of(len(model.shapes), tallest, largest) for _ in range(self._workers.threads)]

    def set_maps(self, maps: Sequence[np.ndarray | None], map_of_shape: np.ndarray | None = None) -> None:
        """Take the maps of an image set.

        Parameters
        ----------
        maps : log-odds (h, w), or (n_maps, h, w), of each camera; None for a camera without.
        map_of_shape : (n_shapes,) which of them a shape reads; None: there is one.
        """
        self._maps = [None if m is None else np.ascontiguousarray(m if m.ndim == 3 else m[None], dtype=np.float32) for m in maps]
        n = len(self.model.shapes)
        self._map_of_shape = np.zeros(n, dtype=np.int64) if map_of_shape is None else np.asarray(map_of_shape, dtype=np.int64)

    def totals(self, roots: np.ndarray, joints: np.ndarray, shapes: np.ndarray | None = None) -> np.ndarray:
        """What poses gain.

        Parameters
        ----------
        roots, joints : (n, 4, 4) and (n, n_axes) of the poses, n > 0.
        shapes : (n_shapes,) mask of the parts that count, against not being there; the rest of the body is where the first pose
            has it. None: all.

        Returns
        -------
        (n, n_cameras, 2): sums of the maps, and pixels in which the parts show; zeros for cameras without maps.
        """
        if shapes is not None and not shapes.all():
            return self.totals_beside(self.hold(roots[0], joints[0], shapes), roots, joints)
        moving = self._shapes.part(self._placed(roots, joints), self._map_of_shape)
        return self._totals(moving, [None] * len(self.cameras))

    def hold(self, root: np.ndarray, joints: np.ndarray, shapes: np.ndarray) -> HeldParts:
        """Draw what stays of a body while some of its parts are tried in many poses.

        Parameters
        ----------
        root, joints : (4, 4) and (n_axes,) of the pose.
        shapes : (n_shapes,) mask of the parts that move, not all.

        Returns
        -------
        held : until other maps are set.
        """
        placed = self._placed(root[None], joints[None])
        still = self._shapes.some(~shapes).part(np.ascontiguousarray(placed[:, ~shapes]), self._map_of_shape[~shapes])

        def drawn(i: int) -> _Rest:
            lens, given, stride = self.cameras[i].model, *self._given(i)
            rest, gains = np.zeros(stride * lens.height, dtype=np.int32), np.empty((lens.height, lens.width), dtype=np.float32)
            n = still.placed.shape[1]
            arrays = _Work.arrays_for(n, lens.height)
            draw_rest(still.packed, still.smooth, still.placed[0], *given, still.maps, arrays, stride, rest, gains)
            return _Rest(rest, gains, rest.copy())

        rests: list[_Rest | None] = [None] * len(self.cameras)
        seen = [i for i, maps in enumerate(self._maps) if maps is not None]
        for i, rest in zip(seen, self._workers.map(drawn, seen), strict=True):
            rests[i] = rest
        return HeldParts(shapes, self._shapes.some(shapes), tuple(rests))

    def totals_beside(self, held: HeldParts, roots: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """What poses of the parts that move gain, against not being there.

        Parameters
        ----------
        held : of `hold`.
        roots, joints : (n, 4, 4) and (n, n_axes) of the poses, n > 0.

        Returns
        -------
        (n, n_cameras, 2): as of `totals`.
        """
        placed = np.ascontiguousarray(self._placed(roots, joints)[:, held.shapes])
        return self._totals(held.moving.part(placed, self._map_of_shape[held.shapes]), held.rests)

    def _placed(self, roots: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """(n, n_shapes, 4, 4) of all shapes."""
        chain, own = self.model.chain, self._shapes
        placed = np.empty((len(roots), len(own.kinds), 4, 4))
        packed = (chain.parents, chain.offsets, chain.axis_start, chain.axis_count, chain.directions)
        place_shapes(packed, own.links, own.places, np.ascontiguousarray(roots), np.ascontiguousarray(joints), placed)
        return placed

    def _totals(self, moving: _Part, rests: Sequence[_Rest | None]) -> np.ndarray:
        """(n, n_cameras, 2) of the parts that move beside what is drawn already."""
        n_poses = len(moving.placed)
        totals = np.zeros((len(self.cameras), n_poses, 2))
        seen = [i for i, maps in enumerate(self._maps) if maps is not None]
        n = self._workers.threads if n_poses * len(seen) * len(moving.maps) >= _LITTLE else 1
        if n_poses >= _FEW * n:
            parts = [(slice(n_poses * k // n, n_poses * (k + 1) // n), seen) for k in range(n)]
        else:
            parts = [(slice(None), seen[k::n]) for k in range(n)]

        def run(k: int) -> None:
            poses, cameras = parts[k]
            for i in cameras:
                alone = n == 1 or cameras is not seen
                self._score(i, moving, moving.placed[poses], rests[i], self._work[k], totals[i, poses], alone)

        self._workers.map(run, [k for k, (_, cameras) in enumerate(parts) if cameras])
        return np.swapaxes(totals, 0, 1)

    def _given(self, i: int) -> tuple[tuple, int]:
        """What kernels take of a camera, and the stride of what they draw on."""
        table, views, lens = self._tables[i], self._views, self.cameras[i].model
        camera = (views.params[i], views.limits[i], self._Ts_cam_world[i])
        return (camera, views.views[i], views.rays, (table.xs, table.ys), self._maps[i]), (lens.width // LANES + 2) * LANES

    def _score(
        self, i: int, moving: _Part, poses: np.ndarray, held: _Rest | None, work: _Work, totals: np.ndarray, alone: bool
    ) -> None:  # fmt: skip
        """One camera: ``poses`` (n, n_moving, 4, 4) of the parts that move. ``alone``: no other thread draws in it."""
        lens, given, stride = self.cameras[i].model, *self._given(i)
        size, shape = stride * lens.height, (lens.height, lens.width)
        buffer, rest, gains = work.buffer[:size], work.nothing[:size], work.no_gains[: lens.height * lens.width].reshape(shape)
        if held is not None:
            rest, gains = held.rest, held.gains
            if alone:
                buffer = held.buffer
            else:
                buffer[:] = rest
        arrays = work.arrays_of(poses.shape[1])
        score_poses(moving.packed, moving.smooth, poses, *given, moving.maps, arrays, stride, rest, gains, buffer, totals)
        if held is not None and not alone:
            buffer[:] = 0

    def scores(self, roots: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """Sums over all cameras.

        Parameters
        ----------
        roots, joints : (n, 4, 4) and (n, n_axes) of the poses.

        Returns
        -------
        (n,)
        """
        return self.totals(roots, joints)[:, :, 0].sum(axis=1)


@dataclass(frozen=True, eq=False)
class _Rest:
    """What stays, in one camera: `draw_rest`'s ``rest`` and ``gains``, and a copy of the former to draw over."""

    rest: np.ndarray
    gains: np.ndarray
    buffer: np.ndarray


@dataclass(frozen=True, eq=False)
class HeldParts:
    """Parts of a body that stay where they are, drawn once.

    Attributes
    ----------
    shapes, moving : (n_shapes,) mask of the others, and these.
    rests : what is drawn, by camera; None: it has no maps.
    """

    shapes: np.ndarray
    moving: _Shapes
    rests: tuple[_Rest | None, ...]

    @cached_property
    def totals(self) -> np.ndarray:
        """(n_cameras, 2): what they gain alone, and pixels in which they show."""
        found = [(0.0, 0) if r is None else (r.gains.sum(dtype=np.float64), np.count_nonzero(r.rest)) for r in self.rests]
        return np.array(found, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Part:
    """Some shapes: as kernels take them, whether vector instructions can draw all of them, poses (n, n_shapes, 4, 4), maps."""

    packed: tuple[np.ndarray, ...]
    smooth: bool
    placed: np.ndarray
    maps: np.ndarray


@dataclass(frozen=True, eq=False)
class _Shapes:
    """Shapes as kernels draw them."""

    kinds: np.ndarray
    dims: np.ndarray
    links: np.ndarray
    places: np.ndarray

    @classmethod
    def of(cls, model: ArticulatedModel) -> _Shapes:
        arrays = ShapeArrays.from_model(model)
        kinds, dims, places = arrays.kinds.copy(), arrays.dims.copy(), model.Ts_link_shape.copy()
        for i, shape in enumerate(model.shapes):
            primitive = shape.primitive
            if isinstance(primitive, Box):
                kinds[i], dims[i, :3] = BOX, primitive.size
            elif isinstance(primitive, Mesh):
                low, high = primitive.vertices.min(axis=0), primitive.vertices.max(axis=0)
                kinds[i], dims[i, :3] = BOX, np.maximum(high - low, 1e-6)
                places[i] = places[i] @ se3.from_rotation_translation(np.eye(3), 0.5 * (low + high))
        return cls(kinds, dims, arrays.links, places)

    def some(self, mask: np.ndarray) -> _Shapes:
        return _Shapes(self.kinds[mask], self.dims[mask], self.links[mask], self.places[mask])

    def part(self, placed: np.ndarray, map_of_shape: np.ndarray) -> _Part:
        return _Part(self.packed, self.smooth, placed, map_of_shape)

    @cached_property
    def smooth(self) -> bool:
        """Whether vector instructions can draw all of them."""
        return bool(np.isin(self.kinds, (CONE, ELLIPSOID)).all())

    @cached_property
    def packed(self) -> tuple[np.ndarray, ...]:
        """Kinds, dims, colors for the kernels that shade, and which are used."""
        n = len(self.kinds)
        return self.kinds, self.dims, np.zeros((n, 3)), np.ones(n, dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class _Work:
    """Work space of one thread; all zero between calls."""

    arrays: tuple[np.ndarray, ...]
    nothing: np.ndarray
    buffer: np.ndarray
    no_gains: np.ndarray

    @classmethod
    def of(cls, n_shapes: int, height: int, size: int) -> _Work:
        nothing, buffer = np.zeros((2, size), dtype=np.int32)
        return cls(cls.arrays_for(n_shapes, height), nothing, buffer, np.zeros(size, dtype=np.float32))

    @staticmethod
    def arrays_for(n_shapes: int, height: int) -> tuple[np.ndarray, ...]:
        """For as many shapes in images of one height."""
        return (
            np.zeros((n_shapes, N_COEFFICIENTS), dtype=np.float32), np.zeros((n_shapes, N_SURFACE), dtype=np.float32),
            np.zeros((n_shapes, 4), dtype=np.int64), np.zeros((n_shapes, height, 2), dtype=np.int32),
        )  # fmt: skip

    def arrays_of(self, n: int) -> tuple[np.ndarray, ...]:
        """For ``n`` shapes."""
        return tuple(array[:n] for array in self.arrays)
