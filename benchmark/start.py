#!/usr/bin/env python3
"""How long it takes from starting the tracker's process to its first published state.

Six cameras of 640x480 are already publishing a standing person at 30 Hz; then `tracker_node tracker` is started with the shipped
human model, and again. The second start, with compiled code in numba's cache, is the figure.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from tracker_node.camera.camera_model import CameraModel
from tracker_node.camera.camera_rig import Camera, CameraRig
from tracker_node.errors import TrackerError
from tracker_node.evaluation.metrics_file import print_metrics, write_metrics
from tracker_node.geometry import se3
from tracker_node.loaders.model_yaml import load_model
from tracker_node.loaders.rig_yaml import rig_file_of, write_rig_file
from tracker_node.loaders.state_yaml import dump_state
from tracker_node.model.configuration import Configuration, State
from tracker_node.render.raycaster import render_view

MODEL = Path(__file__).resolve().parents[1] / "config" / "models" / "human.yaml"
N_CAMERAS, WIDTH, HEIGHT = 6, 640, 480
STARTS = {"quick": 2, "full": 5}
TIMEOUT_S = 180.0


def write_person(folder: Path) -> None:
    """Plates and one image of each camera, rig.yaml and state.yaml."""
    model, random = load_model(MODEL), np.random.default_rng(0)
    state = State.neutral(model, se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, 1.0])))
    K = np.array([[520.0, 0.0, 319.5], [0.0, 520.0, 239.5], [0.0, 0.0, 1.0]])
    colors = np.array([(150, 160, 155), *(shape.color_rgb[::-1] for shape in model.shapes)], np.uint8)
    cameras = []
    for i in range(N_CAMERAS):
        angle = 2.0 * np.pi * i / N_CAMERAS
        forward = -np.array([np.cos(angle), np.sin(angle), 0.0])
        right = np.cross(forward, [0.0, 0.0, 1.0])
        axes = np.column_stack([right, np.cross(forward, right), forward])
        T_world_cam = se3.from_rotation_translation(axes, np.array([0.0, 0.0, 1.0]) - 3.5 * forward)
        source, plate = folder / f"cam{i + 1}", folder / f"cam{i + 1}_plate.png"
        camera = Camera(f"cam{i + 1}", CameraModel(WIDTH, HEIGHT, K), T_world_cam, source=str(source), plate=str(plate))
        labels = render_view(Configuration(model, state), camera).labels
        source.mkdir()
        for path, picture in ((source / "0.png", labels), (plate, np.zeros_like(labels))):
            noise = random.normal(0.0, 2.0, (HEIGHT, WIDTH, 3))
            cv2.imwrite(str(path), np.clip(colors[picture] + noise, 0, 255).astype(np.uint8))
        cameras.append(camera)
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), folder / "rig.yaml")
    dump_state(state, model, folder / "state.yaml")


def first_result_s(folder: Path) -> float:
    """Start a tracker and wait for its first state."""
    from rclpy.node import Node
    from tracker_msgs.msg import TrackedState

    from tracker_node.ros.child_process import Child
    from tracker_node.ros.executor import ros_process, spin
    from tracker_node.ros.qos import RESULT

    states: list[float] = []
    with ros_process([]) as stop:
        node = Node("stopwatch")
        subscription = node.create_subscription(TrackedState, "tracker/state", lambda _: states.append(time.monotonic()), RESULT)
        files = ["--rig", str(folder / "rig.yaml"), "--model", str(MODEL), "--initial-state", str(folder / "state.yaml")]
        began = time.monotonic()
        tracker = Child(["tracker", *files])
        try:
            spin(node, stop, lambda: bool(states) or time.monotonic() - began > TIMEOUT_S or tracker.returncode is not None)
        finally:
            tracker.end(20.0)
        node.destroy_subscription(subscription)
        node.destroy_node()
    if not states:
        raise TrackerError("the tracker published no state")
    return states[0] - began


def measure(n_starts: int) -> dict[str, float]:
    """The metrics."""
    from tracker_node.ros.child_process import Child

    with tempfile.TemporaryDirectory(prefix="start_") as name:
        folder = Path(name)
        write_person(folder)
        rig = str(folder / "rig.yaml")
        ingest = Child(["camera_ingest", "--rig", rig, "--rate", "30", "--loop", "--preload"], lambda line: None)
        try:
            times = [first_result_s(folder) for _ in range(n_starts)]
        finally:
            ingest.end(20.0)
    later = sorted(times[1:])
    return {
        "start.first_result_s": later[len(later) // 2],
        "start.first_result_max_s": later[-1],
        "start.first_start_s": times[0],
        "start.starts": n_starts,
        "start.cameras": N_CAMERAS,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=f"{STARTS['quick']} starts instead of {STARTS['full']}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    args = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    metrics = measure(STARTS["quick" if args.quick else "full"])
    print_metrics(metrics)
    if args.json:
        write_metrics(args.json, metrics)
    return 0


if __name__ == "__main__":
    sys.exit(main())
