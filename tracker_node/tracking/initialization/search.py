"""Generate and test: in which pose a body is in the maps of evidence, limb by limb.

Silhouettes on small images, and hypotheses drawn to them by Levenberg-Marquardt.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import scipy  # imports its modules when they are first used

from ...camera.rig import Camera
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.area.score import AreaScore
from ...objective.chamfer.correspondences import ContourBody, ContourCorrespondences, ContourOptions, EvidenceMaps
from ...objective.constraints.prior import Prior
from ...observation.chamfer.boundary import boundary_points
from ...observation.chamfer.distance_transform import signed_distance
from ...optimize.fitter import Fitter, Stage
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions
from ...optimize.robust_start import best_apart
from ..limbs.tree import joint_groups
from ..poses import Poses, other_side, reachable

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

        def same(i: int, chosen: list[int]) -> bool:
            others = poses.roots[chosen]
            trace = np.einsum("nij,ij->n", others[:, :3, :3], poses.roots[i, :3, :3])
            turned = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))
            moved = np.linalg.norm(others[:, :3, 3] - poses.roots[i, :3, 3], axis=1)
            return bool(np.any((turned < apart_rad) & (moved < apart_m)))

        return np.array(best_apart(np.argsort(-scores, kind="stable"), same, n), dtype=np.int64)

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

    def promising(self, variants: Poses, n_hypotheses: int, n: int) -> Poses:
        """The best variants of each hypothesis: fits are too dear for all.

        Parameters
        ----------
        variants : as many for each hypothesis, one after the other.
        n_hypotheses, n : and how many of each stay.

        Returns
        -------
        ``n`` for each hypothesis, one after the other.
        """
        scores = self.scores(variants).reshape(n_hypotheses, -1)
        best = np.argsort(-scores, axis=1, kind="stable")[:, :n]
        return variants[(np.arange(n_hypotheses)[:, None] * scores.shape[1] + best).ravel()]

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
                vectors = size * _SHAKE_RAD * rng.standard_normal((n * samples, 3))
                turns = scipy.spatial.transform.Rotation.from_rotvec(vectors)
                roots[:, :3, :3] = turns.as_matrix() @ roots[:, :3, :3]
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


_SAMPLES = 8  # along a contour line: images are small
_REACH_PX = 20.0
_COARSE = ContourOptions(
    robust_scale_px=6.0, samples_per_line=_SAMPLES, inner_weight=0.0, alignment=0.3, outward_px=1.5, boundary_weight=1.0,
    boundary_scale_px=12.0, reach_px=_REACH_PX,
)  # fmt: skip
_FREE_RAD, _STIFF_RAD = 1.5, 0.4  # how far joint angles are expected from neutral
_PRIOR = 4.0  # squared pixels that one such angle costs


class SilhouetteFit:
    """Fits states to the silhouettes of maps of evidence.

    Parameters
    ----------
    cameras, maps : small cameras, and log-odds (h, w) of each; None for a camera without.
    """

    def __init__(self, model: ArticulatedModel, cameras: Sequence[Camera], maps: Sequence[np.ndarray | None]):
        self._model, self._fitter, self._body = model, Fitter(model), ContourBody.of(model, cameras)
        self._maps = [None if odds is None else _evidence(odds) for odds in maps]
        stiffness = np.array([axis.stiffness for axis in model.chain.axes])
        weights = np.zeros(model.n_dof)
        weights[N_ROOT_DOF:] = _PRIOR / np.where(stiffness > 1.0, _STIFF_RAD, _FREE_RAD) ** 2
        self._weights = weights

    def correspond(self, state: State, detail: ContourOptions) -> ContourCorrespondences:
        """Distances to the silhouettes of the outline that is seen in a state.

        Parameters
        ----------
        state, detail : of the body, and how finely.

        Returns
        -------
        The samples with the silhouettes of each camera.
        """
        return ContourCorrespondences(self._body, self._maps, detail, state)

    def fit(self, state: State, rounds: int = 3, iterations: int = 4) -> State:
        """The state that the outline leads to.

        Parameters
        ----------
        state : to begin at.
        rounds : in which it is decided anew what is seen.
        iterations : in each of them.

        Returns
        -------
        Near a minimum.
        """
        prior = Prior(State.neutral(self._model, state.T_world_root), self._weights)
        stage = Stage(_COARSE, LevenbergMarquardtOptions(max_iterations=iterations, tolerance=1e-2))
        return self._fitter.fit(state, self, [stage] * rounds, [prior]).state


def _evidence(odds: np.ndarray) -> EvidenceMaps | None:
    """None where nothing at all speaks for the body."""
    mask = (cv2.GaussianBlur(odds, (3, 3), 0.8) > 0.0).astype(np.uint8)
    if not mask.any():
        return None
    distance = np.asarray(cv2.blur(signed_distance(mask, _REACH_PX), (3, 3)), dtype=np.float32)
    boundary = boundary_points(mask, distance, np.ones_like(mask), 2)
    return EvidenceMaps((0, 0), distance, np.full(mask.shape, _REACH_PX, dtype=np.float32), boundary)
