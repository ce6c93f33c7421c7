"""Generate and test: in which pose a body is in the maps of evidence, limb by limb."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ...objective.area.score import AreaScore
from ..limbs.tree import joint_groups
from ..poses import Poses
from .pose_library import other_side, reachable

_SHAKE_RAD = 0.25


class HypothesisSearch:
    """Improves hypotheses limb by limb.

    Parameters
    ----------
    prior_weight : cost of a joint angle one ``sigma`` from neutral, in units of the score.
    size_m : of the body.
    """

    def __init__(self, score: AreaScore, prior_weight: float, size_m: float):
        self._score, self._prior_weight, self._shake_m = score, prior_weight, 0.04 * size_m
        chain = score.model.chain
        self._limbs = joint_groups(chain)
        self._low, self._high = reachable(chain)
        self._neutral = np.array([axis.neutral for axis in chain.axes])
        self._sigma = np.where([axis.stiffness > 1.0 for axis in chain.axes], 0.35, 1.0)
        self._other_side = other_side([axis.name for axis in chain.axes])

    def scores(self, poses: Poses) -> np.ndarray:
        """(n,) evidence covered, less the prior's cost."""
        off = (poses.joints - self._neutral) / self._sigma
        return self._score.scores(poses.roots, poses.joints) - self._prior_weight * np.sum(off**2, axis=1)

    def best(self, poses: Poses, scores: np.ndarray, n: int, apart_m: float, apart_rad: float) -> np.ndarray:
        """The best hypotheses that differ from each other in place or in heading.

        Parameters
        ----------
        poses, scores : hypotheses, and (n_poses,).
        n : at most.
        apart_m, apart_rad : nearer than both, two are the same.

        Returns
        -------
        Indices, best first.
        """
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

    def varied(self, poses: Poses, samples: int, rng: np.random.Generator) -> Poses:
        """Variants of each hypothesis.

        There are as many as limbs, each with the best of some settings of that limb from anywhere between its limits; and one
        that faces the other way, left and right exchanged.

        Parameters
        ----------
        poses : hypotheses.
        samples : settings of a limb.
        rng : chooses them.

        Returns
        -------
        Those of one hypothesis after those of the other.
        """
        n, variants = len(poses), []
        for limb in self._limbs:
            joints = np.repeat(poses.joints, samples, axis=0)
            joints[:, limb] = self._low[limb] + rng.random((n * samples, len(limb))) * (self._high - self._low)[limb]
            tried = Poses(np.repeat(poses.roots, samples, axis=0), joints)
            best = np.argmax(self.scores(tried).reshape(n, samples), axis=1)
            variants.append(tried[np.arange(n) * samples + best])
        variants.append(self._turned(poses))
        joined = Poses.joined(variants)
        return joined[np.arange(len(joined)).reshape(len(variants), n).T.ravel()]

    def _turned(self, poses: Poses) -> Poses:
        roots = poses.roots.copy()
        roots[:, :3, :3] = np.diag([-1.0, -1.0, 1.0]) @ roots[:, :3, :3]
        return Poses(roots, poses.joints[:, self._other_side])

    def best_of(self, poses: Poses, scores: np.ndarray, variants: Poses) -> tuple[Poses, np.ndarray]:
        """Each hypothesis, or the best of its variants.

        Parameters
        ----------
        poses, scores : hypotheses, and (n_poses,).
        variants : as many for each, one after the other.

        Returns
        -------
        As many hypotheses, with their scores.
        """
        n = len(poses)
        found = self.scores(variants).reshape(n, -1)
        winner = np.argmax(found, axis=1)
        return self._better(poses, scores, variants[np.arange(n) * found.shape[1] + winner], found[np.arange(n), winner])

    def shaken(self, poses: Poses, scores: np.ndarray, samples: int, rng: np.random.Generator) -> tuple[Poses, np.ndarray]:
        """Each hypothesis after the best of small changes, limb by limb and of the root.

        Parameters
        ----------
        poses, scores : hypotheses, and (n_poses,).
        samples : changes of each.
        rng : chooses them.

        Returns
        -------
        As many hypotheses, with their scores.
        """
        n = len(poses)
        for limb in (None, *self._limbs):
            roots, joints = np.repeat(poses.roots, samples, axis=0), np.repeat(poses.joints, samples, axis=0)
            size = 0.25 + 0.75 * rng.random((n * samples, 1))  # some near, some far
            if limb is None:
                roots[:, :3, 3] += size * self._shake_m * rng.standard_normal((n * samples, 3))
                turns = Rotation.from_rotvec(size * _SHAKE_RAD * rng.standard_normal((n * samples, 3))).as_matrix()
                roots[:, :3, :3] = turns @ roots[:, :3, :3]
            else:
                moved = joints[:, limb] + 2.0 * _SHAKE_RAD * size * rng.standard_normal((n * samples, len(limb)))
                joints[:, limb] = np.clip(moved, self._low[limb], self._high[limb])
            poses, scores = self.best_of(poses, scores, Poses(roots, joints))
        return poses, scores

    def better(self, poses: Poses, scores: np.ndarray, others: Poses) -> tuple[Poses, np.ndarray]:
        """Each of the others that scores higher takes the place of its hypothesis.

        Parameters
        ----------
        poses, scores : hypotheses, and (n_poses,).
        others : as many.

        Returns
        -------
        As many hypotheses, with their scores.
        """
        return self._better(poses, scores, others, self.scores(others))

    @staticmethod
    def _better(poses: Poses, scores: np.ndarray, others: Poses, found: np.ndarray) -> tuple[Poses, np.ndarray]:
        up = found > scores
        roots = np.where(up[:, None, None], others.roots, poses.roots)
        return Poses(roots, np.where(up[:, None], others.joints, poses.joints)), np.where(up, found, scores)
