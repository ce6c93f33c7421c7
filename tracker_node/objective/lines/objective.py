"""Correspondence lines of all cameras as one least-squares objective over states, in information units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...observation.region.background import NO_ROOM, PackedRoom
from ...render.contour.samples import most_samples
from ...render.occluders import NOTHING
from ...render.shape_arrays import ShapeArrays
from ..contour_residual import assemble
from ..moved_configuration import bodies_seen, cameras_by_body
from ..normal_equations import CameraEquations, NormalEquations
from ..per_camera import camera_constants, serial
from . import correspondence as kernel
from .camera import correspond_camera, sum_camera
from .evidence import N_EVIDENCE, count_evidence, line_residuals
from .table import PRECISION, SHARP


@dataclass(frozen=True)
class RegionOptions:
    """See the fields of the same names in the tracker's configuration."""

    samples_per_line: int = 20
    half_length: int = 8
    outward_px: float = 3.0
    clamp: float = 2.0
    sharpness: float = 1.0
    model_sigma_px: float = 0.5
    robust_sigmas: float = 3.0
    correlation: float = 1.0
    shadow: float = 0.4

    def packed(self, scale: float, model_sigma_px: float) -> np.ndarray:
        options = np.zeros(kernel.N_OPTIONS)
        options[kernel.SCALE] = scale
        options[kernel.HALF_LENGTH] = self.half_length
        options[kernel.CLAMP] = self.clamp
        options[kernel.SHARPNESS] = self.sharpness
        options[kernel.MODEL_VARIANCE] = model_sigma_px**2 + ((0.5 * scale) ** 2 / 3.0 if scale > 1.0 else 0.0)
        options[kernel.ROBUST] = self.robust_sigmas
        options[kernel.CORRELATION] = self.correlation
        options[kernel.SHADOW] = self.shadow
        options[kernel.FINE] = float(scale <= 1.0)
        return options


_FEWEST_LINES = 30
_COARSE_SAMPLES = 5  # of a generator line: where lines are coarse, half of them do, but not fewer than these
_FEW_SAMPLES = 1000


@dataclass(frozen=True, eq=False)
class View:
    """What one camera shows.

    Attributes
    ----------
    bgr : (h, w, 3) uint8.
    densities : color densities (body (n_classes, n_colors), scene).
    room : of the empty scene, `EmptyRoom.packed`.
    """

    bgr: np.ndarray
    densities: tuple[np.ndarray, np.ndarray]
    room: PackedRoom = NO_ROOM


@dataclass(frozen=True, eq=False)
class PartEvidence:
    """How well contours are borne out, (n_cameras, n_shapes) each.

    ``expected`` samples of the body's outline that the camera should see; ``found`` of them whose lines tell anything; ``close``
    of those whose contour is within ``close_px``; ``chi2`` summed squared residuals over their variance; ``log_ratio`` summed
    log-likelihood of a contour on the line against none.
    """

    expected: np.ndarray
    found: np.ndarray
    close: np.ndarray
    chi2: np.ndarray
    log_ratio: np.ndarray


class LineSlot:
    """One camera's constants and work arrays, reused from image set to image set."""

    def __init__(self, camera: Camera, model: ArticulatedModel, capacity: int):
        n_links = len(model.chain.links)
        self.camera = camera_constants(camera)
        self.rows, self.pixels, self.info, self.lines = kernel.line_arrays(capacity)
        self.n = 0
        self.normal = np.zeros((n_links, 6, 6))
        self.gradient = np.zeros((n_links, 6))
        self.stats = np.zeros(kernel.N_STATISTICS)
        self.drawn = self.rows, self.pixels, self.info, self.lines
        self.sums = self.normal, self.gradient, self.stats


