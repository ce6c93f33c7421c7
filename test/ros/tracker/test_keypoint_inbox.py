"""Points on their way into a tracker node: used in time or late, listed in its states, refused by name; the tracker is held."""

import time
from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image
from tracker_msgs.msg import Crops, Keypoints, TrackedState

from helpers.ros.held_tracker import Listening
from helpers.ros.samples import tracked_arm
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.observation.image_set import CameraImage
from tracker_node.observation.keypoints.blazepose import NAMES
from tracker_node.observation.keypoints.people import Person
from tracker_node.ros.conversions import image_message, message_of, stamp_ns_of
from tracker_node.ros.qos import RESULT, images_published
from tracker_node.ros.tracker import keypoint_inbox
from tracker_node.ros.tracker.image_inbox import InboxOptions
from tracker_node.ros.tracker.node import TrackerNode, TrackerOptions
from tracker_node.runs.messages import crops_in, keypoints
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status

PERIOD_NS = 33_333_333
PIXELS = np.zeros((120, 160, 3), np.uint8)


class Bench:
    def __init__(self, probe, recording, modalities=("region", "keypoints")):
        self.probe, self.tracker = probe, Listening()
        rig = load_rig(recording / "rig.yaml")
        self.node = TrackerNode(
            TrackerOptions(
                rig, tracked_arm(), TrackerConfig(modalities=modalities), inbox=InboxOptions(lossless=True),
                make_tracker=lambda *_: self.tracker,
            )
        )  # fmt: skip
        probe.add_node(self.node)
        self.states = probe.listen(TrackedState, "tracker/state")
        create = probe.node.create_publisher
        self.images = {name: create(Image, f"{name}/image_raw", images_published(50)) for name in rig.names}
        self.points = {name: create(Keypoints, f"{name}/keypoints", RESULT) for name in rig.names}
        assert self.node.start()
        ends = [*self.images.values(), *(self.points.values() if "keypoints" in modalities else ())]
        probe.spin_until(lambda: all(end.get_subscription_count() for end in ends), "subscriptions")
        probe.until_known("tracker")

    def send(self, i: int) -> None:
        for publisher in self.images.values():
            publisher.publish(image_message(i * PERIOD_NS, "f", PIXELS))

    def track(self, i: int) -> TrackedState:
        """Send an image set; its state."""
        n = len(self.states)
        self.send(i)
        self.probe.spin_until(lambda: len(self.states) > n, "a state")
        return self.states[-1]

    def put(self, i: float, cameras=("cam1", "cam2", "cam3"), **changes) -> None:
        """Send points, until the node has them."""
        inbox = self.node._keypoints
        for camera in cameras:
            n = inbox.received[camera]
            message = points(camera, round(i * PERIOD_NS))
            for name, value in changes.items():
                setattr(message, name, value)
            self.points[camera].publish(message)
            self.probe.spin_until(lambda n=n, c=camera: inbox.received[c] > n, "arrival")

    @property
    def said(self) -> DiagnosticStatus:
        return self.probe.diagnostics.get("tracker: keypoints", DiagnosticStatus())

    def close(self) -> None:
        self.node.close()
        self.node.destroy_node()


def points(camera: str, stamp_ns: int, n_people: int = 1) -> Keypoints:
    n = len(NAMES)
    person = Person(NAMES, np.full((n, 2), 9.0), np.tile(np.eye(2), (n, 1, 1)), np.ones(n), 0.9, (0.0, 0.0, 20.0, 20.0))
    return message_of(Keypoints, keypoints(CameraImage(camera, stamp_ns, PIXELS, people=(person,) * n_people), "f"))


@pytest.fixture
def build(probe, recording, monkeypatch):
    monkeypatch.setattr(keypoint_inbox, "_PATIENCE_S", 0.0)
    benches = []

    def make(*arguments) -> Bench:
        benches.append(Bench(probe, recording, *arguments))
        return benches[-1]

    yield make
    for bench in benches:
        bench.close()


