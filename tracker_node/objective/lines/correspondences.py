"""Correspondence lines of all cameras as a value: where the colors change beside the contours of a body in one state.

`LineDrawer` draws them about a state; `LineCorrespondences` compares them with any state, in information units. That they exist
says that visibility has been decided: only contour samples that are seen in the state of their drawing have a line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...observation.region.background import NO_ROOM, PackedRoom
from ...observation.region.silhouette import NO_SILHOUETTE, PackedSilhouette
from ...parallel import serial
from ...render.contour.samples import most_samples
from ...render.occluders import NO_NEIGHBORS, NOTHING, PackedNeighbors
from ...render.shape_arrays import ShapeArrays
from ..contour_residual import assemble, sum_of_cameras
from ..normal_equations import CameraEquations, NormalEquations
from ..per_camera import bodies_seen, camera_constants, cameras_by_body
from . import correspondence as kernel
from .camera import N_EVIDENCE, correspond_camera, count_evidence, keep_sharp, line_residuals, sum_camera
from .surfaces import N_UNKNOWNS, Surfaces, SurfaceSums, sum_surfaces

Offsets = Sequence[np.ndarray | None]
"""Per camera the tangent (n_dof,) from a state to where the body is when that camera exposes; None: where the state says."""

_FEWEST_LINES = 30
_COARSE_SAMPLES = 5  # of a generator line: where lines are coarse, half of them do, but not fewer than these
_FEW_SAMPLES = 1000
_LEAST_SEEN = 10  # lines that find the outline, of a camera that sees the body


@dataclass(frozen=True)
class LineOptions:
    """How lines are drawn and weighed: the fields of the same meaning in the tracker's configuration."""

    samples_per_line: int = 20
    half_length: int = 8
    outward_px: float = 3.0
    max_log_ratio: float = 2.0
    pixel_independence: float = 1.0
    robust_sigmas: float = 3.0
    correlation: float = 1.0
    shadow: float = 0.4

    def packed(self, scale: float, model_sigma_px: float) -> np.ndarray:
        """The kernels' options.

        Parameters
        ----------
        scale : pixels from place to place on a line.
        model_sigma_px : standard deviation of contours beyond what their lines say.

        Returns
        -------
        (`correspondence.N_OPTIONS`,)
        """
        options = np.zeros(kernel.N_OPTIONS)
        options[kernel.SCALE] = scale
        options[kernel.HALF_LENGTH] = self.half_length
        options[kernel.CLAMP] = self.max_log_ratio
        options[kernel.SHARPNESS] = self.pixel_independence
        options[kernel.MODEL_VARIANCE] = model_sigma_px**2 + ((0.5 * scale) ** 2 / 3.0 if scale > 1.0 else 0.0)
        options[kernel.ROBUST] = self.robust_sigmas
        options[kernel.CORRELATION] = self.correlation
        options[kernel.SHADOW] = self.shadow
        options[kernel.FINE] = float(scale <= 1.0)
        return options


@dataclass(frozen=True, eq=False)
class View:
    """What one camera shows.

    Attributes
    ----------
    bgr : (h, w, 3) uint8.
    densities : color densities (body (n_classes, n_colors), scene).
    room : the background, `RegionBackground.packed`.
    silhouette : which pixels show the body, by a network; of `observation.region.silhouette.packed`.
    neighbors : which pixels show other bodies, `render.occluders.Occluders.neighbors`.
    """

    bgr: np.ndarray
    densities: tuple[np.ndarray, np.ndarray]
    room: PackedRoom = NO_ROOM
    silhouette: PackedSilhouette = NO_SILHOUETTE
    neighbors: PackedNeighbors = NO_NEIGHBORS

    @property
    def packed(self) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], PackedRoom, PackedSilhouette, PackedNeighbors]:
        """As the kernels take it."""
        return self.bgr, self.densities, self.room, self.silhouette, self.neighbors


@dataclass(frozen=True, eq=False)
class PartEvidence:
    """How well contours agree with the images, (n_cameras, n_shapes) each.

    Attributes
    ----------
    expected : samples of the body's outline that the camera should see.
    found : those of them whose lines have a contour.
    close : those of them whose contour is within ``close_px``.
    chi2 : summed squared residuals over their variance.
    log_ratio : summed log-likelihood ratio of a contour on the line against none.
    filled : those of them that are not close, as the body's colors go on as far as the line looks, where they are common.
    empty : those of them on which none of the body's colors are found, inside of it either.
    """

    expected: np.ndarray
    found: np.ndarray
    close: np.ndarray
    chi2: np.ndarray
    log_ratio: np.ndarray
    filled: np.ndarray
    empty: np.ndarray


