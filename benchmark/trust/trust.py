#!/usr/bin/env python3
"""How far the contour tracker's own word can be trusted: covariances against errors, and LOST against truth.

Two bodies of cones (22 and 40 degrees of freedom) before a strongly colored room, 4 cameras of 640x480, drawn by
another renderer. Sound clips in fast motion give the consistency of the covariances and the false alarms; clips in which the body
is occluded, gone, elsewhere, or one limb is hidden, swapped or mirrored give the delay until LOST. Thresholds and scales were
taken from other clips: `--fit` prints them.

``lost_delay_sets``: the 95th percentile over all events of how many image sets it takes until LOST is said, that of the event
counted as the first; an event that nobody notices counts to the end of its clip. Of the body: from when a joint is more than
200 mm off, or nothing of it is to be seen. Of a limb: from when its end is more than 150 mm off, or it is hidden.
``lost_auc``: the lesser of the areas for the body (any joint more than 200 mm off, by the probability of its worst limb) and for
limbs (end more than 150 mm off). Left out are sets in which something is hidden and yet is where the tracker says;
``lost_auc_strict`` counts them as sound.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tracker_node.errors import TrackerError
from tracker_node.evaluation.consistency import effective_sets, mean_bounds, whitened
from tracker_node.evaluation.metrics import LOST_LIMB_M
from tracker_node.report.metrics_file import report_metrics
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import LimbStatus, Status

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.trust._clips import record
from benchmark.trust._consistency import Consistency, consistency, nees
from benchmark.trust._fit import coefficients, covariance_factor
from benchmark.trust._lost_events import BODY_KINDS, LIMB_KINDS
from benchmark.trust._roc import Roc, roc, roc_picture
from benchmark.trust._runs import Run, config_of, track_all

HIDING = ("occluded", "exit", "hidden")


def main() -> int:
    args = _arguments()
    size = "quick" if args.quick else "full"
    try:
        config = config_of(args.modalities)
        if args.fit:
            return fit(config, size, args)
        rig, clips = record("judge", size, args.cache)
        _, others = record("fit", size, args.cache)
        runs = track_all(clips, rig, config, args.processes)
        fitted = track_all([c for c in others if c.clip.kind == "sound"], rig, config, args.processes)
    except TrackerError as error:
        print(f"contour_trust: error: {error}", file=sys.stderr)
        return 2
    figures = nees_figures(runs, fitted) | lost_figures(runs, config.status.limb_lost, args.picture)
    report_metrics(figures, args.json)
    return 0


def _arguments() -> argparse.Namespace:
    parser = parser_of(
        __doc__,
        "python benchmark/trust/trust.py --quick --json out/benchmark/contour_trust.json",
        "fewer clips: too few for the definitions",
    )
    parser.add_argument("--modalities", nargs="+", default=["region"], choices=("chamfer", "region"), help="default: region")
    add = parser.add_argument
    add("--fit", action="store_true", help="print what limb_status.py and the configuration hold, from the other clips")
    add("--cache", type=Path, default=Path("out/synthetic/trust"), help="where clips are kept, 3 GB (default: %(default)s)")
    add("--picture", type=Path, default=Path("out/benchmark/trust_roc.png"), help="of the ROC (default: %(default)s)")
    add("--processes", type=int, default=len(os.sched_getaffinity(0)), help="side by side (default: %(default)s)")
    return parser.parse_args()


def fit(config: TrackerConfig, size: str, args: argparse.Namespace) -> int:
    """Print coefficients and scales."""
    rig, clips = record("fit", size, args.cache)
    runs = track_all(clips, rig, config, args.processes)
    print("COEFFICIENTS", np.round(coefficients(runs), 1).tolist())
    for body in dict.fromkeys(run.body for run in runs):
        sound = [run for run in _sound(runs, body) if run.joint_errors.max() < LOST_LIMB_M]
        print(f"covariances of the {body} are too small by a factor of", round(covariance_factor(sound), 2))
    return 0


def nees_figures(runs: Sequence[Run], fitted: Sequence[Run]) -> dict[str, float | int]:
    """Of sound clips: the whole state, and every landmark."""
    figures: dict[str, float | int] = {}
    states, points, later, after = [], [], [], []
    for body in dict.fromkeys(run.body for run in runs):
        own, other = _sound(runs, body), _sound(fitted, body)
        state = _consistency(own, other)
        effective = state.effective_sets
        power = _stack(own, "errors") ** 2 / np.diagonal(_stack(own, "covariances"), axis1=-2, axis2=-1)
        alone = power.mean(axis=(0, 1))
        point = _landmarks(own, other)
        smoothed = None if np.isnan(_stack(own, "smoothed_errors")).any() else _consistency(own, other, "smoothed_")
        states.append(state)
        points.append(point)
        later += [] if smoothed is None else [smoothed]
        after += [value for run in runs if run.body == body for value in _after_loss(run, effective)]
        figures |= {
            f"trust.{body}.nees_in_bounds": state.runs_in_bounds,
            f"trust.{body}.nees_mean": state.mean,
            f"trust.{body}.nees_independent_sets": effective,
            f"trust.{body}.landmark_nees_in_bounds": point.runs_in_bounds,
            f"trust.{body}.landmark_nees_mean": point.mean,
            f"trust.{body}.dof_nees_p10": float(np.percentile(alone, 10)),
            f"trust.{body}.dof_nees_median": float(np.median(alone)),
            f"trust.{body}.dof_nees_p90": float(np.percentile(alone, 90)),
            f"trust.{body}.joint_error_mm": 1e3 * float(np.mean([run.joint_errors.mean() for run in own])),
        }
        if smoothed is not None:
            figures |= {
                f"trust.{body}.smoothed_nees_in_bounds": smoothed.runs_in_bounds,
                f"trust.{body}.smoothed_nees_mean": smoothed.mean,
            }
    if later:
        figures["trust.smoothed_nees_in_bounds"] = _pooled(later, "runs_in_bounds")
    return {
        "trust.nees_in_bounds": _pooled(states, "runs_in_bounds"),
        "trust.nees_in_independent_bounds": _pooled(states, "runs_in_independent_bounds"),
        "trust.nees_sets_in_bounds": _pooled(states, "sets_in_bounds"),
        "trust.landmark_nees_in_bounds": _pooled(points, "runs_in_bounds"),
        "trust.nees_after_loss_in_bounds": float(np.mean(after)) if after else float("nan"),
        "trust.nees_after_loss_runs": len(after),
        "trust.nees_runs": sum(len(state.nees) for state in states),
        **figures,
    }


def _sound(runs: Sequence[Run], body: str) -> list[Run]:
    return [run for run in runs if run.kind == "sound" and run.body == body]


def _consistency(own: Sequence[Run], other: Sequence[Run], prefix: str = "") -> Consistency:
    """Of the states of runs, with the independent sets of others."""
    errors, covariances = f"{prefix}errors", f"{prefix}covariances"
    effective = effective_sets(whitened(_stack(other, errors), _stack(other, covariances)))
    return consistency(_stack(own, errors), _stack(own, covariances), effective)


_SETTLED, _FEWEST_AFTER = 3, 5  # image sets after an event until covariances are judged again, and how many that must be


def _after_loss(run: Run, effective: float) -> list[bool]:
    """Whether the NEES of a run in which a limb was hidden lies within its bounds once it is seen and found again; or nothing."""
    sets = np.arange(len(run.status)) >= run.ends + _SETTLED
    if run.kind != "hidden" or sets.sum() < _FEWEST_AFTER or (run.joint_errors[sets] > LOST_LIMB_M).any():
        return []
    n = run.errors.shape[-1]
    low, high = mean_bounds(n, max(effective * sets.mean(), 1.0))
    return [bool(low <= nees(run.errors[sets], run.covariances[sets]).mean() <= high)]


def _stack(runs: Sequence[Run], name: str) -> np.ndarray:
    return np.array([getattr(run, name) for run in runs])


def _landmarks(own: Sequence[Run], other: Sequence[Run]) -> Consistency:
    """Every landmark of every run as a run of its own, of three numbers."""

    def flat(runs: Sequence[Run], name: str) -> np.ndarray:
        values = np.swapaxes(_stack(runs, name), 1, 2)
        return values.reshape(-1, *values.shape[2:])

    effective = effective_sets(whitened(flat(other, "landmark_errors"), flat(other, "landmark_covariances")))
    return Consistency(nees(flat(own, "landmark_errors"), flat(own, "landmark_covariances")), 3, effective)


def _pooled(parts: Sequence[Consistency], name: str) -> float:
    return float(np.average([getattr(part, name) for part in parts], weights=[len(part.nees) for part in parts]))


def lost_figures(runs: Sequence[Run], threshold: float, picture: Path) -> dict[str, float | int]:
    """Of all clips: ROC, delays and false alarms."""
    curves = {"body": _body_roc(runs, strict=False), "limbs": _limb_roc(runs, strict=False)}
    picture.parent.mkdir(parents=True, exist_ok=True)
    picture.write_bytes(roc_picture(curves, threshold))
    strict = (_body_roc(runs, strict=True), _limb_roc(runs, strict=True))
    sound = [run for run in runs if run.kind == "sound"]
    alarms = [(run.status == Status.LOST) | (run.limb_status == LimbStatus.LOST).any(axis=1) for run in sound]
    doubts = [run.status != Status.TRACKING for run in sound]
    truly_lost = [run.lost for run in sound]
    figures: dict[str, float | int] = {
        "trust.lost_auc": min(curve.area for curve in curves.values()),
        "trust.lost_auc_strict": min(curve.area for curve in strict),
        "trust.body_auc": curves["body"].area,
        "trust.limb_auc": curves["limbs"].area,
    }
    delays = {kind: [_delay(run) for run in runs if run.kind == kind] for kind in (*BODY_KINDS, *LIMB_KINDS)}
    told = [delay for kind in delays.values() for delay in kind if delay is not None]
    figures |= {
        "trust.lost_delay_sets": float(np.percentile(told, 95)),
        "trust.lost_delay_mean_sets": float(np.mean(told)),
        "trust.lost_delay_max_sets": int(max(told)),
        "trust.later_than_three_sets": sum(delay > 3 for delay in told),
        "trust.events": sum(len(kind) for kind in delays.values()),
        "trust.events_that_lost_nothing": sum(delay is None for kind in delays.values() for delay in kind),
        "trust.false_alarms": int(sum((alarm & ~lost).sum() for alarm, lost in zip(alarms, truly_lost, strict=True))),
        "trust.doubtful_sets": int(sum(doubt.sum() for doubt in doubts)),
        "trust.sound_sets": sum(len(run.status) for run in sound),
        "trust.sound_sets_truly_lost": int(sum(lost.sum() for lost in truly_lost)),
    }
    for kind, values in delays.items():
        own = [run for run in runs if run.kind == kind]
        late = [delay for delay in values if delay is not None]
        figures[f"trust.{kind}.delay_sets"] = float(np.mean(late)) if late else float("nan")
        figures[f"trust.{kind}.events"] = len(values)
        figures[f"trust.{kind}.back_at_the_end"] = sum(bool(run.joint_errors[-1].max() < LOST_LIMB_M) for run in own)
    return figures


def _hidden_but_right(run: Run) -> np.ndarray:
    """(T,) sets in which what cannot be seen may be where the tracker says all the same."""
    return run.on if run.kind in HIDING else np.zeros(len(run.status), dtype=np.bool_)


def _body_roc(runs: Sequence[Run], strict: bool) -> Roc:
    lost = [run.lost for run in runs]
    keep = [gone | ~_hidden_but_right(run) | strict for run, gone in zip(runs, lost, strict=True)]
    scores = [run.limb_probability.max(axis=1) for run in runs]
    return roc(_masked(scores, keep), _masked(lost, keep))


def _limb_roc(runs: Sequence[Run], strict: bool) -> Roc:
    lost = [run.tip_errors > run.lost_tip_m for run in runs]
    keep = [gone | ~_hidden_but_right(run)[:, None] | strict for run, gone in zip(runs, lost, strict=True)]
    return roc(_masked([run.limb_probability for run in runs], keep), _masked(lost, keep))


def _masked(values: Sequence[np.ndarray], masks: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([value[mask] for value, mask in zip(values, masks, strict=True)])


def _delay(run: Run) -> int | None:
    """Image sets until LOST is said of what an event is about; None where nothing was ever lost, or was found again at once."""
    if run.limb < 0:
        lost, said = run.lost, run.status == Status.LOST
    else:
        lost = run.tip_errors[:, run.limb] > run.lost_tip_m
        known = (run.limb_status[:, run.limb] == LimbStatus.LOST) | (run.limb_status[:, run.limb] == LimbStatus.UNSEEN)
        said = known | (run.status == Status.LOST)
    if run.kind in ("occluded", "hidden"):
        lost = lost | run.on
    sets = np.flatnonzero(lost & (np.arange(len(lost)) >= run.begins))
    if not len(sets):
        return None
    first = int(sets[0])
    told = np.flatnonzero(said[first:])
    found = np.flatnonzero(~lost[first:])
    if len(found) and found[0] <= 3 and (not len(told) or told[0] >= found[0]):
        return None
    return int(told[0]) + 1 if len(told) else len(lost) - first


if __name__ == "__main__":
    sys.exit(main())
