#!/usr/bin/env python3
"""Launch files run by the real ``ros2 launch`` until they reach their state: a state published, an image, a bag, a report.

TRACKER_ROS2_ENV names the folder whose env.sh makes ``ros2`` available, with this package installed. RViz may be missing: then
one line says so, and the exit status is 0.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from helpers.ros import ros2_env
from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository


def main() -> int:
    args = _arguments()
    if ros2_env.missing():
        print(f"launch_files: error: {ros2_env.missing()}", file=sys.stderr)
        return 2
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    from benchmark.ros._launched import FILES, stage_in
    from helpers.ros.graph import ros_context

    run = 0
    with ros_context():
        for name, reach in FILES.items():
            if args.only and name not in args.only:
                continue
            with tempfile.TemporaryDirectory(prefix="launch_") as folder, stage_in(Path(folder)) as stage:
                try:
                    reach(stage)
                except AssertionError as error:
                    print(f"{name}.launch.py: {error}", file=sys.stderr)
                    continue
            run += 1
            print(f"{name}.launch.py: runs", file=sys.stderr, flush=True)
    report_metrics({"launch.files_run": run}, args.json)
    return 0 if run == len(args.only or FILES) else 1


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="example:\n  python benchmark/ros/launch_files.py --json out/benchmark/launch_files.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="the same: there are seven of them")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="only these files, without .launch.py")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
