"""Posterior probability that each limb is lost, from its outline's evidence, the image sets before, and the covariance.

Whether a limb is where the state says is a hidden two-state process: from image set to image set it gets lost, or found, with
small probabilities, and each set's evidence multiplies the odds. The evidence is how much of the limb's outline is found where it
should be, and with what confidence, as fractions of its level while all was well: a body that is not quite the model's, or of the
color of its surroundings, is never found as a drawn one is. What such fractions say of tracked and lost limbs is a logistic
regression (see `benchmark/trust/trust.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ...model.configuration import State, configured
from ...model.humans.keypoints import is_person
from ...objective.lines.correspondences import PartEvidence
from ..config import StatusConfig
from ..estimate import LimbReport, LimbStatus, Status
from .tree import Limb, length_scale, limbs_of, thing_size
from .views import FLAT, LimbViews

LOST_TIP_M = 0.150  # a limb of a person whose end is farther off is lost
_LEAST_IN_CAMERA = 5  # samples of a limb's outline, for a camera to say anything of it
_LEAST_OF_PART = 15  # samples of a part's outline in all cameras, for it to be judged alone
_LEAST = 1e-4  # probability that nothing is ever below
_LEAST_EMPTY = 0.15  # of a limb's outline, that shows none of its colors, for it to be elsewhere...
_UNTOLD = 0.49  # ...else this is the most that its probability of being lost becomes: nothing tells it from what is behind
_MOST_FILLED = 0.5  # of the outline, on both sides of which the limb's colors may say nothing
_NOISE = 0.2  # fraction of the outline that is found anywhere
_BESIDE = 1.0  # log odds by outlines that count at most where there is other evidence
_CONFIRMED = -3.0  # log odds of lost, by the points and the outline of one set, that a limb that is seen has
_LEAST_LIMBS = 3  # that are seen, to say where the trunk is
_KNOWN_M = LOST_TIP_M / 5.0  # standard deviation of its end: one camera alone leaves its depth open
_KNOWN_OF_THING = 0.024  # the same, of the size of a smaller body that is no person, and of one without limbs...
_LEAST_OF_THING = 0.68  # ...of whose outline at least so much is found
_OF_GUESSES = 0.1  # weight of what images say of a limb that they seem to know well, but points and outline do not confirm
_CLEAR = 0.75  # of the outline of a limb in place is found, of one that need not be looked for elsewhere
_START = 0.3  # probability of lost that a limb starts with

MEASURES = ("close share, mean", "close share, median camera", "log-likelihood ratio, mean", "close share, worst part")
# Log odds of lost: the constant, and what each measure adds, in shares of its level while all is well
COEFFICIENTS = np.array([7.3, -3.3, -2.8, -0.5, -3.2])
_LEAST_LEVELS = np.array([0.40, 0.40, 5.0, 0.30])  # what is less is not well, whatever it has always been...
_LEAST_CONFIRMED = 0.25 * _LEAST_LEVELS  # ...unless points say that it is: clothes may have the colors of what is behind them
_MOST_OF_LEVEL = 1.5  # that a measure counts for
_LEVEL_RATE = 0.05  # weight of the newest image set in the levels


def known_m(model: ArticulatedModel) -> float:
    """The largest standard deviation, meters, with which the place of a body, or the end of its limb, is called known."""
    by_size_m = math.inf if is_person(model) else _KNOWN_OF_THING * thing_size(model)
    return by_size_m if len(limbs_of(model)) == 1 else min(_KNOWN_M, by_size_m)


def limb_measures(evidence: PartEvidence, shapes: np.ndarray) -> np.ndarray | None:
    """`MEASURES` of a limb.

    The close share is that of the outline found where it should be; the log-likelihood ratio is that of a contour against none,
    a sample. The median camera is, of an even number, the better: some may be covered, and one may agree by chance. The worst
    part is that of the limb's shapes of which the least is found.

    Parameters
    ----------
    evidence : of one image set.
    shapes : (n_shapes,) mask of the limb's.

    Returns
    -------
    (4,), or None where too little of the limb should be seen.
    """
    result = np.empty(len(MEASURES))
    tables = evidence.expected, evidence.filled, evidence.close, evidence.log_ratio
    return result if _measure(*tables, shapes, result) else None


@compiled
def _measure(expected, filled, close, log_ratio, shapes, result):
    """Fill ``result`` with `MEASURES`; whether any camera says enough for that. Tables are (n_cameras, n_shapes)."""
    n_cameras, n_shapes = expected.shape
    told = expected - np.minimum(filled, _MOST_FILLED * expected)
    shares, n_seen, total, total_close, confidence = np.empty(n_cameras), 0, 0.0, 0.0, 0.0
    for i in range(n_cameras):
        here, found, ratio = 0.0, 0.0, 0.0
        for j in range(n_shapes):
            if shapes[j]:
                here, found, ratio = here + told[i, j], found + close[i, j], ratio + log_ratio[i, j]
        if here >= _LEAST_IN_CAMERA:
            at, share = n_seen, found / here
            while at > 0 and shares[at - 1] > share:  # in order
                shares[at] = shares[at - 1]
                at -= 1
            shares[at] = share
            n_seen, total, total_close, confidence = n_seen + 1, total + here, total_close + found, confidence + ratio
    if not n_seen:
        return False
    worst = np.inf
    for j in range(n_shapes):
        part = told[:, j].sum() if shapes[j] else 0.0
        if part >= _LEAST_OF_PART:
            worst = min(worst, close[:, j].sum() / part)
    share = total_close / total
    result[0], result[1], result[2] = share, shares[n_seen // 2], confidence / total
    result[3] = worst if worst < np.inf else share
    return True


@compiled
def _share_of(part, whole, shapes):
    """What samples of some shapes (n_shapes,) mask are one thing, of those that are another; tables (n_cameras, n_shapes)."""
    some, most = 0.0, 0.0
    for i in range(whole.shape[0]):
        for j in range(whole.shape[1]):
            if shapes[j]:
                some, most = some + part[i, j], most + whole[i, j]
    return some / max(most, 1.0)


@compiled
def _odds(measures, levels):
    """Log odds of lost of a limb whose measures have these levels."""
    odds = COEFFICIENTS[0]
    for k in range(measures.size):
        odds += COEFFICIENTS[1 + k] * min(measures[k] / levels[k], _MOST_OF_LEVEL)
    return min(levels[0] / _LEAST_LEVELS[0], 1.0) * odds  # an outline that is hardly ever found says little


@compiled
def _of_points(links, points, Ts_link, moved_by, twists, covariance):
    """(n, 3, 3) covariances, m^2, of points (n, 3) that are fixed on links, by that of the state."""
    n = twists.shape[0]
    found, J, half, place = np.empty((links.size, 3, 3)), np.empty((n, 3)), np.empty((n, 3)), np.empty(3)
    dofs = np.empty(n, dtype=np.int64)
    for k in range(links.size):
        T, count = Ts_link[links[k]], 0
        for a in range(3):
            place[a] = T[a, 0] * points[k, 0] + T[a, 1] * points[k, 1] + T[a, 2] * points[k, 2] + T[a, 3]
        for i in range(n):
            if moved_by[links[k], i]:
                dofs[count] = i
                for a in range(3):
                    b, c = (a + 1) % 3, (a + 2) % 3
                    J[count, a] = twists[i, a] + twists[i, 3 + b] * place[c] - twists[i, 3 + c] * place[b]
                count += 1
        for i in range(count):
            half[i] = 0.0
            for j in range(count):
                for a in range(3):
                    half[i, a] += covariance[dofs[i], dofs[j]] * J[j, a]
        found[k] = 0.0
        for i in range(count):
            for a in range(3):
                for b in range(3):
                    found[k, a, b] += J[i, a] * half[i, b]
    return found


class LimbJudge:
    """Keeps the probability that each limb is lost; deterministic in what it has been given since `reset`.

    Attributes
    ----------
    limbs : the trunk first.
    probabilities : (n_limbs,) of being lost, by evidence alone.
    shares : (n_limbs, n_measures) the last `MEASURES` in shares of their levels; nan for what cannot be seen.
    was_lost : whether the body was at the last `restart`.
    """

    def __init__(self, model: ArticulatedModel, config: StatusConfig):
        self._model, self._config = model, config
        self.limbs: tuple[Limb, ...] = limbs_of(model)
        self._known_m, self._views = known_m(model), LimbViews(model, self.limbs)
        self._sigmas_of: tuple[Any, Any, np.ndarray] = None, None, np.zeros(0)  # of which state and covariance, the last ones
        self.reset()

    def reset(self) -> None:
        """Forget the evidence of limbs."""
        self._levels: np.ndarray | None = None  # (n_limbs, n_measures)
        self._set_aside: np.ndarray | None = None  # those of sets in which silhouettes help to find outlines, or do not
        self._helped: bool | None = None
        self.shares = np.full((len(self.limbs), len(MEASURES)), np.nan)
        self._views.reset()
        self.restart()

    def restart(self) -> None:
        """A state has been handed over; nobody knows how good it is."""
        self.was_lost = not self.knows or self.body_lost
        self.probabilities = np.full(len(self.limbs), _START)
        self._confirmed = np.ones(len(self.limbs), dtype=np.bool_)
        self._guessed = np.zeros(len(self.limbs), dtype=np.bool_)
        self.rivals = np.zeros(len(self.limbs), dtype=np.bool_)
        self._views.restart()

    @property
    def by_probability(self) -> list[tuple[Limb, float]]:
        """Limbs, with the probability that each is lost."""
        return list(zip(self.limbs, self.probabilities.tolist(), strict=True))

    @property
    def knows(self) -> bool:
        """Whether anything has been seen that limbs can be compared with."""
        return self._helped is not None

    @property
    def lost(self) -> list[int]:
        """Indices of the limbs that were more likely lost than not, at the last `update`."""
        return np.flatnonzero(self.probabilities >= 0.5).tolist() if self.knows else []

    @property
    def body_lost(self) -> bool:
        """Whether the trunk, or most of the limbs, are."""
        lost = self.lost
        return 0 in lost or 2 * len(lost) > len(self.limbs)

    def update(
        self, evidence: PartEvidence, state: State, covariance: np.ndarray | None = None, others: np.ndarray | None = None,
        helped: bool = False, common: np.ndarray | None = None, own_surfaces: bool = False, depth_m: float = 0.0,
        px_per_m: float = math.inf, told_joints: bool = False,
    ) -> tuple[LimbReport, ...]:  # fmt: skip
        """Take in an image set.

        Parameters
        ----------
        evidence : of the image set at ``state``.
        state : of the body.
        covariance : (n_dof, n_dof) of ``state`` in its tangent; None: not known.
        others : (n_limbs,) log odds of being lost by the points of a detector, nan without any; None: no detector has looked.
        helped : silhouettes of a detector help to find the outlines.
        common : (n_limbs,) mask of those whose colors are all around: little tells them from what is behind; None: of none.
        own_surfaces : the shapes are those that are seen: outlines count beside points as they do alone.
        depth_m : standard deviation of the depth of the whole body, beside ``covariance``.
        px_per_m : pixels of a meter at the body: outlines alone do not tell narrow limbs from others.
        told_joints : the body has said where its joints are: depth is known.

        Returns
        -------
        One report a limb, the trunk's first.
        """
        measures = [limb_measures(evidence, limb.shapes) for limb in self.limbs]
        if self._helped is not None and helped != self._helped:
            self._levels, self._set_aside = self._set_aside, self._levels
        self._helped = helped
        if self._levels is None:
            self._levels = self._first_levels(measures)
        sigmas = np.zeros(len(self.limbs)) if covariance is None else self.tip_sigmas(state, covariance)
        doubts = [self._deep(depth_m)] * len(self.limbs)
        if others is None:
            found = np.array([np.nan if each is None else each[0] for each in measures])
            by_views = self._views.doubts(evidence, found, px_per_m, told_joints)
            doubts = [deep or doubt for deep, doubt in zip(doubts, by_views, strict=True)]
            others = np.full(len(self.limbs), np.nan)
            others[0] = self._trunk_by_limbs(measures)
        else:
            self._views.told()
        beside = self._config.evidence_limit if own_surfaces else _BESIDE
        empty = [_share_of(evidence.empty, evidence.expected, limb.shapes) for limb in self.limbs]
        told = [share >= _LEAST_EMPTY and (common is None or not common[i]) for i, share in enumerate(empty)]
        each = zip(measures, sigmas.tolist(), others.tolist(), told, strict=True)
        reports = (self._limb(i, *of_limb, beside) for i, of_limb in enumerate(each))
        return tuple(map(LimbReport.doubted, reports, doubts))

    def _trunk_by_limbs(self, measures: Sequence[np.ndarray | None]) -> float:
        """Log odds of the trunk being lost by the limbs that hang on it; nan unless most of those that are seen are in place.

        A trunk in clothes of the wall's colors has no outline that could be found, but limbs are not in place without it.
        """
        seen = sorted(self.odds(i, each) for i, each in enumerate(measures) if i and each is not None)
        if measures[0] is None or len(seen) < _LEAST_LIMBS:
            return math.nan
        most = seen[len(seen) // 2]  # of an even number, the worse of the two in the middle
        return most if most < 0.0 else math.nan

    def odds(self, i: int, measures: np.ndarray) -> float:
        """Log odds of a limb being lost, by one image set alone.

        Parameters
        ----------
        i : index of the limb.
        measures : of `limb_measures`.

        Returns
        -------
        Natural logarithm.
        """
        assert self._levels is not None
        return _odds(measures, self._levels[i])

    def _first_levels(self, measures: Sequence[np.ndarray | None]) -> np.ndarray:
        """Those of the median limb, for all: one that is off from the beginning is not to be the standard of itself; its own of
        a limb that was in place in sets of the other kind."""
        seen = [m for m in measures if m is not None]
        median = np.median(seen, axis=0) if seen else _LEAST_LEVELS
        levels = np.tile(np.maximum(median, _LEAST_LEVELS), (len(self.limbs), 1))
        for i, own in enumerate(measures):
            if self._set_aside is not None and own is not None and self.probabilities[i] < self._config.limb_degraded:
                levels[i] = np.maximum(own, _LEAST_CONFIRMED)
        return levels

    def nothing_seen(self) -> tuple[LimbReport, ...]:
        """Reports of a set in which no camera sees anything."""
        config = self._config
        self.probabilities = self.probabilities + (1.0 - self.probabilities) * config.limb_loss
        paired = zip(self.limbs, self.probabilities, strict=True)
        return tuple(LimbReport(limb.name, LimbStatus.UNSEEN, "in no image", float(p)) for limb, p in paired)

    def _limb(
        self, i: int, measures: np.ndarray | None, sigma_m: float, others: float, told: bool, beside: float
    ) -> LimbReport:  # fmt: skip
        config, limb, before = self._config, self.limbs[i], self.probabilities[i]
        p = before * (1.0 - config.limb_recovery) + (1.0 - before) * config.limb_loss
        elsewhere = _beyond(self._lost_tip_m, sigma_m)
        if i > 0:  # what hangs on a lost trunk is lost, whatever it happens to lie on
            elsewhere = max(elsewhere, float(self.probabilities[0]))
        outline, self.shares[i] = 0.0, np.nan
        if measures is not None:
            assert self._levels is not None
            outline, self.shares[i] = self.odds(i, measures), np.minimum(measures / self._levels[i], _MOST_OF_LEVEL)
        if i > 0 and not math.isnan(others):
            agrees = others + max(outline, -beside) <= _CONFIRMED
            self._confirmed[i] = agrees and sigma_m <= self._known_m
            self._guessed[i] = not agrees and sigma_m <= (self._known_m if p < config.limb_lost else self._lost_tip_m)
        others = 0.0 if math.isnan(others) else others
        if measures is None and not others:
            self.probabilities[i] = p
            return LimbReport(limb.name, LimbStatus.UNSEEN, "hidden, or in no image", 1.0 - (1.0 - p) * (1.0 - elsewhere))
        if others:  # which limb it is they know; how much of an outline is found depends on clothes and walls
            outline = min(max(outline, -beside), beside)
        odds = min(max(outline + others, -config.evidence_limit), config.evidence_limit)
        p = min(max(1.0 / (1.0 + (1.0 - p) / p * math.exp(-odds)), _LEAST), 1.0 - _LEAST)
        if i > 0 and not others and not told and p > before:
            p = max(min(p, _UNTOLD), before)
        self.probabilities[i] = p
        if p < config.limb_degraded and measures is not None and self._confirmed[i]:
            assert self._levels is not None
            least = _LEAST_CONFIRMED if others else np.minimum(self._levels[i], _LEAST_LEVELS)
            self._levels[i] = np.maximum(self._levels[i] + _LEVEL_RATE * (measures - self._levels[i]), least)
        probability = 1.0 - (1.0 - p) * (1.0 - elsewhere)
        status, reason = self._status(probability), ""
        if status is LimbStatus.TRACKING and self.rivals[i]:
            status, reason = LimbStatus.DEGRADED, "it may as well be elsewhere"
        elif status is LimbStatus.TRACKING and not self._confirmed[i]:
            status, reason = LimbStatus.DEGRADED, "hidden, or not where a detector guesses it"
            if sigma_m > self._known_m:
                reason = f"its end is known to {1e3 * sigma_m:.0f} mm"
        elif status is not LimbStatus.TRACKING:
            reason = "its points are elsewhere"
            if measures is not None and others <= max(outline, 0.0):
                reason = f"{100.0 * measures[0]:.0f} % of its outline are found"
            if elsewhere > p:
                by_itself = sigma_m > self._lost_tip_m / 3.0
                reason = f"its end may be elsewhere: known to {1e3 * sigma_m:.0f} mm" if by_itself else "the trunk is"
        return LimbReport(limb.name, status, reason, probability)

    def _deep(self, depth_m: float) -> str:
        """Why limbs that are where their outlines are may be elsewhere along the rays; "" if there is no reason."""
        return f"its depth is known to {1e3 * depth_m:.0f} mm" if depth_m > self._known_m else ""

    def _status(self, probability: float) -> LimbStatus:
        if probability >= self._config.limb_lost:
            return LimbStatus.LOST
        return LimbStatus.DEGRADED if probability >= self._config.limb_degraded else LimbStatus.TRACKING

    def tip(self, i: int, state: State) -> np.ndarray:
        """Where a limb ends.

        Parameters
        ----------
        i : index of the limb.
        state : of the body.

        Returns
        -------
        (3,) meters, world.
        """
        T = configured(self._model, state).Ts_world_link[self.limbs[i].end]
        return T[:3, :3] @ self.limbs[i].tip + T[:3, 3]

    @property
    def unsure(self) -> list[int]:
        """Limbs in place that may as well be elsewhere, as outlines are hard to find, and those with a rival.

        However likely they seem to be in place: what lies on another outline has been found as well in set after set.
        """
        if self._levels is None:
            return []
        odd = (self.probabilities < self._config.limb_lost) & (self._levels[:, 0] < _CLEAR)
        return [i for i in np.flatnonzero(odd | self.rivals).tolist() if i]

    def tip_sigmas(self, state: State, covariance: np.ndarray) -> np.ndarray:
        """How well the end of each limb is known.

        Parameters
        ----------
        state : of the body.
        covariance : (n_dof, n_dof) of it in its tangent.

        Returns
        -------
        (n_limbs,) meters, the standard deviation in the most uncertain direction.
        """
        if self._sigmas_of[0] is state and self._sigmas_of[1] is covariance:
            return self._sigmas_of[2]
        body = configured(self._model, state)
        of_tips = _of_points(*self._tips, body.Ts_world_link, self._model.chain.link_moved_by, body.twists, covariance)
        sigmas = np.sqrt(np.maximum(np.linalg.eigvalsh(of_tips)[:, -1], 0.0))
        self._sigmas_of = state, covariance, sigmas
        return sigmas

    def doubt(self, evidence: PartEvidence, state: State, covariance: np.ndarray) -> str:
        """Whether a body without limbs may not quite be where it has been found.

        One camera sees little of the depth. Its colors are learned all the same: without, it is lost next.

        Parameters
        ----------
        evidence : of the image set at ``state``.
        state, covariance : of the body; (n_dof, n_dof) in its tangent.

        Returns
        -------
        The reason; "" if there is none.
        """
        if len(self.limbs) > 1:
            return ""
        found = float(evidence.close.sum() / max(evidence.expected.sum(), 1.0))
        if found < _LEAST_OF_THING:
            return f"{100.0 * found:.0f} % of its outline are found"
        sigma_m = float(self.tip_sigmas(state, covariance)[0])
        return f"{self.limbs[0].name} is known to {1e3 * sigma_m:.0f} mm" if sigma_m > self._known_m else ""

    @cached_property
    def _tips(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_limbs,) links that limbs end on, and (n_limbs, 3) where in them, meters."""
        return np.array([limb.end for limb in self.limbs]), np.array([limb.tip for limb in self.limbs])

    @cached_property
    def _lost_tip_m(self) -> float:
        """How far off the end of a limb that is lost is, meters."""
        return LOST_TIP_M * (min(length_scale(self._model), 1.0) if len(self.limbs) > 1 else 1.0)

    def part_weights(self, reports: Sequence[LimbReport]) -> np.ndarray:
        """(n_shapes,) 1 for the parts of limbs that are TRACKING, or in place where one camera alone sees them; 0 for others."""
        result = np.ones(len(self._model.shapes))
        for limb, report in zip(self.limbs, reports, strict=True):
            if report.status is not LimbStatus.TRACKING and report.reason != FLAT:  # without its colors it is lost next
                result[limb.shapes] = 0.0
        return result

    def dof_weights(self, reports: Sequence[LimbReport]) -> np.ndarray:
        """(n_dof,) factor of the square root of the information that the images give.

        1 where a limb is in place, towards 0 as it is lost: what was fitted to another thing says nothing of it. Little where it
        is hidden, and a detector guesses.
        """
        result = np.ones(self._model.n_dof)
        for limb, report, guessed in zip(self.limbs, reports, self._guessed, strict=True):
            if report.status is LimbStatus.LOST:
                result[limb.dofs] = math.sqrt(1.0 - min(report.probability, 1.0 - 1e-4))
            if guessed:
                result[limb.dofs] = np.minimum(result[limb.dofs], _OF_GUESSES)
        return result


