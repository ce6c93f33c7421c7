#!/usr/bin/env python3
"""Whether parameters of a running tracker can be changed without losing an image: six 640x480 cameras at 30 Hz.

Three processes: `tracker_node camera_ingest` (a recording forward and backward: the body never jumps), `tracker_node tracker`,
and this one, which changes parameters one after the other: values of the configuration, the kind of the
evidence, the engine, the cameras in use; and once a round it pauses the tracker for a while and lets it go on. With
``--composed`` cameras and tracker are one process, `tracker_node compose`. A change is over when the tracker says that it is in
effect. Changes begin when the body has been TRACKING for a second. Lost are the images that the tracker's own counts call
`lost in transport` (reception stood still) or `overflowed` (a single image set took longer than a second); of both each. As long
again nothing is changed, for comparison.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from tracker_node.errors import TrackerError
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.config_file import dump_config
from tracker_node.synthesis.recording import Request
from tracker_node.tracking.config import TrackerConfig

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark.contour._runs import Clip, clip_parser, configured, print_circumstances, recorded
from benchmark.ros.live import N_IMAGES, PATIENCE_S, RATE_HZ, there_and_back
from benchmark.ros.transport import wait_until

ROUNDS = {"quick": 1, "full": 5}
SETTLED_SETS, AFTER_S = 30, 2.0


def main(arguments: list[str] | None = None) -> int:
    parser = clip_parser(__doc__, "python benchmark/ros/reconfigure.py --quick --json out/benchmark/reconfigure.json")
    parser.add_argument("--composed", action="store_true", help="cameras and tracker in one process")
    args = parser.parse_args(arguments)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    try:
        clip = recorded(f"cones-{N_IMAGES}", Request(subject="model", motion="waves", n_images=N_IMAGES), args.cache)
        figures = measure(clip, configured(args.changes), ROUNDS["quick" if args.quick else "full"], args.composed)
    except TrackerError as error:
        print(f"reconfigure: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


PAUSE_S = 1.0


def changes(cameras: tuple[str, ...]) -> list[dict[str, object]]:
    """What is set, one after the other; the last ones bring back what was."""
    return [
        {"status.limb_degraded": 0.3},
        {"cameras": list(cameras[:-1])},
        {"region.scales": "6 3"},
        {"cameras": list(cameras)},
        {"modalities": ["chamfer"]},
        {"chamfer.robust_scale_px": 5.0},
        {"modalities": ["region"], "status.limb_lost": 0.4},
    ]


@dataclass(frozen=True)
class Totals:
    """Images that did not arrive, or waited too long; image sets left out for a newer one, and those tracked, at a time."""

    at_s: float
    in_transport: int
    overflowed: int
    skipped: int
    states: int

    @property
    def lost(self) -> int:
        return self.in_transport + self.overflowed


class Watcher:
    """Listens to the tracker's /diagnostics and sets its parameters."""

    def __init__(self) -> None:
        from diagnostic_msgs.msg import DiagnosticArray
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.node import Node
        from std_srvs.srv import SetBool
        from tracker_msgs.msg import TrackedState

        self.node = Node("reconfigure_benchmark")
        self.states = 0
        self.tracking = 0  # states one after the other, up to the latest
        self.counts: dict[str, dict[str, str]] = {}
        self.said: list[str] = []  # of the parameters
        self.node.create_subscription(TrackedState, "tracker/state", self._count, 100)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._listen, 100)
        self._enabling = self.node.create_client(SetBool, "tracker/enable")
        self._client = self.node.create_client(SetParametersAtomically, "tracker/set_parameters_atomically")

    def _count(self, message) -> None:
        self.states += 1
        self.tracking = self.tracking + 1 if message.status == message.TRACKING else 0

    def _listen(self, message) -> None:
        for status in message.status:
            if status.name == "tracker: parameters":
                self.said.append(status.message)
            self.counts[status.name] = {pair.key: pair.value for pair in status.values}

    def totals(self, cameras: tuple[str, ...]) -> Totals:
        """What has been counted until now."""
        in_transport, overflowed = (
            sum(int(self.counts.get(f"tracker: {name}", {}).get(key, "0")) for name in cameras)
            for key in ("lost in transport", "overflowed")
        )
        skipped = int(self.counts.get("tracker: status", {}).get("image sets skipped", "0"))
        return Totals(time.monotonic(), in_transport, overflowed, skipped, self.states)

    def change(self, values: dict[str, object], spin: Callable[[Callable[[], object], str], None]) -> float:
        """Set parameters; how long it takes until they are in effect [s]."""
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter

        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        spin(self._client.service_is_ready, "the tracker's services")
        self.said.clear()
        began = time.monotonic()
        answer = self._client.call_async(SetParametersAtomically.Request(parameters=parameters))
        spin(answer.done, f"the answer to {values}")
        if not answer.result().result.successful:
            raise TrackerError(f"{values} was refused: {answer.result().result.reason}")
        spin(lambda: "in effect" in self.said, f"{values} in effect")
        return time.monotonic() - began

    def enable(self, enabled: bool, spin: Callable[[Callable[[], object], str], None]) -> None:
        """Let the tracker go on, or pause it."""
        from std_srvs.srv import SetBool

        answer = self._enabling.call_async(SetBool.Request(data=enabled))
        spin(answer.done, "the answer to a pause")


