#!/usr/bin/env python3
"""Whether images arrive: six 640x480 color cameras at 30 Hz, from an ingest process to a tracker process, for a minute.

The sender is `tracker_node camera_ingest` on moving, noisy images that are decoded into memory beforehand, so that decoding is
not what is measured. The receiver is the tracker node itself: its subscriptions, inbox, worker thread, synchronizer and
publishers; only the body is not fitted. Latency is from an image set's stamp, the time at which it was due, to the moment at
which the synchronized set is handed to the tracker. An image is lost unless it is in a synchronized set; a set is skipped when
the worker thread finds a newer one beside it, which happens on a machine that is busy with other things.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import TrackerError
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.report.metrics_file import report_metrics

N_CAMERAS, WIDTH, HEIGHT, RATE_HZ = 6, 640, 480, 30.0
N_DISTINCT = 30  # images per camera, then again from the first
SECONDS = {"quick": 10.0, "full": 60.0}
CPU_AFTER_S = 2.0  # the start is not what is measured


def write_cameras(folder: Path) -> Path:
    """Image folders of six cameras in which a disc moves over a textured, noisy ground; returns rig.yaml."""
    random = np.random.default_rng(0)
    K = np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]])
    ground = cv2.GaussianBlur(random.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8), (0, 0), 6)
    cameras = []
    for c in range(N_CAMERAS):
        source = folder / f"cam{c + 1}"
        source.mkdir()
        for i in range(N_DISTINCT):
            image = ground.copy()
            angle = 2.0 * np.pi * (i / N_DISTINCT + c / N_CAMERAS)
            cv2.circle(image, (int(320 + 180 * np.cos(angle)), int(240 + 120 * np.sin(angle))), 50, (40, 90, 220), -1)
            noise = random.integers(0, 12, image.shape, dtype=np.uint8)
            cv2.imwrite(str(source / f"{i:03}.png"), cv2.add(image, noise), [cv2.IMWRITE_PNG_COMPRESSION, 1])
        cameras.append(Camera(f"cam{c + 1}", CameraModel(WIDTH, HEIGHT, K), np.eye(4), source=str(source)))
    rig_file = folder / "rig.yaml"
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), rig_file)
    return rig_file


def cpu_s(pid: int) -> float:
    """Processor time that a process has used, all threads."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def wait_until(what: str, condition, timeout_s: float) -> None:
    """Poll a condition of another process."""
    until_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > until_s:
            raise TrackerError(f"{what} did not happen within {timeout_s:g} s")
        time.sleep(0.05)


def measure(seconds: float) -> dict[str, float]:
    """Run both processes and compare what was sent with what came."""
    from tracker_node.ros.child_process import Child

    with tempfile.TemporaryDirectory(prefix="transport_") as name:
        folder = Path(name)
        rig_file, result_file, ready_file = write_cameras(folder), folder / "received.json", folder / "ready"
        receiver = Child(["--receiver", str(rig_file), str(result_file), str(ready_file)], program=[__file__])
        sent: dict[str, int] = {}
        try:
            wait_until("the receiver's start", ready_file.exists, 60.0)
            sender = Child(
                ["camera_ingest", "--rig", str(rig_file), "--rate", str(RATE_HZ), "--loop", "--preload", "--no-frame-skip",
                 "--wait-for-subscribers", "1"],
                lambda line: sent.update({m[1]: int(m[2]) for m in [re.match(r"(\w+): (\d+) published", line)] if m}),
            )  # fmt: skip
            try:
                wait_until("the first image set", lambda: ready_file.read_text() == "receiving", 60.0)
                time.sleep(CPU_AFTER_S)
                before, began = (cpu_s(sender.pid), cpu_s(receiver.pid)), time.monotonic()
                time.sleep(seconds - CPU_AFTER_S)
                elapsed_s = time.monotonic() - began
                used = cpu_s(sender.pid) - before[0], cpu_s(receiver.pid) - before[1]
            finally:
                sender.end(20.0)
            time.sleep(0.5)
        finally:
            receiver.end(20.0)
        received = json.loads(result_file.read_text())
    return figures(sent, received, elapsed_s, used)


