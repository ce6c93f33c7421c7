"""The detector node over a real graph: which images it works on, where it searches, what it says; its detector is not real."""

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import Image
from tracker_msgs.msg import Crops, Keypoints

from helpers.ros.graph import stamps
from tracker_node.cli.main import parser_of
from tracker_node.cli.nodes import keypoints as command
from tracker_node.observation.keypoints.blazepose import NAMES
from tracker_node.observation.keypoints.crop import Crop
from tracker_node.observation.keypoints.people import Person
from tracker_node.ros.conversions import image_message, message_of
from tracker_node.ros.keypoints.node import KeypointsNode, KeypointsOptions
from tracker_node.ros.qos import images_published
from tracker_node.runs.messages import crops
from tracker_node.runs.messages.people import detected_people

CAMERAS = {"cam1": "cam1_optical_frame", "cam2": "cam2_optical_frame"}
PERIOD_NS = 33_333_333


class FakeDetector:
    """Finds one person, whose points are at the value of the first pixel; not in crops that are too small for anybody."""

    def __init__(self):
        self.searched: list[tuple] = []
        self.go, self.fails = threading.Event(), False
        self.go.set()

    def detect(self, image, expected=()):
        assert self.go.wait(30.0)
        self.searched.append(tuple(expected))
        if self.fails:
            raise RuntimeError("no good")
        if expected and expected[0].size < 10.0:
            return ()
        pixels = np.full((len(NAMES), 2), float(image[0, 0, 0]))
        return (Person(NAMES, pixels, np.tile(np.eye(2), (len(NAMES), 1, 1)), np.ones(len(NAMES)), 0.9, (0.0, 0.0, 9.0, 9.0)),)


class Bench:
    def __init__(self, probe, **changes):
        self.probe, self.detector = probe, FakeDetector()
        self.node = KeypointsNode(KeypointsOptions(CAMERAS, lambda: self.detector, "fake", **changes))
        probe.add_node(self.node)
        create = probe.node.create_publisher
        self.images = {name: create(Image, f"{name}/image_raw", images_published(50)) for name in CAMERAS}
        self.crops = create(Crops, "tracker/crops", 10)
        self.points = {name: probe.listen(Keypoints, f"{name}/keypoints") for name in CAMERAS}
        ends = [*self.images.values(), self.crops]
        probe.spin_until(lambda: all(end.get_subscription_count() for end in ends), "subscriptions of the node")
        heard = [*self.node._points_of.values()]
        probe.spin_until(lambda: all(each.get_subscription_count() for each in heard), "our subscriptions")
        probe.until_known("keypoints")

    def send(self, i: int) -> None:
        for publisher in self.images.values():
            publisher.publish(image_message(i * PERIOD_NS, "f", np.full((48, 64, 3), i, np.uint8)))

    def sets(self, n: int) -> None:
        self.probe.spin_until(lambda: self.node._sets.formed == n, f"{n} image sets")

    def part(self, name: str = "detector") -> DiagnosticStatus:
        return self.probe.diagnostics.get(f"keypoints: {name}", DiagnosticStatus())

    def close(self) -> None:
        self.detector.go.set()
        self.node.close()
        self.node.destroy_node()


@pytest.fixture
def build(probe) -> Iterator:
    benches = []

    def make(**changes) -> Bench:
        benches.append(Bench(probe, **changes))
        return benches[-1]

    yield make
    for bench in benches:
        bench.close()


def test_each_camera_has_its_points_with_the_stamp_of_the_image(build, probe):
    bench = build()
    bench.send(7)
    probe.spin_until(lambda: all(bench.points.values()), "points of both cameras")
    for camera, (message,) in bench.points.items():
        assert (message.camera, message.header.frame_id, message.detector) == (camera, CAMERAS[camera], "fake")
        (person,) = detected_people(message).people
        assert person.names == NAMES and (person.pixels == 7.0).all()
    assert stamps(bench.points["cam1"]) == stamps(bench.points["cam2"]) == [7 * PERIOD_NS]


def test_images_are_asked_for_when_the_networks_are_loaded(probe):
    """A source that waits for its subscribers would have sent half of a recording by then."""
    loaded, detector = threading.Event(), FakeDetector()

    def load() -> FakeDetector:
        assert loaded.wait(30.0)
        return detector

    node = KeypointsNode(KeypointsOptions(CAMERAS, load, "fake"))
    try:
        probe.add_node(node)
        images = probe.node.create_publisher(Image, "cam1/image_raw", images_published(50))
        probe.until_known("keypoints")
        later = time.monotonic() + 1.0
        probe.spin_until(lambda: time.monotonic() > later)
        assert images.get_subscription_count() == 0
        loaded.set()
        probe.spin_until(lambda: images.get_subscription_count() == 1, "the subscription to images")
    finally:
        loaded.set()
        node.close()
        node.destroy_node()


def test_the_newest_set_wins_and_the_others_are_counted(build, probe):
    bench = build()
    bench.detector.go.clear()
    bench.send(1)
    bench.sets(1)
    time.sleep(0.3)  # it is at work on that
    for i in range(2, 7):
        bench.send(i)
        bench.sets(i)
    bench.detector.go.set()
    probe.spin_until(lambda: len(bench.points["cam1"]) == 2, "points of two sets")
    assert stamps(bench.points["cam1"]) == [PERIOD_NS, 6 * PERIOD_NS]
    assert bench.node._sets.dropped == 4


