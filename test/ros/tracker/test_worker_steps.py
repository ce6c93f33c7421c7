"""What the worker does with each image, image set and request, one step at a time and without a graph."""

from types import SimpleNamespace

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from helpers.ros.held_tracker import HeldTracker
from helpers.ros.samples import moving_state, small_rig, some_state, tracked_arm
from tracker_node.errors import TrackerError
from tracker_node.observation.image_set import ImageSet
from tracker_node.ros.conversions import image_message
from tracker_node.ros.tracker.image_inbox import ImageInbox, InboxOptions, Received
from tracker_node.ros.tracker.setup import INACTIVE, PAUSED, UNCALIBRATED, TrackingSetup
from tracker_node.ros.tracker.worker import TrackingWorker
from tracker_node.tracking.config import SynchronizerConfig, TrackerConfig
from tracker_node.tracking.estimate import Status

NAMES = ("cam1", "cam2", "cam3")
CONFIG = TrackerConfig(synchronizer=SynchronizerConfig(min_cameras=3))
START = some_state(tracked_arm())


class Bench:
    """A worker whose thread the test is; what it tells is kept."""

    def __init__(self, folder, lossless=True, tracker=None, lenses=True, most_bytes=10**6, cameras=NAMES):
        self.rig = small_rig(folder)
        self.tracker = tracker or HeldTracker()
        self.tracker.go.set()
        self.inbox = ImageInbox(None, NAMES, InboxOptions(lossless=lossless, most_bytes=most_bytes), None)
        self.estimates, self.errors = [], []
        setup = self.setup(self.tracker if lenses else None, cameras)
        self.worker = TrackingWorker(
            self.inbox,
            setup,
            lambda estimate, image_set: self.estimates.append((estimate, image_set)),
            initial_state=START,
            lossless=lossless,
            on_error=self.errors.append,
        )
        self.counts = self.worker.counts

    def setup(self, tracker, cameras=NAMES, config=CONFIG):
        return TrackingSetup(config, cameras, None if tracker is None else self.rig, tracker)

    def step(self, *stamps_ns):
        self.worker._track([ImageSet(stamp_ns, ()) for stamp_ns in stamps_ns])

    @property
    def stamps(self):
        return [image_set.stamp_ns for _, image_set in self.estimates]


def received(camera, stamp_ns=0, width=160, height=120):
    return Received(camera, serialize_message(image_message(stamp_ns, "f", np.zeros((height, width, 3), np.uint8))))


@pytest.fixture(autouse=True)
def _four_at_once(monkeypatch):
    monkeypatch.setattr("tracker_node.ros.tracker.worker._AT_ONCE_MS", 0.0)  # as of a tracker that has no time to spare


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


def test_what_a_new_worker_knows(bench):
    worker = bench.worker
    assert worker.latest is None and worker.fatal is None and worker.at_work_since_s is None and worker.start_state() is None
    assert worker.busy and not worker.paused and worker.lossless
    assert worker.rig is bench.rig and worker.config is CONFIG


def test_the_newest_four_of_those_that_wait_are_tracked_and_no_more(tmp_path):
    bench = Bench(tmp_path, lossless=False)
    bench.step(10, 20, 30, 40)
    assert bench.stamps == [10, 20, 30, 40] and bench.counts.skipped == 0
    bench.step(50, 60, 70, 80, 90, 100, 110)
    assert bench.stamps == [10, 20, 30, 40, 80, 90, 100, 110] and bench.counts.skipped == 3 and bench.counts.tracked == 8


def test_what_comes_during_a_step_is_newer_than_what_waits(tmp_path):
    """None waits for longer than four periods, however long steps take."""
    bench, period_ns = Bench(tmp_path, lossless=False), 33_000_000
    tell = bench.worker._on_estimate

    def told(estimate, image_set):
        if not bench.estimates:
            for i in range(10, 16):
                for camera in NAMES:
                    bench.inbox._enqueue(received(camera, i * period_ns))
        tell(estimate, image_set)

    bench.worker._on_estimate = told
    bench.step(*(i * period_ns for i in range(1, 5)))
    assert bench.stamps == [i * period_ns for i in (1, 12, 13, 14, 15)] and bench.counts.skipped == 5


def test_a_lossless_worker_supersedes_none(bench):
    bench.step(10, 20, 30, 40)
    assert bench.stamps == [10, 20, 30, 40] and bench.counts.skipped == 0


