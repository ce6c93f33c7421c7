"""Experiments on a rigid body as calls: track a sequence, hold it against truth, and map how wide the score's valley is.

Positions are along the world's axes, x anterior-posterior, y lateral, z vertical; figures in millimetres and degrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..model.configuration import State
from ..model.pose_variables import N_ROOT, ROOT_NAMES, from_variables, to_variables
from ..optimize.score_objective import ScoreObjective

VARIABLES = ("vertical", "ap", "lateral", "somersault", "tilt", "twist")  # in the order of the paper's Table 1
_COLUMNS = [ROOT_NAMES.index(name) for name in ("z", "x", "y", "somersault", "tilt", "twist")]
UNITS = ("mm", "mm", "mm", "deg", "deg", "deg")
_SCALES = np.array([1e3] * 3 + [np.degrees(1.0)] * 3)

# Trewartha, Yeadon & Knight, Table 1: range of motion, maximum error, rms error.
PAPER_RANGE = np.array([790.0, 1000.0, 10.0, 360.0, 8.0, 180.0])
PAPER_MAX = np.array([8.0, 8.0, 3.0, 0.4, 0.7, 0.6])
PAPER_RMS = np.array([4.8, 4.5, 1.7, 0.2, 0.3, 0.3])
PAPER_EVALUATIONS_PER_VARIABLE = 20


class Found(Protocol):
    """What every optimizer returns: where it ended, and how many scores (or linearizations) it asked for."""

    @property
    def state(self) -> State: ...
    @property
    def evaluations(self) -> int: ...


@dataclass(frozen=True, eq=False)
class TrackedSequence:
    """``states`` (n), one for each image set; ``evaluations`` (n,)."""

    states: tuple[State, ...]
    evaluations: np.ndarray

    def errors(self, truth: Sequence[State]) -> np.ndarray:
        """(n, 6) signed, mm and degrees, in the order of `VARIABLES`."""
        return np.stack([pose_error(state, true) for state, true in zip(self.states, truth, strict=True)])

    @property
    def evaluations_per_variable(self) -> float:
        """Scores for each of the six variables of an image set, mean: what the paper counts."""
        return float(self.evaluations.mean()) / N_ROOT


def track(show: Callable[[int], None], n_images: int, start: State, fit: Callable[[State], Found]) -> TrackedSequence:
    """Track a sequence without extrapolation: each image set starts from the estimate of the one before.

    Parameters
    ----------
    show : hands image set i to the objective that ``fit`` uses.
    start : where the first image set starts from.
    """
    states: list[State] = []
    evaluations: list[int] = []
    for image in range(n_images):
        show(image)
        found = fit(states[-1] if states else start)
        states.append(found.state)
        evaluations.append(found.evaluations)
    return TrackedSequence(tuple(states), np.array(evaluations))


def pose_error(state: State, truth: State) -> np.ndarray:
    """(6,) in the order of `VARIABLES`, mm and degrees; full turns do not count."""
    true = to_variables(truth)[:N_ROOT]
    return ((to_variables(state, true)[:N_ROOT] - true)[_COLUMNS]) * _SCALES


def moved(state: State, changes: np.ndarray) -> State:
    """The state with its variables changed by ``changes`` (6,), mm and degrees, in the order of `VARIABLES`."""
    variables = to_variables(state)
    variables[_COLUMNS] += np.asarray(changes) / _SCALES
    return from_variables(variables)


def error_metrics(prefix: str, errors: np.ndarray) -> dict[str, float]:
    """``<prefix>.<variable>_rms_mm`` and ``_max_mm``, or ``_deg``, of errors (n, 6)."""
    metrics = {}
    for name, unit, column in zip(VARIABLES, UNITS, errors.T, strict=True):
        metrics[f"{prefix}.{name}_rms_{unit}"] = float(np.sqrt(np.mean(column**2)))
        metrics[f"{prefix}.{name}_max_{unit}"] = float(np.abs(column).max())
    return metrics


def profile(objective: ScoreObjective, state: State, variable: str, changes: np.ndarray) -> np.ndarray:
    """Scores (n,) with one of `VARIABLES` changed by ``changes`` (n,), mm or degrees."""
    unit = np.eye(N_ROOT)[VARIABLES.index(variable)]
    return objective.scores([moved(state, change * unit) for change in changes])


def basin(changes: np.ndarray, scores: np.ndarray) -> tuple[float, float, float]:
    """Where the lowest score lies, and how far to either side of it the score rises without a fall.

    Scores that are not finite end the basin.
    """
    lowest = int(np.argmin(np.where(np.isfinite(scores), scores, np.inf)))
    ends = []
    for direction in (-1, 1):
        end = lowest
        while 0 <= end + direction < len(scores) and math.inf > scores[end + direction] > scores[end]:
            end += direction
        ends.append(abs(float(changes[end] - changes[lowest])))
    return float(changes[lowest]), ends[0], ends[1]


def success_rate(
    fit: Callable[[State], Found], truth: State, distance_mm: float, angle_deg: float, trials: int, seed: int = 0,
    near_mm: float = 5.0,
) -> float:  # fmt: skip
    """Share of starts from which a fit ends within ``near_mm`` of the truth.

    Parameters
    ----------
    distance_mm, angle_deg : length of the displacement, and angle of the rotation about a world axis, both in random directions.
    """
    rng = np.random.default_rng(seed)
    reached = 0
    for _ in range(trials):
        tangent = np.zeros(N_ROOT + truth.joint_positions.size)
        tangent[:3] = distance_mm / 1e3 * _unit(rng)
        tangent[3:6] = np.deg2rad(angle_deg) * _unit(rng)
        found = fit(truth.retract(tangent)).state
        reached += bool(1e3 * np.linalg.norm(found.T_world_root[:3, 3] - truth.T_world_root[:3, 3]) <= near_mm)
    return reached / trials


def _unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)
