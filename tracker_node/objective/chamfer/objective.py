"""The contour cost of all cameras as a least-squares objective over states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import Camera
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...render.contour.generators import SAMPLES, world_spheres
from ...render.contour.picks import N_PICK_COLUMNS
from ...render.shape_arrays import ShapeArrays
from .. import contour_residual as kernel
from ..constraints.prior import Prior
from ..moved_configuration import bodies_seen, cameras_by_body
from ..normal_equations import CameraEquations, NormalEquations
from ..per_camera import camera_constants, serial
from .agreement import N_AGREEMENT, count_agreement


@dataclass(frozen=True)
class ContourOptions:
    """See the fields of the same names in the tracker's configuration.

    ``outward_px`` is how far beyond a contour the class of the sample is decided, ``alignment`` the least cosine between a
    boundary's normal and the contour's. ``variance_px2`` is the variance of one sample times how many neighbours share one error:
    what squared pixels are divided by to become information.
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

    ``silhouette`` float32, signed distance to the silhouette's boundary (positive outside), ``edges`` float32, distance to the
    nearest image edge inside the silhouette; both in pixels and truncated. ``boundary`` (n, 4) float32: points of the
    silhouette's boundary on the crop and their outward normals.
    """

    origin: tuple[int, int]
    silhouette: np.ndarray
    edges: np.ndarray
    boundary: np.ndarray


class CameraSlot:
    """One camera's constants and work arrays, reused from image set to image set."""

    def __init__(self, camera: Camera, model: ArticulatedModel, samples_per_line: int):
        n_links = len(model.chain.links)
        self.camera = camera_constants(camera)
        most = SAMPLES * samples_per_line
        self.flags = np.zeros((len(model.shapes), most), dtype=np.uint8)
        self.picks = np.zeros((len(model.shapes), most, N_PICK_COLUMNS))
        self.n_picks = np.zeros(len(model.shapes), dtype=np.int64)
        self.samples = np.zeros((self.flags.size, kernel.N_SAMPLE_COLUMNS))
        self.normal = np.zeros((n_links, 6, 6))
        self.gradient = np.zeros((n_links, 6))
        self.stats = np.zeros(kernel.N_STATISTICS)
        self.agreement = np.zeros(N_AGREEMENT)

    @property
    def work(self) -> tuple[np.ndarray, ...]:
        """The arrays that the kernel fills."""
        return self.flags, self.picks, self.n_picks, self.samples, self.normal, self.gradient, self.stats


class ContourObjective:
    """Cost of a state against the evidence of one image set.

    Which samples are seen is decided at the first linearization and kept, so that the cost stays comparable between
    iterations; `restart` decides it anew at the next one.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        arrays: ShapeArrays,
        slots: Sequence[CameraSlot],
        maps: Sequence[EvidenceMaps | None],
        options: ContourOptions,
        priors: Sequence[Prior] = (),
        parallel: Callable[[Callable, list], list] = serial,
    ):  # fmt: skip
        self.model, self.arrays, self.slots, self.maps = model, arrays, slots, maps
        self.options, self.priors = options, priors
        self._packed = options.packed()
        self._map = parallel
        self._offsets: list[np.ndarray | None] = [None] * len(slots)
        self._refresh = True

    def restart(self, options: ContourOptions, offsets: Sequence[np.ndarray | None] | None = None) -> None:
        """Go on with other ``options`` (same number of samples); visibility is decided anew at the next linearization.

        ``offsets``: for each camera the tangent (n_dof,) from the state to where the body is when that camera exposes, or None;
        not given, all cameras expose at one instant.
        """
        self.options, self._packed = options, options.packed()
        self._offsets = [None] * len(self.slots) if offsets is None else list(offsets)
        self._refresh = True

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations at ``state``; sums run over the cameras in the order of the rig."""
        bodies = bodies_seen(self.model, state, self._offsets)
        refresh, self._refresh = self._refresh, False

        def run(index: int) -> None:
            slot, maps = self.slots[index], self.maps[index]
            assert maps is not None
            Ts, spheres = bodies[index].Ts_world_shape, np.empty((len(self.model.shapes), 4))
            world_spheres(Ts, self.arrays.bounds, spheres)
            kernel.linearize_camera(
                self.arrays.packed,
                Ts,
                spheres,
                slot.camera,
                (maps.silhouette, maps.edges, maps.origin, maps.boundary),
                self._packed,
                self.options.samples_per_line,
                refresh,
                slot.work,
            )

        active = [i for i, maps in enumerate(self.maps) if maps is not None]
        self._map(run, active)
        H, g = np.zeros((self.model.n_dof, self.model.n_dof)), np.zeros(self.model.n_dof)
        cost, count = 0.0, 0
        for together in cameras_by_body(active, bodies):
            self._assemble(together, bodies[together[0]], H, g)
        for i in active:
            cost += float(self.slots[i].stats[kernel.COST])
            count += int(self.slots[i].stats[kernel.COUNT])
        information = 1.0 / self.options.variance_px2
        H, g, cost = information * H, information * g, information * cost
        for prior in self.priors:
            cost += prior.add_to(H, g, state)
        return NormalEquations(H, g, cost, count)

    def _assemble(self, cameras: Sequence[int], body: Configuration, H: np.ndarray, g: np.ndarray) -> None:
        """Add what the links of ``body`` have to tell in these cameras."""
        chain = self.model.chain
        own_H, own_g = np.empty_like(H), np.empty_like(g)
        link_normal, link_gradient = np.zeros((len(chain.links), 6, 6)), np.zeros((len(chain.links), 6))
        for i in cameras:
            link_normal += self.slots[i].normal
            link_gradient += self.slots[i].gradient
        kernel.assemble(link_normal, link_gradient, chain.link_moved_by, body.twists, own_H, own_g)
        H += own_H
        g += own_g

    def camera_equations(self) -> list[CameraEquations | None]:
        """What each camera has said in the last linearization, None for one without evidence."""
        information = 1.0 / self.options.variance_px2
        return [
            None if maps is None else CameraEquations(information * slot.normal, information * slot.gradient)
            for slot, maps in zip(self.slots, self.maps, strict=True)
        ]

    def count_agreement(self, state: State, close_px: float, close_m: float = 0.0) -> None:
        """Fill the ``agreement`` of every slot with evidence: how much of the outline in ``state`` lies on the silhouette's
        boundary, and the other way round, within ``close_px`` and what ``close_m`` at the body is in pixels. Call it after
        `linearize`, which decides what is seen."""
        bodies = bodies_seen(self.model, state, self._offsets)
        root = state.T_world_root[:3, 3]

        def run(index: int) -> None:
            slot, maps = self.slots[index], self.maps[index]
            assert maps is not None
            params, R, t, _ = slot.camera
            depth = max(float(R[2] @ root + t[2]), 0.1)
            close = close_px + close_m * float(params[0]) / depth
            count_agreement(
                self.arrays.packed,
                bodies[index].Ts_world_shape,
                slot.camera,
                (maps.silhouette, maps.edges, maps.origin, maps.boundary),
                (slot.flags, slot.picks, slot.n_picks),
                self.options.samples_per_line,
                (close, self.options.alignment),
                slot.samples,
                slot.agreement,
            )

        self._map(run, [i for i, maps in enumerate(self.maps) if maps is not None])
