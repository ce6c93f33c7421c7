#!/usr/bin/env python3
"""What the synchronizer makes of cameras that misbehave: a table of sets formed, latencies, and why sets are missing.

Four cameras at 30 Hz for twenty seconds, with the images' stamps and arrivals drawn anew for each situation (the generator is
seeded). The number of each image's instant is known, hence which sets should have been formed, and whether a set mixes instants.
Latency: from the exposure to the arrival of the image that decided the set, less the time that every image is on its way. An
instant is unaccounted for when images of it were sent, and it has neither a set nor a counted reason why not.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tracker_node.observation.image_set import CameraImage
from tracker_node.observation.synchronizer import REASONS, ImageSynchronizer
from tracker_node.report.metrics_file import write_metrics
from tracker_node.tracking.config import SynchronizerConfig

CAMERAS = ("cam01", "cam02", "cam03", "cam04")
RATE_HZ, SECONDS = 30.0, 20.0
TRANSPORT_S = 0.010
_PIXELS = np.zeros((1, 1), dtype=np.uint8)


@dataclass(frozen=True)
class Shot:
    """An image on its way: its instant, the stamp that it carries, and when it arrives (seconds)."""

    camera: str
    instant: int
    stamp_s: float
    arrival_s: float


@dataclass(frozen=True)
class Situation:
    """How images differ from the ideal, and the smallest sets asked for."""

    name: str
    shots: Callable[[np.random.Generator], list[Shot]]
    min_cameras: int = 2
    tolerance: float = SynchronizerConfig.tolerance


def ideal() -> list[Shot]:
    n = round(SECONDS * RATE_HZ)
    return [Shot(c, i, i / RATE_HZ, i / RATE_HZ + TRANSPORT_S) for i in range(n) for c in CAMERAS]


def changed(shots: Iterable[Shot], change: Callable[[Shot], Iterable[Shot]]) -> list[Shot]:
    return [new for shot in shots for new in change(shot)]


def delayed(shot: Shot, seconds: float) -> Shot:
    return Shot(shot.camera, shot.instant, shot.stamp_s, shot.arrival_s + seconds)


def stamped(shot: Shot, seconds: float) -> Shot:
    return Shot(shot.camera, shot.instant, shot.stamp_s + seconds, shot.arrival_s)


def situations() -> list[Situation]:
    last = CAMERAS[-1]
    period = 1.0 / RATE_HZ

    def each(change):
        return lambda rng: changed(ideal(), lambda shot: change(shot, rng))

    def stamp_jitter(shot, rng):
        return [stamped(shot, rng.uniform(-0.15, 0.15) * period)]

    def arrival_jitter(shot, rng):
        return [delayed(shot, rng.exponential(0.020))]

    def late_by(seconds):
        return lambda shot, _: [delayed(shot, seconds if shot.camera == last else 0.0)]

    def lost(shot, rng):
        return [] if rng.random() < 0.10 else [shot]

    def gone(shot, _):
        return [] if shot.camera == last and shot.stamp_s > 10.0 else [shot]

    def doubled(shot, rng):
        return [shot, delayed(shot, 0.3 * period)] if rng.random() < 0.10 else [shot]

    def reordered(shot, rng):
        return [delayed(shot, 2.5 * period if rng.random() < 0.10 else 0.0)]

    def free(shot, _):
        return [stamped(shot, 0.25 * period * CAMERAS.index(shot.camera))]

    def pause(shot, _):
        return [] if 5.0 < shot.stamp_s < 9.0 else [shot]

    def wrong(shot, _):
        return [stamped(shot, 3600.0 if shot.camera == last else 0.0)]

    def everything(shot, rng):
        if rng.random() < 0.05:
            return []
        shot = delayed(stamped(shot, rng.uniform(-0.1, 0.1) * period), rng.exponential(0.010) + 0.3 * (shot.camera == last))
        return [shot, shot] if rng.random() < 0.05 else [shot]

    return [
        Situation("ideal", each(lambda shot, _: [shot])),
        Situation("stamps_jitter", each(stamp_jitter)),
        Situation("arrival_jitters", each(arrival_jitter)),
        Situation("one_300ms_late", each(late_by(0.3))),
        Situation("one_300ms_late_all_needed", each(late_by(0.3)), min_cameras=0),
        Situation("one_beyond_queue", each(late_by(2.0))),
        Situation("tenth_lost", each(lost)),
        Situation("tenth_lost_all_needed", each(lost), min_cameras=0),
        Situation("one_stops", each(gone)),
        Situation("tenth_doubled", each(doubled)),
        Situation("tenth_reordered", each(reordered)),
        Situation("free_running", each(free)),
        Situation("free_running_tolerance_0.8", each(free), tolerance=0.8),
        Situation("all_pause_4s", each(pause), min_cameras=1),
        Situation("one_an_hour_ahead", each(wrong)),
        Situation("one_an_hour_ahead_one_needed", each(wrong), min_cameras=1),
        Situation("everything", each(everything)),
    ]


def measure(situation: Situation, config: SynchronizerConfig, seed: int = 7) -> dict[str, float | int]:
    """Figures of one situation."""
    shots = sorted(situation.shots(np.random.default_rng(seed)), key=lambda shot: shot.arrival_s)
    sync = ImageSynchronizer(
        CAMERAS, image_period_s=1.0 / RATE_HZ, tolerance=situation.tolerance, queue_s=config.queue_s,
        min_cameras=situation.min_cameras,
    )  # fmt: skip
    instants: dict[tuple[str, int], int] = {}
    latencies: list[float] = []
    formed: list[set[int]] = []  # instants of each set

    def take(sets, now_s: float) -> None:
        for image_set in sets:
            formed.append({instants[image.camera, image.stamp_ns] for image in image_set.images})
            latencies.append(now_s - min(formed[-1]) / RATE_HZ - TRANSPORT_S)

    for shot in shots:
        stamp_ns = round(1e9 * (100.0 + shot.stamp_s))
        instants[shot.camera, stamp_ns] = shot.instant
        take(sync.add(CameraImage(shot.camera, stamp_ns, _PIXELS, "mono8")), shot.arrival_s)
    n_live = len(latencies)
    take(sync.flush(), shots[-1].arrival_s)
    not_formed = {reason: n for reason, n in sync.sets_not_formed.items() if n}
    images = {reason: sum(counts[reason] for counts in sync.counters.values()) for reason in REASONS}
    n_instants = len({shot.instant for shot in shots})
    without = n_instants - len(set().union(*formed))
    p50, p95, worst = np.percentile(1e3 * np.array(latencies[:n_live]), [50, 95, 100])
    return {
        "instants": n_instants, "complete": sync.sets_complete, "of_fewer": sync.sets_incomplete,
        "mixed": sum(len(numbers) > 1 for numbers in formed), "unaccounted": max(0, without - sum(not_formed.values())),
        **{f"not_formed.{reason}": n for reason, n in not_formed.items()},
        **{f"images.{reason}": n for reason, n in images.items() if n},
        "latency_ms_p50": float(p50), "latency_ms_p95": float(p95), "latency_ms_max": float(worst),
    }  # fmt: skip


def table(rows: dict[str, dict[str, float | int]]) -> str:
    """The figures as a Markdown table."""
    numbers = ("instants", "complete", "of_fewer", "mixed", "unaccounted")
    head = ("situation", *numbers, "not formed", "images left out", "latency p50, p95, max (ms)")
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for name, row in rows.items():
        times = ", ".join(f"{row[f'latency_ms_{p}']:.0f}" for p in ("p50", "p95", "max"))
        cells = [name, *(row[key] for key in numbers), _reasons(row, "not_formed."), _reasons(row, "images."), times]
        lines.append("| " + " | ".join(str(cell) for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def _reasons(row: dict[str, float | int], prefix: str) -> str:
    return ", ".join(f"{key.removeprefix(prefix)} {n}" for key, n in row.items() if key.startswith(prefix)) or "-"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="as every benchmark has it; this one is quick")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here too")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write the table here too")
    args = parser.parse_args(arguments)
    config = SynchronizerConfig()
    rows = {situation.name: measure(situation, config) for situation in situations()}
    print(table(rows), end="")
    figures = {f"synchronizer.{name}.{key}": value for name, row in rows.items() for key, value in row.items()}
    if args.markdown:
        args.markdown.parent.mkdir(parents=True, exist_ok=True)
        args.markdown.write_text(table(rows), encoding="utf-8")
    if args.json:
        write_metrics(args.json, figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