@pytest.mark.parametrize(("finishing", "tracked", "skipped"), [(False, 1, 2), (True, 3, 0)])
def test_a_stop_between_image_sets_leaves_the_rest_and_counts_it(bench, finishing, tracked, skipped):
    bench.worker._finishing = finishing
    bench.worker._on_estimate = lambda *_: bench.worker._thread.stopping.set()
    bench.step(10, 20, 30)
    assert (bench.counts.tracked, bench.counts.skipped) == (tracked, skipped)


def test_an_image_set_is_at_work_only_while_it_is_tracked(bench):
    seen = []
    bench.worker._on_estimate = lambda *_: seen.append(bench.worker.at_work_since_s)
    bench.step(10)
    assert seen[0] > 0.0 and bench.worker.at_work_since_s is None


def test_requests_are_obeyed_between_image_sets(bench):
    bench.worker._on_estimate = lambda *_: bench.worker.reinitialize() if not bench.tracker.told else None
    bench.step(10, 20)
    assert bench.tracker.told == ["look anew"] and bench.worker.start_state() is not None  # followed by the second


def test_image_sets_without_lenses_are_counted_one_by_one(tmp_path):
    bench = Bench(tmp_path, lenses=False)
    bench.step(10, 20)
    assert bench.counts.skipped == 2 and bench.counts.tracked == 0 and bench.estimates == []


def test_a_failed_image_set_is_lost_where_the_body_was_and_says_how_long_it_took(bench):
    ticks = iter([5.0, 5.25, 5.5])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tracker_node.ros.tracker.worker.time", SimpleNamespace(perf_counter=lambda: next(ticks), monotonic=float))
        bench.tracker.failing = {10}
        bench.step(10)
    ((estimate, image_set),) = bench.estimates
    assert image_set.stamp_ns == estimate.stamp_ns == 10 and bench.worker.latest is estimate
    assert estimate.status is Status.LOST and estimate.status_reason == "RuntimeError: no good"
    assert estimate.timings.total_ms == 250.0 and estimate.timings.observe_ms == estimate.timings.optimize_ms == 0.0
    assert estimate.state is START and [report.camera for report in estimate.cameras] == list(NAMES)
    assert bench.errors[0].startswith("image set 10: RuntimeError('no good')\nTraceback") and len(bench.errors) == 1
    assert (bench.counts.failed, bench.counts.lost[""], bench.counts.tracked) == (1, 1, 1)
    assert bench.worker.start_state() is None  # it was never tracked


def test_after_a_set_that_was_tracked_a_failed_one_is_where_that_left_the_body(bench):
    bench.tracker.failing = {20}
    bench.step(10, 20)
    first, second = (estimate for estimate, _ in bench.estimates)
    assert second.state is first.state and second.state is not START and bench.worker.start_state() is first.state
    assert (bench.counts.failed, bench.counts.lost[""], bench.counts.tracked) == (1, 1, 2)


def test_failures_that_a_user_can_mend_are_one_line(bench):
    def step(image_set):
        raise TrackerError("mend me")

    bench.tracker.estimate = step
    bench.step(10)
    assert bench.errors == ["image set 10: mend me"] and bench.estimates[0][0].status_reason == "TrackerError: mend me"


def test_what_cannot_be_published_is_counted_and_the_next_is_tracked(bench):
    def fail(estimate, image_set):
        raise TrackerError("no room")

    bench.worker._on_estimate = fail
    bench.step(10, 20)
    assert bench.errors == [f"image set {stamp}: not published: no room" for stamp in (10, 20)]
    assert (bench.counts.failed, bench.counts.lost[""], bench.counts.tracked) == (2, 0, 2)


def test_a_set_is_learned_from_once_its_estimate_is_out(bench):
    learned = []
    bench.worker._on_estimate = lambda estimate, image_set: learned.append(bench.tracker.learned)
    bench.step(10, 20, 30)
    assert learned == [0, 1, 2] and bench.tracker.learned == 3


def test_what_cannot_be_learned_is_counted_and_the_next_is_tracked(bench):
    bench.tracker.breaks_learning = True
    bench.step(10, 20)
    assert [error.split("\n")[0] for error in bench.errors] == [
        f"image set {stamp}: not learned from: RuntimeError('cannot learn')" for stamp in (10, 20)
    ]
    assert bench.stamps == [10, 20] and (bench.counts.failed, bench.counts.tracked) == (2, 2)


