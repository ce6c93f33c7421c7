"""Contour samples of all cameras as a value: which of them are seen, and how far they are from silhouettes and edges.

Agreement of outline and silhouette in one camera, counted sample by sample.

A robust residual says how far those samples are off that have found something; it stays small when half of the body is
somewhere else. What tells is how much of the body's outline lies on the silhouette's boundary, and how much of that boundary
lies on the outline.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import Camera
from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...parallel import serial
from ...render.contour.generators import N_COLUMNS, OUTER, SAMPLES, draw_contour, world_spheres
from ...render.contour.picks import N_PICK_COLUMNS
from ...render.contour.samples import N_PIXEL_COLUMNS, NU, NV, U, V, project_samples
from ...render.shape_arrays import ShapeArrays
from .. import contour_residual as kernel
from ..contour_residual import bilinear, columns_of, nearest_sample
from ..normal_equations import CameraEquations, NormalEquations
from ..per_camera import bodies_seen, camera_constants, cameras_by_body


@dataclass(frozen=True)
class ContourOptions:
    """See the fields of the same names in the tracker's configuration.

    Attributes
    ----------
    outward_px : how far beyond a contour the class of the sample is decided.
    alignment : least cosine between a boundary's normal and the contour's.
    variance_px2 : variance of one sample times how many neighbors share one error: what squared pixels are divided by to become
        information.
    """

    robust_scale_px: float = 8.0
    samples_per_line: int = 25
    sliding: bool = True
    distances: str = "split"
    outward_px: float = 3.0
    inner_weight: float = 0.3
    alignment: float = 0.6
    boundary_weight: float = 0.3
    boundary_scale_px: float = 20.0
    reach_px: float = 40.0
    variance_px2: float = 1.0

    def packed(self) -> np.ndarray:
        """(`contour_residual.N_OPTIONS`,) for the kernels."""
        options = np.zeros(kernel.N_OPTIONS)
        options[kernel.ROBUST_SCALE] = self.robust_scale_px
        options[kernel.SLIDING] = float(self.sliding)
        options[kernel.DISTANCES] = kernel.KINDS.index(self.distances)
        options[kernel.OUTWARD_PX] = self.outward_px
        options[kernel.INNER_WEIGHT] = self.inner_weight
        options[kernel.ALIGNMENT] = self.alignment
        options[kernel.BOUNDARY_WEIGHT] = self.boundary_weight if self.distances == "split" else 0.0
        options[kernel.BOUNDARY_SCALE] = self.boundary_scale_px
        options[kernel.REACH] = self.reach_px
        return options


@dataclass(frozen=True, eq=False)
class EvidenceMaps:
    """Distances around the predicted body in one camera, on a crop whose first pixel is ``origin`` (u, v).

    Attributes
    ----------
    silhouette : float32, signed distance to the silhouette's boundary (positive outside), pixels, truncated.
    edges : float32, distance to the nearest image edge inside the silhouette, pixels, truncated.
    boundary : (n, 4) float32, points of the silhouette's boundary on the crop and their outward normals.
    """

    origin: tuple[int, int]
    silhouette: np.ndarray
    edges: np.ndarray
    boundary: np.ndarray

    @property
    def packed(self) -> tuple[np.ndarray, np.ndarray, tuple[int, int], np.ndarray]:
        """As the kernels take them."""
        return self.silhouette, self.edges, self.origin, self.boundary


@dataclass(frozen=True, eq=False)
class ContourBody:
    """A body before the cameras of a rig, as the kernels take it.

    Attributes
    ----------
    model, arrays : the body, and its shapes.
    cameras : constants of each camera.
    parallel : maps a function over cameras.
    """

    model: ArticulatedModel
    arrays: ShapeArrays
    cameras: tuple[tuple[np.ndarray, ...], ...]
    parallel: Callable[[Callable, list], list]

    @classmethod
    def of(
        cls, model: ArticulatedModel, cameras: Sequence[Camera], arrays: ShapeArrays | None = None,
        parallel: Callable[[Callable, list], list] = serial,
    ) -> ContourBody:  # fmt: skip
        """Of a model and cameras.

        Parameters
        ----------
        model : the body.
        cameras : of the images.
        arrays : of the body's shapes; None: with the caps of cones.
        parallel : maps a function over cameras.

        Returns
        -------
        Ready for the kernels.
        """
        arrays = arrays or ShapeArrays.from_model(model)
        return cls(model, arrays, tuple(camera_constants(camera) for camera in cameras), parallel)


@dataclass(frozen=True, eq=False)
class _Seen:
    """Of one camera: class of every sample, (n_shapes, n), and what of its contour was picked."""

    flags: np.ndarray
    picks: np.ndarray
    n_picks: np.ndarray


@dataclass(frozen=True, eq=False)
class CameraResiduals:
    """Distances of one camera, summed at one state: 6x6 matrices of the links, gradients, statistics of the kernel."""

    normal: np.ndarray
    gradient: np.ndarray
    stats: np.ndarray


class ContourCorrespondences:
    """Contours compared with the maps of one image set (`Correspondences`).

    Which samples are seen is decided at the state given, and kept, so that costs are comparable between states.

    Parameters
    ----------
    body : the body before the cameras.
    maps : by camera; None for one without.
    options : what is read, and how it counts.
    state : in which it is decided what is seen.
    offsets : per camera the tangent (n_dof,) from a state to where the body is when that camera exposes; None: where it says.
    """

    def __init__(
        self,
        body: ContourBody,
        maps: Sequence[EvidenceMaps | None],
        options: ContourOptions,
        state: State,
        offsets: Sequence[np.ndarray | None] | None = None,
    ):
        self.body, self.maps, self.options = body, tuple(maps), options
        self._packed = options.packed()
        self._offsets = [None] * len(self.maps) if offsets is None else list(offsets)
        most = SAMPLES * options.samples_per_line
        n = len(body.model.shapes)
        self._seen = [
            _Seen(np.zeros((n, most), np.uint8), np.zeros((n, most, N_PICK_COLUMNS)), np.zeros(n, np.int64)) for _ in self.maps
        ]
        self._latest = state, *self._linearized(state, True)

    @property
    def active(self) -> list[int]:
        """Cameras with maps."""
        return [i for i, maps in enumerate(self.maps) if maps is not None]

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations in information units; sums run over the cameras in the order of the rig."""
        return self._at(state)[0]

    def camera_equations(self, state: State) -> list[CameraEquations | None]:
        """What each camera says of ``state``; None for one without maps."""
        information = 1.0 / self.options.variance_px2
        return [
            None if found is None else CameraEquations(information * found.normal, information * found.gradient)
            for found in self.residuals(state)
        ]

    def residuals(self, state: State) -> list[CameraResiduals | None]:
        """Sums of each camera at ``state``, in pixels; None for one without maps."""
        return self._at(state)[1]

    def _at(self, state: State) -> tuple[NormalEquations, list[CameraResiduals | None]]:
        if self._latest[0] is not state:
            self._latest = state, *self._linearized(state, False)
        return self._latest[1:]

    def _linearized(self, state: State, decide: bool) -> tuple[NormalEquations, list[CameraResiduals | None]]:
        model, arrays = self.body.model, self.body.arrays
        bodies, n_links = bodies_seen(model, state, self._offsets), len(model.chain.links)
        found: list[CameraResiduals | None] = [None] * len(self.maps)

        def run(i: int) -> None:
            maps, seen = self.maps[i], self._seen[i]
            assert maps is not None
            own = CameraResiduals(np.zeros((n_links, 6, 6)), np.zeros((n_links, 6)), np.zeros(kernel.N_STATISTICS))
            Ts, spheres = bodies[i].Ts_world_shape, np.empty((len(model.shapes), 4))
            world_spheres(Ts, arrays.bounds, spheres)
            samples = np.zeros((seen.flags.size, kernel.N_SAMPLE_COLUMNS))
            kernel.linearize_camera(
                arrays.packed, Ts, spheres, self.body.cameras[i], maps.packed, self._packed, self.options.samples_per_line,
                decide, (seen.flags, seen.picks, seen.n_picks, samples, own.normal, own.gradient, own.stats),
            )  # fmt: skip
            found[i] = own

        self.body.parallel(run, self.active)
        return self._summed(found, bodies), found

    def _summed(self, found: Sequence[CameraResiduals | None], bodies: Sequence[Configuration]) -> NormalEquations:
        model = self.body.model
        H, g, cost, count = np.zeros((model.n_dof, model.n_dof)), np.zeros(model.n_dof), 0.0, 0
        for together in cameras_by_body(self.active, bodies):
            normal, gradient = np.zeros((len(model.chain.links), 6, 6)), np.zeros((len(model.chain.links), 6))
            for i in together:
                own = found[i]
                assert own is not None
                normal += own.normal
                gradient += own.gradient
            kernel.assemble(normal, gradient, model.chain.link_moved_by, bodies[together[0]].twists, H, g)
        for camera in found:
            if camera is not None:
                cost += float(camera.stats[kernel.COST])
                count += int(camera.stats[kernel.COUNT])
        information = 1.0 / self.options.variance_px2
        return NormalEquations(information * H, information * g, information * cost, count)

    def agreement(self, state: State, close_px: float, close_m: float = 0.0) -> np.ndarray:
        """How much of the outline lies on the silhouette's boundary, and the other way round.

        Parameters
        ----------
        state : of the body.
        close_px, close_m : what is closer than their sum lies on each other, the second in pixels at the body.

        Returns
        -------
        (n_cameras, `agreement.N_AGREEMENT`); zeros for cameras without maps.
        """
        bodies = bodies_seen(self.body.model, state, self._offsets)
        root, counts = state.T_world_root[:3, 3], np.zeros((len(self.maps), N_AGREEMENT))

        def run(i: int) -> None:
            maps, seen = self.maps[i], self._seen[i]
            assert maps is not None
            params, R, t, _ = self.body.cameras[i]
            close = close_px + close_m * float(params[0]) / max(float(R[2] @ root + t[2]), 0.1)
            _count_agreement(
                self.body.arrays.packed, bodies[i].Ts_world_shape, self.body.cameras[i], maps.packed,
                (seen.flags, seen.picks, seen.n_picks), self.options.samples_per_line, (close, self.options.alignment),
                np.zeros((seen.flags.size, kernel.N_SAMPLE_COLUMNS)), counts[i],
            )  # fmt: skip

        self.body.parallel(run, self.active)
        return counts


