#!/usr/bin/env python3
"""How long a node takes to end when it is told to: SIGINT and SIGTERM, every node, whatever it is doing.

Real processes are stopped at random times while they start, compile, look for the body or for limbs, track, play and record. The
exit status must be 0, and a bag that was being recorded must pass `tracker_node bag check`. The seed is fixed.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

SEED, N_STOPS, N_QUICK = 17, 60, 15


def main() -> int:
    args = _arguments()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    from benchmark.ros._stops import MOMENTS, Stop, scene_in, stopped
    from helpers.ros.graph import remove_left_segments, ros_context, shared_memory_files
    from helpers.ros.samples import write_recording
    from helpers.sources.bag_samples import write_bag

    stops: dict[str, list[Stop]] = {}
    before = shared_memory_files()
    with tempfile.TemporaryDirectory(prefix="stop_") as name, ros_context():
        recording = Path(name) / "recording"
        write_recording(recording, 12)
        write_bag(recording / "bag")
        moments = [moment for moment in MOMENTS if not args.only or any(text in moment for text in args.only)]
        for i in range(N_QUICK if args.quick else N_STOPS):
            moment = moments[i % len(moments)]
            number = (signal.SIGINT, signal.SIGTERM)[(i + i // len(moments)) % 2]
            with scene_in(Path(name) / str(i), recording, f"{SEED} {i}") as scene:
                stop = stopped(moment, number, scene)
            stops.setdefault(moment, []).append(stop)
            print(f"{moment}, {number.name}: {stop.seconds:.2f} s, status {stop.status}", file=sys.stderr, flush=True)
        remove_left_segments(before)
    every = [stop for group in stops.values() for stop in group]
    for moment, group in stops.items():
        print(f"  {moment:32} {len(group):3} stops, worst {max(stop.seconds for stop in group):.2f} s")
    metrics = {
        "stop.worst_s": max(stop.seconds for stop in every),
        "stop.p50_s": sorted(stop.seconds for stop in every)[len(every) // 2],
        "stop.stops": len(every),
        "stop.status_0": sum(stop.status == 0 for stop in every),
        "stop.bags": sum(stop.bags for stop in every),
        "stop.bags_sound": sum(stop.sound for stop in every),
    }
    report_metrics(metrics, args.json)
    good = metrics["stop.status_0"] == metrics["stop.stops"] and metrics["stop.bags_sound"] == metrics["stop.bags"]
    return 0 if good else 1


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="example:\n  python benchmark/ros/stop.py --quick --json out/benchmark/stop.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help=f"{N_QUICK} stops instead of {N_STOPS}")
    parser.add_argument("--only", nargs="+", default=[], metavar="TEXT", help="only moments that have one of these texts")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