def test_only_stamps_that_go_back_reset_the_tracker(bench):
    bench.step(20, 20, 30)
    assert bench.tracker.told == []
    bench.tracker.failing = {29}
    bench.step(29)
    assert bench.tracker.told == ["reset"] and bench.estimates[-1][0].state is START  # what was before is forgotten
    bench.step(29)
    assert bench.tracker.told == ["reset"]


def test_a_request_is_told_again_when_stamps_go_back_and_not_once_it_is_followed(bench):
    bench.step(20)
    bench.worker.set_state(START)
    bench.worker._thread.obey()
    bench.step(10)
    last = START.to_values()[-1]
    assert bench.tracker.told == [last, "reset", last]
    bench.step(5)
    assert bench.tracker.told == [last, "reset", last, "reset"]


@pytest.mark.parametrize("status", [Status.TRACKING, Status.DEGRADED])
def test_a_new_tracker_takes_over_from_the_old_one_with_the_latest_set(bench, status):
    bench.tracker.status = status
    bench.step(10, 20)
    new = HeldTracker()
    bench.worker.use(bench.setup(new))
    bench.worker._thread.obey()
    assert new.told == [("take over", bench.tracker, 20)] and bench.tracker.told == []
    assert bench.worker._loop.tracker is new


def test_what_cannot_be_taken_over_begins_where_the_body_was(bench):
    def refuse(old, image_set):
        raise TrackerError("of another size")

    bench.step(10)
    new = HeldTracker()
    new.take_over = refuse
    bench.worker.use(bench.setup(new))
    bench.worker._thread.obey()
    assert new.told == [bench.estimates[0][0].state.to_values()[-1]]


def test_a_lost_body_is_begun_at_and_not_taken_over(bench):
    bench.tracker.status = Status.LOST
    bench.step(10)
    new = HeldTracker()
    bench.worker.use(bench.setup(new))
    bench.worker._thread.obey()
    assert new.told == [bench.estimates[0][0].state.to_values()[-1]] and bench.counts.lost[""] == 1


def test_a_search_goes_on_with_a_new_tracker(bench):
    bench.tracker.status = Status.INITIALIZING
    bench.step(10)
    new = HeldTracker()
    bench.worker.use(bench.setup(new))
    bench.worker._thread.obey()
    assert new.told == ["look anew"]


def test_a_tracker_that_comes_after_none_goes_on_at_the_state(bench):
    bench.step(10)
    bench.worker.use(bench.setup(None))
    bench.worker._thread.obey()
    assert bench.worker.rig is None
    new = HeldTracker()
    bench.worker.use(bench.setup(new))
    bench.worker._thread.obey()
    assert new.told == [bench.estimates[0][0].state.to_values()[-1]]


def test_the_first_tracker_is_told_nothing_unless_something_was_asked(tmp_path):
    bench = Bench(tmp_path, lenses=False)
    bench.worker.use(bench.setup(bench.tracker))
    bench.worker._thread.obey()
    assert bench.tracker.told == []
    bench.worker.reinitialize()
    bench.worker._thread.obey()
    second = HeldTracker()
    bench.worker.use(bench.setup(second))
    bench.worker._thread.obey()
    assert bench.tracker.told == second.told == ["look anew"]


def test_a_change_of_cameras_reaches_the_formation(bench):
    bench.worker.use(bench.setup(HeldTracker(), cameras=("cam1",), config=TrackerConfig()))
    bench.worker._thread.obey()
    assert len(bench.worker.formation.add(received("cam1").decode())) == 1  # one camera is a whole set


def test_the_next_start_is_as_asked_else_where_the_body_was(bench):
    bench.step(10)
    there = bench.estimates[0][0].state
    assert bench.worker.start_state() is there
    other = moving_state(tracked_arm(), 3)
    bench.worker.set_state(other)
    assert bench.worker.start_state() is other  # before the tracker has been told
    bench.worker.reinitialize()
    assert bench.worker.start_state() is None
    bench.worker._thread.obey()
    bench.step(20)
    assert bench.worker.start_state() is bench.estimates[1][0].state


@pytest.mark.parametrize(("ask", "told"), [("reset", "reset"), ("reinitialize", "look anew")])
def test_requests_that_forget(bench, ask, told):
    bench.worker._handle([received("cam1")])
    bench.step(10)
    getattr(bench.worker, ask)()
    assert bench.worker.latest is not None  # until the thread has come to it
    bench.worker._thread.obey()
    assert bench.worker.latest is None and bench.tracker.told == [told]
    n_reset = bench.worker.formation.counters["cam1"].get("reset", 0)
    assert n_reset == (1 if ask == "reset" else 0)
    bench.step(5)  # the clock is forgotten by a reset alone
    assert bench.tracker.told == ([told] if ask == "reset" else [told, "reset", told])


