"""A recorder process under load: six cameras from an ingest process, results from another, and what of it is in the bag."""

from __future__ import annotations

import os
import re
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmark.ros.transport import CPU_AFTER_S, N_CAMERAS, RATE_HZ, cpu_s, wait_until, write_cameras
from tracker_node.errors import TrackerError
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.ros.child_process import Child

RESULTS = ("state", "state_covariance", "pose", "joint_states")
TOPICS = (*(f"/cam{i + 1}/image_raw" for i in range(N_CAMERAS)), *(f"/tracker/{name}" for name in RESULTS))
READY = "recorder: ready"
RECORDED = "/cam[0-9]+/image_raw|/tracker/.*"
START_S = 60.0
END_S = 60.0
SETTLE_S = 0.5  # between the discovery of a subscriber here and ours there
_PUBLISHED = re.compile(r"(\S+): (\d+) published")


class Streams:
    """The processes that publish; ``published`` is known after `end`.

    Results are a tracker's: state with covariances, pose and joint angles of the human, as often as the cameras expose.
    """

    def __init__(self, folder: Path):
        rig_file = write_cameras(folder)
        self.lines: list[str] = []
        arguments = ["camera_ingest", "--rig", str(rig_file), "--rate", str(RATE_HZ), "--preload", "--loop", "--no-frame-skip"]
        self._children = [
            Child([*arguments, "--wait-for-subscribers", "1"], self.lines.append),
            Child(["--results"], self.lines.append, program=[__file__]),
        ]

    @property
    def published(self) -> Counter[str]:
        """Messages by topic; a topic of which no publisher has said anything, or that it has published none, is an error."""
        counts: Counter[str] = Counter()
        for name, count in _PUBLISHED.findall("\n".join(self.lines)):
            counts[name if name.startswith("/") else f"/{name}/image_raw"] = int(count)
        missing = [topic for topic in TOPICS if not counts[topic]]
        if missing:
            raise TrackerError(f"no messages published, or not said how many: {', '.join(missing)}")
        return counts

    def end(self) -> None:
        """Let them finish what they have begun."""
        for child in self._children:
            child.interrupt()
        for child in self._children:
            child.end(END_S)


@contextmanager
def streams(folder: Path) -> Iterator[Streams]:
    """`Streams` that end with the block."""
    running = Streams(folder)
    try:
        yield running
    finally:
        running.end()


class Recorder:
    """A recorder process that is ready."""

    def __init__(self, bag: Path, *options: str):
        self.bag, self.lines = bag, []
        self.child = Child(["recorder", "--output", str(bag), "--regex", RECORDED, *options], self.lines.append)
        wait_until("the recorder's start", lambda: self._said(READY) or self.child.returncode is not None, START_S)

    def _said(self, text: str) -> bool:
        return any(text in line for line in self.lines)

    @property
    def size(self) -> int:
        """Bytes of the bag so far."""
        return sum(file.stat().st_size for file in self.bag.glob("*.mcap"))

    def wait_for_bytes(self, size: int) -> None:
        """Until the bag has become so large."""
        wait_until("recording", lambda: self.size > size, START_S)


@dataclass
class Recording:
    """A finished recording.

    Attributes
    ----------
    published, recorded : messages by topic.
    cpu_percent : of one core, of the recorder's process, from two seconds after its first message on.
    """

    published: Counter[str]
    recorded: Counter[str] = field(default_factory=Counter)
    cpu_percent: float = 0.0
    mb_per_s: float = 0.0
    seconds: float = 0.0
    lines: list[str] = field(default_factory=list)

    @property
    def lost(self) -> int:
        return sum((self.published - self.recorded).values())


def record(folder: Path, seconds: float, *options: str) -> Recording:
    """Record the streams from their first message to their last."""
    recorder = Recorder(folder / "bag", *options)
    with streams(folder) as source:
        recorder.wait_for_bytes(10_000_000)
        time.sleep(CPU_AFTER_S)
        began, cpu_began = time.monotonic(), cpu_s(recorder.child.pid)
        time.sleep(seconds)
        percent = 100.0 * (cpu_s(recorder.child.pid) - cpu_began) / (time.monotonic() - began)
    size = recorder.size
    recorder.child.end(END_S)
    recording = Recording(source.published, cpu_percent=percent, lines=[*source.lines, *recorder.lines])
    with BagReader(recorder.bag) as reader:
        recording.recorded.update({name: topic.message_count for name, topic in reader.topics.items()})
        recording.seconds = (reader.end_ns - reader.start_ns) * 1e-9
    recording.mb_per_s = size / 1e6 / recording.seconds
    return recording


