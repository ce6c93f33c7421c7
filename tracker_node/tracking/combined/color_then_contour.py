"""Two engines in one step: colors say where the body is, contours from there on how exactly."""

from __future__ import annotations

from dataclasses import replace

from ...model.configuration import State
from ...objective.constraints.prior import Prior
from ...objective.normal_equations import Comparison, NormalEquations
from ...observation.image_set import ImageSet
from ...optimize.result import OptimizerResult
from ..engine import Engine, Images, Report, Verdict
from ..estimate import Status
from ..motion.model import Passage


class ColorThenContourEngine:
    """The `Engine` of colors, whose answer is where that of contours begins; status and covariance are those of the contours.

    Where colors do not find the body, contours begin where it is expected.
    """

    in_information_units = True

    def __init__(self, colors: Engine, contours: Engine):
        self._colors, self._contours = colors, contours
        self._images: Images = ()
        self._passage: Passage | None = None
        self._waiting = True
        self._jumped = False
        self._lost = True

    def reset(self) -> None:
        """Both."""
        self._colors.reset()
        self._contours.reset()

    def begin(self, images: Images, start: State, *, known: bool = False) -> State:
        """Contours learn where colors have led."""
        start = self._colors.begin(images, start, known=known)
        return self._contours.begin(images, start, known=known)

    def observe(self, images: Images, expected: State | None, passage: Passage | None = None) -> None:
        """What contours see depends on what colors have found, and so is looked at in `fit`."""
        self._images, self._passage, self._waiting = images, passage, expected is None
        self._colors.observe(images, expected, passage)

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> OptimizerResult:
        """Iterations and evaluations are those of both."""
        found = self._colors.fit(start, first)
        verdict = None if self._waiting else self._colors.judge(found, ImageSet(0, ()))
        self._lost = lost = verdict is None or verdict.status is Status.LOST
        self._jumped = not lost and verdict is not None and verdict.jumped
        begin = start if lost else found.state
        self._contours.observe(self._images, None if self._waiting else begin, self._passage)
        result = self._contours.fit(begin, first, prior)
        return replace(
            result, iterations=result.iterations + found.iterations, evaluations=result.evaluations + found.evaluations
        )

    def judge(self, result: OptimizerResult, image_set: ImageSet) -> Verdict:
        """Of the contours; colors know whether the body was found far from where it was expected."""
        return replace(self._contours.judge(result, image_set), jumped=self._jumped)

    def linearize(self, state: State) -> NormalEquations:
        """Of the contours."""
        return self._contours.linearize(state)

    def comparison(self) -> Comparison | None:
        """Of the contours."""
        return self._contours.comparison()

    def report(self, result: OptimizerResult, image_set: ImageSet) -> Report:
        """Of the contours."""
        return self._contours.report(result, image_set)

    def learn(self, images: Images, state: State) -> None:
        """Both."""
        self._colors.learn(images, state)
        self._contours.learn(images, state)
