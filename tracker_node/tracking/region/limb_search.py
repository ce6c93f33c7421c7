"""Search for a limb: in many poses by the area that it would cover, then in the best of them by its contours.

The poses are where the limb was last tracked, where it is predicted, at rest, as its partner on the other side is, mirrored about
rest, at random about those, and at random within the joints' limits; then about the best of them, closer and closer. Their
score is that of the colors that the limb would cover. The best few are fitted to correspondence lines, the limb's degrees of
freedom alone. A fit is taken if the colors speak for it, and its outline is that of a limb in place; where none is, the likeliest
places are followed (`limb_modes`). So many poses are tried per image set that the effort stays bounded; a limb that is not found
is searched again in the next. The generator is seeded.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.lines.correspondences import PartEvidence
from ..config import LimbSearchConfig
from ..estimate import LimbReport, LimbStatus
from ..limbs.judge import LimbJudge, limb_measures
from ..limbs.tree import Limb
from ..poses import Apart, Poses, PoseSearch, Round
from .limb_modes import LimbModes, SearchedSet

_SPREADS_RAD = (0.2, 0.6)  # of random poses about likely ones
_WANDERERS = 0.25  # fraction of the random poses that may be anywhere within the limits
_FIRST = 0.4  # fraction of all poses that are tried before the best of them are searched around
_ROUNDS_RAD = (0.25, 0.15, 0.08, 0.04)  # how far around, round by round
_BEST = 6  # of them that are searched around...
_APART_RAD = 0.2  # ...and differ in some joint by this at least
_TRUNK_COSTS = 3  # times as much to try the whole body as a limb
_TRUNK_SPREAD_M, _TRUNK_SPREAD_RAD = 0.08, 0.2
_TRUNK_ROUNDS = (1.0, 0.5, 0.25)  # fractions of that, round by round
_TRUNK_BEST = 4  # that are searched around
_LIMBS_A_SET = 2  # that are searched
_IN_A_ROW = 2  # failed searches for a limb, before it pauses
_FOUND_ODDS = 0.5  # log odds of lost that a limb must have to be taken for found...
_BETTER_ODDS = 1.5  # ...and how much less they must be than where it is now
_LIKELIEST = 2  # of the likely places: where a limb was tracked, and where it was expected
_GAIN = 0.1  # log-likelihood, per cell in which the limb shows, by which the colors must speak for another pose


class LimbSearch:
    """Remembers where limbs were tracked, and searches those that are lost.

    Parameters
    ----------
    model : the body.
    judge : knows what limbs in place look like.
    config : parameters.

    Attributes
    ----------
    modes : other places of limbs that are followed.
    """

    def __init__(self, model: ArticulatedModel, judge: LimbJudge, config: LimbSearchConfig):
        self._model, self._judge, self._config = model, judge, config
        self._partners, self.modes = _partners(judge.limbs), LimbModes(judge)
        self.reset()

    @property
    def enabled(self) -> bool:
        """Whether limbs are searched at all."""
        return self._config.poses > 0

    def reset(self) -> None:
        """Nothing is remembered."""
        self._rng = np.random.default_rng(self._config.seed)
        self._tracked: dict[str, np.ndarray] = {}
        self._sets, self._turn = 0, 0  # image sets that have been assessed; which of the lost limbs comes first
        self._failed: dict[int, tuple[int, int]] = {}  # failed searches in a row, and the set of the last one
        self.modes.reset()

    def remember(self, state: State, reports: Sequence[LimbReport]) -> None:
        """Take in an image set that is done with.

        Parameters
        ----------
        state : where the body is.
        reports : of its limbs; those that are TRACKING are where ``state`` says.
        """
        self._sets += 1
        for limb, report in zip(self._judge.limbs, reports, strict=True):
            if report.status is LimbStatus.TRACKING:
                self._tracked[limb.name] = state.joint_positions[limb.dofs[N_ROOT_DOF:]]

    def likely(self, limb: Limb, state: State, predicted: State) -> np.ndarray:
        """Likely places of a limb.

        Parameters
        ----------
        limb : of the judge's.
        state : the body as it is taken to be now.
        predicted : as it was expected.

        Returns
        -------
        (n, n_own) radians, the limb's joints.
        """
        own = limb.dofs[N_ROOT_DOF:]
        neutral = np.array([axis.neutral for axis in self._model.chain.axes])[own]
        angles = [self._tracked.get(limb.name, neutral), predicted.joint_positions[own], neutral, state.joint_positions[own]]
        if limb.name in self._partners:
            angles.append(state.joint_positions[self._partners[limb.name].dofs[N_ROOT_DOF:]])
        angles.append(2.0 * neutral - state.joint_positions[own])
        return np.array(angles)

    def find_trunk(self, state: State, predicted: State, images: SearchedSet) -> State | None:
        """The trunk where the colors speak for it, with all that hangs on it.

        What hangs on a trunk that is off cannot be found by itself, and lines reach only so far: the whole body is moved, turned
        and bent about where it is taken to be and where it was expected, then closer about the best.

        Parameters
        ----------
        state, predicted : the body as it is taken to be now, and as it was expected.
        images : those of this set.

        Returns
        -------
        A better state; None where the colors speak for none.
        """
        trunk, everything = self._judge.limbs[0], np.ones(len(self._model.shapes), dtype=np.bool_)
        here, cells = images.gains(Poses.of([state]), everything)[0]
        chain = self._model.chain
        spread = np.where(np.arange(chain.n_dof) < 3, _TRUNK_SPREAD_M, _TRUNK_SPREAD_RAD) * trunk.dofs
        spread[N_ROOT_DOF:] = np.minimum(spread[N_ROOT_DOF:], chain.upper - chain.lower)

        def score(poses: Poses) -> np.ndarray:
            return images.gains(poses, everything)[:, 0]

        starts, per_round = Poses.of([state, predicted]), self._config.poses // _TRUNK_COSTS / len(_TRUNK_ROUNDS)
        rounds = [
            Round(share * spread, max(round(per_round / (len(starts) if i == 0 else _TRUNK_BEST)), 1), _TRUNK_BEST)
            for i, share in enumerate(_TRUNK_ROUNDS)
        ]
        search = PoseSearch(chain, score, np.ones(chain.n_dof, dtype=np.bool_), self._rng)
        found = search.run(starts, rounds, 1)[0].state(0)
        better = bool(score(Poses.of([found]))[0] > here + _GAIN * cells)
        self._note(0, better)
        return found if better else None

    def doubtful(self, evidence: PartEvidence) -> dict[int, float]:
        """Limbs that this image set alone speaks against.

        Without those whose search has just failed: ``config.interval_sets``.

        Returns
        -------
        Log odds of lost by index of the judge's limbs, the trunk's 0.
        """
        if not self._config.poses:
            return {}
        odds = {i: self.odds(i, evidence) for i in range(len(self._judge.limbs))}
        odds = {i: here for i, here in odds.items() if 0.0 < here < np.inf}
        self._failed = {i: failed for i, failed in self._failed.items() if i in odds or i in self._judge.lost}
        return {i: here for i, here in odds.items() if not self.pauses(i)}

    def pauses(self, i: int) -> bool:
        """Whether the search for limb ``i`` has just failed."""
        times, last = self._failed.get(i, (0, 0))
        return times >= _IN_A_ROW and self._sets - last < self._config.interval_sets

    def _note(self, i: int, found: bool) -> None:
        self._failed[i] = (0 if found else self._failed.get(i, (0, 0))[0] + 1, self._sets)

    def recover(self, doubtful: Mapping[int, float], state: State, predicted: State, images: SearchedSet) -> State | None:
        """Search limbs that are lost.

        Parameters
        ----------
        doubtful : of `doubtful`.
        state, predicted : the body as it is taken to be now, and as it was expected.
        images : those of this set.

        Returns
        -------
        ``state`` with limbs elsewhere; None where nothing speaks for other places.
        """
        limbs, found = [i for i in doubtful if i], None
        self._turn += 1
        for i in [limbs[(self._turn + j) % len(limbs)] for j in range(min(len(limbs), _LIMBS_A_SET))]:
            better = self._find(i, found or state, predicted, images, min(_FOUND_ODDS, doubtful[i] - _BETTER_ODDS))
            self._note(i, better is not None)
            found = better or found
        return found

    def try_elsewhere(self, limbs: Iterable[int], state: State, predicted: State, images: SearchedSet) -> State | None:
        """Move limbs to where the colors speak for them, lost or not.

        Parameters
        ----------
        limbs : indices of the judge's.
        state, predicted, images : as of `recover`.

        Returns
        -------
        ``state`` with limbs elsewhere; None where the colors speak for no other places.
        """
        found = None
        for i in limbs:
            better = self._find(i, found or state, predicted, images, None) if self._config.poses else None
            self._note(i, better is not None)
            found = better or found
        return found

    def look_elsewhere(self, i: int, state: State, predicted: State, images: SearchedSet) -> None:
        """Follow from now on where the colors speak most for a limb, beside where it is.

        Parameters
        ----------
        i : index of the judge's limbs.
        state, predicted, images : as of `recover`.
        """
        self._follow(i, state, self._tried(self._judge.limbs[i], state, predicted, images)[0])

    def _follow(self, i: int, state: State, poses: Poses, more: Sequence[np.ndarray] = ()) -> None:
        own = self._judge.limbs[i].dofs[N_ROOT_DOF:]
        self.modes.add(i, state, [*more, *poses.joints[:, own]])

    def _find(self, i: int, state: State, predicted: State, images: SearchedSet, most: float | None) -> State | None:
        """The state with limb ``i`` where the colors speak for it, if its log odds of lost are below ``most`` there.

        A lost one, for which there is none, is followed where it was tracked, where it was expected, and where the colors speak
        most for it.
        """
        limb = self._judge.limbs[i]
        here, cells = images.gains(Poses.of([state]), limb.shapes)[0]
        best, highest = None, here + _GAIN * cells
        poses, scores = self._tried(limb, state, predicted, images)
        for k in np.flatnonzero(scores > highest).tolist():
            pose = images.fit_part(poses.state(k), limb.dofs)
            gain = float(images.gains(Poses.of([pose.state]), limb.shapes)[0, 0])
            if gain > highest and (most is None or self.odds(i, pose.evidence) < most):
                best, highest = pose.state, gain
        if best is not None:
            self.modes.drop(i)
        elif most is not None:
            self._follow(i, state, poses, list(self.likely(limb, state, predicted)[:_LIKELIEST]))
        return best

    def _tried(self, limb: Limb, state: State, predicted: State, images: SearchedSet) -> tuple[Poses, np.ndarray]:
        """The best of all poses that are tried, apart from each other, and their scores."""
        own, tries = limb.dofs[N_ROOT_DOF:], self._config.poses
        angles = self._drawn(limb, self.likely(limb, state, predicted), round(_FIRST * tries))
        joints = np.repeat(state.joint_positions[None], len(angles), axis=0)
        joints[:, own] = angles
        around = round((1.0 - _FIRST) * tries / (len(_ROUNDS_RAD) * _BEST))
        rounds = [Round(spread, around, _BEST) for spread in _ROUNDS_RAD] if around else []
        search = PoseSearch(
            self._model.chain, lambda poses: images.gains(poses, limb.shapes)[:, 0], limb.dofs, self._rng,
            Apart(lambda poses: poses.joints[:, own], _APART_RAD),
        )  # fmt: skip
        return search.run(Poses.with_joints(state, joints), rounds, self._config.fits)

    def _drawn(self, limb: Limb, likely: np.ndarray, n: int) -> np.ndarray:
        """(>= n, n_own): likely angles, others about them, and some anywhere within the limits, where there are limits."""
        own = limb.dofs[N_ROOT_DOF:]
        low, high = self._model.chain.lower[own], self._model.chain.upper[own]
        n_anywhere = round(_WANDERERS * n) if np.isfinite(high - low).all() else 0
        about = likely[np.arange(max(n - n_anywhere - len(likely), 0)) % len(likely)]
        spreads = np.resize(np.repeat(_SPREADS_RAD, len(likely)), len(about))
        about = about + spreads[:, None] * self._rng.normal(size=about.shape)
        return np.concatenate([likely, about, self._rng.uniform(low, high, (n_anywhere, len(low)))])

    def odds(self, i: int, evidence: PartEvidence) -> float:
        """Log odds of lost of one limb by one image set.

        Parameters
        ----------
        i : index of the judge's limbs.
        evidence : of this image set.

        Returns
        -------
        Infinite for a limb that cannot be seen.
        """
        measures = limb_measures(evidence, self._judge.limbs[i].shapes)
        return np.inf if measures is None else self._judge.odds(i, measures)


def _partners(limbs: Sequence[Limb]) -> dict[str, Limb]:
    """Limb of the other side by name, where both have as many degrees of freedom."""
    by_name = {limb.name: limb for limb in limbs}
    result = {}
    for name, limb in by_name.items():
        for side, other in (("left", "right"), ("right", "left")):
            partner = by_name.get(name.replace(side, other)) if side in name else None
            if partner is not None and partner.dofs.sum() == limb.dofs.sum():
                result[name] = partner
    return result
