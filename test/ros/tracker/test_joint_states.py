"""A robot beside a tracker node: what it says goes with the image sets of its times; what cannot be used is said."""

import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image, JointState
from tracker_msgs.msg import TrackedState

from helpers.ros.held_tracker import Listening
from helpers.ros.samples import tracked_arm
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.ros import joint_states
from tracker_node.ros.conversions import image_message, message_of
from tracker_node.ros.qos import RESULT, images_published
from tracker_node.ros.tracker.image_inbox import InboxOptions
from tracker_node.ros.tracker.node import TrackerNode, TrackerOptions
from tracker_node.runs.messages.parts import header

PERIOD_NS = 33_333_333
PIXELS = np.zeros((120, 160, 3), np.uint8)


class Bench:
    def __init__(self, probe, recording):
        self.probe, self.tracker = probe, Listening()
        rig = load_rig(recording / "rig.yaml")
        self.node = TrackerNode(
            TrackerOptions(
                rig, tracked_arm(), inbox=InboxOptions(lossless=True), joint_states="/robot/joint_states",
                make_tracker=lambda *_: self.tracker,
            )
        )  # fmt: skip
        probe.add_node(self.node)
        self.states = probe.listen(TrackedState, "tracker/state")
        create = probe.node.create_publisher
        self.images = {name: create(Image, f"{name}/image_raw", images_published(50)) for name in rig.names}
        self.robot = create(JointState, "/robot/joint_states", RESULT)
        assert self.node.start()
        ends = [*self.images.values(), self.robot]
        probe.spin_until(lambda: all(end.get_subscription_count() for end in ends), "subscriptions")
        probe.until_known("tracker")

    @property
    def inbox(self) -> joint_states.JointStateInbox:
        return self.node._joint_states

    def say(self, stamp_ns: int, names=("elbow_flexion", "gripper"), positions=(0.5, 0.0)) -> None:
        n = self.inbox.received
        content = {"header": header(stamp_ns, ""), "name": list(names), "position": list(positions)}
        self.robot.publish(message_of(JointState, content))
        self.probe.spin_until(lambda: self.inbox.received > n, "arrival")

    def send(self, i: int) -> None:
        for publisher in self.images.values():
            publisher.publish(image_message(i * PERIOD_NS, "f", PIXELS))

    def track(self, i: int) -> dict[str, float]:
        """Send an image set; what the tracker was told beside it."""
        n = len(self.states)
        self.send(i)
        self.probe.spin_until(lambda: len(self.states) > n, "a state")
        return dict(self.tracker.sets[-1].joint_positions)

    @property
    def said(self) -> DiagnosticStatus:
        return self.probe.diagnostics.get("tracker: joint_states", DiagnosticStatus())


@pytest.fixture
def bench(probe, recording, monkeypatch):
    monkeypatch.setattr(joint_states, "_PATIENCE_S", 0.0)
    made = Bench(probe, recording)
    yield made
    made.node.close()
    made.node.destroy_node()


def test_what_is_said_goes_with_the_sets_of_its_times(bench):
    bench.say(0, positions=(0.5, 0.0))
    bench.say(PERIOD_NS, positions=(0.6, 0.0))
    assert bench.track(0) == {"elbow_flexion": 0.5} and bench.track(1) == {"elbow_flexion": 0.6}
    assert bench.track(2) == pytest.approx({"elbow_flexion": 0.7}) and bench.track(20) == {}
    bench.probe.spin_until(lambda: b"".join([bench.said.level]) == b"\0" and "used" in bench.said.message, "a report")
    values = {entry.key: entry.value for entry in bench.said.values}
    assert (values["received"], values["used"], values["without"]) == ("2", "3", "1")


def test_a_lossless_tracker_waits_for_it(bench, monkeypatch):
    bench.say(0)
    monkeypatch.setattr(joint_states, "_PATIENCE_S", 20.0)
    bench.send(1)
    until_s = time.monotonic() + 0.3
    bench.probe.spin_until(lambda: time.monotonic() > until_s)
    assert not bench.tracker.sets
    bench.say(2 * PERIOD_NS, positions=(0.7, 0.0))
    bench.probe.spin_until(lambda: len(bench.tracker.sets) == 1, "a state")
    assert dict(bench.tracker.sets[0].joint_positions) == pytest.approx({"elbow_flexion": 0.6})


def test_colors_alone_are_refused_beside_it(bench):
    said = bench.node.set_parameters([Parameter("modalities", value=["chamfer"])])
    assert said[0].successful
    said = bench.node.set_parameters([Parameter("modalities", value=["color"])])
    assert not said[0].successful and "joint states take contours" in said[0].reason


def test_what_cannot_be_used_is_refused_and_said(bench):
    bench.say(0, names=("knee",), positions=(0.5,))
    assert bench.track(0) == {} and bench.inbox.refused == 1
    bench.probe.spin_until(lambda: "expected positions of 'shoulder_x'" in bench.said.message, "a warning")
    assert bench.said.level == DiagnosticStatus.WARN
    bench.say(PERIOD_NS)
    assert bench.track(1) == {"elbow_flexion": 0.5}
    bench.probe.spin_until(lambda: bench.said.level == DiagnosticStatus.OK, "the end of it")


def test_positions_in_degrees_are_refused_as_those_of_a_file_are(bench):
    bench.say(0, positions=(80.0, 0.0))
    assert bench.track(0) == {} and bench.inbox.refused == 1
    bench.probe.spin_until(lambda: "got 80: degrees?" in bench.said.message, "a warning")
    assert "elbow_flexion: expected rad between the joint's limits" in bench.said.message
    assert bench.said.level == DiagnosticStatus.WARN


def test_stamps_of_another_clock_are_told_and_not_waited_for_again_and_again(bench, monkeypatch):
    monkeypatch.setattr(joint_states, "_UNUSED_SETS", 3)
    monkeypatch.setattr(joint_states, "_PATIENCE_S", 0.2)
    began = 3000  # image sets: 100 s
    bench.say(0)
    for i in range(4):
        assert bench.track(began + i) == {}
        bench.say(i * PERIOD_NS)
    assert not bench.inbox._patient
    bench.probe.spin_until(lambda: "none at the time of the last" in bench.said.message, "a warning")
    assert bench.said.level == DiagnosticStatus.WARN and "are both of one clock?" in bench.said.message
    bench.say((began + 4) * PERIOD_NS)
    assert bench.track(began + 4) == {"elbow_flexion": 0.5} and bench.inbox._patient
