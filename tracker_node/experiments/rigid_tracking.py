"""Experiments on a rigid body as calls: track a sequence, hold it against truth, and map how wide the score's valley is.

Positions are along the world's axes, x anterior-posterior, y lateral, z vertical; figures in millimeters and degrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ..model.configuration import N_ROOT, ROOT_NAMES, State, from_variables, to_variables
from ..optimize.score_objective import ScoreObjective

VARIABLES = ("vertical", "ap", "lateral", "somersault", "tilt", "twist")  # in the order of the paper's Table 1
_COLUMNS = [ROOT_NAMES.index(name) for name in ("z", "x", "y", "somersault", "tilt", "twist")]
LABELS = {name: name for name in VARIABLES} | {"ap": "A-P"}
UNITS = ("mm", "mm", "mm", "deg", "deg", "deg")
_SCALES = np.array([1e3] * 3 + [np.degrees(1.0)] * 3)

# Trewartha, Yeadon & Knight, Table 1: range of motion, maximum error, rms error.
PAPER_RANGE = np.array([790.0, 1000.0, 10.0, 360.0, 8.0, 180.0])
PAPER_MAX = np.array([8.0, 8.0, 3.0, 0.4, 0.7, 0.6])
PAPER_RMS = np.array([4.8, 4.5, 1.7, 0.2, 0.3, 0.3])
PAPER_EVALUATIONS_PER_VARIABLE = 20

NEAR_MM = 5.0  # a fit that ends so near to the true position has arrived


class FitResult(Protocol):
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


def track(show: Callable[[int], None], n_images: int, start: State, fit: Callable[[State], FitResult]) -> TrackedSequence:
    """Track a sequence without extrapolation: each image set starts from the estimate of the one before.

    Parameters
    ----------
    show : hands image set i to the objective that ``fit`` uses.
    n_images : image sets.
    start : where the first image set starts from.
    fit : from a start to an estimate.

    Returns
    -------
    An estimate for each image set.
    """
    found: list[FitResult] = []
    for image in range(n_images):
        show(image)
        found.append(fit(found[-1].state if found else start))
    return sequence_of(found)


def fit_each(show: Callable[[int], None], starts: Sequence[State], fit: Callable[[State], FitResult]) -> TrackedSequence:
    """Fit every image set from a start of its own.

    Parameters
    ----------
    show : hands image set i to the objective that ``fit`` uses.
    starts : one an image set.
    fit : from a start to an estimate.

    Returns
    -------
    An estimate for each image set.
    """
    found: list[FitResult] = []
    for image, start in enumerate(starts):
        show(image)
        found.append(fit(start))
    return sequence_of(found)


def sequence_of(found: Sequence[FitResult]) -> TrackedSequence:
    """The fits of a sequence, one for each image set."""
    return TrackedSequence(tuple(each.state for each in found), np.array([each.evaluations for each in found]))


def pose_error(state: State, truth: State) -> np.ndarray:
    """Difference of two poses; full turns do not count.

    Parameters
    ----------
    state, truth : of a rigid body.

    Returns
    -------
    (6,) in the order of `VARIABLES`, mm and degrees.
    """
    true = to_variables(truth)[:N_ROOT]
    return ((to_variables(state, true)[:N_ROOT] - true)[_COLUMNS]) * _SCALES


def moved(state: State, changes: npt.ArrayLike) -> State:
    """The state with its variables changed.

    Parameters
    ----------
    state : of a rigid body.
    changes : (6,) in the order of `VARIABLES`, mm and degrees.

    Returns
    -------
    The changed state.
    """
    variables = to_variables(state)
    variables[_COLUMNS] += np.asarray(changes) / _SCALES
    return from_variables(variables)


def motion_ranges(variables: np.ndarray) -> np.ndarray:
    """(6,) ranges of pose variables (n, 6), mm and degrees, in the order of `VARIABLES`."""
    return np.ptp(variables, axis=0)[_COLUMNS] * _SCALES


def error_metrics(prefix: str, errors: np.ndarray) -> dict[str, float]:
    """Metrics of errors.

    Parameters
    ----------
    prefix : of their names.
    errors : (n, 6) in the order of `VARIABLES`, mm and degrees; or (n_starts, n, 6), of several starts.

    Returns
    -------
    ``<prefix>.<variable>_rms_<unit>`` and ``_max_<unit>`` -> value, the median of several starts; of these also the lowest and
    the highest, ``_rms_low_<unit>`` and ``_rms_high_<unit>``.
    """
    metrics = {}
    rms, most = _by_start(errors)
    for i, (name, unit) in enumerate(zip(VARIABLES, UNITS, strict=True)):
        metrics[f"{prefix}.{name}_rms_{unit}"] = float(np.median(rms[:, i]))
        metrics[f"{prefix}.{name}_max_{unit}"] = float(np.median(most[:, i]))
        if len(rms) > 1:
            metrics[f"{prefix}.{name}_rms_low_{unit}"] = float(rms[:, i].min())
            metrics[f"{prefix}.{name}_rms_high_{unit}"] = float(rms[:, i].max())
    return metrics


def _by_start(errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Root mean squares and maxima (n_starts, 6)."""
    each = errors.reshape(-1, *errors.shape[-2:])
    return np.sqrt(np.mean(each**2, axis=1)), np.abs(each).max(axis=1)