def measure(clip: Clip, config: TrackerConfig, rounds: int, composed: bool = False) -> dict[str, float | int]:
    """Run the processes, change parameters, and count.

    Parameters
    ----------
    clip : whose images are sent.
    config : of the tracker at first.
    rounds : of all `changes` and a pause.
    composed : cameras and tracker are one process.

    Returns
    -------
    figures : by name.
    """
    from tracker_node.ros.child_process import Child
    from tracker_node.ros.executor import ros_process, spin

    names = clip.rig.names
    with tempfile.TemporaryDirectory(prefix="reconfigure_") as folder_name, ros_process([]) as stop, ExitStack() as ended:
        folder = Path(folder_name)
        rig_file = there_and_back(clip, folder)
        dump_config(config, folder / "tracker.yaml")
        watcher = Watcher()
        ended.callback(watcher.node.destroy_node)

        def spin_until(predicate: Callable[[], object], what: str) -> None:
            until_s = time.monotonic() + PATIENCE_S
            spin(watcher.node, stop, lambda: bool(predicate()) or time.monotonic() > until_s)
            wait_until(what, lambda: bool(predicate()), 0.01)

        def pass_time(seconds: float) -> None:
            until_s = time.monotonic() + seconds
            spin(watcher.node, stop, lambda: time.monotonic() > until_s)

        body = ["--model", str(clip.folder / "person.yaml"), "--initial-state", str(clip.folder / "state.yaml")]
        tracking = ["--rig", str(rig_file), *body, "--config", str(folder / "tracker.yaml")]
        pace = ["--rate", str(RATE_HZ), "--loop", "--preload", "--no-frame-skip"]
        # One process for all cameras: those that begin at different times would show different moments of the recording.
        apart = [["tracker", *tracking], ["camera_ingest", "--rig", str(rig_file), *pace, "--wait-for-subscribers", "1"]]
        for arguments in [["compose", *tracking, *pace]] if composed else apart:
            ended.callback(Child(arguments, _quiet).end, 20.0)
        spin_until(lambda: watcher.tracking >= SETTLED_SETS, "a body that is tracked")
        began, took_s = watcher.totals(names), []
        for _ in range(rounds):
            for values in changes(names):
                took_s.append(watcher.change(values, spin_until))
                pass_time(AFTER_S)
            watcher.enable(False, spin_until)
            pass_time(PAUSE_S)
            watcher.enable(True, spin_until)
            pass_time(AFTER_S)
        changed = watcher.totals(names)
        pass_time(changed.at_s - began.at_s)
        alone = watcher.totals(names)
        figures = {
            "reconfigure.lost_images": changed.lost - began.lost,
            "reconfigure.lost_in_transport": changed.in_transport - began.in_transport,
            "reconfigure.overflowed": changed.overflowed - began.overflowed,
            "reconfigure.lost_images_without_changes": alone.lost - changed.lost,
            "reconfigure.changes": len(took_s),
            "reconfigure.in_effect_s_max": max(took_s),
            "reconfigure.seconds": changed.at_s - began.at_s,
            "reconfigure.states": changed.states - began.states,
            "reconfigure.states_without_changes": alone.states - changed.states,
            "reconfigure.sets_left_out": changed.skipped - began.skipped,
            "reconfigure.sets_left_out_without_changes": alone.skipped - changed.skipped,
        }
        return {key.replace(".", "_composed." if composed else ".", 1): value for key, value in figures.items()}


def _quiet(line: str) -> None:
    if "error" in line.lower():
        print(line, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
