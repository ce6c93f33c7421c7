"""What the worker does when the tracker is slow or fails; the tracker here is one that a test can hold and break."""

import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import Image, JointState
from std_srvs.srv import SetBool, Trigger
from tracker_msgs.msg import StateCovariance, TrackedState
from tracker_msgs.srv import SetState

from helpers.ros.graph import TIMEOUT_S, stamps
from helpers.ros.held_tracker import HeldTracker
from helpers.ros.samples import some_state, tracked_arm
from tracker_node.camera.model import CameraModel
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import State
from tracker_node.ros.conversions import camera_info_message, image_message
from tracker_node.ros.qos import images_published
from tracker_node.ros.tracker.image_inbox import MOST_BYTES, InboxOptions, Received
from tracker_node.ros.tracker.node import TrackerNode, TrackerOptions
from tracker_node.tracking.config import SynchronizerConfig, TrackerConfig
from tracker_node.tracking.estimate import Status


class Bench:
    """A node with a `HeldTracker`, and publishers of its cameras' images."""

    def __init__(self, probe, recording, lossless, most_bytes=MOST_BYTES, **changes):
        self.probe, self.tracker = probe, HeldTracker()
        rig = load_rig(recording / "rig.yaml")
        inbox = InboxOptions(lossless=lossless, capacity=6, most_bytes=most_bytes)
        options = TrackerOptions(rig, tracked_arm(), inbox=inbox, make_tracker=lambda *_: self.tracker, **changes)
        self.node = TrackerNode(options)
        probe.add_node(self.node)
        self.states, self._reports = probe.listen(TrackedState, "tracker/state"), probe.listen(DiagnosticArray, "/diagnostics")
        create = probe.node.create_publisher
        self.cameras = [create(Image, f"{name}/image_raw", images_published(50)) for name in rig.names]
        assert self.node.start()
        probe.spin_until(lambda: all(c.get_subscription_count() for c in self.cameras), "subscriptions")

    def send(self, i: int, first_ns: int = 0) -> None:
        """One image set, until the node has all of it."""
        before = dict(self.node._inbox.last_arrival_s)
        for camera in self.cameras:
            camera.publish(image_message(first_ns + i * 33_000_000, "f", np.full((120, 160, 3), i % 256, np.uint8)))
        arrival = self.node._inbox.last_arrival_s
        self.probe.spin_until(lambda: len(arrival) == 3 and all(arrival[c] != before.get(c) for c in arrival), "arrival")

    def said(self, part: str) -> list[tuple[bytes, str]]:
        """Level and message of every report on a part so far."""
        return [(s.level, s.message) for array in self._reports for s in array.status if s.name == f"tracker: {part}"]

    def change_parameters(self, scale: float) -> None:
        """A new tracker is made; it is this one again."""
        (result,) = self.node.set_parameters([Parameter("region.robust_sigmas", value=scale)])
        assert result.successful
        self.probe.spin_until(lambda: not self.node._builder.busy, "the new tracker")

    def enable(self, enabled: bool) -> None:
        assert self.probe.ask(SetBool, "tracker/enable", SetBool.Request(data=enabled)).success

    def put(self, **values: float) -> None:
        request = SetState.Request(dof_names=list(values), values=list(values.values()))
        assert self.probe.ask(SetState, "tracker/set_state", request).success

    def close(self):
        self.tracker.go.set()
        self.node.close()
        self.node.destroy_node()


@pytest.fixture(autouse=True)
def _four_at_once(monkeypatch):
    monkeypatch.setattr("tracker_node.ros.tracker.worker._AT_ONCE_MS", 0.0)  # as of a tracker that has no time to spare


@pytest.fixture
def build(probe, recording):
    benches = []

    def make(lossless: bool, **changes) -> Bench:
        benches.append(Bench(probe, recording, lossless, **changes))
        return benches[-1]

    yield make
    for bench in benches:
        bench.close()


def test_the_newest_four_sets_win_and_the_others_are_counted(probe, build):
    bench = build(lossless=False)
    bench.send(0)
    probe.spin_until(bench.tracker.stepping.is_set, "the first step")
    for i in range(1, 7):
        bench.send(i)
    bench.tracker.go.set()
    probe.spin_until(lambda: len(bench.states) == 5, "five states")
    assert stamps(bench.states) == [i * 33_000_000 for i in (0, 3, 4, 5, 6)]
    assert bench.node.skipped == 2