@dataclass(frozen=True)
class Kill:
    """A recorder that was killed while messages came.

    Attributes
    ----------
    loss_s : from the last recorded message of a topic to the kill, by topic; infinite where nothing can be read.
    problem : what the reader says of the bag.
    gaps : topics of which a message is missing before the last recorded one.
    """

    loss_s: dict[str, float]
    problem: str
    gaps: tuple[str, ...]


def kill(bag: Path, seconds: float, *options: str) -> Kill:
    """Record streams that are running for so long, kill the recorder with SIGKILL, and read what it left."""
    recorder = Recorder(bag, *options)
    recorder.wait_for_bytes(10_000_000)
    time.sleep(seconds)
    killed_ns = time.time_ns()
    os.kill(recorder.child.pid, signal.SIGKILL)
    recorder.child.end(END_S)
    last_ns: dict[str, int] = {}
    stamps_ns: dict[str, list[int]] = {}
    with BagReader(bag) as reader:
        for message in reader.messages():
            last_ns[message.topic] = max(last_ns.get(message.topic, 0), message.stamp_ns)
            if message.type_name == "sensor_msgs/msg/Image":
                seconds_, nanoseconds = np.frombuffer(message.data, "<i4", 2, 4)
                stamps_ns.setdefault(message.topic, []).append(int(seconds_) * 10**9 + int(nanoseconds))
        problem = reader.problem
    gaps = [topic for topic, stamps in stamps_ns.items() if np.any(np.diff(stamps) > 1.5e9 / RATE_HZ)]
    return Kill(losses_s(last_ns, killed_ns), problem, tuple(gaps))


def losses_s(last_ns: Mapping[str, int], killed_ns: int) -> dict[str, float]:
    """By topic, of all that are published: from its last recorded message to the kill; infinite where there is none."""
    return {topic: (killed_ns - last_ns[topic]) * 1e-9 if topic in last_ns else float("inf") for topic in TOPICS}


def _result_messages() -> dict[str, Any]:
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from sensor_msgs.msg import JointState
    from tracker_msgs.msg import StateCovariance, TrackedState

    from tracker_node.model.humans.human import human_model

    names = list(human_model().chain.dof_names)
    n = len(names)
    joints = JointState(name=names[6:], position=[0.0] * (n - 6), velocity=[0.0] * (n - 6))
    state = TrackedState(dof_names=names, values=[0.0] * n, velocities=[0.0] * n, model="human")
    covariance = StateCovariance(dof_names=names, covariance=[0.0] * (n * n), velocity_covariance=[0.0] * (n * n))
    return dict(zip(RESULTS, (state, covariance, PoseWithCovarianceStamped(), joints), strict=True))


def publish_results() -> int:
    """The process that stands for a tracker: begins when each topic has a subscriber."""
    from rclpy.duration import Duration
    from rclpy.node import Node

    from tracker_node.ros.executor import ros_process, spin
    from tracker_node.ros.qos import RESULT

    messages = _result_messages()
    counts: Counter[str] = Counter()
    with ros_process([]) as stop:
        node = Node("results")
        outlets = {name: node.create_publisher(type(m), f"/tracker/{name}", RESULT) for name, m in messages.items()}

        def publish() -> None:
            for name, outlet in outlets.items():
                messages[name].header.stamp = node.get_clock().now().to_msg()
                outlet.publish(messages[name])
                counts[name] += 1

        spin(node, stop, lambda: all(outlet.get_subscription_count() for outlet in outlets.values()))
        time.sleep(SETTLE_S)
        node.create_timer(1.0 / RATE_HZ, publish)
        spin(node, stop)
        for outlet in outlets.values():
            outlet.wait_for_all_acked(Duration(seconds=5.0))
        node.destroy_node()
    for name, count in counts.items():
        print(f"/tracker/{name}: {count} published", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(publish_results())
