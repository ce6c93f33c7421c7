"""Downhill stepping with the V-algorithm, as published by Trewartha, Yeadon & Knight.

Loops of decreasing step length; in each, one variable after the other: step downhill, stop after two consecutive increases of the
score, move to the best point, refine it by the V-algorithm.

The paper leaves open how the downhill direction is found, where V is used, and the steps of its seven loops. Here the first
step is tried both ways; V is a switch; the seven loops are the five and two finer ones. A point that V proposes is taken only if
its score is lower.

The V-algorithm: around its minimum the score of a colored body falls and rises about linearly, so the minimum lies where the line
through two points on the falling side meets the line through two on the rising side; that puts an estimate between the steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from .score_objective import ScoreObjective, SearchResult, VariableSpace

_INCREASES = 2  # consecutive ones of the score end a line
_MOST_STEPS = 40  # also end it, which a slope without an end would need
V_WHERE = ("every_line", "last_loop", "never")


@dataclass(frozen=True)
class LoopOptions:
    """Steps of one loop, for the root's position (m) and for all angles (rad); only every ``row_step``-th image row is scored."""

    step_m: float
    step_rad: float
    row_step: int = 1


def schedule(steps_mm: Sequence[float], steps_deg: Sequence[float], row_steps: Sequence[int] = ()) -> tuple[LoopOptions, ...]:
    """Loops from steps in millimeters and degrees.

    Parameters
    ----------
    steps_mm, steps_deg : of each loop, for the root's position and for angles.
    row_steps : of each loop, see `LoopOptions`; empty: all rows.

    Returns
    -------
    As many loops.
    """
    rows = row_steps or [1] * len(steps_mm)
    return tuple(LoopOptions(1e-3 * mm, math.radians(deg), n) for mm, deg, n in zip(steps_mm, steps_deg, rows, strict=True))


FIVE_LOOPS = schedule((50, 30, 20, 10, 10), (5, 3, 2, 1, 1))
SEVEN_LOOPS = schedule((50, 30, 20, 10, 10, 5, 2), (5, 3, 2, 1, 1, 0.5, 0.2))
DECIMATED_LOOPS = schedule((50, 30, 20, 10, 10), (5, 3, 2, 1, 1), (8, 8, 4, 2, 2))
SCHEDULES = {"five_loops": FIVE_LOOPS, "seven_loops": SEVEN_LOOPS, "decimated": DECIMATED_LOOPS}


@dataclass(frozen=True)
class SteppingOptions:
    """How to step.

    Attributes
    ----------
    schedule : the loops.
    order : indices of the variables (`model.configuration.to_variables`) in the order they are stepped; None: all, in their own.
    v : where the V-algorithm is used: ``every_line``, ``last_loop`` or ``never``.
    """

    schedule: tuple[LoopOptions, ...] = FIVE_LOOPS
    order: tuple[int, ...] | None = None
    v: str = "every_line"

    def __post_init__(self):
        if not self.schedule:
            raise ValueError("expected a schedule of one loop at least, got none")
        if self.v not in V_WHERE:
            raise ValueError(f"expected v, one of {V_WHERE}, got '{self.v}'")


@dataclass(frozen=True)
class LineWalk:
    """The walk along one variable: its best place and score, and whether the rising score (or a limit) has ended it."""

    place: float
    score: float
    ended: bool


def _walk_line(
    scores_at: Callable[[list[float]], np.ndarray], place: float, score: float, step: float, limits: tuple[float, float],
    use_v: bool,
) -> LineWalk:  # fmt: skip
    """Walk along one variable: both neighbors, then on in the lower one's direction until the score has risen often enough.

    As many increases as are missing, so many points are needed at least: they are scored at once, and none is wasted.
    """
    lower, upper = limits
    neighbors = [min(place + step, upper), max(place - step, lower)]
    open_sides = [value for value in neighbors if value != place]
    known = dict(zip(open_sides, scores_at(open_sides), strict=True)) if open_sides else {}
    f_up, f_down = (float(known.get(value, math.inf)) for value in neighbors)
    if f_down < f_up:
        neighbors, f_up, f_down, step = neighbors[::-1], f_down, f_up, -step
    places, values = [neighbors[1], place, neighbors[0]], [f_down, score, f_up]
    rises, steps = int(f_up >= score), 1
    wall = False
    while rises < _INCREASES and steps < _MOST_STEPS and not wall:
        count = min(_INCREASES - rises, _MOST_STEPS - steps)
        ahead = [min(max(places[-1] + i * step, lower), upper) for i in range(1, count + 1)]
        ahead = [b for a, b in zip([places[-1], *ahead], ahead, strict=False) if b != a]
        wall = len(ahead) < count
        for value, f in zip(ahead, scores_at(ahead) if ahead else (), strict=True):
            rises = rises + 1 if f >= values[-1] else 0
            places.append(value)
            values.append(float(f))
            steps += 1
    best = min(range(len(values)), key=values.__getitem__)
    if values[best] >= score:
        best = 1  # stay where nothing is better
    line = LineWalk(places[best], values[best], rises >= _INCREASES or wall)
    refined = vertex(places, values) if use_v else None
    if refined is None or refined in places:
        return line
    f = float(scores_at([refined])[0])
    return LineWalk(refined, f, line.ended) if f < line.score else line


