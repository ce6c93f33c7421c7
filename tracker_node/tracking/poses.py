"""Many poses of one body at a time, and the search for better ones: drawn, scored, and drawn again about the best.

A search begins with those of a library: a body whose axes have the names of the human's gets poses that people are found in; any
body gets its neutral pose and samples between its limits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..model.articulated import ArticulatedModel
from ..model.configuration import State
from ..model.humans.measures import mirrored_name
from ..model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ..optimize.robust_start import best_apart, scrambled_halton

_WIDEST = 1.2  # radians from neutral that axes without narrow limits are sampled in

# Degrees by the name of the axis, without a side: both sides. Signs and zeros are those of docs/formats.md.
_ARMS_OUT = {"shoulder_elevation_front": 60.0, "shoulder_elevation_back": 30.0}
_LEVEL = {"shoulder_elevation_front": 90.0, "shoulder_elevation_back": 45.0}
_FORWARD = {"shoulder_elevation_front": 80.0, "shoulder_elevation_back": -40.0}
_UP = {"shoulder_elevation_front": 165.0}
_CROUCH = {"hip_flexion": 75.0, "knee_flexion": 90.0, "abdomen_flexion": 25.0}
_BOW = {"hip_flexion": 35.0, "abdomen_flexion": 40.0, "torso_flexion": 25.0}
_POSTURES: tuple[dict[str, float], ...] = (
    {},
    _ARMS_OUT,
    _LEVEL,
    _FORWARD,
    _UP,
    {"elbow_flexion": 90.0},
    {"shoulder_elevation_front": 40.0, "shoulder_elevation_back": 30.0, "elbow_flexion": 70.0, "hip_abduction": 15.0},
    {**_LEVEL, "hip_abduction": 25.0},
    _CROUCH,
    {**_CROUCH, **_FORWARD},
    _BOW,
    {**_BOW, **_LEVEL},
    {"hip_flexion": 80.0, "knee_flexion": 80.0},
)
# Of the left side, then of the right; each is taken the other way round as well.
_ONE_SIDED: tuple[tuple[dict[str, float], dict[str, float]], ...] = (
    ({"hip_flexion": 25.0, "shoulder_elevation_front": -15.0}, {"hip_flexion": -15.0, "knee_flexion": 25.0, **_ARMS_OUT}),
    ({"hip_flexion": 40.0, "knee_flexion": 45.0}, {"hip_flexion": -10.0, "knee_flexion": 15.0}),
    (_UP, {}),
    (_LEVEL, {}),
    ({"hip_flexion": 75.0, "knee_flexion": 20.0, **_ARMS_OUT}, _ARMS_OUT),
    ({"hip_abduction": 45.0, **_LEVEL}, _LEVEL),
    ({"hip_flexion": 60.0, "knee_flexion": 90.0}, {}),
)


def other_side(names: Sequence[str]) -> np.ndarray:
    """Index of the axis of the other side for each axis, its own where a name begins with neither ``left_`` nor ``right_``."""
    index = {name: i for i, name in enumerate(names)}
    return np.array([index.get(mirrored_name(name), i) for i, name in enumerate(names)], dtype=np.int64)


def reachable(chain: KinematicChain) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper angles (n_axes,) that are worth trying: within the limits, and not far from neutral on stiff axes."""
    neutral = np.array([axis.neutral for axis in chain.axes])
    stiffness = np.array([axis.stiffness for axis in chain.axes])
    wide = np.where(stiffness > 1.0, 0.5, np.pi)
    return np.maximum(chain.lower, neutral - wide), np.minimum(chain.upper, neutral + wide)


def library_poses(model: ArticulatedModel, n_random: int, seed: int) -> np.ndarray:
    """Joint angles of typical and of random poses.

    Parameters
    ----------
    model : the body.
    n_random, seed : number of random ones, and their seed.

    Returns
    -------
    (n, n_axes) the neutral ones first, each pose once.
    """
    chain = model.chain
    neutral = np.array([axis.neutral for axis in chain.axes])
    rows = [neutral]
    sided = [(both, both) for both in _POSTURES]
    sided += [pair for left, right in _ONE_SIDED for pair in ((left, right), (right, left))]
    for left, right in sided:
        row = neutral.copy()
        for i, axis in enumerate(chain.axes):
            own = left if axis.name.startswith("left_") else right
            row[i] += np.deg2rad(own.get(axis.name.removeprefix("left_").removeprefix("right_"), 0.0))
        rows.append(row)
    if chain.n_axes:
        low, high = reachable(chain)
        low, high = np.maximum(low, neutral - _WIDEST), np.minimum(high, neutral + _WIDEST)
        unit = scrambled_halton(n_random, chain.n_axes, seed)
        rows += list(low + unit * (high - low))
    clipped = np.clip(np.array(rows).reshape(len(rows), chain.n_axes), chain.lower, chain.upper)
    _, first = np.unique(clipped, axis=0, return_index=True)
    return clipped[np.sort(first)]


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
