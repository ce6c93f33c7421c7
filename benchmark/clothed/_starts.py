"""Starts without a state, from random image sets of a clip: whether the body is found, and what that takes."""

from __future__ import annotations

import sys
import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmark.clothed._people import KeptPeople
from benchmark.clothed._recording import ClothedClip
from benchmark.clothed._runs import TOGETHER, WithPeople, joints_of, settings, with_given
from tracker_node.observation.image_set import ImageSet
from tracker_node.runs.people.detection import people_in
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.tracker import Tracker

SETS_AFTER, MOST_SETS = 5, 30  # image sets tracked after the first state; sets until there must be one
MEAN_M, LARGEST_M = 0.060, 0.150


@dataclass(frozen=True)
class Trial:
    """One start: from image set ``row``; ``cpu_s`` of all threads until the first state, ``sets`` before it."""

    row: int
    success: bool
    cpu_s: float
    sets: int
    mean_mm: float
    largest_mm: float


def start_trials(
    clip: ClothedClip, config: TrackerConfig, asked: WithPeople, later: WithPeople, rows: Sequence[int],
    tell: Callable[[Trial], None] = lambda trial: None,
) -> list[Trial]:  # fmt: skip
    """Starts from given image sets, the tracker compiled before.

    Parameters
    ----------
    clip, config : which, and the tracker.
    asked : the detector, which looks at every image anew: its time counts until there is a state.
    later : the detector afterwards.
    rows : first image sets.
    tell : is told of each.

    Returns
    -------
    In their order.
    """
    tracker = Tracker(clip.rig, clip.model, config)
    if rows:
        trial_of(clip, tracker, asked, later, rows[0], 1)
    result = []
    for row in rows:
        result.append(trial_of(clip, tracker, asked, later, row))
        tell(result[-1])
    return result


def trial_of(
    clip: ClothedClip, tracker: Tracker, asked: WithPeople, later: WithPeople, row: int, after: int = SETS_AFTER
) -> Trial:
    """One start.

    Parameters
    ----------
    clip, tracker : the tracker is reset.
    asked, later : see `start_trials`.
    row : first image set.
    after : sets after the first state, in the last of which the body has to be where it is.

    Returns
    -------
    The trial.
    """
    tracker.reset()
    cpu_s, before, states = 0.0, 0, 0
    mean = largest = np.inf
    for i, image_set in enumerate(clip.sets(row, row + MOST_SETS + after)):
        began = time.process_time()
        image_set, _ = (later if states else asked)(tracker, image_set)
        estimate = tracker.step(image_set)
        if not states:
            cpu_s += time.process_time() - began
            before += not estimate.status.has_state
        states += bool(states or estimate.status.has_state)
        if states > after or (not states and before >= MOST_SETS):
            errors = np.linalg.norm(joints_of(clip.model, estimate)[0] - clip.truth_m[row + i], axis=1)
            if np.isfinite(errors).all():
                mean, largest = float(errors.mean()), float(errors.max())
            break
    success = mean < MEAN_M and largest < LARGEST_M
    return Trial(row, success, cpu_s, before, 1e3 * mean, 1e3 * largest)


def first_rows(clip: ClothedClip, n: int, seed: int) -> list[int]:
    """``n`` image sets to begin with, after each of which there are enough."""
    last = max(len(clip) - 2 * SETS_AFTER, 1)
    return sorted(np.random.default_rng(seed).choice(last, n, replace=n > last).tolist())


def starts(clip: ClothedClip, kept: KeptPeople, n: int, changes: Sequence[str]) -> list[Trial]:
    """Starts of points and contours together from ``n`` random image sets of a clip."""

    def asked(tracker: Tracker, image_set: ImageSet) -> tuple[ImageSet, float]:
        crops = tracker.expected_crops(image_set.stamp_ns)
        people = [people_in(kept.detector, image.pixels, crop)[0] for image, crop in zip(image_set.images, crops, strict=True)]
        return with_given(image_set, people), 0.0

    def tell(trial: Trial) -> None:
        print(
            f"{clip.name}, start at set {trial.row}: {'ok' if trial.success else 'failed'} after {trial.sets} sets,"
            f" {trial.cpu_s:.2f} s; then {trial.mean_mm:.0f} mm, largest {trial.largest_mm:.0f}",
            file=sys.stderr, flush=True,
        )  # fmt: skip

    rows = first_rows(clip, n, zlib.crc32(clip.name.encode()))
    return start_trials(clip, settings(TOGETHER, changes), asked, kept.with_people, rows, tell)