def test_waiting_images_are_bounded_and_the_loss_is_counted(probe, build):
    bench = build(lossless=False)
    bench.send(0)
    probe.spin_until(bench.tracker.stepping.is_set, "the first step")
    for i in range(1, 13):  # six more than may wait
        bench.send(i)
    bench.node.report()
    bench.tracker.go.set()
    probe.spin_until(lambda: len(bench.states) == 5, "five states")
    assert stamps(bench.states)[-1] == 12 * 33_000_000
    assert bench.node._inbox.overflowed == {"cam1": 6, "cam2": 6, "cam3": 6} and bench.node.skipped == 2
    said = bench.said("cam2")
    assert any(level == DiagnosticStatus.WARN and "images are lost (overflowed" in message for level, message in said)


def test_lossless_tracks_every_set_in_order(probe, build):
    bench = build(lossless=True)
    for i in range(8):
        bench.send(i)
    bench.tracker.go.set()
    probe.spin_until(lambda: len(bench.states) == 8, "all states")
    assert stamps(bench.states) == [i * 33_000_000 for i in range(8)]


def test_a_failing_tracker_is_said_to_be_lost_and_goes_on(probe, build):
    bench = build(lossless=True)
    covariances = probe.listen(StateCovariance, "tracker/state_covariance")
    probe.spin_until(lambda: probe.node.count_subscribers("/tracker/state_covariance") == 1, "the subscription")
    bench.tracker.failing = {33_000_000}
    bench.tracker.go.set()
    for i in range(3):
        bench.send(i)
    probe.spin_until(lambda: len(bench.states) == len(covariances) == 3, "a state for every set")
    assert [s.status for s in bench.states] == [Status.DEGRADED, Status.LOST, Status.DEGRADED]
    assert "no good" in bench.states[1].status_reason
    assert np.array_equal(bench.states[1].values, bench.states[0].values) and covariances[1].covariance[0] > 1e3


def test_a_publisher_that_does_not_match_is_on_the_diagnostics(probe, build):
    build(lossless=True)  # asks for reliable images
    probe.node.create_publisher(Image, "cam2/image_raw", qos_profile_sensor_data)
    name = "tracker: quality of service of cam2"
    probe.spin_until(lambda: name in probe.diagnostics, "the report")
    assert probe.diagnostics[name].level == DiagnosticStatus.WARN


def test_a_state_that_was_asked_for_outlasts_changes_of_parameters_until_it_is_used(probe, build):
    """Asked for while paused; each new tracker begins with it, and with where the body is only once a set has been tracked."""
    bench = build(lossless=True)
    bench.tracker.go.set()
    bench.send(0)
    probe.spin_until(lambda: len(bench.states) == 1, "a state")
    tracked = bench.states[0].values[-1]
    bench.enable(False)
    bench.put(elbow_flexion=0.3)
    bench.change_parameters(11.0)
    bench.change_parameters(12.0)
    bench.enable(True)
    probe.spin_until(lambda: bench.tracker.told == [0.3, 0.3, 0.3], "the state, told to each tracker")
    bench.send(1)
    probe.spin_until(lambda: len(bench.states) == 2, "a state after the pause")
    bench.change_parameters(13.0)
    probe.spin_until(lambda: len(bench.tracker.told) == 4, "the old tracker's body")
    assert bench.tracker.told[3] == ("take over", bench.tracker, 33_000_000)
    bench.tracker.status = Status.LOST
    bench.send(2)
    probe.spin_until(lambda: len(bench.states) == 3, "a state that is not believed")
    bench.change_parameters(14.0)
    probe.spin_until(lambda: len(bench.tracker.told) == 5, "where to look")
    assert bench.tracker.told[4] == tracked != 0.3


def test_states_asked_for_in_parts_add_up(probe, build):
    bench = build(lossless=True)
    names = list(tracked_arm().chain.dof_names)
    bench.enable(False)
    bench.put(**{names[0]: 0.25})
    bench.put(elbow_flexion=0.7)
    start = bench.node._worker.start_state().to_values()
    assert (start[0], start[-1]) == (0.25, 0.7)
    assert probe.ask(Trigger, "tracker/reset", Trigger.Request()).success
    bench.put(elbow_flexion=0.5)
    start = bench.node._worker.start_state().to_values()
    assert (start[0], start[-1]) == (0.0, 0.5)


