"""A lost limb is looked for again: from several likely poses, with the rest of the body as it is.

The poses are where the limb was last sound, where it is predicted, at rest, as its partner on the other side is, mirrored about
rest, and some at random. They are scored as they are by the engine's own lines; the best few are fitted, the limb's degrees of
freedom alone, and the best fit is taken if its evidence is that of a sound limb. So many are tried an image set that the effort
stays bounded; a limb that is not found is looked for again in the next. The generator is seeded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..model.articulated_model import ArticulatedModel
from ..model.configuration import State
from ..model.kinematic_chain import N_ROOT_DOF
from ..objective.normal_equations import LeastSquaresObjective, NormalEquations
from ..objective.region_objective import PartEvidence
from ..optimize.levenberg_marquardt import LevenbergMarquardtOptions, clip_to_limits, minimize
from .config import StatusConfig
from .estimate import LimbReport, LimbStatus
from .limb_status import LimbJudge, limb_measures
from .limbs import Limb

_SPREAD_RAD = 0.6  # of random poses about the last sound one
_SCORE_SCALE = 4.0  # pixels from place to place on the lines by which poses are scored...
_FIT_SCALES = (4.0, 2.0, 1.0)  # ...and fitted
_LIMBS_A_SET = 2  # that are looked for
_FOUND_ODDS = 0.5  # log odds of lost that a limb must have to be taken for found...
_BETTER_ODDS = 1.5  # ...and how much less they must be than where it is now
_FIT = LevenbergMarquardtOptions(max_iterations=4, tolerance=1e-3)


@dataclass(frozen=True, eq=False)
class Lines:
    """The correspondence lines of an image set: how they are drawn about a state, their normal equations with priors and
    constraints, and what they bear out within so many pixels."""

    correspond: Callable[[State, float], None]
    whole: LeastSquaresObjective
    part_evidence: Callable[[State, float], PartEvidence]


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

    def __init__(self, model: ArticulatedModel, judge: LimbJudge, config: StatusConfig, close_px: float):
        self._model, self._judge, self._config, self._close_px = model, judge, config, close_px
        self._partners = _partners(judge.limbs)
        self.reset()

    def reset(self) -> None:
        """Nothing is remembered."""
        self._rng = np.random.default_rng(self._config.limb_seed)
        self._sound: dict[str, np.ndarray] = {}

    def remember(self, state: State, reports: Sequence[LimbReport]) -> None:
        """Limbs that are TRACKING are where ``state`` says."""
        for limb, report in zip(self._judge.limbs, reports, strict=True):
            if report.status is LimbStatus.TRACKING:
                self._sound[limb.name] = state.joint_positions[limb.dofs[N_ROOT_DOF:]]

    def poses(self, limb: Limb, state: State, predicted: State) -> list[State]:
        """``state`` with the limb in likely places, the likeliest first."""
        own = limb.dofs[N_ROOT_DOF:]
        neutral = np.array([axis.neutral for axis in self._model.chain.axes])[own]
        last = self._sound.get(limb.name, neutral)
        angles = [last, predicted.joint_positions[own], neutral]
        if limb.name in self._partners:
            angles.append(state.joint_positions[self._partners[limb.name].dofs[N_ROOT_DOF:]])
        angles.append(2.0 * neutral - state.joint_positions[own])
        while len(angles) < self._config.limb_tries:
            angles.append(last + self._rng.normal(0.0, _SPREAD_RAD, int(own.sum())))
        result = []
        for q in angles[: self._config.limb_tries]:
            joints = state.joint_positions.copy()
            joints[own] = q
            result.append(clip_to_limits(State(state.T_world_root, joints), self._model.chain))
        return result

    def recover(self, lost: Sequence[int], state: State, predicted: State, lines: Lines) -> State | None:
        """``state`` with lost limbs (indices of the judge's) found elsewhere, the lines being drawn about it; None where nothing
        speaks for other places."""
        evidence = lines.part_evidence(state, self._close_px)
        if not self._config.limb_tries:
            return None
        odds = [self._odds(i, evidence) for i in lost]
        found = None
        for i, here in [(i, here) for i, here in zip(lost, odds, strict=True) if here > 0.0][:_LIMBS_A_SET]:
            better = self._find(i, found or state, predicted, lines, min(_FOUND_ODDS, here - _BETTER_ODDS))
            found = better or found
        return found

    def _find(self, i: int, state: State, predicted: State, lines: Lines, least: float) -> State | None:
        """The state with limb ``i`` elsewhere whose log odds of lost are least, if they are below ``least``."""
        limb, best = self._judge.limbs[i], None
        poses = self.poses(limb, state, predicted)
        scores = np.array([self._score(limb, pose, lines) for pose in poses])
        ranked = [0, *(j for j in np.argsort(-scores, kind="stable") if j)]  # where it was last sound comes first
        for j in ranked[: self._config.limb_fits]:
            pose = poses[j]
            for scales in (_FIT_SCALES[-1:], _FIT_SCALES):  # from near, and from afar
                for scale in scales:
                    lines.correspond(pose, scale)
                    pose = minimize(OneLimb(lines.whole, limb.dofs), pose, self._model.chain, _FIT).state
                odds = self._odds(i, lines.part_evidence(pose, self._close_px))
                if odds < least:
                    best, least = pose, odds
        return best

    def _odds(self, i: int, evidence: PartEvidence) -> float:
        """Log odds of lost; those of a limb that cannot be seen speak for nothing."""
        measures = limb_measures(evidence, self._judge.limbs[i].shapes)
        return np.inf if measures is None else self._judge.odds(i, measures)

    def _score(self, limb: Limb, pose: State, lines: Lines) -> float:
        """How much of the limb's outline is found about a pose, and how surely; hidden limbs come last."""
        lines.correspond(pose, _SCORE_SCALE)
        measures = limb_measures(lines.part_evidence(pose, _SCORE_SCALE * self._close_px), limb.shapes)
        return -1.0 if measures is None else float(measures[0] * measures[2])


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
