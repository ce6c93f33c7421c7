#!/usr/bin/env python3
"""How long a user waits for the first result: from starting the tracker's process to its first published state.

Six 640x480 cameras are already publishing at 30 Hz from a process of their own; `tracker_node tracker` is started with rig, model
and first pose, and a third process (this one) waits for the first `tracker/state`. The first start, which may compile, is not
counted; the figure is the median of the following ones. ``cold_compile_s``: what a start with an empty cache of machine code
takes more. ``setup.warm_s``: what `make setup` takes to fill that cache.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from tracker_node.errors import TrackerError
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import Request, produce, show_progress

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.contour.accuracy import DEFAULT_CACHE

N_IMAGES = 30  # the quick cones of contour_accuracy.py
STARTS = {"quick": 2, "full": 5}
PATIENCE_S = 240.0
COMPILE_AHEAD = Path(__file__).resolve().parents[2] / "tools" / "compile_ahead.py"


def main() -> int:
    args = _arguments()
    folder = args.cache / f"cones-{N_IMAGES}"
    produce(Request(subject="model", motion="waves", n_images=N_IMAGES), folder, progress=show_progress)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    try:
        first, *others = measure(folder, 1 + STARTS["quick" if args.quick else "full"])
        with empty_cache():
            (cold,) = measure(folder, 1)
        with empty_cache():
            began = time.monotonic()
            subprocess.run([sys.executable, str(COMPILE_AHEAD)], check=True)
            warm_s = time.monotonic() - began
    except TrackerError as error:
        print(f"start: error: {error}", file=sys.stderr)
        return 2
    figures = {
        "start.first_result_s": float(np.median(others)),
        "start.first_result_max_s": float(np.max(others)),
        "start.first_start_s": first,
        "start.cold_compile_s": cold - float(np.median(others)),
        "setup.warm_s": warm_s,
        "start.starts": len(others),
    }
    report_metrics(figures, args.json)
    return 0


def _arguments() -> argparse.Namespace:
    parser = parser_of(
        __doc__, "python benchmark/ros/start.py --quick --json out/benchmark/start.json", "two starts instead of five"
    )
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="where recordings are kept (default: %(default)s)")
    return parser.parse_args()


@contextmanager
def empty_cache() -> Iterator[None]:
    """Processes that are started meanwhile find no machine code."""
    before = os.environ.get("NUMBA_CACHE_DIR")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        try:
            yield
        finally:
            del os.environ["NUMBA_CACHE_DIR"]
            if before is not None:
                os.environ["NUMBA_CACHE_DIR"] = before


def measure(folder: Path, starts: int) -> list[float]:
    """Seconds of each start."""
    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from tracker_msgs.msg import TrackedState

    from tracker_node.ros.child_process import Child
    from tracker_node.ros.executor import ros_process, spin

    rig, model, state = (str(folder / name) for name in ("rig.yaml", "person.yaml", "state.yaml"))
    seconds: list[float] = []
    with ros_process([]) as stop:
        node = Node("start_benchmark")
        came = threading.Event()
        node.create_subscription(TrackedState, "tracker/state", lambda _: came.set(), QoSProfile(depth=10))
        spinner = threading.Thread(target=spin, args=(node, stop), daemon=True)
        spinner.start()
        cameras = Child(["camera_ingest", "--rig", rig, "--rate", "30", "--loop", "--preload"], lambda _: None)
        try:
            for _ in range(starts):
                came.clear()
                began = time.monotonic()
                tracker = Child(["tracker", "--rig", rig, "--model", model, "--initial-state", state], lambda _: None)
                try:
                    if not came.wait(PATIENCE_S):
                        raise TrackerError(f"the tracker published no state within {PATIENCE_S:g} s")
                    seconds.append(time.monotonic() - began)
                finally:
                    tracker.end(20.0)
        finally:
            cameras.end(20.0)
            stop.set()
            spinner.join(timeout=5.0)
            node.destroy_node()
    return seconds


if __name__ == "__main__":
    sys.exit(main())
