"""Searches of the engine of regions for what its fit has not reached: a far start, a lost body, lost limbs, a wrong tilt."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.constraints.prior import Prior
from ...objective.lines.objective import PartEvidence
from ...objective.normal_equations import Comparison, LeastSquaresObjective
from ...optimize.result import OptimizerResult
from ..config import TrackerConfig
from ..estimate import LimbReport, Status
from ..parameters import numbers
from .limb_search import LimbSearch, Lines, gains
from .limb_status import LimbJudge
from .tilts import Misfit, tilted

_CLEARLY = 0.05  # share of the outline by which long lines must do better than short ones
_CLEAR_ODDS = -1.5  # log odds of lost, below which a limb is where it was found, wherever else it might have been
_LOOSE_M = 0.15  # standard deviation of where a limb's end is expected, beyond which it is looked for in any case
_LOOKS = 3  # at all limbs, at most, on the first image set
_LEAST_LINES = 0.8  # of those of another fit, that a tilted body must have to be held against it


@dataclass(frozen=True, eq=False)
class Kept:
    """What a fit leaves behind in the engine beside its result."""

    whole: LeastSquaresObjective
    comparison: Comparison | None
    model_sigma_px: float


@dataclass(frozen=True, eq=False)
class Fits:
    """How the engine fits, and how well a state is borne out by the lines last drawn.

    Attributes
    ----------
    descend : (start, scales of the lines, prior) -> result, the lines of the last scale being drawn about it.
    settled : a result with the lines drawn anew about its state, after other states have been tried.
    kept, keep : what `descend` has left in the engine; and back to that.
    part_evidence : (state, close_px) -> evidence.
    cost_per_line : robust, of the state last linearized.
    limb_lines : (predicted state) -> what the search for limbs draws and fits.
    """

    descend: Callable[[State, tuple[float, ...], Prior | None], OptimizerResult]
    settled: Callable[[OptimizerResult], OptimizerResult]
    kept: Callable[[], Kept]
    keep: Callable[[Kept], None]
    part_evidence: Callable[[State, float], PartEvidence]
    cost_per_line: Callable[[], float]
    limb_lines: Callable[[State], Lines]


class RegionSearches:
    """Knows where body and limbs were last sound; ``limbs`` says which are lost.

    Attributes
    ----------
    sound : where the body was last, before it was lost; None: nowhere yet.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, limbs: LimbJudge, fits: Fits):
        region = config.region
        self._rig, self._model, self._limbs, self._fits = rig, model, limbs, fits
        self._scales, self._close_px = numbers(region.scales), region.inlier_px
        self._first_scales, self._wide_scales = numbers(region.first_scales), numbers(region.wide_scales)
        self._pause = config.limb_search.interval_sets
        self._search = LimbSearch(model, limbs, config.limb_search, region.inlier_px)
        self.reset()

    def reset(self) -> None:
        """Nothing is remembered."""
        self.sound: State | None = None
        self._search.reset()
        self.begin()

    def begin(self) -> None:
        """A body is looked at that may be another one, or look otherwise."""
        self._misfit = Misfit()
        self._in_vain = 0  # how often a lost body has been looked for

    def remember(self, state: State, status: Status, limbs: Sequence[LimbReport]) -> None:
        """Where what is not lost has been found."""
        self._search.remember(state, limbs)
        if status is not Status.LOST:
            self.sound, self._in_vain = state, 0

    def first(self, start: State, prior: Prior | None) -> OptimizerResult:
        """Long lines reach a body that is far off, and mislead one that is near: both are tried, and the better is kept; then
        each limb is looked for where the colors would rather have it."""
        fits = self._fits
        near = fits.descend(start, self._first_scales, prior)
        kept, share = fits.kept(), self._close_share(near.state)
        far = fits.descend(start, self._wide_scales, prior)
        if self._close_share(far.state) > share + _CLEARLY:
            return self._looked_over(far, prior)
        fits.keep(kept)
        return self._looked_over(fits.settled(near), prior)

    def _looked_over(self, result: OptimizerResult, prior: Prior | None) -> OptimizerResult:
        """The same with limbs where the colors would rather have them, as long as the whole body gains by it."""
        fits, lines = self._fits, self._fits.limb_lines(result.state)
        for _ in range(_LOOKS):
            found = self._search.look_over(range(1, len(self._limbs.limbs)), result.state, result.state, lines)
            again = None if found is None else self._if_better(found, result, prior, lines)
            if again is None:
                break
            result = again
        return fits.settled(result)

    def _if_better(self, state: State, result: OptimizerResult, prior: Prior | None, lines: Lines) -> OptimizerResult | None:
        """The fit that begins at ``state``, where the colors gain more by it than by ``result``."""
        everything, kept = np.ones(len(self._model.shapes), dtype=np.bool_), self._fits.kept()
        again = self._fits.descend(state, self._scales, prior)
        old, new = gains([result.state, again.state], everything, lines)[:, 0]
        if new > old:
            return again
        self._fits.keep(kept)
        return None

    def mended(self, result: OptimizerResult, start: State, prior: Prior | None) -> tuple[OptimizerResult, bool]:
        """The fit of an image set, begun at ``start``, with what is lost found again; and whether anything was."""
        if self._model.n_dof == N_ROOT_DOF and self._misfit.is_sudden(self._fits.cost_per_line()):
            result = self._tilted_back(result, prior)
        if not self._limbs.knows:
            return result, False
        if self._limbs.body_lost and self.sound is not None:
            return self._restarted(result, self.sound)
        doubtful, lost = self._doubtful(result), self._limbs.lost
        # Of a limb that is lost nobody knows where it is: its prediction grows wide, which is no reason not to pause
        loose = [i for i in self._loose(start, prior) if i not in lost or not self._search.pauses(i)]
        if loose:
            evidence = self._fits.part_evidence(result.state, self._close_px)
            loose = [i for i in loose if self._search.odds(i, evidence) > _CLEAR_ODDS]
        if not doubtful and not loose:
            return result, False
        lines, before = self._fits.limb_lines(start), result
        if any(i not in lost for i in loose) or 0 in doubtful or len(doubtful) > 1:
            result = self._with_trunk(result, start, prior, lines)
            doubtful = self._doubtful(result)
        found = self._search.look_over(loose, result.state, start, lines)
        others = {i: odds for i, odds in doubtful.items() if i not in loose}
        if others:
            found = self._search.recover(others, found or result.state, start, lines) or found
        again = None if found is None else self._if_better(found, result, prior, lines)
        result = result if again is None else again
        jumped = result is not before and (not loose or bool(self._limbs.lost))  # what is loose may be anywhere
        return self._fits.settled(result), jumped

    def _with_trunk(self, result: OptimizerResult, start: State, prior: Prior | None, lines: Lines) -> OptimizerResult:
        """The same with the trunk, and all that hangs on it, where the colors would rather have it."""
        found = self._search.find_trunk(result.state, start, lines)
        again = None if found is None else self._if_better(found, result, prior, lines)
        return result if again is None else again

    def _loose(self, start: State, prior: Prior | None) -> list[int]:
        """Limbs that are expected at ``start``, but may be anywhere else, if most may: what has been seen long ago tells little.

        One alone is looked for when images speak against it.
        """
        if prior is None or len(self._limbs.limbs) == 1 or not self._search.tries:
            return []
        sigmas = self._limbs.tip_sigmas(start, np.linalg.inv(prior.information))
        loose = [i for i, sigma in enumerate(sigmas) if i and sigma > _LOOSE_M]
        return loose if 2 * len(loose) >= len(sigmas) - 1 else []

    def _doubtful(self, result: OptimizerResult) -> dict[int, float]:
        return self._search.doubtful(self._fits.part_evidence(result.state, self._close_px))

    def _restarted(self, result: OptimizerResult, sound: State) -> tuple[OptimizerResult, bool]:
        """A lost body is looked for where it was last sound, with longer lines; the better of that and ``result``.

        Looked for in vain twice, it is looked for in every few sets only: who is slow loses more.
        """
        self._in_vain += 1
        if self._in_vain > 2 and self._in_vain % self._pause:
            return result, False
        kept, share = self._fits.kept(), self._close_share(result.state)
        again = self.first(sound, None)
        if self._close_share(again.state) > share:
            self._in_vain = 0
            return again, True
        self._fits.keep(kept)
        return self._fits.settled(result), False

    def _tilted_back(self, result: OptimizerResult, prior: Prior | None) -> OptimizerResult:
        """A rigid body whose lines disagree all at once may be tilted to the other side: the best of all tilts and ``result``."""
        fits = self._fits
        before, least, best = fits.kept(), fits.cost_per_line(), result
        kept = before
        for state in tilted(self._model, self._rig, result.state):
            other = fits.descend(state, self._scales[-2:], prior)
            if fits.cost_per_line() < least and other.equations.count >= _LEAST_LINES * result.equations.count:
                least, best, kept = fits.cost_per_line(), other, fits.kept()
            fits.keep(before)
        fits.keep(replace(kept, model_sigma_px=before.model_sigma_px))
        return fits.settled(best)

    def _close_share(self, state: State) -> float:
        evidence = self._fits.part_evidence(state, self._close_px)
        return float(evidence.close.sum() / max(evidence.expected.sum(), 1.0))