@dataclass(frozen=True, eq=False)
class CameraLines:
    """Lines of one camera: ``lines`` (n, `N_LINE_COLUMNS`), ``info`` (n, `N_INFO_COLUMNS`), the camera's constants."""

    lines: np.ndarray
    info: np.ndarray
    camera: tuple[np.ndarray, ...]


_OF_SHAPES = np.zeros((0, N_UNKNOWNS))


class LineDrawer:
    """Draws the correspondence lines of a body in the images of one rig.

    Parameters
    ----------
    rig, model, arrays : cameras, body, and the body's shapes as kernels take them.
    classes : (n_shapes,) color class of every shape.
    options : how lines are drawn.
    parallel : maps a function over cameras.
    covers : (h, w) depth of what stands before the body, in every camera (`Occluders.depths`, read anew each time); None: nothing
        does.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        arrays: ShapeArrays,
        classes: np.ndarray,
        options: LineOptions,
        parallel: Callable[[Callable, list], list] = serial,
        covers: Sequence[np.ndarray] | None = None,
    ):
        self._covers = [NOTHING] * len(rig) if covers is None else covers
        self._model, self._arrays, self._classes, self._options = model, arrays, classes, options
        most = most_samples(arrays.packed, options.samples_per_line)
        few = most * len(rig) < _FEW_SAMPLES
        self._map = serial if few else parallel  # to hand a few lines to another thread takes longer than to draw them
        self._cameras = [camera_constants(camera) for camera in rig]
        self._work = [kernel.line_arrays(most) for _ in rig]

    def draw(
        self, views: Sequence[View | None], state: State, scale: float, model_sigma_px: float, offsets: Offsets | None = None,
        surfaces: Surfaces | None = None,
    ) -> LineCorrespondences:  # fmt: skip
        """Draw the lines of the contours that are seen in ``state``.

        Parameters
        ----------
        views : what the cameras show, in the order of the rig; None for one that shows nothing.
        state : of the body.
        scale : pixels from place to place on a line; at 1 and below contours are placed below the pixel.
        model_sigma_px : standard deviation of contours beyond what their lines say.
        offsets : where the body is when each camera exposes; None: where ``state`` says.
        surfaces : where those of the parts are beside the shapes; None: they are the shapes' own.

        Returns
        -------
        The lines; nothing of them changes later.
        """
        offsets = [None] * len(views) if offsets is None else list(offsets)
        packed, n_samples = self._options.packed(scale, model_sigma_px), self._options.samples_per_line
        if scale > 1.0:
            n_samples = max(n_samples // 2, min(n_samples, _COARSE_SAMPLES))
        bodies, n_links = bodies_seen(self._model, state, offsets), len(self._model.chain.links)
        means = _OF_SHAPES if surfaces is None else surfaces.means
        lines: list[CameraLines | None] = [None] * len(views)
        sums = LineSums.empty(state, bodies, n_links)

        def run(i: int) -> None:
            view, work = views[i], self._work[i]
            assert view is not None
            n = correspond_camera(
                view.packed, self._covers[i], self._classes, self._arrays.packed, self._arrays.bounds, bodies[i].Ts_world_shape,
                bodies[i].Ts_world_link, self._cameras[i], n_samples, self._options.outward_px, packed, means, work,
                sums.of_camera(i),
            )  # fmt: skip
            _, _, info, drawn = work
            lines[i] = CameraLines(drawn[:n].copy(), info[:n].copy(), self._cameras[i])

        self._map(run, [i for i, view in enumerate(views) if view is not None])
        return LineCorrespondences(_Drawn(self._model, tuple(lines), packed, tuple(offsets), surfaces), sums)


@dataclass(frozen=True, eq=False)
class LineSums:
    """Lines summed at ``state``: ``bodies`` as each camera sees it, and each camera's sums, zero where it shows nothing.

    Attributes
    ----------
    normal, gradient : (n_cameras, n_links, 6, 6), (n_cameras, n_links, 6), by spatial twists of the links.
    stats : (n_cameras, `correspondence.N_STATISTICS`).
    """

    state: State
    bodies: Sequence[Configuration]
    normal: np.ndarray
    gradient: np.ndarray
    stats: np.ndarray

    @classmethod
    def empty(cls, state: State, bodies: Sequence[Configuration], n_links: int) -> LineSums:
        """Of no lines.

        Parameters
        ----------
        state, bodies : see the class.
        n_links : of the body.

        Returns
        -------
        Zeros, to be filled.
        """
        n = len(bodies)
        return cls(state, bodies, np.zeros((n, n_links, 6, 6)), np.zeros((n, n_links, 6)), np.zeros((n, kernel.N_STATISTICS)))

    def of_camera(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As kernels fill them."""
        return self.normal[i], self.gradient[i], self.stats[i]

    def total(self, statistic: int) -> float:
        """One of the statistics over all cameras."""
        return sum(self.stats[:, statistic].tolist())


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What does not change once lines are drawn: body, lines of each camera, options of the kernels, offsets of the cameras."""

    model: ArticulatedModel
    cameras: tuple[CameraLines | None, ...]
    packed: np.ndarray
    offsets: tuple[np.ndarray | None, ...]
    surfaces: Surfaces | None = None

    @property
    def seeing(self) -> list[tuple[int, CameraLines]]:
        """Cameras that show something, with their lines."""
        return [(i, camera) for i, camera in enumerate(self.cameras) if camera is not None]


class LineCorrespondences:
    """Lines that have been drawn, compared with states (`Correspondences`); sums run over the cameras in the order of the rig.

    Attributes
    ----------
    cameras : lines of each camera of the rig, None for one that shows nothing.
    variance : px^2, what contours are taken to be off beyond what their lines say.
    drawn_at : the state about which the lines were drawn.
    scale : pixels from place to place on them.
    """

    def __init__(self, drawn: _Drawn, sums: LineSums):
        self._drawn, self.cameras = drawn, drawn.cameras
        self.variance, self.scale = float(drawn.packed[kernel.MODEL_VARIANCE]), float(drawn.packed[kernel.SCALE])
        self.drawn_at = sums.state
        self._latest = LinesAt(drawn, sums)

    @property
    def active(self) -> list[int]:
        """Cameras that show something."""
        return [i for i, _ in self._drawn.seeing]

    def seeing(self, state: State) -> list[int]:
        """Cameras that see the body in a state: enough of their lines find its outline."""
        at = self.at(state)
        return [i for i in self.active if at.stats(i)[kernel.COUNT] >= _LEAST_SEEN]

    def at(self, state: State) -> LinesAt:
        """The lines compared with a state; the latest comparison is kept."""
        if self._latest.state is not state:
            self._latest = LinesAt(self._drawn, self._summed(state))
        return self._latest

    def _summed(self, state: State) -> LineSums:
        drawn = self._drawn
        sums = LineSums.empty(state, bodies_seen(drawn.model, state, drawn.offsets), len(drawn.model.chain.links))
        for i, own in drawn.seeing:
            T = sums.bodies[i].Ts_world_link
            sum_camera(own.lines, own.info, len(own.lines), T, own.camera, drawn.packed, sums.of_camera(i))
        return sums

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations of the lines at ``state``; not to be written into."""
        return self.at(state).equations

    def camera_equations(self, state: State) -> list[CameraEquations | None]:
        """What each camera says of ``state``; None for one that shows nothing."""
        sums, shown = self.at(state).sums, self.cameras
        return [None if own is None else CameraEquations(sums.normal[i], sums.gradient[i]) for i, own in enumerate(shown)]


