#!/usr/bin/env python3
"""Whether the tracker keeps up: images of six 640x480 cameras at 30 Hz to published states, for a minute.

Three processes: `tracker_node camera_ingest` sends decoded images (a recording forward and backward: the body never jumps),
`tracker_node tracker` tracks them as they come (the newest set wins), and this one listens. With ``--composed`` the first two
are one, `tracker_node compose`, and images are not sent; with ``--both`` that comes after. An image set is lost if no
state of its stamp has come; latency is from the stamp, the time at which the images were due, to the state's arrival here. The
first seconds, in which the tracker loads its code and finds its first pose, are not judged.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tracker_node.camera.rig import CameraRig
from tracker_node.errors import TrackerError
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.config_file import dump_config
from tracker_node.synthesis.recording import Request
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark.contour._runs import Clip, clip_parser, configured, print_circumstances, recorded
from benchmark.ros.transport import cpu_s, wait_until

N_IMAGES = 30  # the quick cones of contour_accuracy.py
RATE_HZ = 30.0
SECONDS = {"quick": 10.0, "full": 60.0}
SETTLE_S = 4.0
PATIENCE_S = 90.0  # the tracker may have to compile
LAST_STATES_S = 1.0


def main(arguments: list[str] | None = None) -> int:
    parser = clip_parser(__doc__, "python benchmark/ros/live.py --quick --set threads=2 --json out/benchmark/live.json")
    parser.add_argument("--rate", type=int, default=int(RATE_HZ), metavar="HZ", help="of the images (default: %(default)s)")
    parser.add_argument("--composed", action="store_true", help="ingest and tracker in one process")
    parser.add_argument("--both", action="store_true", help="first apart, then composed")
    parser.add_argument("--seconds", type=float, metavar="S", help=f"to judge (default: {SECONDS['full']:g})")
    args = parser.parse_args(arguments)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    seconds = args.seconds or SECONDS["quick" if args.quick else "full"]
    try:
        of_default_rate = args.rate == RATE_HZ
        name, n_images = (f"cones-{N_IMAGES}", N_IMAGES) if of_default_rate else (f"cones-{args.rate}hz", args.rate)
        request = Request(subject="model", motion="waves", n_images=n_images, rate_hz=float(args.rate))
        clip, config = recorded(name, request, args.cache), configured(args.changes)
        prefix, figures = "live" if of_default_rate else f"live6_{args.rate}hz", dict[str, float | int]()
        for composed in (False, True) if args.both else (args.composed,):
            of_run = measure(clip, config, seconds, args.rate, composed)
            place = f"{prefix}_composed" if composed else prefix
            figures |= {key.replace("live", place, 1): value for key, value in of_run.items()}
    except TrackerError as error:
        print(f"live: error: {error}", file=sys.stderr)
        return 2
    print(f"modalities: {', '.join(config.modalities)}, threads: {config.threads}")
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def there_and_back(clip: Clip, folder: Path) -> Path:
    """``rig.yaml`` of cameras that show the clip forward, then backward; the images are links."""
    cameras = []
    for camera in clip.rig:
        files = sorted(Path(camera.source).glob("[0-9]*.*"))
        source = folder / camera.name
        source.mkdir()
        for i, file in enumerate([*files, *files[-2:0:-1]]):
            (source / f"{i:04d}{file.suffix}").symlink_to(file.resolve())
        plate = str(Path(camera.background).resolve()) if camera.background else camera.background
        cameras.append(replace(camera, source=str(source), background=plate))
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), folder / "rig.yaml")
    return folder / "rig.yaml"


def measure(
    clip: Clip, config: TrackerConfig, seconds: float, rate_hz: float = RATE_HZ, composed: bool = False
) -> dict[str, float | int]:
    """Run the processes, and compare what was sent with what came.

    Parameters
    ----------
    clip : whose images are sent, forward and backward.
    config : of the tracker.
    seconds : to judge.
    rate_hz : of the images.
    composed : ingest and tracker are one process.

    Returns
    -------
    figures : by name; processor time in percent of one processor.
    """
    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import CameraInfo
    from tracker_msgs.msg import TrackedState

    from tracker_node.ros.child_process import Child
    from tracker_node.ros.executor import ros_process, spin

    sent: list[int] = []
    states: list[tuple[int, int, int]] = []
    with tempfile.TemporaryDirectory(prefix="live_") as name, ros_process([]) as stop:
        folder = Path(name)
        rig_file = there_and_back(clip, folder)
        dump_config(config, folder / "tracker.yaml")
        node = Node("live_benchmark")
        camera, quality = clip.rig.names[0], QoSProfile(depth=200)
        node.create_subscription(CameraInfo, f"{camera}/camera_info", lambda m: sent.append(_stamp_ns(m)), quality)
        node.create_subscription(
            TrackedState, "tracker/state", lambda m: states.append((_stamp_ns(m), time.time_ns(), m.status)), quality
        )
        spinner = threading.Thread(target=spin, args=(node, stop), daemon=True)
        spinner.start()
        body = ["--model", str(clip.folder / "person.yaml"), "--initial-state", str(clip.folder / "state.yaml")]
        tracking = ["--rig", str(rig_file), *body, "--config", str(folder / "tracker.yaml")]
        pace = ["--rate", str(rate_hz), "--loop", "--preload", "--no-frame-skip"]
        waits = ["--wait-for-subscribers", "1", "--wait-for-info-subscribers", "1"]
        if composed:
            children = {"graph": Child(["compose", *tracking, *pace], _quiet)}
        else:
            children = {
                "tracker": Child(["tracker", *tracking], _quiet),
                "sources": Child(["camera_ingest", "--rig", str(rig_file), *pace, *waits], _quiet),
            }
        try:
            wait_until("the first state", lambda: bool(states), PATIENCE_S)
            time.sleep(SETTLE_S)
            before, began = {name: cpu_s(child.pid) for name, child in children.items()}, time.monotonic()
            from_ns = time.time_ns()
            time.sleep(seconds)
            to_ns, elapsed_s = time.time_ns(), time.monotonic() - began
            used = {name: cpu_s(child.pid) - before[name] for name, child in children.items()}
            time.sleep(LAST_STATES_S)
        finally:
            for child in reversed(children.values()):  # nothing is sent to who has ended
                child.end(20.0)
            stop.set()
            spinner.join(timeout=5.0)
            node.destroy_node()
    figures = live_figures([s for s in sent if from_ns <= s < to_ns], states)
    percent = {f"live.{name}_cpu_percent": 100.0 * used_s / elapsed_s for name, used_s in used.items()}
    return figures | percent | {"live.threads": config.threads}


def live_figures(sent: Sequence[int], states: Sequence[tuple[int, int, int]]) -> dict[str, float | int]:
    """Figures of the sets with the stamps ``sent``; ``states``: stamp, arrival (ns) and status of all that came."""
    arrivals = {stamp: (arrival, status) for stamp, arrival, status in states}
    came = [(stamp, *arrivals[stamp]) for stamp in sent if stamp in arrivals]
    latencies = np.array([1e-6 * (arrival - stamp) for stamp, arrival, _ in came]) if came else np.array([np.nan])
    span_s = 1e-9 * (max(sent) - min(sent)) if len(sent) > 1 else np.nan
    return {
        "live.lost": len(sent) - len(came),
        "live.latency_ms_p50": float(np.percentile(latencies, 50)),
        "live.latency_ms_p95": float(np.percentile(latencies, 95)),
        "live.latency_ms_max": float(latencies.max()),
        "live.sets": len(sent),
        "live.rate_hz": (len(sent) - 1) / span_s,
        "live.not_tracking": sum(status != Status.TRACKING for _, _, status in came),
    }


def _stamp_ns(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def _quiet(line: str) -> None:
    if re.search("error|warn", line, re.IGNORECASE):
        print(line, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