def test_where_it_is_lossless_no_set_is_left_out(build, probe):
    bench = build(lossless=True)
    bench.detector.go.clear()
    for i in range(1, 7):
        bench.send(i)
        bench.sets(i)
    bench.detector.go.set()
    probe.spin_until(lambda: len(bench.points["cam1"]) == 6, "points of all sets")
    assert stamps(bench.points["cam1"]) == [i * PERIOD_NS for i in range(1, 7)]
    assert bench.node._sets.dropped == 0


def test_no_set_is_looked_at_before_all_subscribers_that_are_waited_for_are_there(build, probe):
    bench = build(lossless=True, wait_for_subscribers=2)
    for i in range(1, 4):
        bench.send(i)
        bench.sets(i)
    probe.spin_until(lambda: bench.part().message == "waiting for subscribers", "a report")
    assert not bench.detector.searched
    for name in CAMERAS:
        probe.listen(Keypoints, f"{name}/keypoints")  # into the same lists
    heard = list(bench.points.values())
    probe.spin_until(lambda: all(len(each) == 6 for each in heard), "points of all sets for everybody")
    assert all(sorted(stamps(each)) == sorted([i * PERIOD_NS for i in (1, 2, 3)] * 2) for each in heard)
    assert bench.node._sets.dropped == 0


def test_it_searches_around_the_body_and_elsewhere_where_nobody_is_there(build, probe):
    bench, near, empty = build(), Crop((20.0, 30.0), 40.0, 0.1), Crop((1.0, 1.0), 5.0)
    bench.crops.publish(message_of(Crops, crops(3 * PERIOD_NS, "world", ("cam1", "cam2"), (near, empty))))
    probe.spin_until(lambda: bench.node._crops["tracker"][1] == {"cam1": near, "cam2": empty}, "crops")
    bench.send(4)
    probe.spin_until(lambda: all(bench.points.values()), "points")
    assert bench.detector.searched == [(near,), (empty,), ()]


@pytest.mark.parametrize("squares, at", [((None, None), 3), ((Crop((9.0, 9.0), 40.0),) * 2, 30)])
def test_whole_images_are_searched_for_a_body_that_is_not_known_or_was_seen_long_ago(build, probe, squares, at):
    bench = build()
    bench.crops.publish(message_of(Crops, crops(3 * PERIOD_NS, "world", ("cam1", "cam2"), squares)))
    probe.spin_until(lambda: bench.node._crops["tracker"][0] > 0, "crops")
    bench.send(at)
    probe.spin_until(lambda: all(bench.points.values()), "points")
    assert bench.detector.searched == [(), ()]


@pytest.mark.parametrize(("given", "followed", "joining"), [
    ([], ("tracker",), ()),
    (["--joining", "tracker/person_1", "tracker/person_2"], (), ("tracker/person_1", "tracker/person_2")),
    (["--joining", "tracker/person_1", "--tracker", "tracker/anna"], ("tracker/anna",), ("tracker/person_1",)),
    (["--tracker"], (), ()),
    (["--tracker", ""], (), ()),
])  # fmt: skip
def test_the_usual_tracker_is_not_waited_for_where_people_join(given, followed, joining):
    args = parser_of("keypoints", command).parse_args(["--rig", "rig.yaml", *given])
    assert command.followed(args) == followed and tuple(args.joining) == joining


def test_crops_of_those_who_have_joined_are_searched(build, probe):
    bench, near = build(trackers=(), joining=("tracker", "elsewhere")), Crop((20.0, 30.0), 40.0, 0.1)
    bench.send(3)  # whole images, for who has come in
    probe.spin_until(lambda: len(bench.detector.searched) == 2, "the first images")
    bench.crops.publish(message_of(Crops, crops(4 * PERIOD_NS, "world", ("cam1", "cam2"), (near, near))))
    probe.spin_until(lambda: bench.node._crops["tracker"][0] > 0, "crops")
    bench.send(4)
    probe.spin_until(lambda: len(bench.detector.searched) == 4, "the next images")
    assert bench.detector.searched == [(), (), (near,), (near,)]


def test_what_the_detector_raises_ends_nothing(build, probe):
    bench = build()
    bench.detector.fails = True
    bench.send(1)
    probe.spin_until(lambda: "no good" in bench.part().message, "a report")
    assert bench.part().level == DiagnosticStatus.WARN
    bench.detector.fails = False
    bench.send(2)
    probe.spin_until(lambda: all(bench.points.values()), "points all the same")
    probe.spin_until(lambda: bench.part().message == "detecting", "recovery")


def test_images_that_cannot_be_used_are_named(build, probe):
    bench = build()
    wrong = image_message(PERIOD_NS, "f", np.zeros((48, 64, 3), np.uint8))
    wrong.encoding = "32FC7"
    bench.images["cam2"].publish(wrong)
    probe.spin_until(lambda: bench.part().level == DiagnosticStatus.ERROR, "a report")
    assert "cam2" in bench.part().message and "32FC7" in bench.part().message


def test_the_rate_is_limited(build, probe):
    bench = build(rate_hz=2.0)
    began_s = time.monotonic()
    for i in range(1, 60):
        bench.send(i)
        until_s = time.monotonic() + 0.03
        probe.spin_until(lambda t=until_s: time.monotonic() > t, "time goes on")
    assert len(bench.points["cam1"]) <= 2.0 * (time.monotonic() - began_s) + 1


def test_a_detector_that_cannot_be_made_is_told(probe):
    def fail():
        raise ValueError("not a model")

    node = KeypointsNode(KeypointsOptions(CAMERAS, fail))
    try:
        assert node.worker.ready.wait(10.0)
        assert str(node.fatal) == "not a model"
        node.report()
    finally:
        node.close()
        node.destroy_node()
