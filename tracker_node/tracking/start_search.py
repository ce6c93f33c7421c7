"""Generate and test: where in the maps of evidence a body is, and in which posture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..model.configuration import State
from ..objective.evidence_score import EvidenceScore
from .start_postures import limbs, reachable


@dataclass(frozen=True, eq=False)
class Poses:
    """Many states: ``roots`` (n, 4, 4), ``joints`` (n, n_axes)."""

    roots: np.ndarray
    joints: np.ndarray

    def __len__(self) -> int:
        return len(self.roots)

    def __getitem__(self, index) -> Poses:
        return Poses(self.roots[index], self.joints[index])

    def state(self, i: int) -> State:
        return State(self.roots[i].copy(), self.joints[i].copy())

    @classmethod
    def of(cls, states: list[State]) -> Poses:
        return cls(np.array([s.T_world_root for s in states]), np.array([s.joint_positions for s in states]))

    @classmethod
    def joined(cls, parts: list[Poses]) -> Poses:
        return cls(np.concatenate([p.roots for p in parts]), np.concatenate([p.joints for p in parts]))


@dataclass(frozen=True)
class Effort:
    """One round of the search.

    Attributes
    ----------
    samples : of each hypothesis, for each limb. sweeps : over all limbs.
    position_m, angle_rad, joint_rad : spread of the samples about the hypothesis.
    wild : share of a limb's samples that lie anywhere between its limits.
    """

    samples: int
    sweeps: int
    position_m: float
    angle_rad: float
    joint_rad: float
    wild: float = 0.0


class StartSearch:
    """Improves hypotheses limb by limb.

    Parameters
    ----------
    prior_weight : cost of a joint angle one ``sigma`` from neutral, in units of the score.
    """

    def __init__(self, score: EvidenceScore, prior_weight: float, seed: int):
        self._score, self._prior_weight, self._seed = score, prior_weight, seed
        chain = score.model.chain
        self._limbs = limbs(chain)
        self._low, self._high = reachable(chain)
        self._neutral = np.array([axis.neutral for axis in chain.axes])
        self._sigma = np.where([axis.stiffness > 1.0 for axis in chain.axes], 0.35, 1.0)

    def scores(self, poses: Poses) -> np.ndarray:
        """(n,) evidence covered, less the prior's cost."""
        off = (poses.joints - self._neutral) / self._sigma
        return self._score.scores(poses.roots, poses.joints) - self._prior_weight * np.sum(off**2, axis=1)

    def best(self, poses: Poses, scores: np.ndarray, n: int, apart_m: float, apart_rad: float) -> np.ndarray:
        """Indices of the best ``n``, best first, that differ from each other in place or in heading."""
        chosen: list[int] = []
        for i in np.argsort(-scores, kind="stable"):
            others = poses.roots[chosen]
            trace = np.einsum("nij,ij->n", others[:, :3, :3], poses.roots[i, :3, :3])
            turned = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))
            moved = np.linalg.norm(others[:, :3, 3] - poses.roots[i, :3, 3], axis=1)
            if not np.any((turned < apart_rad) & (moved < apart_m)):
                chosen.append(int(i))
                if len(chosen) == n:
                    break
        return np.array(chosen, dtype=np.int64)

    def better(self, poses: Poses, scores: np.ndarray, others: Poses) -> tuple[Poses, np.ndarray]:
        """Each of ``others`` that scores higher takes the place of its hypothesis."""
        found = self.scores(others)
        up = found > scores
        roots = np.where(up[:, None, None], others.roots, poses.roots)
        return Poses(roots, np.where(up[:, None], others.joints, poses.joints)), np.where(up, found, scores)

    def improve(self, poses: Poses, scores: np.ndarray, effort: Effort) -> tuple[Poses, np.ndarray]:
        """Each hypothesis after ``effort``, and its score."""
        rng = np.random.default_rng(self._seed)
        for _ in range(effort.sweeps):
            for limb in (None, *self._limbs):
                poses, scores = self._try(poses, scores, limb, effort, rng)
        return poses, scores

    def _try(self, poses: Poses, scores: np.ndarray, limb, effort: Effort, rng) -> tuple[Poses, np.ndarray]:
        n, m = len(poses), effort.samples
        roots, joints = np.repeat(poses.roots, m, axis=0), np.repeat(poses.joints, m, axis=0)
        shrink = 0.25 + 0.75 * rng.random((n * m, 1))  # some near, some far
        if limb is None:
            roots[:, :3, 3] += shrink * effort.position_m * rng.standard_normal((n * m, 3))
            turns = Rotation.from_rotvec(shrink * effort.angle_rad * rng.standard_normal((n * m, 3))).as_matrix()
            roots[:, :3, :3] = turns @ roots[:, :3, :3]
        else:
            near = joints[:, limb] + shrink * effort.joint_rad * rng.standard_normal((n * m, len(limb)))
            anywhere = self._low[limb] + rng.random((n * m, len(limb))) * (self._high - self._low)[limb]
            wild = rng.random((n * m, 1)) < effort.wild
            joints[:, limb] = np.clip(np.where(wild, anywhere, near), self._low[limb], self._high[limb])
        tried = Poses(roots, joints)
        found = self.scores(tried).reshape(n, m)
        winner = np.argmax(found, axis=1)
        rows, best = np.arange(n) * m + winner, found[np.arange(n), winner]
        up = best > scores
        roots = np.where(up[:, None, None], roots[rows], poses.roots)
        return Poses(roots, np.where(up[:, None], joints[rows], poses.joints)), np.where(up, best, scores)