def test_looking_anew_outlasts_a_change_of_parameters(probe, build):
    bench = build(lossless=True)
    bench.tracker.go.set()
    assert probe.ask(Trigger, "tracker/reinitialize", Trigger.Request()).success
    bench.change_parameters(11.0)
    probe.spin_until(lambda: bench.tracker.told == ["look anew"] * 2, "told to both trackers")
    bench.tracker.status = Status.INITIALIZING
    bench.send(0)
    probe.spin_until(lambda: len(bench.states) == 1, "a state")
    bench.change_parameters(12.0)
    probe.spin_until(lambda: bench.tracker.told == ["look anew"] * 3, "what still looks goes on to look")


def test_images_that_cannot_wait_for_the_lenses_are_counted(probe, build):
    bench = build(lossless=False, calibration_from_topics=True)
    for i in range(5):
        bench.send(i)
    worker, overflowed = bench.node._worker, bench.node._inbox.overflowed
    uncalibrated = worker.counts.idle["uncalibrated"]
    probe.spin_until(lambda: len(worker._not_yet) == 3 and uncalibrated.total() + sum(overflowed.values()) == 12, "all others")
    assert uncalibrated.total() >= 9


def test_an_image_set_that_takes_for_ever_is_said_to(probe, build):
    bench = build(lossless=True)
    bench.send(0)
    probe.spin_until(bench.tracker.stepping.is_set, "the step")
    status, worker = probe.diagnostics, bench.node._worker
    for seconds, level in ((10.0, DiagnosticStatus.WARN), (100.0, DiagnosticStatus.ERROR)):
        worker.at_work_since_s -= seconds
        probe.spin_until(lambda level=level: "tracker: rate" in status and status["tracker: rate"].level == level, "said")
        assert status["tracker: rate"].message.startswith("at work on one image set for 1")
    bench.tracker.go.set()
    probe.spin_until(lambda: status["tracker: rate"].level != DiagnosticStatus.ERROR, "its end")


def test_what_lasts_is_said_again_after_a_rest(probe, build):
    """A subscriber that asks for more than is offered stays when the node has been inactive, and so do lenses."""
    bench = build(lossless=True, calibration_from_topics=True)
    lens = CameraModel(160, 120, np.array([[150.0, 0.0, 80.0], [0.0, 150.0, 60.0], [0.0, 0.0, 1.0]]))
    bench.node._inbox.infos.update({f"cam{i}": camera_info_message(0, "f", lens) for i in (1, 2, 3)})
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    probe.node.create_subscription(TrackedState, "tracker/state", print, latched)
    status = probe.diagnostics
    mismatch, calibration = "tracker: quality of service of ~/state", "tracker: calibration"
    for _ in range(2):
        probe.spin_until(lambda: mismatch in status and status[mismatch].level == DiagnosticStatus.WARN, "the mismatch")
        probe.spin_until(lambda: calibration in status and status[calibration].message == "complete", "the calibration")
        bench.node.trigger_deactivate()
        probe.spin_until(lambda: status[mismatch].message == status[calibration].message == "inactive", "the rest")
        bench.node.report()
        assert bench.node.activate()


def test_a_tracker_that_is_too_slow_is_said_to_be_until_it_keeps_up(probe, build):
    bench = build(lossless=False)
    bench.send(0)
    probe.spin_until(bench.tracker.stepping.is_set, "the first step")
    for i in range(1, 7):
        bench.send(i)
    bench.tracker.go.set()

    def slow() -> list[int]:
        found = enumerate(bench.said("rate"))
        return [k for k, (level, said) in found if level == DiagnosticStatus.WARN and said.startswith("too slow")]

    probe.spin_until(slow, "too slow")
    sent, until_s = 7, time.monotonic() + TIMEOUT_S
    while (DiagnosticStatus.OK, "tracking") not in bench.said("rate")[slow()[-1] :]:
        assert time.monotonic() < until_s, "it is not said that it keeps up"
        bench.send(sent)
        sent += 1
        probe.spin_until(lambda n=sent: len(bench.states) == n - 2, "a state in time")


