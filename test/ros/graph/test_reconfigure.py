"""Parameters of a running tracker: the new tracker is made while images are received and tracked."""

import threading

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image
from tracker_msgs.msg import TrackedState

from helpers.ros.held_tracker import HeldTracker
from helpers.ros.samples import tracked_arm
from tracker_node.errors import ModelError, TrackerError
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.ros.conversions import image_message
from tracker_node.ros.qos import images_published
from tracker_node.ros.tracker.image_inbox import InboxOptions
from tracker_node.ros.tracker.node import TrackerNode
from tracker_node.ros.tracker.setup import SetupBuilder, TrackerOptions, TrackingSetup
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.warm_up import SmallTrackers

TIMEOUT_S = 60.0


class SlowMaker:
    """Makes the first tracker at once, each of the others when it may; one may be impossible."""

    def __init__(self) -> None:
        self.may, self.asked = threading.Event(), threading.Semaphore(0)
        self.made: list[HeldTracker] = []
        self.problem: Exception | None = None

    def __call__(self, *_) -> HeldTracker:
        if self.made:
            self.asked.release()
            assert self.may.wait(TIMEOUT_S), "the event loop is held up by the making of a tracker"
            if self.problem is not None:
                raise self.problem
        self.made.append(HeldTracker())
        self.made[-1].go.set()
        return self.made[-1]


class Bench:
    def __init__(self, probe, recording) -> None:
        self.probe, self.maker, self.number = probe, SlowMaker(), 0
        rig = load_rig(recording / "rig.yaml")
        options = TrackerOptions(rig, tracked_arm(), inbox=InboxOptions(lossless=True), make_tracker=self.maker)
        self.node = TrackerNode(options)
        probe.add_node(self.node)
        self.states = probe.listen(TrackedState, "tracker/state")
        create = probe.node.create_publisher
        self.cameras = {name: create(Image, f"{name}/image_raw", images_published(50)) for name in rig.names}
        assert self.node.start()
        probe.spin_until(lambda: all(c.get_subscription_count() for c in self.cameras.values()), "subscriptions")

    def set(self, name: str, value) -> bool:
        return self.node.set_parameters([Parameter(name, value=value)])[0].successful

    def track(self, *cameras: str) -> None:
        """One image set of these cameras, or of all, and its state."""
        before = len(self.states)
        for name in cameras or self.cameras:
            self.cameras[name].publish(image_message(self.number * 33_000_000, "f", np.zeros((120, 160, 3), np.uint8)))
        self.number += 1
        self.probe.spin_until(lambda: len(self.states) == before + 1, "a state")

    def said(self) -> tuple[bytes, str]:
        status = self.probe.diagnostics.get("tracker: parameters")
        return (b"", "") if status is None else (status.level, status.message)


@pytest.fixture
def bench(probe, recording):
    bench = Bench(probe, recording)
    yield bench
    bench.maker.may.set()
    bench.node.close()
    bench.node.destroy_node()


def test_images_are_received_and_tracked_while_the_new_tracker_is_made(bench):
    bench.track()
    assert bench.set("region.robust_sigmas", 2.0)
    assert bench.maker.asked.acquire(timeout=TIMEOUT_S)
    for _ in range(3):
        bench.track()
    bench.probe.spin_until(lambda: "prepared" in bench.said()[1], "that it is being prepared")
    assert len(bench.maker.made) == 1
    bench.maker.may.set()
    bench.probe.spin_until(lambda: bench.said() == (DiagnosticStatus.OK, "in effect"), "in effect")
    bench.track()
    assert len(bench.maker.made) == 2


def test_cameras_are_left_when_the_tracker_of_the_others_is_there(bench):
    bench.track()
    assert bench.set("cameras", ["cam1", "cam3"])
    assert bench.maker.asked.acquire(timeout=TIMEOUT_S)
    bench.track()  # of all three, as before
    bench.maker.may.set()
    bench.probe.spin_until(lambda: not bench.cameras["cam2"].get_subscription_count(), "nobody listens to cam2")
    bench.track("cam1", "cam3")


def test_what_cannot_be_made_after_all_is_said_and_the_old_tracker_goes_on(bench):
    bench.track()
    bench.maker.problem = ModelError("too many arms")
    bench.maker.may.set()
    assert bench.set("region.robust_sigmas", 2.0)
    bench.probe.spin_until(lambda: bench.said()[0] == DiagnosticStatus.ERROR, "said so")
    assert "too many arms" in bench.said()[1] and "goes on" in bench.said()[1]
    bench.track()


def test_the_newest_request_wins_and_details_of_mistakes_are_kept():
    may, begun, details = threading.Event(), threading.Event(), []
    first, second = (TrackingSetup(TrackerConfig(), (name,)) for name in ("cam1", "cam2"))
    builder = SetupBuilder(details.append)

    def slow() -> TrackingSetup:
        begun.set()
        assert may.wait(TIMEOUT_S)
        return first

    builder.ask(slow)
    assert begun.wait(TIMEOUT_S) and builder.taken() is None and builder.busy
    builder.ask(lambda: second)
    may.set()
    builder.wait()
    assert builder.taken() is second and builder.taken() is None and not builder.busy
    builder.ask(lambda: {}["nothing"])  # type: ignore[call-overload]
    builder.wait()
    with pytest.raises(TrackerError, match="KeyError: 'nothing'"):
        builder.taken()
    assert "Traceback" in details[0]
    builder.ask(lambda: first)
    builder.forget()
    builder.wait()
    assert builder.taken() is None


def test_a_small_tracker_says_what_does_not_suit(recording):
    from dataclasses import replace

    rig, config = load_rig(recording / "rig.yaml"), TrackerConfig()
    small = SmallTrackers(rig, tracked_arm(), rig.names[:1])
    for modalities in (("region",), ("color",), ("color", "region")):
        for combination in ("joint", "sequential"):
            small.check(rig.names, replace(config, modalities=modalities, combination=combination))
    affine = replace(config, modalities=("texture",))
    with pytest.raises(ModelError, match="no box with a texture"):
        small.check(rig.names, affine)
    scene = replace(config, modalities=("color_over_background",))
    with pytest.raises(ModelError, match="background"):
        small.check(rig.names[1:], scene)