def table1(columns: Mapping[str, np.ndarray], motion: np.ndarray) -> list[list[str]]:
    """The paper's Table 1 with further columns: rows of text, the first one the headings.

    Parameters
    ----------
    columns : title -> errors as of `error_metrics`; each becomes "maximum / rms", medians of several starts, with the range of
        the rms over these.
    motion : (6,) ranges of motion, mm and degrees.

    Returns
    -------
    Rows of text.
    """
    rows = [["variable", "range", "paper's range", "paper: max / rms", *(f"{title}: max / rms" for title in columns)]]
    for i, (name, unit) in enumerate(zip(VARIABLES, UNITS, strict=True)):
        cells = [_of(motion[i], unit, 0), _of(PAPER_RANGE[i], unit, 0), f"{PAPER_MAX[i]:.1f} / {PAPER_RMS[i]:.1f} {unit}"]
        digits = 2 if unit == "mm" else 3
        for errors in columns.values():
            rms, most = _by_start(errors)
            cell = f"{np.median(most[:, i]):.{digits}f} / {_of(np.median(rms[:, i]), unit, digits)}"
            spread = f" ({rms[:, i].min():.{digits}f} to {rms[:, i].max():.{digits}f})"
            cells.append(cell + spread if len(rms) > 1 else cell)
        rows.append([LABELS[name], *cells])
    return rows


def _of(value: float, unit: str, digits: int) -> str:
    return f"{value:.{digits}f} {unit}"


def profile(objective: ScoreObjective, state: State, variable: str, changes: np.ndarray) -> np.ndarray:
    """Scores along one variable.

    Parameters
    ----------
    objective : the score.
    state : where it starts.
    variable : of `VARIABLES`.
    changes : (n,) mm or degrees.

    Returns
    -------
    (n,) scores.
    """
    unit = np.eye(N_ROOT)[VARIABLES.index(variable)]
    return objective.scores([moved(state, change * unit) for change in changes])


def basin(changes: np.ndarray, scores: np.ndarray) -> tuple[float, float, float]:
    """The minimum of a score along a variable, and how far the score rises to either side without a fall.

    Scores that are not finite end the basin.

    Parameters
    ----------
    changes : (n,) increasing.
    scores : (n,); those that are not finite end the basin.

    Returns
    -------
    Change at the minimum, and distances to the ends before and after it.
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
    show: Callable[[int], None], truth: Sequence[State], fit: Callable[[State], FitResult],
    distance_mm: float, angle_deg: float, trials: int, near_mm: float = NEAR_MM,
) -> float:  # fmt: skip
    """Fraction of starts from which a fit ends near the truth.

    Parameters
    ----------
    show : hands image set i to the objective that ``fit`` uses.
    truth : state in each image set.
    fit : from a start to an estimate.
    distance_mm, angle_deg : length of the displacement, and angle of the rotation about a world axis, both in random directions.
    trials : starts; they take the image sets in turn.
    near_mm : largest distance from the truth of a fit that has arrived.

    Returns
    -------
    0 to 1.
    """
    rng = np.random.default_rng(0)
    reached = 0
    for trial in range(trials):
        image = trial % len(truth)
        show(image)
        true = truth[image]
        tangent = np.zeros(N_ROOT + true.joint_positions.size)
        tangent[:3] = distance_mm / 1e3 * _unit(rng)
        tangent[3:6] = np.deg2rad(angle_deg) * _unit(rng)
        found = fit(true.retract(tangent)).state
        reached += bool(1e3 * np.linalg.norm(found.T_world_root[:3, 3] - true.T_world_root[:3, 3]) <= near_mm)
    return reached / trials


def _unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)