class LinesAt:
    """Lines compared with one state; each figure is found when it is first asked for."""

    def __init__(self, drawn: _Drawn, sums: LineSums):
        self._drawn, self.sums, self.state = drawn, sums, sums.state
        self._evidence: dict[float, PartEvidence] = {}

    @cached_property
    def equations(self) -> NormalEquations:
        """Normal equations."""
        model, active = self._drawn.model, [i for i, _ in self._drawn.seeing]
        H, g = np.zeros((model.n_dof, model.n_dof)), np.zeros(model.n_dof)
        cost, count = self.sums.total(kernel.COST), int(self.sums.total(kernel.COUNT))
        for together in cameras_by_body(active, self.sums.bodies):
            cost -= self._assemble(together, H, g)
        return NormalEquations(H, g, cost, count)

    @cached_property
    def surfaces(self) -> SurfaceSums | None:
        """What the lines say of the surfaces; None where these are taken as they are."""
        return self.surfaces_at(float(self._drawn.packed[kernel.MODEL_VARIANCE]))

    def surfaces_at(self, variance: float) -> SurfaceSums | None:
        """The same where contours are off by another ``variance``, px^2, beyond what their lines say."""
        return self._surfaces([i for i, _ in self._drawn.seeing], variance)

    def _surfaces(self, cameras: Sequence[int], variance: float) -> SurfaceSums | None:
        drawn, model, options = self._drawn, self._drawn.model, self._drawn.packed
        if drawn.surfaces is None:
            return None
        n = len(model.shapes)
        table = np.zeros((n, N_UNKNOWNS, N_UNKNOWNS)), np.zeros((n, N_UNKNOWNS)), np.zeros((n, 6, N_UNKNOWNS))
        for i in cameras:
            own = drawn.cameras[i]
            assert own is not None
            sum_surfaces(
                own.lines, own.info, len(own.lines), self.sums.bodies[i].Ts_world_link, own.camera, options[kernel.ROBUST] ** 2,
                variance, 1.0 / options[kernel.CORRELATION], *table,
            )  # fmt: skip
        return SurfaceSums(*table, drawn.surfaces.priors, model.shape_links)

    def _assemble(self, cameras: Sequence[int], H: np.ndarray, g: np.ndarray) -> float:
        """Add what the links say in these cameras, which see one and the same body; what the surfaces take off their cost."""
        chain, body, sums = self._drawn.model.chain, self.sums.bodies[cameras[0]], self.sums
        normal, gradient = sum_of_cameras(sums.normal, sums.gradient, np.array(cameras))
        whole = len(cameras) == len(self._drawn.seeing)
        surfaces = self.surfaces if whole else self._surfaces(cameras, float(self._drawn.packed[kernel.MODEL_VARIANCE]))
        if surfaces is not None:
            normal -= surfaces.of_links(len(normal))
            gradient -= surfaces.pulls(len(gradient))
        assemble(normal, gradient, chain.link_moved_by, body.twists, H, g)
        return 0.0 if surfaces is None else surfaces.cost

    def stats(self, i: int) -> np.ndarray:
        """(`correspondence.N_STATISTICS`,) of camera ``i``; zeros where it shows nothing."""
        return self.sums.stats[i]

    @property
    def cost_per_line(self) -> float:
        """Robust cost over all lines."""
        return self.sums.total(kernel.COST) / max(self.sums.total(kernel.COUNT), 1.0)

    def part_evidence(self, close_px: float) -> PartEvidence:
        """How far the outline agrees with the lines; a contour within ``close_px`` pixels of it is close."""
        if close_px in self._evidence:
            return self._evidence[close_px]
        drawn = self._drawn
        table, variance = np.zeros((N_EVIDENCE, len(drawn.cameras), len(drawn.model.shapes))), drawn.packed[kernel.MODEL_VARIANCE]
        reach_px = float(drawn.packed[kernel.SCALE] * drawn.packed[kernel.HALF_LENGTH])
        for i, own in drawn.seeing:
            count_evidence(
                own.lines, own.info, len(own.lines), self.residuals[i], float(variance), close_px, reach_px, table[:, i]
            )
        self._evidence[close_px] = PartEvidence(*table)
        return self._evidence[close_px]

    @cached_property
    def spread_px(self) -> float | None:
        """Robust standard deviation of contours beyond what their own lines allow for; None of few lines.

        What is left of the median absolute residual once the lines' variance is taken off: the error of the model and the rig.
        """
        seeing = self._drawn.seeing
        n = sum(len(own.lines) for _, own in seeing)
        distances, variances, n_sharp = np.empty(n), np.empty(n), 0
        for i, own in seeing:
            n_sharp = keep_sharp(own.lines, self.residuals[i], distances, variances, n_sharp)
        if n_sharp < _FEWEST_LINES:
            return None
        variance = (1.4826 * _median(distances[:n_sharp])) ** 2 - _median(variances[:n_sharp])
        return math.sqrt(max(variance, 0.0))

    @cached_property
    def residuals(self) -> dict[int, np.ndarray]:
        """(n,) pixels, of the lines of every camera that shows something."""
        found = {}
        for i, own in self._drawn.seeing:
            found[i] = np.empty(len(own.lines))
            body = self.sums.bodies[i]
            line_residuals(own.lines, own.info, len(own.lines), body.Ts_world_link, own.camera, found[i])
        return found


def _median(values: np.ndarray) -> float:
    """Of values, which are put in another order; numpy's takes longer to find out what they are."""
    half = values.size // 2
    values.partition((half - 1, half))
    return float(values[half] if values.size % 2 else 0.5 * (values[half - 1] + values[half]))