OUTLINE, ON_BOUNDARY, BOUNDARY, ON_OUTLINE = range(4)
"""Of one camera: samples of the body's outline; those on the silhouette's boundary; points of that boundary; those on the
outline."""
N_AGREEMENT = 4


@compiled
def _count_agreement(shapes, Ts, camera, maps, decided, n_samples, limits, samples, counts):
    """Count how much of outline and silhouette boundary lie on each other in one camera: fill ``counts`` (`N_AGREEMENT`,).

    ``decided`` is what `contour_residual.linearize_camera` has filled, ``limits`` how near a boundary has to be, and the least
    cosine between the normals.
    """
    flags, picks, n_picks = decided
    params, R, t, center = camera
    silhouette, _, origin, boundary = maps
    close, alignment = limits
    most = SAMPLES * n_samples
    rows, pixels, outwards = np.empty((most, N_COLUMNS)), np.empty((most, N_PIXEL_COLUMNS)), np.empty(most)
    counts[:] = 0.0
    n_outline = 0
    for shape in range(flags.shape[0]):
        count = draw_contour(shapes, shape, Ts[shape], center, n_samples, np.bool_(False), picks[shape], n_picks, rows)
        project_samples(params, R, t, rows, count, 0.0, pixels, outwards)
        for j in range(count):
            if flags[shape, j] != OUTER or outwards[j] < 0.0:
                continue
            u, v, nu, nv = pixels[j, U], pixels[j, V], pixels[j, NU], pixels[j, NV]
            sample = samples[n_outline]
            sample[0], sample[1], sample[2], sample[3] = u - origin[0], v - origin[1], nu, nv
            n_outline += 1
            ok, value, gu, gv = bilinear(silhouette, sample[0], sample[1])
            if not ok:  # beyond the border of the image, where there is nothing to agree with
                continue
            counts[OUTLINE] += 1.0
            slope = math.sqrt(gu * gu + gv * gv)
            if abs(value) < close and gu * nu + gv * nv > alignment * slope:
                counts[ON_BOUNDARY] += 1.0
    columns = columns_of(samples, n_outline)
    squares = np.empty(columns.shape[1], dtype=np.int32)
    reach_sq = np.float32(close * close)
    for i in range(0, boundary.shape[0], 2):  # fractions need no more
        counts[BOUNDARY] += 1.0
        if nearest_sample(columns[0], columns[1], columns[2], columns[3], boundary[i], alignment, reach_sq, squares) >= 0:
            counts[ON_OUTLINE] += 1.0
