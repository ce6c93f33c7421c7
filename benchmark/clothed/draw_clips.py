#!/usr/bin/env python3
"""Draws recordings of clothed people with exact truth, one for each seed.

First step, once: the bodies, in an environment of their own (see the example). Each clip is a folder ``clip_SEED`` with
rig.yaml, cam01..cam04, stills, static.trc, truth.trc and clip.json, which says what it shows.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import cv2

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.clothed._clip import joints_inside, write_clip
from benchmark.clothed._staging import Sources, set_stage
from benchmark.clothed.person._body import FIRST_STEP, MANNEQUIN
from benchmark.clothed.person._motions import MOTIONS
from tracker_node.errors import SourceError, TrackerError
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import default_motions

_QUICK_SETS = 2


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    cv2.setNumThreads(1)
    try:
        if args.quick:
            sources = Sources(args.bodies, None, MANNEQUIN, "guard")
            with tempfile.TemporaryDirectory() as folder:
                figures = draw([1], Path(folder), sources, args.sets or _QUICK_SETS)
        else:
            if args.motions is None:
                raise SourceError("bullet_motions", "name the folder of the captured clips with --motions or TRACKER_SHARED_DATA")
            sources = Sources(args.bodies, Path(args.motions), args.body, args.motion, args.hands)
            figures = draw(args.seeds, args.output, sources, args.sets)
    except TrackerError as error:
        print(f"draw_clips: error: {error}", file=sys.stderr)
        return 2
    report_metrics(figures, args.json)
    return 0


def draw(seeds: list[int], folder: Path, sources: Sources, n_images: int | None = None) -> dict[str, float | int]:
    """Draw clips.

    Parameters
    ----------
    seeds : one clip each.
    folder : of the clips' folders.
    sources : of bodies and motions.
    n_images : image sets of each; None: what the seed says.

    Returns
    -------
    Metrics: image sets, seconds an image set, fraction of joints within the silhouette.
    """
    inside, sets, seconds = [], 0, 0.0
    for seed in seeds:
        began = time.monotonic()
        stage = set_stage(seed, sources, n_images)
        write_clip(stage, folder / f"clip_{seed}")
        inside.append(joints_inside(stage))
        sets += len(stage.poses[0])
        took = time.monotonic() - began
        seconds += took
        print(f"clip_{seed}: {len(stage.poses[0])} sets in {took:.0f} s", file=sys.stderr, flush=True)
    return {
        "clothed_clips.sets": sets,
        "clothed_clips.seconds_per_set": seconds / max(sets, 1),
        "clothed_clips.joints_inside_min": min(inside),
    }


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    bodies = Path("out/clothed/bodies")
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="the bodies, once:\n  " + FIRST_STEP.format(folder=bodies).replace(" && ", "\n  ")
        + "\nexample:\n  OMP_NUM_THREADS=1 python benchmark/clothed/draw_clips.py --seeds 1 4 --output out/clothed",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--seeds", nargs="+", type=int, default=list(range(1, 9)), metavar="N", help="default: 1 to 8")
    parser.add_argument("--output", type=Path, default=Path("out/clothed"), metavar="FOLDER", help="default: %(default)s")
    parser.add_argument("--bodies", type=Path, default=bodies, metavar="FOLDER", help="of the bodies (default: %(default)s)")
    parser.add_argument("--motions", default=default_motions(), metavar="FOLDER", help="captured clips (default: %(default)s)")
    parser.add_argument("--body", metavar="NAME", help=f"this body, e.g. {MANNEQUIN}, which needs no first step")
    parser.add_argument("--motion", choices=MOTIONS, metavar="NAME", help=f"this motion: {', '.join(MOTIONS)}")
    parser.add_argument("--hands", action="store_true", help="hands bend at the wrists, which are straight else")
    parser.add_argument("--sets", type=int, metavar="N", help="image sets (default: 60 to 90, by the seed)")
    parser.add_argument("--quick", action="store_true", help="two image sets of a mannequin, thrown away")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the metrics there, too")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
