"""The body by the colors on either side of its contours: correspondence lines, from coarse to fine; needs no empty scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from statistics import median

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.area.limb_score import LimbScore
from ...objective.constraints.prior import Prior
from ...objective.lines import correspondence as kernel
from ...objective.lines.objective import PartEvidence, RegionObjective, RegionOptions, View
from ...objective.moved_configuration import bodies_seen
from ...objective.normal_equations import Comparison, LeastSquaresObjective, NormalEquations
from ...objective.robust_curvature import curvature_share
from ...objective.sum_objective import SumObjective
from ...observation.chamfer.observer import checked_plates
from ...observation.image_set import ImageSet
from ...observation.region.background import EmptyRoom
from ...observation.region.colors import RegionColors, color_classes, stated_densities, trust_stated_colors
from ...optimize.levenberg_marquardt import clip_to_limits, stepped
from ...optimize.result import OptimizerResult
from ...render.occluders import Occluders
from ...render.shape_arrays import ShapeArrays
from ..chamfer.engine import ContourEngine
from ..config import TrackerConfig
from ..constraints import PX2_PER_INFORMATION, constraints_of, resting
from ..covariance import ImageEvidence, fit_covariance
from ..engine import Images, Report, Verdict
from ..estimate import CameraReport, Status
from ..motion.model import Passage
from ..parameters import numbers
from .limb_search import Lines
from .limb_status import LimbJudge, body_status, is_noise
from .line_errors import LineErrors
from .searches import Fits, Kept, RegionSearches


def region_options(config: TrackerConfig) -> RegionOptions:
    """How lines are drawn, by the parameters."""
    region = config.region
    return RegionOptions(
        samples_per_line=region.samples_per_line,
        half_length=region.half_length,
        clamp=region.max_log_ratio,
        sharpness=region.pixel_independence,
        model_sigma_px=region.model_sigma_px,
        robust_sigmas=region.robust_sigmas,
        correlation=region.correlation,
        shadow=config.background.shadow,
    )


class RegionEngine:
    """The `Engine` of correspondence lines.

    Parameters
    ----------
    rig, model, config : as for the `Tracker`.
    parallel : maps a function over cameras.
    occluders : what stands before the body; None: nothing does.
    plates : as for the `Tracker`.
    distances : contours by the chamfer modality, whose evidence is added where both are in use, or None.
    """

    in_information_units = True

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: TrackerConfig,
        parallel: Callable[[Callable, list], list],
        occluders: Occluders | None = None,
        plates: Mapping[str, np.ndarray | list] | None = None,
        distances: ContourEngine | None = None,
    ):
        self._plates, self._distances = dict(plates or {}), distances
        self._rig, self._model, self._config, self._parallel = rig, model, config, parallel
        self._occluders = occluders or Occluders(None, rig)
        region = config.region
        self._classes = color_classes(model)
        self._stated = stated_densities(model, self._classes)
        self._scales = numbers(region.scales)
        self._constraints, self._rest = constraints_of(model, config), resting(model, config.motion)
        self._arrays = ShapeArrays.from_model(model)
        self._objective = RegionObjective(
            rig, model, self._arrays, self._classes, region_options(config), parallel, self._occluders.depths
        )
        self._curvature = curvature_share(region.robust_sigmas)
        self._fine_damping = np.full(model.n_dof, _FINE_DAMPING)
        self._fine_damping[:N_ROOT_DOF] = _DAMPING
        self._areas = LimbScore(rig, model, self._classes, config.background.shadow, region.max_log_ratio, parallel)
        self._limbs = LimbJudge(model, config.status)
        self._errors = LineErrors(rig, model, region)
        self._searches = RegionSearches(rig, model, config, self._limbs, self._fits())
        self.reset()

    def reset(self) -> None:
        """Nothing is known but the colors that the model states."""
        self._limbs.reset()
        self._searches.reset()
        self._found = False
        self._colors = [RegionColors(self._classes, self._stated, self._config.region.color_prior) for _ in self._rig]
        self._rooms = [self._room(camera) for camera in self._rig]
        if self._distances is not None:
            self._distances.reset()
        self._steady = False
        self._trusted: np.ndarray | None = None  # (n_shapes,) parts of limbs that are where they should be
        self._objective.model_sigma_px = self._config.region.model_sigma_px
        self._count = 0
        self._last_known: tuple[OptimizerResult, ImageEvidence, tuple[np.ndarray, np.ndarray]] | None = None
        self._comparison: Comparison | None = None
        self.whole: LeastSquaresObjective = self._objective
        self._passage: Passage | None = None

    def _room(self, camera: Camera) -> EmptyRoom:
        lens, background = camera.model, self._config.background
        plates = checked_plates(camera.name, lens.width, lens.height, self._plates.get(camera.name))
        return EmptyRoom(plates, background.sigma, background.learning_rate, background.body_margin_px)

    def begin(self, images: Images, start: State, *, known: bool = False) -> State:
        """Learn colors, fit, and learn again: the first pose given is rarely exact. What a sound body has taught is kept."""
        self._limbs.restart()
        if self._searches.sound is not None and not self._limbs.was_lost:
            self._passage = None
            return start
        self._searches.begin()
        self._steady, self._trusted = False, None
        self._passage, guard = None, self._config.region.margin_px
        for guard_px in (guard,) if known else (4 * guard, 2 * guard, guard):
            self._colors = [RegionColors(self._classes, self._stated, self._config.region.color_prior) for _ in self._rig]
            self._learn(images, start, 1.0, guard_px)
            trust_stated_colors(self._colors)
            if guard_px != guard:
                self.observe(images, start)
                start = self.fit(start, first=True).state
        if self._distances is not None:
            self._distances.learn_first(images, start)
        return start

    def observe(self, images: Images, expected: State | None, passage: Passage | None = None) -> None:
        """Keep the images: lines are drawn where the fit needs them."""
        self._passage, self._looked = passage, False
        if self._distances is not None:
            self._distances.observe(images, expected, passage)
        self._objective.set_views(
            [
                None if image is None or expected is None or not colors.knows else self._view(i, image, colors)
                for i, (image, colors) in enumerate(zip(images, self._colors, strict=True))
            ]
        )

    def _view(self, i: int, image: np.ndarray, colors: RegionColors) -> View:
        return View(np.ascontiguousarray(image), (colors.body, colors.scene), self._rooms[i].packed)

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> OptimizerResult:
        """A few Gauss-Newton steps on the lines of each scale, and searches for what they have not reached."""
        if first:
            result, self._found = self._searches.first(start, prior), False
        else:
            result, self._found = self._searches.mended(self._descend(start, self._scales, prior), start, prior)
        return result

    def _fits(self) -> Fits:
        return Fits(
            self._descend, self._settled, self._kept, self._keep, self._part_evidence, self._cost_per_line,
            self._limb_lines,
        )  # fmt: skip

    def _settled(self, result: OptimizerResult) -> OptimizerResult:
        """The same with lines drawn anew about its state, after others have been tried."""
        self._correspond(result.state, self._scales[-1])
        return replace(result, equations=self.whole.linearize(result.state))

    def _kept(self) -> Kept:
        return Kept(self.whole, self._comparison, self._objective.model_sigma_px)

    def _keep(self, kept: Kept) -> None:
        self.whole, self._comparison, self._objective.model_sigma_px = kept.whole, kept.comparison, kept.model_sigma_px

    def _cost_per_line(self) -> float:
        """Of the state last linearized."""
        stats = np.array([self._objective.slots[i].stats for i in self._objective.active]).reshape(-1, kernel.N_STATISTICS)
        return float(stats[:, kernel.COST].sum() / max(stats[:, kernel.COUNT].sum(), 1.0))

    def _limb_lines(self, predicted: State) -> Lines:
        whole = SumObjective([self._objective, *self._constraints], priors=self._priors(predicted, None)[1:])
        return Lines(self._correspond, whole, self._part_evidence, self._area)

    def _area(self, shapes: np.ndarray, roots: np.ndarray, joints: np.ndarray) -> np.ndarray:
        if not self._looked:
            state = State(roots[0], joints[0])
            self._areas.look(self._objective.views, state, max(1, round(math.prod(self._size(state)) / _BODY_CELLS)))
            self._looked = True
        return self._areas.totals(shapes, roots, joints).sum(axis=1)

    def _descend(self, start: State, scales: tuple[float, ...], prior: Prior | None) -> OptimizerResult:
        state = clip_to_limits(start, self._model.chain)
        evidence: list[LeastSquaresObjective] = [self._objective]
        if self._distances is not None:
            evidence.append(self._distances.evidence_around(start))
        # Both look at the same contours: each counts for its share
        factors = [1.0 / len(evidence)] * len(evidence) + [1.0] * len(self._constraints)
        self.whole = whole = SumObjective([*evidence, *self._constraints], factors, self._priors(start, prior))
        chain, repeats = self._model.chain, self._config.region.repeats
        size_m, px_per_m = self._size(state)
        zoom = size_m * px_per_m / _BODY_PX
        steps, moved_px = 0, np.inf
        places = self._places(state)
        settled_px = max(_SETTLED_PX, _SETTLED_SIGMAS * self._objective.model_sigma_px)
        while steps < len(scales) or (steps < len(scales) + repeats and moved_px > settled_px):
            scale = scales[min(steps, len(scales) - 1)]
            self._correspond(state, max(scale * zoom, 1.0) if scale > 1.0 else scale)
            equations = whole.linearize(state)
            if steps == 0:
                self._comparison = self._compared(state, equations, start, prior)
            fits_well = scale <= 1.0 and self._fits_well
            free = fits_well or (scale <= 1.0 and prior is not None)  # first fits, which may begin far off, are held back
            if fits_well:
                equations = self._curved(equations, state, factors[0])
            state = stepped(equations, state, chain, self._fine_damping if free else _DAMPING)
            steps += 1
            before, places = places, self._places(state)
            moved_px = px_per_m * float(np.linalg.norm(places - before, axis=1).max())
        equations = whole.linearize(state)
        self._adapt(state)
        return OptimizerResult(state, equations, steps, steps + 1, bool(np.isfinite(equations.cost)))

    @property
    def _fits_well(self) -> bool:
        """Whether residuals are as the kernel takes them. Of others, the weights' own steps, which never climb, are better."""
        return self._objective.model_sigma_px < self._config.region.model_sigma_px

    def _curved(self, equations: NormalEquations, state: State, factor: float) -> NormalEquations:
        """With the curvature that the lines' robust cost really has near its minimum, for a step that does not fall short."""
        missing = (1.0 - self._curvature) * factor
        return replace(equations, H=equations.H - missing * self._objective.linearize(state).H)

    def _compared(self, state: State, equations: NormalEquations, start: State, prior: Prior | None) -> Comparison:
        """The cameras' own equations beside those of all together, both of lines alone."""
        if self._distances is not None:
            equations = SumObjective([self._objective], priors=self._priors(start, prior)).linearize(state)
        return Comparison(state, equations, self._objective.camera_equations())

    def _places(self, state: State) -> np.ndarray:
        """(n_shapes, 3) where the parts are."""
        return Configuration(self._model, state).Ts_world_shape[:, :3, 3]

    def _size(self, state: State) -> tuple[float, float]:
        """How large the body is (m), and how many pixels a metre of it has, seen from the middle one of the distances of the
        cameras; such that it has `_BODY_PX` where no camera looks at it."""
        places = self._places(state)
        middle = places.mean(axis=0)
        reach = max(float(np.linalg.norm(places - middle, axis=1).max()), float(self._arrays.bounds[:, 3].max()))
        scales = []
        for i in self._objective.active:
            params, R, t, _ = self._objective.slots[i].camera
            depth = float(R[2] @ middle + t[2])
            if depth > reach:  # else the camera looks elsewhere, or stands in the body's midst
                scales.append(float(params[0]) / depth)
        return 2.0 * reach, median(scales) if scales else _BODY_PX / (2.0 * reach)

    def _part_evidence(self, state: State, close_px: float) -> PartEvidence:
        """A contour of a large body may be farther off: what the model leaves out, clothes mostly, is so many pixels larger."""
        size_m, px_per_m = self._size(state)
        return self._objective.part_evidence(state, close_px * max(size_m * px_per_m / _LARGE_PX, 1.0))

    def _known(self, result: OptimizerResult) -> tuple[ImageEvidence, tuple[np.ndarray, np.ndarray]]:
        """What the lines last drawn say of ``result``, and its `fit_covariance`."""
        if self._last_known is None or self._last_known[0] is not result:
            images = self._errors.evidence(self._objective, result.state, 1.0 if self._distances is None else 0.5)
            body = Configuration(self._model, result.state)
            self._last_known = result, images, fit_covariance(result.equations.H, images, body)
        return self._last_known[1:]

    def _correspond(self, state: State, scale: float) -> None:
        self._objective.correspond(state, scale, None if self._passage is None else self._passage.offsets(state))

    def _adapt(self, state: State) -> None:
        """Follow how well the model's contours fit: weights, robustness and covariance go by it."""
        region, spread = self._config.region, self._objective.spread_px(state)
        if spread is not None and region.sigma_rate > 0.0:
            rate = max(region.sigma_rate, _FIRST_RATE / (1.0 + self._count))
            variance = (1.0 - rate) * self._objective.model_sigma_px**2 + rate * spread**2
            self._objective.model_sigma_px = float(np.clip(np.sqrt(variance), region.least_sigma_px, region.model_sigma_px))

    def judge(self, result: OptimizerResult, image_set: ImageSet) -> Verdict:
        """Limb by limb."""
        evidence = self._part_evidence(result.state, self._config.region.inlier_px)
        if not evidence.expected.any():
            self._steady = False
            reason = "no camera sees the body where it is expected"
            return Verdict(Status.LOST, reason, noise=True, limbs=self._limbs.nothing_seen(), surety=_UNSEEN)
        limbs = self._limbs.update(evidence, result.state, self._known(result)[1][0])
        trust = self._limbs.trust(limbs)
        self._trusted = self._limbs.sound_shapes(limbs)
        status, reason = body_status(limbs)
        self._steady = status is Status.TRACKING
        self._searches.remember(result.state, status, limbs)
        if status is Status.TRACKING:
            status, reason = self._status_of_cameras(evidence, image_set)
        return Verdict(
            status, reason, noise=is_noise(evidence), jumped=self._found, limbs=limbs, trust=trust, surety=_surety(evidence)
        )

    def _status_of_cameras(self, evidence: PartEvidence, image_set: ImageSet) -> tuple[Status, str]:
        """Of a body that is well: does every camera see it as it should?"""
        expected, close = evidence.expected.sum(axis=1), evidence.close.sum(axis=1)
        looking = [i for i in self._objective.active if expected[i] >= _LEAST_OUTLINE]
        shares = {i: close[i] / expected[i] for i in looking}
        usual = float(np.median(list(shares.values()))) if shares else 0.0
        against = [f"{self._rig.cameras[i].name} ({100 * share:.0f} %)" for i, share in shares.items() if share < 0.5 * usual]
        if against:
            return Status.DEGRADED, f"the body's outline is not found in {', '.join(against)}"
        if len(image_set.cameras) < len(self._rig):
            return Status.DEGRADED, f"{len(image_set.cameras)} of {len(self._rig)} cameras"
        if len(looking) < min(2, len(self._rig)):
            names = ", ".join(self._rig.cameras[i].name for i in looking) or "no camera"
            return Status.DEGRADED, f"only {names} sees where the body is"
        return Status.TRACKING, ""

    def linearize(self, state: State) -> NormalEquations:
        """Of the lines last drawn."""
        return self._objective.linearize(state)

    def comparison(self) -> Comparison | None:
        """Of the coarse stage: on finer ones, what a camera alone sees elsewhere is out of reach."""
        return self._comparison

    def report(self, result: OptimizerResult, image_set: ImageSet) -> Report:
        """Residuals of the lines."""
        reports, squares, weight = [], 0.0, 0.0
        for i, (camera, slot) in enumerate(zip(self._rig, self._objective.slots, strict=True)):
            image = image_set.get(camera.name)
            used = self._objective.views[i] is not None
            stats = slot.stats if used else np.zeros(kernel.N_STATISTICS)
            squares, weight = squares + stats[kernel.SQUARES], weight + stats[kernel.WEIGHT]
            rms = float(np.sqrt(stats[kernel.SQUARES] / max(stats[kernel.WEIGHT], 1e-12)))
            reports.append(CameraReport(camera.name, 0 if image is None else image.stamp_ns, rms, int(stats[kernel.COUNT])))
        images, (covariance, arcs) = self._known(result)
        return Report(tuple(reports), float(np.sqrt(squares / max(weight, 1e-12))), covariance, images, arcs)

    def learn(self, images: Images, state: State) -> None:
        """Colors change slowly: in each image set some of the cameras learn. A camera that has joined learns all at once."""
        region = self._config.region
        joined = [None if colors.knows else image for image, colors in zip(images, self._colors, strict=True)]
        if any(image is not None for image in joined):
            self._learn(joined, state, 1.0, region.margin_px)
        turn = [
            image if (i + self._count) % region.learn_every == 0 and joined[i] is None else None for i, image in enumerate(images)
        ]
        self._count += 1
        if region.color_rate > 0.0 and any(image is not None for image in turn):
            self._learn(turn, state, region.color_rate, region.margin_px)
        if self._distances is not None:
            self._distances.learn(images, state)

    def _learn(self, images: Images, state: State, rate: float, guard_px: int) -> None:
        offsets = [None] * len(self._rig) if self._passage is None else self._passage.offsets(state)
        bodies, around = bodies_seen(self._model, state, offsets), self._config.region.background_ring_px

        def learn(i: int) -> None:
            found = self._occluders.look(i, bodies[i], self._rig.cameras[i], around)
            image = images[i]
            if found is not None and image is not None:
                self._colors[i].learn(image, found.region, found.labels, rate, guard_px, around, self._trusted)
                if self._steady and self._config.region.learn_background:
                    self._rooms[i].learn(image, found.region, found.labels)

        self._parallel(learn, [i for i, image in enumerate(images) if image is not None])

    def _priors(self, expected: State, prior: Prior | None) -> list[Prior]:
        """The prediction, and the neutral pose where contours are silent."""
        motion = self._config.motion
        if prior is None:
            stay = np.full(self._model.n_dof, motion.stay_angle)
            stay[:3] = motion.stay_position
            prior = Prior(expected, stay / PX2_PER_INFORMATION)
        return [prior, self._rest] if self._rest.information.any() else [prior]


_BODY_CELLS = 90.0  # across the body, in the small images in which limbs are looked for
_SETTLED_PX = 0.7  # a step that moves no part farther is the last
_SETTLED_SIGMAS = 0.75  # or, by this, of what the model's contours are off
_DAMPING = 1e-3  # of a step, relative to the diagonal
_FINE_DAMPING = 1e-5  # the same of joints on the finest lines, which priors hold where images hardly do
_FIRST_RATE = 0.9  # share of the first image set in how well contours fit; later ones follow at a falling rate
_BODY_PX = 300.0  # of a body whose lines are as long as stated; others have theirs with their size
_LARGE_PX = 450.0  # of a body, above which contours are close within more than `region.inlier_px`
_LEAST_OUTLINE = 10  # samples of the outline that a camera should see, to be asked
_UNSEEN = -1e6  # surety of a body that no camera sees: worse than any that is seen
_CHANCE = 3.0  # log-likelihood ratio of a contour against none, a sample, that a body has wherever it is put


def _surety(evidence: PartEvidence) -> float:
    """Log-likelihood of the body's outline against chance; what hides behind the rest wins nothing."""
    return float((evidence.log_ratio - _CHANCE * evidence.expected).sum())
