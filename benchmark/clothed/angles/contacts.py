#!/usr/bin/env python3
"""When feet of rendered people are on the floor, by the tracked body against the exact ankles and toes: another body (anny).

Clips, body and parameters as of ``clothed.py``: the human with ankles, region and keypoints, no start; online states. Both are
judged by the same rule, `evaluation.motion.jumps.find_contacts`; as the truth has no heels, their ankles stand in: differences
are not all of the tracker.

``contacts.agree``: share of the image sets with a state, of both feet, in which they say the same; ``contacts.instant_ms``,
``_p95_ms``: between instants at which a foot comes down or leaves, each paired with one of the same kind within 0.25 s;
``missed``, ``invented``: shares of the true, and of the tracked instants, that have none.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from benchmark._arguments import parser_of
from benchmark.clothed._people import KeptPeople, add_arguments
from benchmark.clothed._recording import RATE_HZ, ClothedClip, load_clip
from benchmark.clothed._runs import TOGETHER, followed, settings
from benchmark.contour._runs import print_circumstances
from tracker_node.errors import SourceError, TrackerError
from tracker_node.evaluation.motion.jumps import Contact, find_contacts
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.model.configuration import Configuration
from tracker_node.report.metrics_file import report_metrics

REACH_S = 0.25
QUICK_CLIPS = 2
FEET = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("heel", "big_toe"))
TRUE_FEET = tuple(name.replace("heel", "ankle") for name in FEET)


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    cv2.setNumThreads(1)
    try:
        folders = args.clips or [folder for seed in range(1, 13) if (folder := args.drawn / f"clip_{seed}").is_dir()]
        if not folders:
            raise SourceError(args.drawn, "no clips; draw them by benchmark/clothed/draw_clips.py")
        found = [compared(load_clip(folder), args) for folder in (folders[:QUICK_CLIPS] if args.quick else folders)]
    except TrackerError as error:
        print(f"contacts: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures(found), args.json)
    return 0


def compared(clip: ClothedClip, args: argparse.Namespace) -> tuple[np.ndarray, list[float], list[int]]:
    """Whether both say the same, by foot and set; seconds between instants; how many: true, missed, tracked, invented."""
    points, times_s = tracked(clip, args), np.arange(len(clip)) / RATE_HZ
    truth = {name: np.array([row[name] for row in clip.targets]) for name in TRUE_FEET}
    own, true = find_contacts(times_s, points), find_contacts(times_s, truth)
    known, same, apart, counts = np.isfinite(points[FEET[0]]).all(axis=1), [], [], np.zeros(4, dtype=int)
    for side, foot in true.items():
        ours = own[side].contacts if side in own else ()
        same.append((_down(ours, times_s) == _down(foot.contacts, times_s))[known])
        for mine, theirs in zip(_instants(ours), _instants(foot.contacts), strict=True):
            pairs = _paired(mine, theirs)
            apart += pairs
            counts += np.array([len(theirs), len(theirs) - len(pairs), len(mine), len(mine) - len(pairs)])
    agree = np.concatenate(same)
    told = f"{counts[0]} instants, {counts[1]} missed, {counts[3]} invented"
    print(f"{clip.name}: same {agree.mean():.3f}; {told}", file=sys.stderr)
    return agree, apart, counts.tolist()


def _paired(mine: np.ndarray, theirs: np.ndarray) -> list[float]:
    """Seconds between instants of which each has one partner, the nearest pairs first."""
    apart = np.abs(mine[:, None] - theirs[None])
    found = []
    while apart.size and apart.min() <= REACH_S:
        i, j = np.unravel_index(apart.argmin(), apart.shape)
        found.append(float(apart[i, j]))
        apart[i], apart[:, j] = np.inf, np.inf
    return found


def tracked(clip: ClothedClip, args: argparse.Namespace) -> Mapping[str, np.ndarray]:
    """Heels and toes in every image set; not-a-number where the body is lost."""
    people = KeptPeople(pose_weights(), args.output / f"{clip.name}_full.sqlite", args.near)
    columns = [clip.model.landmark_index(name) for name in FEET]
    points = np.full((len(clip), len(FEET), 3), np.nan)
    for row, estimate in followed(clip, settings(TOGETHER, args.changes), people.with_people):
        points[row] = Configuration(clip.model, estimate.state).landmarks_world[columns]
    return dict(zip(FEET, np.swapaxes(points, 0, 1), strict=True))


def _down(contacts: Sequence[Contact], times_s: np.ndarray) -> np.ndarray:
    """(n,) whether a foot is on the floor."""
    result = np.zeros(len(times_s), dtype=bool)
    for each in contacts:
        result |= (times_s >= each.start_s) & (times_s <= each.end_s)
    return result


def _instants(contacts: Sequence[Contact]) -> tuple[np.ndarray, np.ndarray]:
    """When a foot is seen to come down, and to leave."""
    return np.array([c.start_s for c in contacts if c.comes]), np.array([c.end_s for c in contacts if c.leaves])


def figures(found: list[tuple[np.ndarray, list[float], list[int]]]) -> dict[str, float | int]:
    """Metrics over all clips."""
    same, apart = np.concatenate([each[0] for each in found]), np.array([t for each in found for t in each[1]])
    true, missed, tracked, invented = np.sum([each[2] for each in found], axis=0).tolist()
    return {
        "contacts.agree": float(same.mean()),
        "contacts.instant_ms": 1e3 * float(np.median(apart)) if len(apart) else float("nan"),
        "contacts.instant_p95_ms": 1e3 * float(np.percentile(apart, 95)) if len(apart) else float("nan"),
        "contacts.instants": true,
        "contacts.missed": missed / max(true, 1),
        "contacts.invented": invented / max(tracked, 1),
    }


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    example = "OMP_NUM_THREADS=1 python benchmark/clothed/angles/contacts.py --clips out/clothed/clip_1"
    parser = parser_of(__doc__, example, "two clips")
    add_arguments(parser, "clip_1 to clip_12", Path("out/benchmark/clothed"))
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