class RegionObjective:
    """Cost of a state against the correspondence lines of one image set.

    Parameters
    ----------
    classes : (n_shapes,) color class of every shape.
    covers : depth of what stands before the body, in every camera (`render.occluders`); None: nothing does.

    `correspond` draws the lines, `linearize` holds states against them. Sums run over the cameras in the order of the rig.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        arrays: ShapeArrays,
        classes: np.ndarray,
        options: RegionOptions,
        parallel: Callable[[Callable, list], list] = serial,
        covers: Sequence[np.ndarray] | None = None,
    ):
        self._covers = [NOTHING] * len(rig) if covers is None else list(covers)
        self.model, self.arrays, self.classes, self.options = model, arrays, classes, options
        few = most_samples(arrays.packed, options.samples_per_line) * len(rig) < _FEW_SAMPLES
        self._map = serial if few else parallel  # to hand a few lines to another thread takes longer than to draw them
        capacity = most_samples(arrays.packed, options.samples_per_line)
        self.slots = [LineSlot(camera, model, capacity) for camera in rig]
        self.views: list[View | None] = [None] * len(rig)
        self.offsets: list[np.ndarray | None] = [None] * len(rig)
        self.model_sigma_px = options.model_sigma_px
        self._packed = options.packed(1.0, self.model_sigma_px)
        self._sums_of: State | None = None  # whom the slots' sums are of, while lines are as they were drawn
        # The same of their equations, of their residuals, of what these bear out (within so many pixels), and of their spread
        self._equations: tuple[State, NormalEquations] | None = None
        self._residuals_of: tuple[State, dict[int, np.ndarray]] | None = None
        self._evidence: tuple[State, float, PartEvidence] | None = None
        self._spread: tuple[State, float | None] | None = None

    @property
    def line_variance(self) -> float:
        """px^2: what the lines last drawn are taken to be off beyond what they say themselves."""
        return float(self._packed[kernel.MODEL_VARIANCE])

    @property
    def active(self) -> list[int]:
        """Cameras that show something."""
        return [i for i, view in enumerate(self.views) if view is not None]

    def set_views(self, views: Sequence[View | None], offsets: Sequence[np.ndarray | None] | None = None) -> None:
        """Go on with the images of another instant.

        ``offsets``: for each camera the tangent (n_dof,) from the state to where the body is when that camera exposes, or None.
        """
        self.views = list(views)
        self.offsets = [None] * len(self.views) if offsets is None else list(offsets)
        self._sums_of, self._equations, self._residuals_of, self._evidence, self._spread = None, None, None, None, None
        for slot in self.slots:
            slot.n = 0

    def correspond(self, state: State, scale: float, offsets: Sequence[np.ndarray | None] | None = None) -> None:
        """Draw the lines of the contours that are seen in ``state``.

        ``scale``: pixels from place to place on a line; ``offsets``: as for the views, where better ones are known by now.
        """
        if offsets is not None:
            self.offsets = list(offsets)
        self._packed = options = self.options.packed(scale, self.model_sigma_px)
        n_samples = self.options.samples_per_line
        if scale > 1.0:
            n_samples = max(n_samples // 2, min(n_samples, _COARSE_SAMPLES))
        poses = bodies_seen(self.model, state, self.offsets)

        def run(i: int) -> None:
            slot, view = self.slots[i], self.views[i]
            assert view is not None
            slot.n = correspond_camera(
                (view.bgr, view.densities, view.room), self._covers[i], self.classes, self.arrays.packed, self.arrays.bounds,
                poses[i].Ts_world_shape, poses[i].Ts_world_link, slot.camera, n_samples, self.options.outward_px, options,
                slot.drawn, slot.sums,
            )  # fmt: skip

        self._map(run, self.active)
        self._sums_of = state
        self._equations, self._residuals_of, self._evidence, self._spread = None, None, None, None

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations of the lines at ``state``; found once a state, and not to be written into."""
        if self._equations is None or self._equations[0] is not state:
            self._equations = state, self._linearized(state)
        return self._equations[1]

    def _linearized(self, state: State) -> NormalEquations:
        poses, active = bodies_seen(self.model, state, self.offsets), self.active
        if state is not self._sums_of:
            for i in active:
                slot = self.slots[i]
                sum_camera(slot.lines, slot.info, slot.n, poses[i].Ts_world_link, slot.camera, self._packed, slot.sums)
            self._sums_of = state
        H, g = np.zeros((self.model.n_dof, self.model.n_dof)), np.zeros(self.model.n_dof)
        cost, count = 0.0, 0
        for together in cameras_by_body(active, poses):
            self._assemble(together, poses[together[0]], H, g)
        for i in active:
            cost += float(self.slots[i].stats[kernel.COST])
            count += int(self.slots[i].stats[kernel.COUNT])
        return NormalEquations(H, g, cost, count)

    def _assemble(self, cameras: Sequence[int], body: Configuration, H: np.ndarray, g: np.ndarray) -> None:
        """Add what the links of ``body`` have to tell in these cameras."""
        chain = self.model.chain
        own_H, own_g = np.empty_like(H), np.empty_like(g)
        normal, gradient = np.zeros((len(chain.links), 6, 6)), np.zeros((len(chain.links), 6))
        for i in cameras:
            normal += self.slots[i].normal
            gradient += self.slots[i].gradient
        assemble(normal, gradient, chain.link_moved_by, body.twists, own_H, own_g)
        H += own_H
        g += own_g

    def camera_equations(self) -> list[CameraEquations | None]:
        """What each camera has said in the last linearization, None for one that shows nothing."""
        return [
            None if view is None else CameraEquations(slot.normal.copy(), slot.gradient.copy())
            for slot, view in zip(self.slots, self.views, strict=True)
        ]

    def part_evidence(self, state: State, close_px: float) -> PartEvidence:
        """How far the lines that were last drawn bear ``state`` out."""
        if self._evidence is None or self._evidence[0] is not state or self._evidence[1] != close_px:
            self._evidence = state, close_px, self._find_evidence(state, close_px)
        return self._evidence[2]

    def _find_evidence(self, state: State, close_px: float) -> PartEvidence:
        table, variance = np.zeros((N_EVIDENCE, len(self.slots), len(self.model.shapes))), self.line_variance
        for i, residuals in self._residuals(state).items():
            slot = self.slots[i]
            count_evidence(slot.lines, slot.info, slot.n, residuals, variance, close_px, table[:, i])
        return PartEvidence(*table)

    def spread_px(self, state: State) -> float | None:
        """By how much contours are off beyond what their own lines allow for: a robust standard deviation; None of few lines.

        What is left of the median absolute residual once the lines' variance is taken off: the error of the model and the rig.
        """
        if self._spread is None or self._spread[0] is not state:
            self._spread = state, self._find_spread(state)
        return self._spread[1]

    def _find_spread(self, state: State) -> float | None:
        residuals, variances = [], []
        for i, residual in self._residuals(state).items():
            slot = self.slots[i]
            precision = slot.lines[: slot.n, PRECISION]
            sharp = precision > SHARP
            residuals.append(residual[sharp])
            variances.append(1.0 / precision[sharp])
        together = np.concatenate(residuals) if residuals else np.zeros(0)
        if together.size < _FEWEST_LINES:
            return None
        variance = (1.4826 * np.median(np.abs(together))) ** 2 - np.median(np.concatenate(variances))
        return float(np.sqrt(max(variance, 0.0)))

    def _residuals(self, state: State) -> dict[int, np.ndarray]:
        """(n,) pixels, of the lines of every camera that shows something."""
        if self._residuals_of is None or self._residuals_of[0] is not state:
            poses, found = bodies_seen(self.model, state, self.offsets), {}
            for i in self.active:
                slot = self.slots[i]
                found[i] = np.empty(slot.n)
                line_residuals(slot.lines, slot.info, slot.n, poses[i].Ts_world_link, slot.camera, found[i])
            self._residuals_of = state, found
        return self._residuals_of[1]
