"""What a fit to lines cannot reach: a first pose that is far off, a lost body, the trunk, limbs, a box tilted the other way.

Each search fits from other states, and keeps the fit that the images bear out better.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State, configured
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.constraints.prior import Prior
from ...objective.lines.correspondences import PartEvidence
from ...optimize.fitter import Fit
from ..assessment import Assessment
from ..config import TEXTURE, TrackerConfig
from ..engine import Solver
from ..estimate import Status
from ..keypoints.fitting import KeypointFitting
from ..limbs.judge import LimbJudge
from ..limbs.tree import thing_size
from ..parameters import numbers
from ..poses import Poses
from .area import RegionArea
from .fitting import LineFit, RegionFitting
from .limb_modes import PartPose
from .limb_search import LimbSearch
from .rigid_modes import RigidModes

_CLEARLY = 0.05  # fraction of the outline by which long lines must do better than short ones
_CLEAR_ODDS = -1.5  # log odds of lost, below which a limb is where it was found, wherever else it might have been
_UNCERTAIN_M = 0.15  # standard deviation of where a limb's end is expected, beyond which it is searched in any case
_FIRST_ROUNDS = 3  # of trying all limbs elsewhere, at most, on the first image set
_REST_SETS = 3  # from one search for limbs to the next while points come, which do without: live, one after another is too much
_POINTS_COME = 30  # image sets since the last points, within which they do
_FAR_M = 0.1  # of a part where points have led it from where it is expected, beyond which contours are asked
_RIVAL_SETS = 3  # from one look for a place that a limb may have as well to the next: it takes as long as half an image set


class _Pace:
    """When searches are due, which take longer than an image set may: of limbs, and of a lost body, every ``interval_sets``."""

    def __init__(self, interval_sets: int):
        self._interval_sets = interval_sets
        self.reset()

    def reset(self) -> None:
        """No points have come, and nothing has been searched."""
        self._failed = 0  # searches for a lost body in a row
        self._since_points, self._since_limbs = _POINTS_COME, _REST_SETS  # image sets
        self._until_rivals = 0

    def next_set(self, has_points: bool) -> None:
        """An image set comes, with points or without."""
        self._since_points = 0 if has_points else self._since_points + 1
        self._since_limbs = 0 if has_points else self._since_limbs + 1  # points have put limbs where they are

    @property
    def points_come(self) -> bool:
        """Whether points have come lately, and will again: they know which limb is where."""
        return self._since_points < _POINTS_COME

    @property
    def limbs_due(self) -> bool:
        """Whether limbs may be searched."""
        return not self.points_come or self._since_limbs >= _REST_SETS

    def rivals_due(self) -> bool:
        """Whether another place may be looked for, to be asked once a set: in every few sets, unless points come, which know."""
        self._until_rivals = (self._until_rivals or _RIVAL_SETS) - 1
        return self._until_rivals == 0 and not self.points_come

    def limbs_searched(self) -> None:
        """They have been."""
        self._since_limbs = 0

    def body_due(self) -> bool:
        """Whether a body that is still lost may be searched: in every few sets, once two searches have failed."""
        self._failed += 1
        return self._failed <= 2 or self._failed % self._interval_sets == 0

    def body_found(self) -> None:
        """It is not lost."""
        self._failed = 0


@dataclass(frozen=True, eq=False)
class _ImagesOfSet:
    """The present images for `LimbSearch`; contours are taken to be off by ``model_sigma_px``."""

    fitting: RegionFitting
    area: RegionArea
    inlier_px: float
    model_sigma_px: float

    def gains(self, poses: Poses, shapes: np.ndarray) -> np.ndarray:
        return self.area.gains(poses, shapes)

    def fit_part(self, state: State, dofs: np.ndarray) -> PartPose:
        fit = self.fitting.fit_part(state, dofs, self.model_sigma_px)
        return PartPose(fit.state, self.fitting.region.part_evidence(fit.correspondences, fit.state, self.inlier_px))


class Reacquisition(Solver):
    """Fits with searches; knows where body and limbs were last tracked.

    Parameters
    ----------
    rig, model, config : as for the `Tracker`.
    judge : says which limbs are lost.
    fitting : fits to lines.
    area : scores poses by the colors that they cover.
    points : fits to the points of a detector, which know where limbs are, in place of searches; None: there are none.

    Attributes
    ----------
    tracked : where the body was last, before it was lost; None: nowhere yet.
    """

    def __init__(
        self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, judge: LimbJudge, fitting: RegionFitting,
        area: RegionArea, points: KeypointFitting | None = None,
    ):  # fmt: skip
        self._rig, self._model, self._region = rig, model, config.region
        self._judge, self._fitting, self._area = judge, fitting, area
        self._points = points
        self._all_scales = numbers(config.region.scales)
        self._search, self._pace = LimbSearch(model, judge, config.limb_search), _Pace(config.limb_search.interval_sets)
        self._scales = self._all_scales
        has_modes = model.n_dof == N_ROOT_DOF and config.colors in (None, TEXTURE)  # colors of its own tell modes apart
        self._rigid = RigidModes(rig, model, fitting, self._evidence) if has_modes else None
        if len(judge.limbs) > 1 and self._search.enabled and len(self._all_scales) > 2:
            self._scales = self._all_scales[1:]  # coarse lines find a narrow limb on any stripe of its color
        self.reset()

    def reset(self) -> None:
        """Nothing is remembered."""
        self.tracked: State | None = None
        self._model_sigma_px = self._region.model_sigma_px
        self._search.reset()
        self._forget()

    def _forget(self) -> None:
        if self._rigid is not None:
            self._rigid.reset()
        self._looked = 0
        self._pace.reset()

    def restart(self) -> bool:
        """The body that comes may be another one, or look otherwise, unless it was tracked until now."""
        if self.tracked is not None and not self._judge.was_lost:
            return True
        self._forget()
        return False

    def support(self, state: State) -> float | None:
        """What the colors of the whole body gain; None before it was tracked."""
        return None if self.tracked is None else float(self._area.gains(Poses.of([state]), self._everything())[0, 0])

    def _everything(self) -> np.ndarray:
        return np.ones(len(self._model.shapes), dtype=np.bool_)

    def fit(self, start: State, first: bool, prior: Prior | None) -> LineFit:
        """A few Gauss-Newton steps on the lines of each scale, and searches for what they have not reached."""
        has_points = self._points is not None and self._points.modality.has_points
        self._pace.next_set(has_points)
        if self._points is not None and has_points:
            fit = self._led_by_points(self._points, start, first, prior)
        elif first:
            fit = self.first(start, prior, self._model_sigma_px)
        else:
            fit = self.improved(self._fitting.fit(start, self._scales, prior, self._model_sigma_px), start, prior)
        fit = self._with_modes(fit, prior)
        if self._rigid is not None:
            fit = self._with_rigid_modes(self._rigid, fit, prior, first)
        self._model_sigma_px = fit.model_sigma_px
        return fit

    def refit(self, start: State, prior: Prior | None) -> LineFit:
        if self._points is not None and self._points.modality.has_points:
            fit = self._led_by_points(self._points, start, False, prior)
        else:
            fit = self._fitting.fit(start, self._scales, prior, self._model_sigma_px)
        self._model_sigma_px = fit.model_sigma_px
        return fit

    def fit_start(self, start: State) -> LineFit:
        return self._fitting.redrawn(self.refit(start, None))

    def _led_by_points(self, points: KeypointFitting, start: State, first: bool, prior: Prior | None) -> LineFit:
        """Lines from where the points have the body: no limb needs a search; a LOST one is where they are, not where it was."""
        scales = numbers(self._region.first_scales) if first else self._all_scales
        led = points.fit(start, first, prior).state
        found = None if first or self._judge.body_lost else self._limbs_by_points(points, led)
        if found is None:
            fit = self._fitting.fit(led, scales, prior, self._model_sigma_px)
        else:
            fit = replace(self._fitting.fit(found, scales, None, self._model_sigma_px), jumped=True)
        if self._fitting.finds_own_surfaces(fit.state):
            fit = replace(self._fitting.fit(fit.state, scales, prior, self._model_sigma_px), jumped=fit.jumped)
        held = None if first else self._held_by_lines(fit, start, prior)
        return replace(self._fitting.redrawn(held or fit), jumped=held is None and fit.jumped)

    def _held_by_lines(self, fit: LineFit, start: State, prior: Prior | None) -> LineFit | None:
        """A fit from where the body is expected, where points have led ``fit`` far from there, and colors speak against it.

        Contours that lie on the model's own shapes tell that; around clothes they do not, and points that err are rarer.
        """
        if not self._fitting.region.surfaces_are_own:
            return None
        apart = configured(self._model, fit.state).Ts_world_shape - configured(self._model, start).Ts_world_shape
        if np.linalg.norm(apart[:, :3, 3], axis=1).max() < _FAR_M:
            return None
        return self._if_better(start, fit, prior)

    def _limbs_by_points(self, points: KeypointFitting, led: State) -> State | None:
        """The state with LOST limbs where their points are; None where none is elsewhere."""
        found = None
        for i in self._judge.lost:
            found = points.limb_elsewhere(found or led, self._judge.limbs[i].dofs) or found
        return found

    def remember(self, fit: Fit, assessment: Assessment) -> None:
        """Keep where body and limbs are, if they are in place."""
        if assessment.part_weights is None:
            return
        self._search.remember(fit.state, assessment.limbs)
        if assessment.status is not Status.LOST:
            self.tracked = fit.state
            self._pace.body_found()

    def first(self, start: State, prior: Prior | None, model_sigma_px: float) -> LineFit:
        """The fit of a first image set.

        Long lines reach a body that is far off, and mislead one that is near: from short to long, those are kept by which clearly
        more of the outline is found; then each limb is tried elsewhere.

        Parameters
        ----------
        start : where the body is said to be.
        prior : in information units, or None.
        model_sigma_px : of `RegionFitting.fit`.

        Returns
        -------
        The best fit, with lines drawn about its state.
        """
        fitting, region = self._fitting, self._region
        best = fitting.fit(start, self._scales, prior, model_sigma_px)
        for scales in (region.first_scales, region.wide_scales):
            other = fitting.fit(start, numbers(scales), prior, best.model_sigma_px)
            if self._close_share(other) > self._close_share(best) + _CLEARLY:
                best = other
        return self._with_limbs_elsewhere(fitting.redrawn(best), prior)

    def _with_limbs_elsewhere(self, fit: LineFit, prior: Prior | None) -> LineFit:
        """The same with limbs where the colors speak for them, as long as the whole body gains by it."""
        limbs = range(1, len(self._judge.limbs))
        for _ in range(_FIRST_ROUNDS):
            found = self._search.try_elsewhere(limbs, fit.state, fit.state, self._images(fit))
            again = None if found is None else self._if_better(found, fit, prior)
            if again is None:
                break
            fit = again
        return self._fitting.redrawn(fit)

    def _if_better(self, state: State, fit: LineFit, prior: Prior | None) -> LineFit | None:
        """The fit that begins at ``state``, where the colors gain more by it than by ``fit``."""
        return self._better(self._fitting.fit(state, self._scales, prior, fit.model_sigma_px), fit)

    def _better(self, other: LineFit, fit: LineFit) -> LineFit | None:
        """``other``, where the colors gain more by it than by ``fit``."""
        old, new = self._area.gains(Poses.of([fit.state, other.state]), self._everything())[:, 0]
        return other if new > old else None

    def improved(self, fit: LineFit, start: State, prior: Prior | None) -> LineFit:
        """The fit of a later image set, with what is lost found again.

        Parameters
        ----------
        fit : of the whole body, begun at ``start``.
        start : where the body was expected.
        prior : in information units, or None.

        Returns
        -------
        The best fit; ``jumped`` where something lost has been found.
        """
        if not self._judge.knows:
            return fit
        if self._judge.body_lost and self.tracked is not None:
            return self._restarted(fit, self.tracked)
        if not self._pace.limbs_due:
            return fit
        doubtful, lost = self._doubtful(fit), self._judge.lost
        # Of a lost limb nobody knows where it is: its prediction grows wide, which is no reason not to pause
        uncertain = [i for i in self._uncertain(start, prior) if i not in lost or not self._search.pauses(i)]
        if uncertain:
            evidence = self._evidence(fit)
            uncertain = [i for i in uncertain if self._search.odds(i, evidence) > _CLEAR_ODDS]
        if not doubtful and not uncertain:
            self._look_elsewhere(fit, start)
            return fit
        self._pace.limbs_searched()
        before = fit
        if doubtful and self._scales is not self._all_scales:  # the longest lines reach what has moved far, or anything else
            coarse = self._better(self._fitting.fit(start, self._all_scales, prior, fit.model_sigma_px), fit)
            if coarse is not None:
                fit, doubtful = coarse, self._doubtful(coarse)
                before = fit  # begun where the body was expected: no jump
        if any(i not in lost for i in uncertain) or 0 in doubtful or len(doubtful) > 1:
            fit = self._with_trunk(fit, start, prior)
            doubtful = self._doubtful(fit)
        images = self._images(fit)
        found = self._search.try_elsewhere(uncertain, fit.state, start, images)
        others = {i: odds for i, odds in doubtful.items() if i not in uncertain}
        if others:
            found = self._search.recover(others, found or fit.state, start, images) or found
        again = None if found is None else self._if_better(found, fit, prior)
        fit = fit if again is None else again
        jumped = fit is not before and (not uncertain or bool(self._judge.lost))  # what is uncertain may be anywhere
        return replace(self._fitting.redrawn(fit), jumped=jumped)

    def _look_elsewhere(self, fit: LineFit, start: State) -> None:
        """Look where else one limb may be that is in place, but not quite surely: another limb with every set."""
        unsure = self._judge.unsure if self._search.enabled and self._pace.rivals_due() else []
        if unsure:
            self._pace.limbs_searched()
            self._looked = min(unsure, key=lambda i: (i <= self._looked, i))
            self._search.look_elsewhere(self._looked, fit.state, start, self._images(fit))

    def _with_modes(self, fit: LineFit, prior: Prior | None) -> LineFit:
        """The same with limbs in modes that have come to speak clearly for themselves, and still do in a fit of the body."""
        modes = self._search.modes
        if self._judge.body_lost or self._pace.points_come:
            modes.reset()
        if modes.followed:
            evidence = self._evidence(fit)
            for i, moved in modes.follow(fit.state, evidence, self._images(fit)).items():
                own = self._judge.limbs[i].dofs[N_ROOT_DOF:]  # another limb may have been moved before
                there = State(fit.state.T_world_root, np.where(own, moved.joint_positions, fit.state.joint_positions))
                other = self._fitting.fit(there, self._scales, prior, fit.model_sigma_px)
                other_evidence = self._evidence(other)
                if modes.gain(i, other_evidence, evidence) > 0.0:
                    modes.drop(i)
                    fit, evidence = replace(self._fitting.redrawn(other), jumped=True), other_evidence
        self._judge.rivals[:] = np.isin(np.arange(len(self._judge.limbs)), modes.followed)
        return fit

    def _with_rigid_modes(self, modes: RigidModes, fit: LineFit, prior: Prior | None, first: bool) -> LineFit:
        """The same, or another mode that is clearly better, with the modes beside it."""
        if not first and self._judge.body_lost:
            modes.reset()
            return fit
        return modes.look(fit, prior, first)

    def _with_trunk(self, fit: LineFit, start: State, prior: Prior | None) -> LineFit:
        """The same with the trunk, and all that hangs on it, where the colors speak for it."""
        found = self._search.find_trunk(fit.state, start, self._images(fit))
        again = None if found is None else self._if_better(found, fit, prior)
        return fit if again is None else again

    def _uncertain(self, start: State, prior: Prior | None) -> list[int]:
        """Limbs that are expected at ``start``, but may be anywhere else, if most may: what was seen long ago says little.

        One alone is searched when images speak against it.
        """
        if prior is None or len(self._judge.limbs) == 1 or not self._search.enabled:
            return []
        covariance = np.linalg.inv(prior.information) if prior.inverse is None else prior.inverse
        sigmas = self._judge.tip_sigmas(start, covariance)
        uncertain = [i for i, sigma in enumerate(sigmas) if i and sigma > _UNCERTAIN_M]
        return uncertain if 2 * len(uncertain) >= len(sigmas) - 1 else []

    def _restarted(self, fit: LineFit, tracked: State) -> LineFit:
        """A lost body is searched where it was last tracked, with longer lines; the better of that and ``fit``.

        Lines that lead it farther than it is long show something else, or tell nothing of its depth.
        After two failed searches, it is searched in every few sets only: who is slow loses more.
        """
        if not self._pace.body_due():
            return fit
        again = self.first(tracked, None, fit.model_sigma_px)
        moved_m = np.linalg.norm(again.state.T_world_root[:3, 3] - tracked.T_world_root[:3, 3])
        if moved_m < thing_size(self._model) and self._close_share(again) > self._close_share(fit):
            self._pace.body_found()
            return replace(again, jumped=True)
        return self._fitting.redrawn(fit)

    def _images(self, fit: LineFit) -> _ImagesOfSet:
        return _ImagesOfSet(self._fitting, self._area, self._region.inlier_px, fit.model_sigma_px)

    def _evidence(self, fit: LineFit) -> PartEvidence:
        return self._fitting.region.part_evidence(fit.correspondences, fit.state, self._region.inlier_px)

    def _doubtful(self, fit: LineFit) -> dict[int, float]:
        return self._search.doubtful(self._evidence(fit))

    def _close_share(self, fit: LineFit) -> float:
        evidence = self._evidence(fit)
        return float(evidence.close.sum() / max(evidence.expected.sum(), 1.0))
