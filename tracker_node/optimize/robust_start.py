"""Where to start from when the prediction is too far off to walk downhill from: many hypotheses, scored at once.

Rounds of hypotheses around the best so far, each round with a narrower spread. Only the root moves: limbs are found from a body
that is in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # imports its modules when they are first used

from ..model.configuration import State
from ..model.kinematic_chain import N_ROOT_DOF
from .score_objective import ScoreObjective

_BITS = 54  # digits of a number of Halton's sequence beyond these change no double


@dataclass(frozen=True)
class RobustStartOptions:
    """How hypotheses are spread.

    Attributes
    ----------
    spread_m, spread_rad : radius of the ball of root positions, and of that of rotation vectors, in the first round.
    n : hypotheses a round.
    rounds : each has ``shrink`` times the spread of the one before.
    keep : so many best hypotheses are the centers of the next round.
    apart : of two hypotheses that are nearer to each other than this fraction of the round's spread, in position and in angle,
        only the better one is kept: or all would soon stand in the first hollow that was found.
    row_step : score every n-th image row only.
    seed : of the hypotheses; the same seed, the same answer.
    """

    spread_m: float = 0.25
    spread_rad: float = 0.45
    n: int = 256
    rounds: int = 3
    shrink: float = 0.5
    keep: int = 8
    apart: float = 0.25
    row_step: int = 8
    seed: int = 0

    @property
    def evaluations(self) -> int:
        """Scores of a search around one start."""
        return 1 + self.n * self.rounds


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A state and its score, on the rows that are scored."""

    state: State
    score: float


def search(objective: ScoreObjective, start: State, options: RobustStartOptions | None = None) -> list[Hypothesis]:
    """Search around a state; deterministic for a seed.

    Parameters
    ----------
    objective : its score judges the hypotheses.
    start : hypotheses are spread around it, and it is one of them.
    options : None: the defaults.

    Returns
    -------
    The ``keep`` best of all hypotheses, best first; empty where none can be scored.
    """
    options = options or RobustStartOptions()
    coarse = _coarse(objective, options)
    best: list[Hypothesis] = []
    around = [start]
    scale = 1.0
    for number in range(options.rounds):
        states = list(around) if number == 0 else []
        states += _spread(around, options.n, options, scale, options.seed + number)
        scores = coarse.scores(states)
        best += [Hypothesis(state, float(score)) for state, score in zip(states, scores, strict=True) if np.isfinite(score)]
        best = _distinct(best, options, scale * options.apart)
        if not best:
            return []
        around = [hypothesis.state for hypothesis in best]
        scale *= options.shrink
    return best


def chance_level(objective: ScoreObjective, state: State, n: int, options: RobustStartOptions | None = None) -> float:
    """What a body scores by chance: the median of hypotheses spread around a state.

    Parameters
    ----------
    objective, state : the score, and where.
    n : hypotheses.
    options : how they are spread; None: the defaults.

    Returns
    -------
    The median; 0 where none can be scored.
    """
    options = options or RobustStartOptions()
    scores = _coarse(objective, options).scores(_spread([state], n, options, 1.0, options.seed))
    scores = scores[np.isfinite(scores)]
    return float(np.median(scores)) if scores.size else 0.0


def _coarse(objective: ScoreObjective, options: RobustStartOptions) -> ScoreObjective:
    return objective.at_row_step(options.row_step) if options.row_step > 1 else objective


def _spread(around: Sequence[State], n: int, options: RobustStartOptions, scale: float, seed: int) -> list[State]:
    """``n`` states around these in turn, within ``scale`` times the spreads."""
    tangents = _ball_points(n, seed) * np.repeat([scale * options.spread_m, scale * options.spread_rad], 3)
    return [_moved(around[i % len(around)], tangent) for i, tangent in enumerate(tangents)]


def _distinct(hypotheses: list[Hypothesis], options: RobustStartOptions, apart: float) -> list[Hypothesis]:
    """The best ``keep`` that are ``apart`` of the spreads from each other, best first."""
    roots = np.array([hypothesis.state.T_world_root for hypothesis in hypotheses]).reshape(-1, 4, 4)

    def same(i: int, chosen: list[int]) -> bool:
        others = roots[chosen]
        near = others[np.linalg.norm(others[:, :3, 3] - roots[i, :3, 3], axis=1) < apart * options.spread_m]
        cosines = 0.5 * (np.einsum("nij,ij->n", near[:, :3, :3], roots[i, :3, :3]) - 1.0)
        return bool((cosines > np.cos(min(apart * options.spread_rad, np.pi))).any())

    order = np.argsort([hypothesis.score for hypothesis in hypotheses], kind="stable")
    return [hypotheses[i] for i in best_apart(order, same, options.keep)]


def best_apart(order: Iterable[int], same: Callable[[int, list[int]], bool], n: int) -> list[int]:
    """The best that are no other one's like.

    Parameters
    ----------
    order : of all, the best first.
    same : whether one is the same as any of those that are chosen.
    n : at most.

    Returns
    -------
    The best first.
    """
    chosen: list[int] = []
    for i in map(int, order):
        if len(chosen) >= n:
            break
        if not same(i, chosen):
            chosen.append(i)
    return chosen


def _moved(state: State, root_tangent: np.ndarray) -> State:
    tangent = np.zeros(N_ROOT_DOF + len(state.joint_positions))
    tangent[:N_ROOT_DOF] = root_tangent
    return state.retract(tangent)


def _ball_points(n: int, seed: int) -> np.ndarray:
    """(n, 6): two points of the unit ball each, spread evenly (scrambled Halton sequence)."""
    uniform = scrambled_halton(n, 8, seed)
    points = np.empty((n, 6))
    for half in (0, 1):
        direction = scipy.special.ndtri(np.clip(uniform[:, 4 * half : 4 * half + 3], 1e-9, 1.0 - 1e-9))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        points[:, 3 * half : 3 * half + 3] = direction * np.cbrt(uniform[:, 4 * half + 3 : 4 * half + 4])
    return points


def scrambled_halton(n: int, n_dims: int, seed: int) -> np.ndarray:
    """Points spread evenly in the unit cube: a Halton sequence whose digits are permuted at random (Owen, arXiv:1706.02808).

    As ``scipy.stats.qmc.Halton`` gives them, to the last bit, without the third of a second that `scipy.stats` takes to be
    imported.

    Parameters
    ----------
    n, n_dims : number of points, and of their coordinates.
    seed : of the permutations.

    Returns
    -------
    (n, n_dims).
    """
    rng = np.random.default_rng(seed)
    return np.stack([_radical_inverses(n, base, _permutations(base, rng)) for base in _primes(n_dims)], axis=1)


def _primes(count: int) -> list[int]:
    primes: list[int] = []
    candidate = 2
    while len(primes) < count:
        if all(candidate % prime for prime in primes):
            primes.append(candidate)
        candidate += 1
    return primes


def _permutations(base: int, rng: np.random.Generator) -> np.ndarray:
    """(n_digits, base), of the values of each digit."""
    rows = np.tile(np.arange(base), (int(np.ceil(_BITS / np.log2(base))) - 1, 1))
    for row in rows:
        rng.shuffle(row)
    return rows


def _radical_inverses(n: int, base: int, permutations: np.ndarray) -> np.ndarray:
    """(n,) of 0, 1, 2 ...: their digits behind the point, in opposite order and permuted."""
    left, weight, inverses = np.arange(n), 1.0 / base, np.zeros(n)
    for permutation in permutations:
        inverses += permutation[left % base] * weight
        weight /= base
        left //= base
    return inverses
