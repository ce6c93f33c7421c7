"""A limb is looked for: in many poses by the area that it would cover, then in the best of them by its contours.

The poses are where the limb was last sound, where it is predicted, at rest, as its partner on the other side is, mirrored about
rest, at random about those, and at random within the joints' limits; then about the best of them, closer and closer. They are
scored by the colors that the limb would cover (`objective.area.limb_score`). The best few are fitted by the engine's lines, the
limb's degrees of freedom alone. A fit is taken if the colors speak for it, and its outline is that of a sound limb. So many poses
are tried an image set that the effort stays bounded; a limb that is not found is looked for again in the next. The generator is
seeded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.lines.objective import PartEvidence
from ...objective.normal_equations import LeastSquaresObjective, NormalEquations
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize
from ..config import LimbSearchConfig
from ..estimate import LimbReport, LimbStatus
from ..limbs import Limb
from .limb_status import LimbJudge, limb_measures
from .trunk_search import best_trunk

_SPREADS_RAD = (0.2, 0.6)  # of random poses about likely ones
_WANDERERS = 0.25  # share of the random poses that may be anywhere within the limits
_FIRST = 0.4  # share of all poses that are tried before the best of them are looked around
_ROUNDS_RAD = (0.25, 0.15, 0.08, 0.04)  # how far around, round by round
_BEST = 6  # of them that are looked around...
_APART_RAD = 0.2  # ...and differ in some joint by this at least
_FIT_SCALES = (4.0, 2.0, 1.0)  # pixels from place to place on the lines by which poses are fitted
_TRUNK_COSTS = 3  # times as much to try the whole body as a limb
_LIMBS_A_SET = 2  # that are looked for
_IN_A_ROW = 2  # searches for a limb in vain, before it pauses
_FOUND_ODDS = 0.5  # log odds of lost that a limb must have to be taken for found...
_BETTER_ODDS = 1.5  # ...and how much less they must be than where it is now
_GAIN = 0.1  # log-likelihood, per cell in which the limb shows, by which the colors must speak for another pose
_FIT = LevenbergMarquardtOptions(max_iterations=3, tolerance=1e-3)


@dataclass(frozen=True, eq=False)
class Lines:
    """The correspondence lines of an image set: how they are drawn about a state, their normal equations with priors and
    constraints, and what they bear out within so many pixels.

    ``area``: (shapes (n_shapes,), roots (n, 4, 4), joints (n, n_axes)) -> (n, 2), what the colors of all cameras gain by these
    shapes, and the cells in which these show, as in `LimbScore.totals`.
    """

    correspond: Callable[[State, float], None]
    whole: LeastSquaresObjective
    part_evidence: Callable[[State, float], PartEvidence]
    area: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


class OneLimb:
    """A least-squares objective in which nothing but some degrees of freedom (mask (n_dof,)) can move."""

    def __init__(self, objective: LeastSquaresObjective, dofs: np.ndarray):
        self._objective, self._stays = objective, ~dofs

    def linearize(self, state: State) -> NormalEquations:
        """With rows and columns of what stays made those of a variable that nothing moves."""
        found, stays = self._objective.linearize(state), self._stays
        H, g = found.H.copy(), found.g.copy()
        H[stays], H[:, stays], g[stays] = 0.0, 0.0, 0.0
        H[stays, stays] = 1.0
        return NormalEquations(H, g, found.cost, found.count)


class LimbSearch:
    """Remembers where limbs were sound, and looks for those that are lost; ``judge`` knows what sound limbs look like."""

    def __init__(self, model: ArticulatedModel, judge: LimbJudge, config: LimbSearchConfig, close_px: float):
        self._model, self._judge, self._config, self._close_px = model, judge, config, close_px
        self._partners = _partners(judge.limbs)
        self.reset()

    @property
    def tries(self) -> int:
        """Poses in which a limb is looked for in one image set; 0: it is not."""
        return self._config.poses

    def reset(self) -> None:
        """Nothing is remembered."""
        self._rng = np.random.default_rng(self._config.seed)
        self._sound: dict[str, np.ndarray] = {}
        self._sets, self._turn = 0, 0  # image sets that have been judged; which of the lost limbs comes first
        self._vain: dict[int, tuple[int, int]] = {}  # searches in vain, in a row, and the set of the last one

    def remember(self, state: State, reports: Sequence[LimbReport]) -> None:
        """Limbs that are TRACKING are where ``state`` says; the image set is done with."""
        self._sets += 1
        for limb, report in zip(self._judge.limbs, reports, strict=True):
            if report.status is LimbStatus.TRACKING:
                self._sound[limb.name] = state.joint_positions[limb.dofs[N_ROOT_DOF:]]

    def likely(self, limb: Limb, state: State, predicted: State) -> np.ndarray:
        """(n, n_own): angles of the limb's joints in likely places."""
        own = limb.dofs[N_ROOT_DOF:]
        neutral = np.array([axis.neutral for axis in self._model.chain.axes])[own]
        angles = [self._sound.get(limb.name, neutral), predicted.joint_positions[own], neutral, state.joint_positions[own]]
        if limb.name in self._partners:
            angles.append(state.joint_positions[self._partners[limb.name].dofs[N_ROOT_DOF:]])
        angles.append(2.0 * neutral - state.joint_positions[own])
        return np.array(angles)

    def find_trunk(self, state: State, predicted: State, lines: Lines) -> State | None:
        """``state`` with the trunk, and all that hangs on it, where the colors would rather have it, or None."""
        trunk, everything = self._judge.limbs[0], np.ones(len(self._model.shapes), dtype=np.bool_)
        here, cells = gains([state], everything, lines)[0]

        def gain(states: list[State]) -> np.ndarray:
            return gains(states, everything, lines)[:, 0]

        tries = self._config.poses // _TRUNK_COSTS
        found = best_trunk(trunk, [state, predicted], self._model.chain, gain, tries, self._rng)
        better = bool(gain([found])[0] > here + _GAIN * cells)
        self._note(0, better)
        return found if better else None

    def doubtful(self, evidence: PartEvidence) -> dict[int, float]:
        """Log odds of lost of limbs (indices of the judge's, the trunk's 0) that this image set alone speaks against.

        Without those that have just been looked for in vain: ``config.interval_sets``.
        """
        if not self._config.poses:
            return {}
        odds = {i: self.odds(i, evidence) for i in range(len(self._judge.limbs))}
        odds = {i: here for i, here in odds.items() if 0.0 < here < np.inf}
        self._vain = {i: vain for i, vain in self._vain.items() if i in odds or i in self._judge.lost}
        return {i: here for i, here in odds.items() if not self.pauses(i)}

    def pauses(self, i: int) -> bool:
        """Whether limb ``i`` has just been looked for in vain."""
        times, last = self._vain.get(i, (0, 0))
        return times >= _IN_A_ROW and self._sets - last < self._config.interval_sets

    def _note(self, i: int, found: bool) -> None:
        self._vain[i] = (0 if found else self._vain.get(i, (0, 0))[0] + 1, self._sets)

    def recover(self, doubtful: Mapping[int, float], state: State, predicted: State, lines: Lines) -> State | None:
        """``state`` with `doubtful` limbs found elsewhere; None where nothing speaks for other places."""
        limbs, found = [i for i in doubtful if i], None
        self._turn += 1
        for i in [limbs[(self._turn + j) % len(limbs)] for j in range(min(len(limbs), _LIMBS_A_SET))]:
            better = self._find(i, found or state, predicted, lines, min(_FOUND_ODDS, doubtful[i] - _BETTER_ODDS))
            self._note(i, better is not None)
            found = better or found
        return found

    def look_over(self, limbs: Iterable[int], state: State, predicted: State, lines: Lines) -> State | None:
        """``state`` with those ``limbs`` (indices of the judge's) elsewhere that the colors would rather have there, or None."""
        found = None
        for i in limbs:
            better = self._find(i, found or state, predicted, lines, None) if self._config.poses else None
            self._note(i, better is not None)
            found = better or found
        return found

    def _find(self, i: int, state: State, predicted: State, lines: Lines, least: float | None) -> State | None:
        """The state with limb ``i`` where the colors would rather have it, if its log odds of lost are below ``least`` there."""
        limb, own = self._judge.limbs[i], self._judge.limbs[i].dofs[N_ROOT_DOF:]
        here, cells = gains([state], limb.shapes, lines)[0]
        best, highest = None, here + _GAIN * cells
        for q in self._tried(limb, state, predicted, lines, highest):
            joints = state.joint_positions.copy()
            joints[own] = q
            pose = State(state.T_world_root, joints)
            for scale in _FIT_SCALES:
                lines.correspond(pose, scale)
                pose = minimize(OneLimb(lines.whole, limb.dofs), pose, self._model.chain, _FIT).state
            gain = float(gains([pose], limb.shapes, lines)[0, 0])
            if gain > highest and (least is None or self.odds(i, lines.part_evidence(pose, self._close_px)) < least):
                best, highest = pose, gain
        return best

    def _tried(self, limb: Limb, state: State, predicted: State, lines: Lines, least: float) -> list[np.ndarray]:
        """The best (n_own,) of all angles that are tried, the best first, of those that gain more than ``least``."""
        own, tries = limb.dofs[N_ROOT_DOF:], self._config.poses
        low, high = self._model.chain.lower[own], self._model.chain.upper[own]

        def scored(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            angles = np.clip(angles, low, high)
            joints = np.repeat(state.joint_positions[None], len(angles), axis=0)
            joints[:, own] = angles
            roots = np.broadcast_to(state.T_world_root, (len(angles), 4, 4))
            return angles, lines.area(limb.shapes, roots, joints)[:, 0]

        angles, gained = scored(self._drawn(limb, self.likely(limb, state, predicted), round(_FIRST * tries)))
        around = round((1.0 - _FIRST) * tries / (len(_ROUNDS_RAD) * _BEST))
        for spread in _ROUNDS_RAD if around else ():
            best = angles[_apart(angles, gained, _BEST)]
            more = np.repeat(best, around, axis=0) + self._rng.normal(0.0, spread, (len(best) * around, len(low)))
            more, more_gained = scored(more)
            angles, gained = np.concatenate([angles, more]), np.concatenate([gained, more_gained])
        return [angles[j] for j in _apart(angles, gained, self._config.fits) if gained[j] > least]

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
        """Log odds of lost; those of a limb that cannot be seen speak for nothing."""
        measures = limb_measures(evidence, self._judge.limbs[i].shapes)
        return np.inf if measures is None else self._judge.odds(i, measures)


def gains(states: Sequence[State], shapes: np.ndarray, lines: Lines) -> np.ndarray:
    """(n, 2) what the colors gain by some shapes (mask (n_shapes,)) in each of the states, and the cells in which these show."""
    return lines.area(shapes, np.array([s.T_world_root for s in states]), np.array([s.joint_positions for s in states]))


def _apart(angles: np.ndarray, gains: np.ndarray, n: int) -> list[int]:
    """Indices of at most ``n`` of the angles (m, n_own), of the largest gains (m,), the best first, apart from each other."""
    chosen: list[int] = []
    for i in np.argsort(-gains, kind="stable").tolist():
        if all(np.abs(angles[i] - angles[j]).max() >= _APART_RAD for j in chosen):
            chosen.append(i)
            if len(chosen) == n:
                break
    return chosen


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