def test_pausing_drops_what_waits_once(bench):
    bench.worker._handle([received("cam1")])
    bench.worker.pause(True)
    bench.worker._thread.obey()
    assert bench.worker.paused and bench.worker.formation.counters["cam1"]["reset"] == 1
    bench.worker._handle([received("cam1"), received("cam2")])
    assert bench.counts.idle[PAUSED] == {"cam1": 1, "cam2": 1} and bench.estimates == []
    bench.worker.pause(False)
    bench.worker._thread.obey()
    bench.worker._handle([received(name, 50) for name in NAMES])
    assert not bench.worker.paused and bench.stamps == [50]


def test_resuming_drops_nothing(bench):
    bench.worker._handle([received("cam1")])
    bench.worker.pause(False)
    bench.worker._thread.obey()
    assert bench.worker.formation.counters["cam1"].get("reset", 0) == 0


def test_images_that_wait_for_lenses_are_tracked_once_they_are_known(tmp_path):
    bench = Bench(tmp_path, lenses=False)
    bench.worker._handle([received(name, 10) for name in NAMES])
    assert bench.counts.idle[UNCALIBRATED].total() == 0
    bench.worker.use(bench.setup(bench.tracker))
    bench.worker._thread.obey()
    bench.worker._handle([])
    assert bench.stamps == [10]
    bench.worker._handle([])
    assert bench.stamps == [10]


def test_a_pause_drops_images_that_wait_for_lenses(tmp_path):
    bench = Bench(tmp_path, lenses=False)
    bench.worker._handle([received("cam1", 10)])
    bench.worker.paused = True
    bench.worker._handle([received("cam2", 10)])
    bench.worker._handle([])
    assert bench.counts.idle[PAUSED] == {"cam1": 1, "cam2": 1}


def test_of_images_that_wait_for_lenses_the_newest_of_each_camera_are_kept(tmp_path):
    bench = Bench(tmp_path, lossless=False, lenses=False)
    items = [received(name, stamp) for stamp in (0, 1) for name in ("cam1", "cam2")]
    bench.worker._handle(items[:3])
    assert bench.counts.idle[UNCALIBRATED].total() == 0
    bench.worker._handle(items[3:])
    assert bench.counts.idle[UNCALIBRATED] == {"cam1": 1} and bench.worker._not_yet == items[1:]


def test_where_nothing_may_be_lost_the_first_images_are_kept_as_far_as_there_is_room(tmp_path):
    size = received("cam1").size
    bench = Bench(tmp_path, lenses=False, most_bytes=2 * size)
    items = [received(name) for name in NAMES]
    bench.worker._handle(items[:2])
    assert bench.counts.idle[UNCALIBRATED].total() == 0 and bench.worker._not_yet == items[:2]
    bench.worker._handle(items[2:])
    assert bench.counts.idle[UNCALIBRATED] == {"cam3": 1} and bench.worker._not_yet == items[:2]


def test_images_of_a_camera_that_is_not_in_use_are_counted(tmp_path):
    bench = Bench(tmp_path, cameras=("cam1", "cam2"))
    bench.worker._handle([received("cam3")])
    assert bench.counts.idle[INACTIVE] == {"cam3": 1} and "cam3" not in bench.worker.formation.counters


@pytest.mark.parametrize(("width", "height"), [(161, 120), (160, 121), (120, 160)])
def test_images_of_another_size_than_calibrated_are_refused_until_one_fits(bench, width, height):
    bench.worker._handle([received("cam2", 0, width, height)])
    said = f"image size contradicts the calibration: expected 160x120, got {width}x{height}"
    assert bench.counts.refused == {"cam2": 1} and bench.counts.problems == {"cam2": said} and bench.errors == []
    bench.worker._handle([received("cam1", 0)])
    assert bench.counts.problems == {"cam2": said}
    bench.worker._handle([received("cam2", 0)])
    assert bench.counts.problems == {} and bench.counts.refused == {"cam2": 1}


def test_an_image_that_nobody_has_foreseen_is_told_with_where_it_failed(bench):
    bench.worker._handle([Received("cam2", None)])
    assert bench.counts.refused == {"cam2": 1} and bench.errors[0].startswith("cam2: ") and "Traceback" in bench.errors[0]


