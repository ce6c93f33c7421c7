#!/usr/bin/env python3
"""Whether a bag takes everything: six 640x480 color cameras at 30 Hz (166 MB/s), from an ingest process to the recorder's disk.

Every image that the ingest has published is looked for in the finished bag. The processor time is that of the recorder's
process, in percent of one core, from two seconds after its first message on.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import sys
import tempfile
import time
from pathlib import Path

from transport import CPU_AFTER_S, N_CAMERAS, RATE_HZ, cpu_s, write_cameras

from tracker_node.errors import TrackerError
from tracker_node.evaluation.metrics_file import print_metrics, write_metrics
from tracker_node.loaders.bag_reader import BagReader

SECONDS = {"quick": 8.0, "full": 20.0}


def measure(folder: Path, seconds: float) -> dict[str, float]:
    """Record for so long, then count; the metrics."""
    from tracker_node.ros.child_process import Child

    rig_file, bag = write_cameras(folder), folder / "bag"
    lines: list[str] = []
    recorder = Child(["recorder", "--output", str(bag), "--regex", "/cam.*"], lines.append)
    wait_until(lambda: any("ready" in line for line in lines) or recorder.returncode is not None)
    ingest_lines: list[str] = []
    arguments = ["camera_ingest", "--rig", str(rig_file), "--rate", str(RATE_HZ), "--preload", "--loop"]
    ingest = Child([*arguments, "--wait-for-subscribers", "1"], ingest_lines.append)
    file = bag / "bag_0.mcap"
    wait_until(lambda: file.exists() and file.stat().st_size > 10_000_000)
    time.sleep(CPU_AFTER_S)
    began, cpu_began = time.monotonic(), cpu_s(recorder.pid)
    time.sleep(seconds)
    percent = 100.0 * (cpu_s(recorder.pid) - cpu_began) / (time.monotonic() - began)
    ingest.end(30.0)
    recorder.end(60.0)
    published = sum(int(n) for line in ingest_lines for n in re.findall(r"(\d+) published", line))
    with BagReader(bag) as reader:
        recorded = sum(t.message_count for t in reader.topics.values() if t.type_name == "sensor_msgs/msg/Image")
        duration_s = (reader.end_ns - reader.start_ns) * 1e-9
    print("\n".join([*ingest_lines, *lines]), file=sys.stderr)
    return {
        "recording.published": published,
        "recording.recorded": recorded,
        "recording.lost": published - recorded,
        "recording.mb_per_s": file.stat().st_size / 1e6 / duration_s,
        "recording.cpu_percent": percent,
        "recording.seconds": duration_s,
        "recording.cameras": N_CAMERAS,
    }


def wait_until(predicate, timeout_s: float = 60.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not predicate():
        if time.monotonic() > deadline:
            raise TrackerError(f"nothing was recorded within {timeout_s:g} s")
        time.sleep(0.05)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help=f"{SECONDS['quick']:g} s instead of {SECONDS['full']:g} s")
    parser.add_argument("--folder", type=Path, help="where to write (up to 5 GB; default: the folder for temporary files)")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    args = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the folder is removed
    with tempfile.TemporaryDirectory(prefix="recording_", dir=args.folder) as folder:
        metrics = measure(Path(folder), SECONDS["quick" if args.quick else "full"])
    print_metrics(metrics)
    if args.json:
        write_metrics(args.json, metrics)
    return 0 if metrics["recording.lost"] == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