def test_results_that_come_late_are_said_to(probe, build):
    """Images of 40 s ago, then fresh ones, where 20 s are allowed; each is tracked before the next, so that none waits."""
    bench = build(lossless=True, config=TrackerConfig(synchronizer=SynchronizerConfig(queue_s=20.0)))
    bench.tracker.go.set()
    late = (DiagnosticStatus.WARN, "results come more than 20 s after their images")
    sent = 0
    for ago_s, expected in ((40, late), (0, (DiagnosticStatus.OK, "from an image's stamp to the state"))):
        before, until_s = len(bench.said("latency")), time.monotonic() + TIMEOUT_S
        while expected not in bench.said("latency")[before:]:
            assert time.monotonic() < until_s, f"not said: {expected}"
            bench.send(0, time.time_ns() - ago_s * 10**9)
            sent += 1
            probe.spin_until(lambda n=sent: len(bench.states) == n, "a state for every set")


def test_image_sets_that_take_longer_than_the_next_is_away_are_said_to(probe, build):
    bench = build(lossless=False)
    bench.tracker.go.set()
    slow = (DiagnosticStatus.WARN, "an image set takes longer than the 33 ms from one to the next")
    fine = (DiagnosticStatus.OK, "stamps are not of this clock")
    for total_ms, sets, expected in ((50.0, range(20), slow), (4.0, range(20, 50), fine)):
        bench.tracker.total_ms = total_ms
        for i in sets:
            bench.send(i)
            probe.spin_until(lambda n=i + 1: len(bench.states) == n, "a state for every set")
        before = len(bench.said("latency"))
        probe.spin_until(lambda n=before, expected=expected: expected in bench.said("latency")[n:], str(expected))


def test_sets_that_wait_for_us_are_not_late(probe, build):
    bench = build(lossless=True)
    bench.tracker.go.set()
    bench.tracker.total_ms = 50.0
    for i in range(30):
        bench.send(i)
    probe.spin_until(lambda: len(bench.states) == 30, "a state for every set")
    before = len(bench.said("latency"))
    probe.spin_until(lambda: len(bench.said("latency")) > before, "the latency")
    assert {level for level, _ in bench.said("latency")} == {DiagnosticStatus.OK}


def test_trouble_that_passes_is_no_warning(probe, build):
    """Sets are 33 ms apart: DEGRADED for 29 of them warns nobody, for 40 it does."""
    bench = build(lossless=True)
    bench.tracker.go.set()

    def warned() -> bool:
        return any(level == DiagnosticStatus.WARN and said.startswith("DEGRADED") for level, said in bench.said("status"))

    for sets, status in ((range(29), Status.DEGRADED), (range(29, 31), Status.TRACKING), (range(31, 71), Status.DEGRADED)):
        assert not warned()
        bench.tracker.status = status
        for i in sets:
            bench.send(i)
        probe.spin_until(lambda n=sets.stop: len(bench.states) == n, "a state for every set")
    probe.spin_until(warned, "that it lasts")


def test_parameters_change_after_a_failed_first_set_and_the_start_stays_as_configured(probe, build):
    initial = some_state(tracked_arm())
    bench = build(lossless=True, initial_state=initial)
    bench.tracker.failing = {0}
    bench.tracker.go.set()
    bench.send(0)
    probe.spin_until(lambda: len(bench.states) == 1, "what is said of the failure")
    assert bench.states[0].status == Status.LOST and np.array_equal(bench.states[0].values, initial.to_values())
    bench.change_parameters(11.0)
    bench.send(1)
    probe.spin_until(lambda: len(bench.states) == 2, "a state")
    assert bench.tracker.told == []  # a new tracker begins as it was made: at the initial state, or with a search


def test_a_search_goes_on_after_a_set_that_failed_in_it(probe, build):
    bench = build(lossless=True)
    bench.tracker.status, bench.tracker.failing = Status.INITIALIZING, {33_000_000}
    bench.tracker.go.set()
    bench.send(0)
    bench.send(1)
    probe.spin_until(lambda: len(bench.states) == 2, "a guess and a failure")
    assert [s.status for s in bench.states] == [Status.INITIALIZING, Status.LOST]
    bench.change_parameters(11.0)
    probe.spin_until(lambda: bench.tracker.told == ["look anew"], "the search, told to the new tracker")


