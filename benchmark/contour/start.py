#!/usr/bin/env python3
"""A start that nobody has helped with: the tracker is shown a clip from some image on, and finds the body by itself.

Each trial begins at another random image set, without an initial state. It succeeds if five image sets after the first one that
has a state every joint is within 200 mm of the truth, and all of them within 80 mm on average; joints without a truth then are
left out. ``cpu_s`` are the processor seconds until there is a state, in the median: the first trial compiles. ``seconds`` is the
longest image set of a trial, the one with the search, on average; ``sets`` is how many pass until there is a state. With
``--processes`` the seconds are those of a machine that is shared.

Clips: ``balancing``, a real person, 4 cameras of 544x960; ``figure``, ten cones in fast motion before strong colors, 4 cameras;
``mannequin_walk``, a dressed person in a furnished room, 6 cameras. ``..._plates`` has images of the background; the figure's
scene has nobody seen empty.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.contour import _balancing_clip as balancing
from benchmark.contour._runs import SCENE, clip_parser, configured, print_circumstances, recorded
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import TrackerError
from tracker_node.evaluation.truth.association import truth_at
from tracker_node.evaluation.truth.files import EVALUATED_JOINTS, load_truth
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import ImageSet
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import FIGURE_IMAGES, Request, default_motions
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.tracker import Tracker

CLIPS = ("balancing", "balancing_plates", "figure", "mannequin_walk", "mannequin_walk_plates")
TRIALS = {"quick": 3, "full": 20}
MEAN_M, LARGEST_M = 0.080, 0.200
SETS_AFTER, MOST_SETS = 5, 45  # sets tracked after the first state; sets until there must be one
BALANCING_LAG_IMAGES = 0.9


@dataclass(frozen=True, eq=False)
class Recording:
    """What is shown and what is true; ``lag_images`` of the images behind the truth."""

    rig: CameraRig
    model: ArticulatedModel
    backgrounds: dict
    sets: list[ImageSet]
    truth: Trajectories
    lag_images: float


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    figures: dict[str, float | int] = {}
    try:
        for name in args.only or CLIPS:
            figures |= start_figures(name, configured(args.changes), args)
    except TrackerError as error:
        print(f"contour_start: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = clip_parser(__doc__, "python benchmark/contour/start.py --only balancing --set modalities=region", CLIPS)
    parser.add_argument("--trials", type=int, metavar="N", help="random first images of each clip")
    parser.add_argument("--processes", type=int, default=1, metavar="N", help="trials side by side (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the first images (default: %(default)s)")
    parser.add_argument("--sample", type=Path, default=Path("out/demo/sample"), help="the Balancing clip (default: %(default)s)")
    parser.add_argument("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    return parser.parse_args(arguments)


def load(name: str, args: argparse.Namespace) -> Recording:
    """The recording called ``name``, made if it is not there."""
    backgrounds = name.endswith("_plates")
    if name.startswith("balancing"):
        clip = balancing.load_clip(args.sample, Path("out/benchmark/balancing"))
        truth = clip.truth.shifted(clip.sets[0].stamp_ns - int(clip.truth.stamps_ns[0]))
        return Recording(clip.rig, clip.model, clip.backgrounds if backgrounds else {}, clip.sets, truth, BALANCING_LAG_IMAGES)
    if name == "figure":
        scene = replace(SCENE, radius=3.2, focal_px=560.0)
        found = recorded("figure", Request(subject="figure", n_images=FIGURE_IMAGES, scene=scene), args.cache)
    else:
        found = recorded("mannequin_walk", Request(motion="walk", motions=args.motions), args.cache)
    truth = load_truth(found.folder / "truth.csv")
    return Recording(found.rig, found.model, load_backgrounds(found.rig) if backgrounds else {}, list(found.sets()), truth, 0.0)


@dataclass(frozen=True)
class Trial:
    """One start: ``until`` image sets passed before there was a state, ``seconds`` took the longest of all."""

    success: bool
    cpu_s: float
    seconds: float
    until: int
    mean_m: float
    told: str


def start_figures(name: str, config: TrackerConfig, args: argparse.Namespace) -> dict[str, float | int]:
    """Trials of the recording ``name``."""
    n, recording = args.trials or TRIALS["quick" if args.quick else "full"], prepare_stage(name, config, args).recording
    last = len(recording.sets) - 2 * SETS_AFTER - (0 if recording.backgrounds else config.initialization.watch_sets)
    firsts = sorted(int(i) for i in np.random.default_rng(args.seed).choice(last, n, replace=n > last))
    trials = []
    for first, trial in zip(firsts, run_trials(name, firsts, config, args), strict=True):
        print(f"{name}: image {first}: {trial.told}", file=sys.stderr, flush=True)
        trials.append(trial)
    figures = {
        "fraction": float(np.mean([t.success for t in trials])), "cpu_s": float(np.median([t.cpu_s for t in trials])),
        "seconds": float(np.mean([t.seconds for t in trials])),
        "sets": float(np.mean([t.until for t in trials])),
        "joint_error_median_mm": float(1e3 * np.median([t.mean_m for t in trials])), "trials": len(trials),
    }  # fmt: skip
    return {f"start_{name}.{key}": value for key, value in figures.items()}


@dataclass(eq=False)
class Stage:
    """What the trials of one process share."""

    recording: Recording
    tracker: Tracker


_stages: dict[str, Stage] = {}


def prepare_stage(name: str, config: TrackerConfig, args: argparse.Namespace) -> Stage:
    """Load the recording ``name`` and compile; once in each process that runs trials of it. The one before is forgotten."""
    _stages.clear()
    recording = load(name, args)
    tracker = Tracker(recording.rig, recording.model, config, recording.backgrounds)
    tracker.step(recording.sets[0])
    _stages[name] = Stage(recording, tracker)
    return _stages[name]


def run_trials(name: str, firsts: Sequence[int], config: TrackerConfig, args: argparse.Namespace) -> Iterator[Trial]:
    """One after the other, on the stage of this process, or side by side in others."""
    if args.processes == 1:
        yield from (trial_of(name, first) for first in firsts)
        return
    shared = (name, config, args)
    with ProcessPoolExecutor(args.processes, get_context("spawn"), initializer=prepare_stage, initargs=shared) as pool:
        yield from pool.map(trial_of, [name] * len(firsts), firsts)


def trial_of(name: str, first: int) -> Trial:
    return trial_from(first, _stages[name].recording, _stages[name].tracker)


def trial_from(first: int, recording: Recording, tracker: Tracker) -> Trial:
    """The tracker is shown the recording from image set ``first`` on."""
    tracker.reset()
    states, stamps, times, until = [], [], [], 0
    cpu_began_s, cpu_s = time.process_time(), 0.0
    for image_set in recording.sets[first : first + MOST_SETS + SETS_AFTER]:
        began = time.perf_counter()
        estimate = tracker.step(image_set)
        times.append(time.perf_counter() - began)
        if not states:
            cpu_s = time.process_time() - cpu_began_s
        if estimate.status is Status.INITIALIZING:
            until += 1
        else:
            states.append(estimate.state)
            stamps.append(image_set.stamp_ns)
        if len(states) == SETS_AFTER + 1:
            break
    errors = joint_errors(recording, states, stamps)
    mean, largest = _mean_and_largest(errors[-1:])
    judged = int(np.isfinite(errors[-1:]).sum())
    told = (
        f"state after {until} sets, {cpu_s:.1f} s of processor time; at first {_mm(errors[:1])}, then {_mm(errors[-1:])},"
        f" {judged} joints judged; {estimate.status.name} {estimate.status_reason}".rstrip()
    )
    return Trial(mean < MEAN_M and largest < LARGEST_M, cpu_s, max(times), until, mean, told)


def joint_errors(recording: Recording, states: Sequence[State], stamps: Sequence[int]) -> np.ndarray:
    """(n_states, n_joints) meters; nan for joints whose place nobody knows then."""
    names = [n for n in recording.truth.names if n in recording.model.landmark_names]
    names = [n for n in names if n in EVALUATED_JOINTS] or names
    rows = [recording.model.landmark_index(n) for n in names]
    if not states:
        return np.zeros((0, len(rows)))
    period_ns = int(np.median(np.diff([s.stamp_ns for s in recording.sets])))
    true = truth_at(recording.truth.select(tuple(names)), np.array(stamps), recording.lag_images, period_ns)
    found = np.array([Configuration(recording.model, state).landmarks_world[rows] for state in states])
    return np.where(true.valid, np.linalg.norm(found - true.positions_m, axis=2), np.nan)


def _mean_and_largest(errors: np.ndarray) -> tuple[float, float]:
    """Of one set's joints, meters; infinite where none of them can be judged."""
    known = errors[np.isfinite(errors)]
    return (float(known.mean()), float(known.max())) if known.size else (np.inf, np.inf)


def _mm(errors: np.ndarray) -> str:
    mean, largest = _mean_and_largest(errors)
    return f"{1e3 * mean:.0f} mm (largest {1e3 * largest:.0f})" if np.isfinite(mean) else "nothing"


if __name__ == "__main__":
    sys.exit(main())