def used(state: TrackedState) -> dict[str, int]:
    """Camera -> which image the points were found in."""
    stamps = [stamp_ns_of(stamp) // PERIOD_NS for stamp in state.keypoint_stamps]
    return dict(zip(state.keypoint_cameras, stamps, strict=True))


def test_points_in_time_go_with_their_set_and_late_ones_with_the_next(build):
    bench = build()
    bench.put(5)
    assert used(bench.track(5)) == {"cam1": 5, "cam2": 5, "cam3": 5}
    assert all(image.people is not None and image.people_stamp_ns is None for image in bench.tracker.sets[-1].images)
    assert used(bench.track(6)) == {}
    bench.put(6, ["cam2"])
    assert used(bench.track(7)) == {"cam2": 6}
    late = bench.tracker.sets[-1].get("cam2")
    assert late.people_stamp_ns == 6 * PERIOD_NS and (late.people[0].pixels == 9.0).all()


def test_points_are_waited_for_where_every_set_is_tracked(build, monkeypatch):
    bench = build()
    monkeypatch.setattr(keypoint_inbox, "_PATIENCE_S", 20.0)
    bench.send(5)
    bench.put(5, ["cam1", "cam2"])
    until_s = time.monotonic() + 0.3
    bench.probe.spin_until(lambda: time.monotonic() > until_s)
    assert not bench.states
    bench.put(5, ["cam3"])
    bench.probe.spin_until(lambda: bench.states, "a state")
    assert used(bench.states[0]) == {"cam1": 5, "cam2": 5, "cam3": 5}


def test_points_of_images_that_wait_for_a_lossless_tracker_wait_too(build):
    """It is four seconds behind the cameras, and the detector is not."""
    bench, n = build(), 120
    bench.tracker.go.clear()
    for i in range(1, n + 1):
        bench.send(i)
        bench.put(i)
        bench.probe.spin_until(lambda i=i: set(bench.node._inbox.arrived.values()) == {i}, "images")
    bench.tracker.go.set()
    bench.probe.spin_until(lambda: len(bench.states) == n, "states")
    assert [used(state) for state in bench.states[1:]] == [{"cam1": i, "cam2": i, "cam3": i} for i in range(2, n + 1)]
    assert not bench.node._keypoints.matching.problems()


def test_what_became_of_points_is_counted(build, probe):
    bench = build()
    bench.track(1)
    bench.put(1, ["cam1"])
    bench.put(500, ["cam2"])
    bench.track(2)
    probe.spin_until(lambda: bench.said.level == DiagnosticStatus.WARN, "a report")
    assert "camera 'cam2': points at 16666666500 ns match no image" in bench.said.message
    values = {value.key: value.value for value in bench.said.values}
    assert (values["received"], values["late"], values["unmatched"], values["refused"]) == ("2", "1", "1", "0")


def test_five_hundred_people_and_points_that_are_not_finite_do_no_harm(build):
    bench = build()
    bench.put(1, persons=points("cam1", 0, 500).persons)
    people = points("cam1", 0).persons
    people[0].u[4] = float("nan")
    bench.put(2, persons=people)
    assert used(bench.track(1)) == {"cam1": 1, "cam2": 1, "cam3": 1}
    assert len(bench.tracker.sets[-1].get("cam1").people) == 16
    bench.track(2)
    (person,) = bench.tracker.sets[-1].get("cam1").people
    assert np.isfinite(person.pixels).all() and np.flatnonzero(person.scores == 0.0).tolist() == [4]


REFUSED = {
    "another camera's": ({"camera": "cam9"}, "cam9"),
    "names that nobody knows": ({"names": [f"p{i}" for i in range(len(NAMES))]}, "no point has a name"),
    "too few names": ({"names": list(NAMES[1:])}, "32"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_messages_that_cannot_be_used_are_refused_by_name(build, probe, kind):
    changes, said = REFUSED[kind]
    bench = build()
    bench.put(1, ["cam1"], **changes)
    probe.spin_until(lambda: bench.said.level == DiagnosticStatus.WARN, "a report")
    assert "cam1" in bench.said.message and said in bench.said.message
    assert used(bench.track(1)) == {}
    bench.put(1, ["cam1"])
    probe.spin_until(lambda: bench.said.level == DiagnosticStatus.OK, "recovery")
    assert used(bench.track(2)) == {"cam1": 1}


def test_huge_messages_are_refused_before_they_are_read(build, probe, monkeypatch):
    monkeypatch.setattr(keypoint_inbox, "MOST_BYTES", 1000)
    bench = build()
    bench.put(1, ["cam1"])
    probe.spin_until(lambda: "expected at most 1000 bytes" in bench.said.message, "a report")
    assert used(bench.track(1)) == {}


def test_points_are_listened_to_only_where_they_are_among_the_modalities(build, probe):
    bench = build(("region",))
    assert not any(publisher.get_subscription_count() for publisher in bench.points.values())
    said = "published, and not in use: modalities has no keypoints"
    probe.spin_until(lambda: bench.said.message == said, "that points are not in use")
    (result,) = bench.node.set_parameters([Parameter("modalities", value=["region", "keypoints"])])
    assert result.successful, result.reason
    probe.spin_until(lambda: all(p.get_subscription_count() for p in bench.points.values()), "subscriptions")
    bench.track(1)
    bench.put(1)
    assert used(bench.track(2)) == {"cam1": 1, "cam2": 1, "cam3": 1}


def test_crops_are_where_the_body_is_and_nowhere_while_it_is_lost(build, probe):
    bench = build()
    crops = probe.listen(Crops, "tracker/crops")
    probe.spin_until(lambda: bench.node._outputs[""].subscriber_count("crops") > 0, "our subscription")
    bench.tracker.status = Status.TRACKING
    bench.track(1)
    bench.tracker.status = Status.LOST
    bench.track(2)
    probe.spin_until(lambda: len(crops) == 2, "crops")
    assert crops[0].cameras == ["cam1", "cam2", "cam3"] and crops_in(crops[1]) == {}
    for square in crops_in(crops[0]).values():
        assert square.size > 0.0


def test_a_jump_back_of_stamps_begins_anew(build):
    bench = build()
    for i in (100, 101):
        bench.track(i)
    bench.put(101)
    bench.track(1)
    assert used(bench.states[-1]) == {}
    bench.put(1)
    assert used(bench.track(2)) == {"cam1": 1, "cam2": 1, "cam3": 1}
    assert replace(bench.tracker.sets[-1].images[0], people=None).people_stamp_ns == PERIOD_NS


def test_points_that_cannot_be_used_are_said_to_be(build):
    bench = build()
    bench.track(0)
    person = points("cam1", 0).persons[0]
    person.covariance_uu = [-1.0] * len(NAMES)
    bench.put(0, persons=[person])
    bench.node._keypoints.report(())
    bench.probe.spin_until(lambda: bench.said.level == DiagnosticStatus.WARN, "a warning")
    assert bench.said.message.startswith("camera 'cam1': keypoints: no point can be used: expected")
    assert not bench.node._keypoints.refused
    bench.put(1)
    bench.node._keypoints.report(())
    bench.probe.spin_until(lambda: bench.said.level == DiagnosticStatus.OK, "no warning")


def test_points_that_come_and_are_never_used_are_said_to_be_and_why(build, monkeypatch):
    """Their stamps stay 0: the first matches no image, and the others are of an image that had some."""
    monkeypatch.setattr(keypoint_inbox, "_SILENT_S", 0.4)
    bench = build()
    for i in range(100, 600):
        bench.put(0)
        bench.track(i)
        bench.node._keypoints.report(())
        if bench.said.message.startswith("points come, but none was used"):
            break
    assert bench.said.level == DiagnosticStatus.WARN and "their stamps do not change" in bench.said.message
    for i in range(600, 603):
        bench.put(i)
        assert used(bench.track(i))
    bench.node._keypoints.report(())
    bench.probe.spin_until(lambda: bench.said.level == DiagnosticStatus.OK, "no warning")


def test_people_without_any_point_are_told_when_it_lasts(build, monkeypatch):
    monkeypatch.setattr(keypoint_inbox, "_SILENT_S", 0.4)
    bench = build()
    person = points("cam1", 0).persons[0]
    person.scores = [0.0] * len(NAMES)
    for i in range(1, 500):
        bench.put(i, persons=[person])
        bench.track(i)
        bench.node._keypoints.report(())
        if bench.said.level == DiagnosticStatus.WARN:
            break
    assert bench.said.message.startswith("people come without a point that was found")
    assert i > 1 and not bench.node._keypoints.refused
