"""The body by the colors of its parts: generate and test, for bodies that articulate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.color.score import ColorObjective, ColorOptions
from ...objective.constraints.prior import Prior
from ...objective.normal_equations import Comparison, LeastSquaresObjective, NormalEquations
from ...objective.points.photometry import PhotometryOptions, SurfacePhotometry
from ...observation.image_set import ImageSet
from ...optimize.result import OptimizerResult
from ..config import ColorConfig
from ..engine import Images, Report, Verdict
from ..estimate import CameraReport
from ..motion.model import Passage
from .hierarchy import Pulled, Stage
from .judge import ColorAgreement, agreement_of, judge_colors
from .part_colors import PartColors, check_colors
from .rigid_search import RigidSearch
from .search import ColorSearch


class ColorEngine:
    """The `Engine` of colored parts.

    Parameters
    ----------
    rig, model : as for the `Tracker`.
    parallel : maps a function over cameras.

    Raises
    ------
    ModelError : a model without colors, when none are to be learnt.
    """

    in_information_units = False

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        color: ColorConfig,
        threads: int,
        parallel: Callable[[Callable, list], list],
    ):
        self._rig, self._model, self._config = rig, model, color
        if not color.learn_colors:
            check_colors(model)
        self._options = PhotometryOptions(
            color.representation, color.normalized_weight, color.levels, robust_scale=color.robust_scale
        )
        self._photometry = SurfacePhotometry(model, rig, self._options, parallel)
        self._score: ColorObjective | RigidSearch | None = None  # what else looks at images in the parts' colors
        self._search: ColorSearch
        if color.optimizer == "alignment" and model.chain.n_axes == 0:
            self._score = self._search = RigidSearch(model, rig, color, self._photometry, threads)
        else:
            score = None
            if color.optimizer != "alignment":
                options = ColorOptions(color.representation, color.normalized_weight)
                self._score = score = ColorObjective(model, rig, options, threads=threads)
            self._search = ColorSearch(model, color, self._photometry, score)
        self.reset()

    def reset(self) -> None:
        """The colors are those of the model."""
        self._colors = PartColors(self._model, self._rig)
        self._take_colors()
        self._learnt = False
        self._rng = np.random.default_rng(self._config.seed)
        self._images: Images = [None] * len(self._rig)
        self._priors: list[Prior] = []
        self._agreement: ColorAgreement | None = None

    def _take_colors(self) -> None:
        """Those of the model are left to the model, whose faces may have colors of their own."""
        colors = self._colors.rgb if self._colors.learnt else None
        self._photometry.set_colors(colors)
        if self._score is not None:
            self._score.set_colors(colors)

    def begin(self, images: Images, start: State, *, known: bool = False) -> State:
        """Where colors are yet to be learnt: learn them, fit, and learn again, since the first pose given is rarely exact."""
        if not self._config.learn_colors or self._learnt:
            return start
        self._learnt = True
        self._learn(images, start, 1.0)
        if known:
            return start
        self.observe(images, start)
        start = self.fit(start, first=True).state
        self._learn(images, start, 1.0)
        return start

    def observe(self, images: Images, expected: State | None, passage: Passage | None = None) -> None:
        """Blur and halve the images around the expected body."""
        self._images = [None] * len(self._rig) if expected is None else images
        around = State.neutral(self._model) if expected is None else expected
        self._photometry.set_images(self._images, around, self._config.reach_px)
        if self._score is not None:
            self._score.set_images(self._images)

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> OptimizerResult:
        """From coarse to fine, and once more where limbs that have been lost are found again."""
        self._priors = self._pulls(start)
        result = self._search.run(start, self._priors, first)
        self._agreement = self._agreement_at(result.state)
        for limb in self._search.limbs:
            if self._disagrees(limb) and self._config.search_states:
                result = self._look_for(limb, result)
        return result

    def _pulls(self, expected: State) -> list[Prior]:
        config, axes = self._config, self._model.chain.axes
        stay = np.full(self._model.n_dof, config.stay_angle)
        stay[:3] = config.stay_position
        neutral = np.zeros(self._model.n_dof)
        neutral[N_ROOT_DOF:] = [config.neutral_angle * axis.stiffness for axis in axes]
        return [Prior(expected, stay), Prior(State.neutral(self._model, expected.T_world_root), neutral)]

    def _agreement_at(self, state: State) -> ColorAgreement:
        return agreement_of(self._photometry.painted, self._rig, self._images, state, self._options)

    def _disagrees(self, limb: Stage) -> bool:
        """Whether a limb is seen, and is not where it is seen."""
        return self._limb_agreement(self._agreement, limb) < self._config.degraded_agreement

    def _limb_agreement(self, agreement: ColorAgreement | None, limb: Stage) -> float:
        """Of all parts of a limb together; infinite where none is seen."""
        assert agreement is not None
        return agreement.of(limb.links[self._model.shape_links])

    def _look_for(self, limb: Stage, result: OptimizerResult) -> OptimizerResult:
        """The result with the limb where it suits better, if such a place is found."""
        found = self._search.find_limb(limb, result.state, self._rng)
        polished = self._search.run(found, self._pulls(found), first=False)
        agreement = self._agreement_at(polished.state)
        if self._limb_agreement(agreement, limb) <= self._limb_agreement(self._agreement, limb):
            return result
        self._agreement = agreement
        return replace(
            polished, iterations=result.iterations + polished.iterations, evaluations=result.evaluations + polished.evaluations
        )

    def judge(self, result: OptimizerResult, image_set: ImageSet) -> Verdict:
        """By how far colors agree, against what they would by chance."""
        assert self._agreement is not None
        return judge_colors(self._agreement, self._model, self._rig, image_set.cameras, self._config)

    def linearize(self, state: State) -> NormalEquations:
        """On the finest level, with the priors of the last fit."""
        self._agreement = self._agreement_at(state)
        return Pulled(self._photometry.at_level(0), self._priors).linearize(state)

    def evidence_at(self, state: State) -> tuple[LeastSquaresObjective, float]:
        """Colors of the surface seen in ``state``, without priors, and what their unit is in units of information."""
        level, config = self._photometry.at_level(0), self._config
        level.freeze(state)
        variance = max(self._agreement_at(state).rms, config.residual_sigma) ** 2
        return level, 1.0 / (variance * config.correlation)

    def comparison(self) -> Comparison | None:
        """Cameras are not compared: the units are grey levels."""
        return None

    def report(self, result: OptimizerResult, image_set: ImageSet) -> Report:
        """Residuals are in grey levels, where those of contours are in pixels; samples are pixels of the mask.

        The covariance is the inverse of the normal equations times the variance of a pixel; neighbors share their errors, so
        only one in ``config.correlation`` counts as independent.
        """
        agreement, config, equations = self._agreement, self._config, result.equations
        assert agreement is not None
        reports = []
        for i, camera in enumerate(self._rig):
            image = image_set.get(camera.name)
            stamp_ns, pixels = 0 if image is None else image.stamp_ns, int(agreement.pixels[i].sum())
            reports.append(CameraReport(camera.name, stamp_ns, float(agreement.camera_rms[i]), pixels))
        H = equations.H.copy()
        H[np.diag_indices_from(H)] += 1e-6 * max(float(np.diag(H).max()), 1.0)
        covariance = max(agreement.rms, config.residual_sigma) ** 2 * config.correlation * np.linalg.inv(H)
        return Report(tuple(reports), agreement.rms, 0.5 * (covariance + covariance.T))

    def learn(self, images: Images, state: State) -> None:
        """Colors follow slowly, where they are to."""
        if self._config.color_rate > 0.0:
            self._learn(images, state, self._config.color_rate)

    def _learn(self, images: Images, state: State, share: float) -> None:
        self._colors.learn(images, state, share)
        self._take_colors()
