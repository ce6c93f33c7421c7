"""Many poses of one body at a time, and the search for better ones: drawn, scored, and drawn again about the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..model.configuration import State
from ..model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ..optimize.robust_start import best_apart


@dataclass(frozen=True, eq=False)
class Poses:
    """n states: ``roots`` (n, 4, 4), ``joints`` (n, n_axes)."""

    roots: np.ndarray
    joints: np.ndarray

    def __len__(self) -> int:
        return len(self.roots)

    def __getitem__(self, index) -> Poses:
        return Poses(self.roots[index], self.joints[index])

    def state(self, i: int) -> State:
        """Pose ``i`` as a state of its own."""
        return State(self.roots[i].copy(), self.joints[i].copy())

    @classmethod
    def of(cls, states: Sequence[State]) -> Poses:
        return cls(np.array([s.T_world_root for s in states]), np.array([s.joint_positions for s in states]))

    @classmethod
    def with_joints(cls, state: State, joints: np.ndarray) -> Poses:
        """The root of a state with other joint angles.

        Parameters
        ----------
        state : whose root stays.
        joints : (n, n_axes) radians.

        Returns
        -------
        n poses.
        """
        return cls(np.repeat(state.T_world_root[None], len(joints), axis=0), joints)

    @classmethod
    def joined(cls, parts: Sequence[Poses]) -> Poses:
        return cls(np.concatenate([p.roots for p in parts]), np.concatenate([p.joints for p in parts]))

    def clipped(self, chain: KinematicChain) -> Poses:
        """The same with every joint within its limits."""
        return Poses(self.roots, np.clip(self.joints, chain.lower, chain.upper))

    def retracted(self, tangents: np.ndarray) -> Poses:
        """Every pose moved by its own of ``tangents`` (n, n_dof)."""
        if not tangents[:, :N_ROOT_DOF].any():
            return Poses(self.roots, self.joints + tangents[:, N_ROOT_DOF:])
        return Poses.of([State(T, q).retract(t) for T, q, t in zip(self.roots, self.joints, tangents, strict=True)])


Score = Callable[[Poses], np.ndarray]
"""(n,) of n poses: the more the better."""


@dataclass(frozen=True, eq=False)
class Round:
    """One round of a search.

    Attributes
    ----------
    spread : standard deviations in the tangent by which poses are drawn about the best: a number, or (n_dof,).
    n : poses drawn about each of them.
    keep : so many best poses are drawn about.
    dofs : (n_dof,) mask of what is drawn; None: that of the search.
    score : by which this round and the later ones score; None: as before.
    """

    spread: float | np.ndarray
    n: int
    keep: int
    dofs: np.ndarray | None = None
    score: Score | None = None


@dataclass(frozen=True, eq=False)
class Apart:
    """When poses count as two: their ``coordinates`` (n, k) differ by ``distance`` at least, in the norm of this ``order``."""

    coordinates: Callable[[Poses], np.ndarray]
    distance: float
    order: float = np.inf


class PoseSearch:
    """Finds poses of large score: for a lost limb, the trunk, a limb of a start; deterministic for a generator.

    Parameters
    ----------
    chain : kinematics of the body; joints stay within their limits.
    score : of many poses at once, such as one by area.
    dofs : (n_dof,) mask of what is drawn.
    rng : seeded.
    apart : when poses count as two; None: any two do.
    """

    def __init__(
        self, chain: KinematicChain, score: Score, dofs: np.ndarray, rng: np.random.Generator, apart: Apart | None = None
    ):
        self._chain, self._score, self._dofs, self._rng, self._apart = chain, score, dofs, rng, apart

    def run(self, first: Poses, rounds: Sequence[Round], n: int) -> tuple[Poses, np.ndarray]:
        """Score ``first``, then what every round draws about the best of all so far.

        Parameters
        ----------
        first : poses to begin with.
        rounds : one after the other. One with a score of its own goes on from the best so far alone.
        n : poses that are wanted.

        Returns
        -------
        At most ``n`` poses that are apart from each other, the best first, and their scores (n,).
        """
        poses, score = first.clipped(self._chain), self._score
        scores = score(poses)
        for now in rounds:
            best = poses[self.distinct(poses, scores, now.keep)]
            if now.score is not None:
                score, poses = now.score, best
                scores = score(best)
            drawn = self._drawn(best, now)
            if len(drawn):
                poses, scores = Poses.joined([poses, drawn]), np.concatenate([scores, score(drawn)])
        order = self.distinct(poses, scores, n)
        return poses[order], scores[order]

    def _drawn(self, best: Poses, now: Round) -> Poses:
        dofs = self._dofs if now.dofs is None else now.dofs
        spread = now.spread if isinstance(now.spread, float) else now.spread[dofs]
        tangents = np.zeros((len(best) * now.n, len(dofs)))
        tangents[:, dofs] = spread * self._rng.normal(size=(len(tangents), int(dofs.sum())))
        repeated = Poses(np.repeat(best.roots, now.n, axis=0), np.repeat(best.joints, now.n, axis=0))
        return repeated.retracted(tangents).clipped(self._chain)

    def distinct(self, poses: Poses, scores: np.ndarray, n: int) -> list[int]:
        """Indices of the best poses that are apart from each other.

        Parameters
        ----------
        poses : any number.
        scores : theirs, (n_poses,).
        n : at most so many.

        Returns
        -------
        The best first.
        """
        order, apart = np.argsort(-scores, kind="stable").tolist(), self._apart
        if apart is None:
            return order[:n]
        places: dict[int, np.ndarray] = {}

        def same(i: int, chosen: list[int]) -> bool:
            place = places[i] = apart.coordinates(poses[i : i + 1])[0]
            return not all(np.linalg.norm(place - places[other], apart.order) >= apart.distance for other in chosen)

        return best_apart(order, same, n)
