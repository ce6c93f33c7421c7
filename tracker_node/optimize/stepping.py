"""Downhill stepping with the V-algorithm, as published by Trewartha, Yeadon & Knight.

Loops of decreasing step length; in each, one variable after the other: step downhill, stop after two consecutive increases of the
score, move to the best point, refine it by the V-algorithm.

The paper leaves open how the downhill direction is found, where V is used, and the steps of its seven loops. Here the first
step is tried both ways; V is a switch; the seven loops are the five and two finer ones. A point that V proposes is taken only if
its score is lower.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from .score_objective import ScoreObjective, SearchResult, VariableSpace
from .v_algorithm import vertex

V_WHERE = ("every_line", "last_loop", "never")


@dataclass(frozen=True)
class LoopOptions:
    """Steps of one loop, for the root's position (m) and for all angles (rad); only every ``row_step``-th image row is scored."""

    step_m: float
    step_rad: float
    row_step: int = 1


def schedule(steps_mm: Sequence[float], steps_deg: Sequence[float], row_steps: Sequence[int] = ()) -> tuple[LoopOptions, ...]:
    """Loops from steps in millimeters and degrees."""
    rows = row_steps or [1] * len(steps_mm)
    return tuple(
        LoopOptions(1e-3 * mm, math.radians(deg), n) for mm, deg, n in zip(steps_mm, steps_deg, rows, strict=True)
    )


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
    order : indices of the variables (``model/pose_variables``) in the order they are stepped; None: all, in their own order.
    increases : a line ends after so many consecutive increases of the score.
    v : where the V-algorithm is used: ``every_line``, ``last_loop`` or ``never``.
    max_steps : a line also ends after so many steps, which a slope without an end would need.
    trace : keep every evaluation.
    """

    schedule: tuple[LoopOptions, ...] = FIVE_LOOPS
    order: tuple[int, ...] | None = None
    increases: int = 2
    v: str = "every_line"
    max_steps: int = 40
    trace: bool = False

    def __post_init__(self):
        if not self.schedule:
            raise ValueError("expected a schedule of one loop at least, got none")
        if self.v not in V_WHERE:
            raise ValueError(f"expected v, one of {V_WHERE}, got '{self.v}'")
        if self.increases < 1 or self.max_steps < 1:
            raise ValueError(f"expected increases and max_steps of 1 or more, got {self.increases}, {self.max_steps}")


@dataclass(frozen=True)
class Line:
    """The walk along one variable: its best place and score, and whether the rising score (or a limit) has ended it."""

    place: float
    score: float
    ended: bool


def walk_line(
    scores_at: Callable[[list[float]], np.ndarray], place: float, score: float, step: float, limits: tuple[float, float],
    options: SteppingOptions, use_v: bool,
) -> Line:  # fmt: skip
    """One variable: both neighbors, then on in the lower one's direction until the score has risen often enough.

    As many increases as are missing, so many points are needed at least: they are scored at once, and none is in vain.
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
    while rises < options.increases and steps < options.max_steps and not wall:
        count = min(options.increases - rises, options.max_steps - steps)
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
    line = Line(places[best], values[best], rises >= options.increases or wall)
    refined = vertex(places, values) if use_v else None
    if refined is None or refined in places:
        return line
    f = float(scores_at([refined])[0])
    return Line(refined, f, line.ended) if f < line.score else line


def step_downhill(
    objective: ScoreObjective, start: State, chain: KinematicChain, options: SteppingOptions | None = None,
    active: Sequence[int] | None = None,
) -> SearchResult:  # fmt: skip
    """Walk downhill from ``start``; deterministic.

    Parameters
    ----------
    chain : its joint limits are never left, at no point that is scored.
    active : indices of the variables that may move; None: all. (A rigid body is its first six; a hierarchy steps limb by limb.)

    Returns
    -------
    Not converged: the start cannot be scored, or a line of the last loop was cut off by ``max_steps``.
    """
    options = options or SteppingOptions()
    space = VariableSpace(objective, start, chain, options.trace)
    order = range(space.size) if options.order is None else options.order
    variables = [i for i in order if active is None or i in active]
    x, score, converged = space.start.copy(), math.inf, False
    for number, loop in enumerate(options.schedule):
        space.begin_stage(number, loop.row_step)
        if number == 0 or loop.row_step != options.schedule[number - 1].row_step:
            score = float(space.scores([x], active=variables)[0])
        if not math.isfinite(score):
            return space.result(x, score, False)
        last = number == len(options.schedule) - 1
        use_v = options.v == "every_line" or (options.v == "last_loop" and last)
        converged = True
        for i in variables:

            def scores_at(values: list[float], i: int = i, base: np.ndarray = x) -> np.ndarray:
                points = np.repeat(base[None], len(values), axis=0)
                points[:, i] = values
                return space.scores(list(points), variable=i)

            step = loop.step_m if i < 3 else loop.step_rad
            limits = float(space.lower[i]), float(space.upper[i])
            line = walk_line(scores_at, float(x[i]), score, step, limits, options, use_v)
            x[i], score, converged = line.place, line.score, converged and line.ended
    return space.result(x, score, converged)