def test_a_thread_tracks_what_has_come_in_before_it_ends(bench):
    for name in NAMES:
        bench.inbox._enqueue(received(name, 10))
    bench.inbox._enqueue(received("cam1", 10_000_000_000))
    bench.worker.start()
    bench.worker.stop(finish=True)
    assert bench.stamps[0] == 10 and bench.counts.idle[INACTIVE].total() == 0
    bench.worker.stop()  # a second time is nothing


def test_a_thread_that_is_not_to_finish_counts_what_waits(bench):
    bench.worker.paused = False
    bench.worker._thread._thread = SimpleNamespace(join=lambda timeout: None, is_alive=lambda: False)  # has ended already
    bench.worker._not_yet = [received("cam2")]
    bench.inbox._enqueue(received("cam1"))
    bench.worker.stop(finish=False)
    assert bench.counts.idle[INACTIVE] == {"cam1": 1, "cam2": 1} and bench.worker._not_yet == []
    assert not bench.worker._thread.started and not bench.worker._finishing


def test_a_stop_that_takes_too_long_is_refused_and_the_thread_goes_on(bench):
    bench.tracker.go.clear()
    for name in NAMES:
        bench.inbox._enqueue(received(name, 10))
    bench.worker.start()
    assert bench.tracker.stepping.wait(10.0)
    with pytest.raises(TrackerError, match=r"the tracking thread has not ended within 0\.05 s"):
        bench.worker.stop(timeout_s=0.05)
    assert not bench.worker._thread.stopping.is_set()
    bench.tracker.go.set()
    bench.worker.stop()
    assert bench.stamps == [10] and bench.worker.fatal is None


@pytest.mark.parametrize(("lossless", "finish", "expected"), [(True, True, True), (False, True, False), (True, False, False)])
def test_only_a_lossless_worker_that_is_to_finish_does(tmp_path, lossless, finish, expected):
    bench = Bench(tmp_path, lossless=lossless)
    bench.worker.start()
    bench.worker.stop(finish=finish)
    assert bench.worker._finishing is expected


def test_why_the_thread_has_ended_is_kept_and_told(bench):
    def broken(timeout_s):
        raise TrackerError("no inbox")

    bench.inbox.take = broken
    bench.worker._thread.run()
    assert str(bench.worker.fatal) == "no inbox" and bench.errors == ["the tracking thread has ended: no inbox"]


@pytest.mark.parametrize(("lenses", "paused"), [(False, False), (True, True)])
def test_without_a_tracker_or_at_rest_nothing_is_finished(tmp_path, lenses, paused):
    bench = Bench(tmp_path, lenses=lenses)
    bench.worker.paused, bench.worker._finishing = paused, True
    bench.worker._thread.stopping.set()
    bench.inbox._enqueue(received("cam1"))
    bench.worker._thread.run()
    assert bench.inbox.waiting == 1 and bench.worker.fatal is None


def test_a_finishing_worker_tracks_sets_that_lack_a_camera(tmp_path):
    bench = Bench(tmp_path)
    bench.worker.use(bench.setup(bench.tracker, config=TrackerConfig(synchronizer=SynchronizerConfig(min_cameras=2))))
    bench.worker._thread.obey()
    bench.worker._finishing = True
    bench.worker._thread.stopping.set()
    for name in NAMES[:2]:
        bench.inbox._enqueue(received(name, 70))
    bench.worker._thread.run()
    assert bench.stamps == [70] and bench.errors == []


def test_sets_that_have_waited_are_made_up_for_where_that_takes_a_moment(tmp_path, monkeypatch):
    monkeypatch.setattr("tracker_node.ros.tracker.worker._AT_ONCE_MS", 100.0)
    bench = Bench(tmp_path, lossless=False)
    bench.step(10)
    bench.worker.step_ms = 100.0 / 6
    bench.step(*range(20, 100, 10))
    assert bench.stamps[:4] == [10, 40, 50, 60] and bench.counts.skipped == 2


def test_stamps_that_a_driver_does_not_set_are_refused_but_not_a_recording_that_begins_at_zero(bench):
    bench.worker._handle([received("cam1", ns) for ns in (0, 33, 0, 0, 0)])
    assert bench.counts.refused == {"cam1": 2} and "header.stamp" in bench.counts.problems["cam1"]
    bench.worker._handle([received("cam1", 66)])
    assert bench.counts.refused == {"cam1": 2} and not bench.counts.problems