def step_downhill(
    objective: ScoreObjective, start: State, chain: KinematicChain, options: SteppingOptions | None = None,
    active: Sequence[int] | None = None,
) -> SearchResult:  # fmt: skip
    """Walk downhill; deterministic.

    Parameters
    ----------
    objective : score.
    start : state to begin at.
    chain : its joint limits are never left, at no point that is scored.
    options : None: the defaults.
    active : indices of the variables that may move; None: all. (A rigid body is its first six; a hierarchy steps limb by limb.)

    Returns
    -------
    Not converged: the start cannot be scored, or a line of the last loop took too many steps.
    """
    options = options or SteppingOptions()
    space = VariableSpace(objective, start, chain)
    order = range(space.size) if options.order is None else options.order
    variables = [i for i in order if active is None or i in active]
    x, score, converged = space.start.copy(), math.inf, False
    for number, loop in enumerate(options.schedule):
        space.begin_stage(loop.row_step)
        if number == 0 or loop.row_step != options.schedule[number - 1].row_step:
            score = float(space.scores([x], active=variables)[0])
        if not math.isfinite(score):
            return space.result(x, score, False)
        last = number == len(options.schedule) - 1
        use_v = options.v == "every_line" or (options.v == "last_loop" and last)
        converged = True
        for run in space.together(variables):
            if space.hold(x, run):
                score = float(space.scores([x], active=run)[0])
            for i in run:

                def scores_at(values: list[float], i: int = i, base: np.ndarray = x) -> np.ndarray:
                    points = np.repeat(base[None], len(values), axis=0)
                    points[:, i] = values
                    return space.scores(list(points), variable=i)

                step = loop.step_m if i < 3 else loop.step_rad
                limits = float(space.lower[i]), float(space.upper[i])
                line = _walk_line(scores_at, float(x[i]), score, step, limits, use_v)
                x[i], score, converged = line.place, line.score, converged and line.ended
    return space.result(x, score, converged)


def intersection(x: Sequence[float], f: Sequence[float]) -> float | None:
    """Where the line through the first two of four points meets the line through the last two.

    Parameters
    ----------
    x, f : (4,) places in the order of the walk (rising or falling alike), and their scores.

    Returns
    -------
    The place; None unless the first pair falls, the second rises, and they meet between the outer points.
    """
    if not (math.isfinite(f[0]) and math.isfinite(f[3]) and f[1] < f[0] and f[3] > f[2]):
        return None
    falling, rising = (f[1] - f[0]) / (x[1] - x[0]), (f[3] - f[2]) / (x[3] - x[2])
    place = (f[2] - f[1] + falling * x[1] - rising * x[2]) / (falling - rising)
    return place if min(x[0], x[3]) < place < max(x[0], x[3]) else None


def vertex(x: Sequence[float], f: Sequence[float]) -> float | None:
    """The refined minimum of a walk.

    The lowest point and the one before it are the falling pair, the two after it the rising one: the last two pairs of a walk
    that two increases have ended. Exact where the vertex lies behind the lowest point; else they meet in that point itself.

    Parameters
    ----------
    x, f : (n,) places in the order of the walk, and their scores.

    Returns
    -------
    The place; None where the points around the lowest do not make a V.
    """
    k = min(range(len(f)), key=f.__getitem__)
    return intersection(x[k - 1 : k + 3], f[k - 1 : k + 3]) if 1 <= k <= len(f) - 3 else None
