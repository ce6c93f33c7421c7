"""Colors and contours in one least-squares problem, each as sure of itself as its covariance says."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

from ...model.configuration import State
from ...model.kinematic_chain import KinematicChain
from ...objective.constraints.prior import Prior
from ...objective.normal_equations import LeastSquaresObjective
from ...objective.sum_objective import SumObjective
from ...observation.image_set import ImageSet
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize
from ...optimize.result import OptimizerResult
from ..color.engine import ColorEngine
from ..config import TrackerConfig
from ..engine import Engine, Report
from .color_then_contour import ColorThenContourEngine


class Contours(Engine, Protocol):
    """An engine in units of information, whose last fit can be gone on with."""

    @property
    def whole(self) -> LeastSquaresObjective:
        """What the last fit has minimized at its end: contours, constraints and priors."""
        ...


class ColorWithContourEngine(ColorThenContourEngine):
    """The `Engine` of both: colors lead, contours follow, and then both pull at once (Knossow et al. name it as what comes next).

    The normal equations of the colors, divided by the variance of one pixel's color and by how many neighbors share one error,
    are an inverse covariance like those of the contours, so the two are added, each divided by what its covariances have to be
    multiplied with to be borne out by errors. Where colors do not find the body, contours are alone.
    """

    def __init__(self, colors: ColorEngine, contours: Contours, chain: KinematicChain, config: TrackerConfig):
        super().__init__(colors, contours)
        self._painted, self._outlined, self._chain, self._config = colors, contours, chain, config.joint
        self._share = 1.0 / config.joint.color_scale  # in units of the contours' information

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> OptimizerResult:
        """Iterations and evaluations are those of all three."""
        result = super().fit(start, first, prior)
        if self._lost:
            return result
        options = LevenbergMarquardtOptions(max_iterations=self._config.iterations, tolerance=1e-3)
        for _ in range(self._config.passes):
            level, information = self._painted.evidence_at(result.state)
            both = SumObjective([self._outlined.whole, level], [1.0, self._share * information])
            found = minimize(both, result.state, self._chain, options)
            result = replace(
                found, iterations=result.iterations + found.iterations, evaluations=result.evaluations + found.evaluations
            )
        return result

    def report(self, result: OptimizerResult, image_set: ImageSet) -> Report:
        """That of the contours, without where they alone would have the body: the state rests on the colors, too."""
        report = super().report(result, image_set)
        if self._lost or report.images is None:
            return report
        return replace(report, images=replace(report.images, gradient=None))