def _beyond(distance: float, sigma: float) -> float:
    """Probability that a normal variable is farther than ``distance`` from its mean."""
    return math.erfc(distance / (math.sqrt(2.0) * sigma)) if sigma > 0.0 else 0.0


def is_noise(evidence: PartEvidence) -> bool:
    """Whether so little of the outline is found that what was fitted cannot be the body at all."""
    return bool(evidence.close.sum() < _NOISE * evidence.expected.sum())


def body_status(reports: Sequence[LimbReport]) -> tuple[Status, str]:
    """Of the whole body, and why: LOST with its trunk, or with most of its parts that are seen; DEGRADED with any limb.

    The trunk is one of these: a person whose arms and head are lost stands where trunk and legs are.
    """
    trunk, limbs = reports[0], reports[1:]
    lost = [limb for limb in limbs if limb.status is LimbStatus.LOST]
    unseen = [limb for limb in limbs if limb.status is LimbStatus.UNSEEN]
    if trunk.status is LimbStatus.UNSEEN and len(unseen) == len(limbs):
        return Status.LOST, "no camera sees the body where it is expected"
    if trunk.status is LimbStatus.LOST:
        return Status.LOST, f"{trunk.name}: {trunk.reason}"
    seen = len(limbs) - len(unseen)
    if seen > 1 and 2 * len(lost) > seen + 1:
        return Status.LOST, f"{len(lost)} of {seen} limbs that should be seen are lost"
    for status, word in ((LimbStatus.LOST, "lost"), (LimbStatus.DEGRADED, "uncertain"), (LimbStatus.UNSEEN, "unseen")):
        named = [limb.name for limb in reports if limb.status is status]
        if named:
            return Status.DEGRADED, f"{', '.join(named)} {word}"
    return Status.TRACKING, ""
