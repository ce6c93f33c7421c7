"""Metrics of runs on clips of clothed people: errors, lost sets and limbs, what was said of limbs, covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmark.clothed._recording import ENDS, JOINTS
from benchmark.clothed._runs import Run
from tracker_node.evaluation.metrics import LOST_JOINT_M, LOST_LIMB_M, lost_limbs, lost_sets, mean_error, offset_free_errors
from tracker_node.tracking.estimate import LimbStatus, Status

SIGMAS = 2.0


@dataclass(frozen=True)
class Accuracy:
    """Of one run; millimeters over the sets that have a state, counts over all.

    ``first_state_set``: sets before there was a state. ``lost_limbs``: names of their end joints.
    """

    mpjpe12_mm: float
    offset_free12_mm: float
    lost_limbs: tuple[str, ...]
    lost_sets: int
    first_state_set: int


def accuracy(run: Run) -> Accuracy:
    """Raw errors, errors without one constant offset a joint in the world, and what was lost by the truth."""
    n = len(run.rows)
    known = np.repeat(run.has_state[:, None], len(JOINTS), axis=1)
    difference = np.where(known[..., None], run.found_m - run.truth_m, 0.0)
    free, _ = offset_free_errors(difference, known)
    errors = np.linalg.norm(difference, axis=2)
    ends = list(ENDS)
    limbs = lost_limbs(errors[:, ends], known[:, ends]) | (not run.has_state.any())
    lost = lost_sets(run.has_state, run.status == Status.LOST, errors, known)
    first = int(np.argmax(run.has_state)) if run.has_state.any() else n
    return Accuracy(
        1e3 * mean_error(errors, known), 1e3 * mean_error(free, known),
        tuple(JOINTS[end] for end, is_lost in zip(ends, limbs, strict=True) if is_lost), int(lost.sum()), first,
    )  # fmt: skip


def wrong_sets(run: Run) -> np.ndarray:
    """Rows of image sets in which a joint is more than 200 mm off."""
    return run.rows[run.has_state & (np.nan_to_num(run.errors_m) > LOST_JOINT_M).any(axis=1)]


@dataclass(frozen=True)
class LimbCounts:
    """Limb-sets by what is true and what is said of them; ``shown``: the cameras see more than half of the limb."""

    wrong: int = 0
    wrong_tracking: int = 0
    wrong_degraded: int = 0
    right: int = 0
    right_lost: int = 0
    right_degraded: int = 0
    shown: int = 0
    shown_tracking: int = 0

    def __add__(self, other: LimbCounts) -> LimbCounts:
        return LimbCounts(*(a + b for a, b in zip(self.values, other.values, strict=True)))

    @property
    def values(self) -> tuple[int, ...]:
        """In the order of the fields."""
        return tuple(getattr(self, name) for name in self.__dataclass_fields__)

    def fractions(self) -> dict[str, float]:
        """The three that are judged, by key; nan over nothing."""
        return {
            "wrong_called_tracking": _over(self.wrong_tracking, self.wrong),
            "right_called_lost": _over(self.right_lost, self.right),
            "right_called_tracking": _over(self.shown_tracking, self.shown),
        }


def count_limbs(errors_m: np.ndarray, said: np.ndarray, shown: np.ndarray) -> LimbCounts:
    """Limb-sets by what is true and what is said.

    Parameters
    ----------
    errors_m : (n, k) of the end joints; nan without a state, which counts nowhere.
    said : (n, k) `LimbStatus`.
    shown : (n, k) fraction of the limb that the cameras see.

    Returns
    -------
    The counts.
    """
    known = np.isfinite(errors_m)
    wrong = known & (np.nan_to_num(errors_m) > LOST_LIMB_M)
    right = known & ~wrong
    tracking, degraded, lost = (said == status for status in (LimbStatus.TRACKING, LimbStatus.DEGRADED, LimbStatus.LOST))
    seen = right & (shown > 0.5)
    flags = (
        wrong, wrong & tracking, wrong & degraded, right, right & lost, right & degraded, seen, seen & tracking,
    )  # fmt: skip
    return LimbCounts(*(int(flag.sum()) for flag in flags))


def limbs_of_run(run: Run, shown: np.ndarray) -> LimbCounts:
    """`count_limbs` of a run."""
    return count_limbs(run.errors_m[:, list(ENDS)], run.limbs, shown)


def _over(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")


def within_sigmas(runs: Sequence[Run], offset_free: bool = True) -> np.ndarray:
    """How often errors are within two of their standard deviations, axis by axis of the world.

    Parameters
    ----------
    runs : any.
    offset_free : each run is taken without its own constant offset a joint.

    Returns
    -------
    (12,) fraction of each joint.
    """
    hits = [np.zeros((0, len(JOINTS), 3), dtype=bool)]
    for run in runs:
        rows = run.has_state
        if rows.any():
            difference = (run.found_m - run.truth_m)[rows]
            offsets = difference.mean(axis=0) if offset_free else 0.0
            hits.append(np.abs(difference - offsets) <= SIGMAS * np.sqrt(run.variances_m2[rows]))
    found = np.concatenate(hits)
    return found.mean(axis=(0, 2)) if len(found) else np.full(len(JOINTS), np.nan)


def together_over_best(
    together: Sequence[Accuracy], points: Sequence[Accuracy], contours: Sequence[Accuracy]
) -> dict[str, float]:
    """Error of the sum over that of the better modality alone, in the worst clip.

    Parameters
    ----------
    together, points, contours : of the same clips; ``contours`` may end early.

    Returns
    -------
    ``raw`` and ``offset_free``.
    """
    result = {}
    none = Accuracy(float("nan"), float("nan"), (), 0, 0)
    contours = [*contours, *[none] * (len(together) - len(contours))]
    for key, name in (("raw", "mpjpe12_mm"), ("offset_free", "offset_free12_mm")):
        values = [[getattr(each, name) for each in runs] for runs in (together, points, contours)]
        ratios = [both / np.nanmin(alone) for both, *alone in zip(*values, strict=True)]
        result[key] = float(np.max(ratios)) if ratios else float("nan")
    return result


def per_joint_mm(run: Run) -> np.ndarray:
    """(12, 2) millimeters, raw and without a constant offset."""
    rows = run.has_state
    difference = (run.found_m - run.truth_m)[rows]
    free = np.linalg.norm(difference - difference.mean(axis=0), axis=2)
    return 1e3 * np.stack([run.errors_m[rows].mean(axis=0), free.mean(axis=0)], axis=1)


def worst_joints(run: Run, n: int = 3) -> str:
    """The joints with the largest mean errors, raw / offset-free mm."""
    if not run.has_state.any():
        return "no state"
    errors = per_joint_mm(run)
    order = np.argsort(-errors[:, 0])[:n]
    return ", ".join(f"{JOINTS[j]} {errors[j, 0]:.0f} / {errors[j, 1]:.0f}" for j in order)