def test_nothing_is_kept_of_a_recording_that_begins_again_with_a_failure(probe, build):
    bench = build(lossless=True)
    bench.tracker.failing = {33_000_000}
    bench.tracker.go.set()
    bench.send(0, first_ns=10**12)
    bench.send(1)
    probe.spin_until(lambda: len(bench.states) == 2, "a state and a failure")
    neutral = State.neutral(tracked_arm()).to_values()
    assert np.array_equal(bench.states[1].values, neutral) and not np.array_equal(bench.states[0].values, neutral)
    bench.change_parameters(11.0)
    bench.send(2)
    probe.spin_until(lambda: len(bench.states) == 3, "a state")
    assert bench.tracker.told == ["reset"]


@pytest.mark.parametrize("status", [Status.LOST, Status.INITIALIZING])
def test_what_cannot_say_that_it_is_wrong_is_not_sent_while_the_body_is_not_known(probe, build, status):
    bench = build(lossless=True)
    topics = {"pose": PoseWithCovarianceStamped, "twist": TwistWithCovarianceStamped, "joint_states": JointState}
    came = {name: probe.listen(kind, f"tracker/{name}") for name, kind in topics.items()}
    probe.spin_until(lambda: all(probe.node.count_publishers(f"/tracker/{name}") for name in topics), "the topics")
    probe.spin_until(lambda: bench.node.has_subscribers(dict.fromkeys(topics, 1)), "subscriptions")
    bench.tracker.go.set()
    statuses = [Status.TRACKING, status, status, Status.DEGRADED]
    for i, bench.tracker.status in enumerate(statuses):
        bench.send(i)
        probe.spin_until(lambda n=i: len(bench.states) == n + 1, "a state")
    assert [state.status for state in bench.states] == statuses
    known = [0, 3 * 33_000_000]
    for name, messages in came.items():
        probe.spin_until(lambda m=messages: len(m) == 2, name)
        assert stamps(messages) == known


def test_a_lossless_tracker_that_has_no_room_says_so(probe, build):
    """Three images of 57 kB fit; the others are counted, and what has waited is tracked."""
    bench = build(lossless=True, most_bytes=4 * 120 * 160 * 3)
    bench.send(0)
    probe.spin_until(bench.tracker.stepping.is_set, "the first step")
    for i in range(1, 4):
        bench.send(i)
    overflowed = bench.node._inbox.overflowed
    assert sum(overflowed.values()) == 6
    for name in overflowed:
        probe.spin_until(lambda n=name: any("lost though none may be" in said for _, said in bench.said(n)), f"{name} says so")
    bench.tracker.go.set()
    probe.spin_until(lambda: len(bench.states) == 2, "what had room")


def test_images_that_wait_for_lenses_are_limited(probe, build):
    bench = build(lossless=True, most_bytes=4 * 120 * 160 * 3, calibration_from_topics=True)
    counts = bench.node._worker.counts.idle["uncalibrated"]
    for i in range(4):
        bench.send(i)
        probe.spin_until(lambda: not bench.node._inbox.waiting, "the worker has them")
    probe.spin_until(lambda: counts.total() == 9, "nine of twelve are too many")
    probe.spin_until(lambda: any("9 images are lost" in said for _, said in bench.said("calibration")), "said so")


def test_what_nobody_has_foreseen_ends_no_tracking(probe, build, monkeypatch):
    """Neither an image that cannot be taken apart nor an estimate that cannot be told ends the thread; both are counted."""
    bench = build(lossless=True)
    bench.tracker.go.set()
    usual, outputs = Received.decode, bench.node._outputs[""]
    monkeypatch.setattr(Received, "decode", lambda received: {}["pixels"] if received.camera == "cam2" else usual(received))
    bench.send(0)
    probe.spin_until(lambda: bench.node._worker.counts.refused["cam2"] == 1, "an image that is refused")
    monkeypatch.undo()
    publish = outputs.publish
    outputs.publish = lambda *_: [][1]
    bench.send(1)
    probe.spin_until(lambda: bench.node._worker.counts.failed > 0, "an estimate that is not told")
    outputs.publish = publish
    bench.send(2)
    probe.spin_until(lambda: stamps(bench.states)[-1:] == [2 * 33_000_000], "the next state")
    assert bench.node.fatal is None