def figures(sent: dict[str, int], received: dict, elapsed_s: float, used: tuple[float, float]) -> dict[str, float]:
    """The metrics of a run."""
    latencies = np.array(received["latencies_ms"])
    in_sets = received["used"]
    n_sent = sum(sent.values())
    return {
        "transport.cameras": N_CAMERAS,
        "transport.sent": n_sent,
        "transport.lost": n_sent - sum(in_sets.values()),
        "transport.sets": len(latencies),
        "transport.skipped_sets": received["skipped"],
        "transport.rate_hz": n_sent / N_CAMERAS / max(received["span_s"] + 1.0 / RATE_HZ, 1e-9),
        "transport.latency_ms_p50": float(np.percentile(latencies, 50)),
        "transport.latency_ms_p95": float(np.percentile(latencies, 95)),
        "transport.latency_ms_max": float(latencies.max()),
        "transport.sender_cpu_percent": 100.0 * used[0] / elapsed_s,
        "transport.receiver_cpu_percent": 100.0 * used[1] / elapsed_s,
    }


def receive(rig_file: str, result_file: str, ready_file: str) -> int:
    """The receiving process: a tracker node whose tracker notes when each image set comes."""
    from tracker_node.loaders.rig.rig_yaml import load_rig
    from tracker_node.model.articulated import ArticulatedModel, Shape
    from tracker_node.model.configuration import State
    from tracker_node.model.kinematic_chain import KinematicChain
    from tracker_node.model.shapes.primitives import Ellipsoid
    from tracker_node.ros.executor import ros_process, spin
    from tracker_node.ros.tracker.node import TrackerNode, TrackerOptions
    from tracker_node.tracking.config import TrackerConfig
    from tracker_node.tracking.estimate import Status, Timings, TrackEstimate

    arrivals_ns: list[tuple[int, int]] = []
    model = ArticulatedModel("ball", KinematicChain(("ball",), ()), (Shape("ball", "ball", Ellipsoid((0.1, 0.1, 0.1))),))

    class Clerk:
        """Stands where the tracker stands."""

        def __init__(self, _rig, _model, _config: TrackerConfig, state: State | None):
            self._state = state or State.neutral(model)

        def step(self, image_set) -> TrackEstimate:
            arrivals_ns.append((image_set.stamp_ns, time.time_ns()))
            if len(arrivals_ns) == 1:
                Path(ready_file).write_text("receiving")
            timings = Timings(0.0, 0.0, 0.0)
            return TrackEstimate(
                image_set.stamp_ns, Status.TRACKING, "", self._state, np.zeros(6), np.eye(6), 0.0, 0.0, (), 0, 0, timings
            )

        def reset(self) -> None: ...
        def set_state(self, state: State) -> None: ...
        def reinitialize(self, near: object = None) -> None: ...

    with ros_process([]) as stop:
        node = TrackerNode(TrackerOptions(load_rig(rig_file), model, make_tracker=Clerk))
        node.start()
        Path(ready_file).write_text("waiting")
        try:
            spin(node, stop)
        finally:
            node.close()
            counters, skipped = node.counters(), node.skipped
            node.destroy_node()
    stamps = [stamp for stamp, _ in arrivals_ns]
    Path(result_file).write_text(
        json.dumps({
            "latencies_ms": [1e-6 * (arrival - stamp) for stamp, arrival in arrivals_ns],
            "span_s": 1e-9 * (max(stamps) - min(stamps)) if stamps else 0.0,
            "used": {camera: counter["used"] for camera, counter in counters.items()},
            "skipped": skipped,
        })
    )
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=f"{SECONDS['quick']:g} s instead of {SECONDS['full']:g} s")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    parser.add_argument("--receiver", nargs=3, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.receiver:
        return receive(*args.receiver)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    seconds = SECONDS["quick" if args.quick else "full"]
    print(f"{N_CAMERAS} cameras of {WIDTH}x{HEIGHT}, {RATE_HZ:g} Hz, {seconds:g} s, between two processes")
    metrics = measure(seconds)
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
