#!/usr/bin/env python3
"""Whether a detector of people runs beside the tracker: four 640x480 cameras at 30 Hz, points as often as they come, no set lost.

Four processes: `tracker_node camera_ingest` sends a clothed person's images (forward and backward: the body never jumps),
`tracker_node tracker` tracks them with the modalities region and keypoints, `tracker_node keypoints` finds points in the newest,
and this one listens. The clip is drawn once (`benchmark/clothed`); another one is given by its folder. An image set is lost if no
state of its stamp has come.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tracker_node.calibration.body import scale_to_trial, targets_of
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import TrackerError
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.humans.human import human_model
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.config_file import dump_config
from tracker_node.tracking.config import TrackerConfig

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark.clothed._clip import write_clip
from benchmark.clothed._staging import Sources, set_stage
from benchmark.clothed.person._body import MANNEQUIN
from benchmark.contour._runs import Clip, clip_parser, configured, print_circumstances
from benchmark.ros.live import LAST_STATES_S, RATE_HZ, SETTLE_S, _quiet, _stamp_ns, live_figures, there_and_back
from benchmark.ros.transport import cpu_s, wait_until

N_IMAGES = 40
SECONDS = {"quick": 10.0, "full": 60.0}
PATIENCE_S = 180.0  # the tracker may have to compile


def main(arguments: list[str] | None = None) -> int:
    parser = clip_parser(__doc__, "python benchmark/ros/points.py --quick --json out/benchmark/points.json")
    parser.add_argument("--seconds", type=float, metavar="S", help=f"to judge (default: {SECONDS['full']:g})")
    parser.add_argument("--clip", type=Path, metavar="FOLDER", help="rig.yaml, static.trc, truth.trc (default: one is drawn)")
    parser.add_argument("--weights", type=Path, metavar="FILE", help="of the network that finds points (default: full)")
    args = parser.parse_args(arguments)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    seconds = args.seconds or SECONDS["quick" if args.quick else "full"]
    try:
        clip = clothed(args.clip or drawn(args.cache))
        config = configured(args.changes, modalities=["region", "keypoints"])
        figures = measure(clip, config, seconds, [] if args.weights is None else ["--weights", str(args.weights)])
    except TrackerError as error:
        print(f"points: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def drawn(cache: Path) -> Path:
    """Folder of a mannequin in clothes who moves on the spot; kept from run to run."""
    folder = cache / f"clothed-{N_IMAGES}"
    if not (folder / "clip.json").exists():
        write_clip(set_stage(1, Sources(cache, None, MANNEQUIN, "guard"), N_IMAGES), folder)
    return folder


def clothed(folder: Path) -> Clip:
    """A clip of a clothed person, the body by its static trial, the start by its truth, with images of the background if any."""
    model = scale_to_trial(human_model(), load_trc(folder / "static.trc")).model
    start = fit_state_to_landmarks(model, targets_of(model, load_trc(folder / "truth.trc"), 0)).state
    rig = load_rig(folder / "rig.yaml")
    stills = {camera.name: folder / "stills" / f"{camera.name}.jpg" for camera in rig}
    cameras = (replace(c, background=str(stills[c.name]) if stills[c.name].exists() else c.background) for c in rig)
    return Clip(folder, CameraRig(tuple(cameras)), model, start)


@dataclass
class _Heard:
    """What has come, with its arrival (ns)."""

    sent: list[int] = field(default_factory=list)
    states: list[tuple[int, int, int]] = field(default_factory=list)  # stamp, arrival, status
    with_points: list[int] = field(default_factory=list)  # arrivals of states
    points: list[tuple[int, int, int]] = field(default_factory=list)  # stamp, arrival, people


def measure(clip: Clip, config: TrackerConfig, seconds: float, detector: list[str]) -> dict[str, float | int]:
    """Run the processes, and compare what was sent with what came.

    Parameters
    ----------
    clip, config : what is tracked, and how.
    seconds : to judge.
    detector : options of ``tracker_node keypoints``.

    Returns
    -------
    Metrics.
    """
    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import CameraInfo
    from tracker_msgs.msg import Keypoints, TrackedState

    from tracker_node.ros.child_process import Child
    from tracker_node.ros.executor import ros_process, spin

    heard = _Heard()
    with tempfile.TemporaryDirectory(prefix="points_") as name, ros_process([]) as stop:
        folder = Path(name)
        rig = ["--rig", str(there_and_back(clip, folder))]
        dump_config(config, folder / "tracker.yaml")
        dump_model(clip.model, folder / "person.yaml")
        dump_state(clip.start, clip.model, folder / "state.yaml")
        node = Node("points_benchmark")
        camera, quality = clip.rig.names[0], QoSProfile(depth=200)

        def came(message: TrackedState) -> None:
            now_ns = time.time_ns()
            heard.states.append((_stamp_ns(message), now_ns, message.status))
            if message.keypoint_cameras:
                heard.with_points.append(now_ns)

        def found(message: Keypoints) -> None:
            heard.points.append((_stamp_ns(message), time.time_ns(), len(message.persons)))

        node.create_subscription(CameraInfo, f"{camera}/camera_info", lambda m: heard.sent.append(_stamp_ns(m)), quality)
        node.create_subscription(TrackedState, "tracker/state", came, quality)
        node.create_subscription(Keypoints, f"{camera}/keypoints", found, quality)
        spinner = threading.Thread(target=spin, args=(node, stop), daemon=True)
        spinner.start()
        body = ["--model", str(folder / "person.yaml"), "--initial-state", str(folder / "state.yaml")]
        waits = ["--wait-for-subscribers", "2", "--wait-for-info-subscribers", "1"]
        children = {
            "tracker": Child(["tracker", *rig, *body, "--config", str(folder / "tracker.yaml")], _quiet),
            "keypoints": Child(["keypoints", *rig, *detector], _quiet),
            "sources": Child(
                ["camera_ingest", *rig, "--rate", str(RATE_HZ), "--loop", "--preload", "--no-frame-skip", *waits], _quiet
            ),
        }
        try:
            wait_until("the first state", lambda: bool(heard.states), PATIENCE_S)
            wait_until("the first points", lambda: bool(heard.points), PATIENCE_S)
            time.sleep(SETTLE_S)
            before, began, from_ns = {n: cpu_s(c.pid) for n, c in children.items()}, time.monotonic(), time.time_ns()
            time.sleep(seconds)
            to_ns, elapsed_s = time.time_ns(), time.monotonic() - began
            percent = {n: 100.0 * (cpu_s(c.pid) - before[n]) / elapsed_s for n, c in children.items()}
            time.sleep(LAST_STATES_S)
        finally:
            for each in ("sources", "keypoints", "tracker"):
                children[each].end(20.0)
            stop.set()
            spinner.join(timeout=5.0)
            node.destroy_node()
    return figures_of(heard, from_ns, to_ns) | {f"live_points.{n}_cpu_percent": value for n, value in percent.items()}


def figures_of(heard: _Heard, from_ns: int, to_ns: int) -> dict[str, float | int]:
    """Metrics of what has come between two times.

    Parameters
    ----------
    heard : all of it.
    from_ns, to_ns : of the clock.

    Returns
    -------
    Metrics.
    """
    seconds = 1e-9 * (to_ns - from_ns)
    points = [(stamp, arrival, people) for stamp, arrival, people in heard.points if from_ns <= arrival < to_ns]
    late_ms = [1e-6 * (arrival - stamp) for stamp, arrival, _ in points] or [np.nan]
    live = live_figures([stamp for stamp in heard.sent if from_ns <= stamp < to_ns], heard.states)
    return {
        "points.rate_hz": len(points) / seconds,
        "points.late_ms_p50": float(np.percentile(late_ms, 50)),
        "points.without_people": sum(people == 0 for _, _, people in points),
        "live_points.used_hz": sum(from_ns <= arrival < to_ns for arrival in heard.with_points) / seconds,
        **{name.replace("live.", "live_points."): value for name, value in live.items()},
    }


if __name__ == "__main__":
    sys.exit(main())
