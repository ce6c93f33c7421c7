"""The loop that live and offline runs share: resets, requests, other trackers."""

import numpy as np
import pytest

from helpers.ros.held_tracker import HeldTracker
from helpers.ros.samples import some_state, tracked_arm
from tracker_node.errors import TrackerError
from tracker_node.observation.image_set import ImageSet
from tracker_node.runs.loop import StartRequest, TrackingLoop
from tracker_node.tracking.estimate import Status

START = some_state(tracked_arm())
LAST = START.to_values()[-1]


def held(**changes):
    tracker = HeldTracker()
    tracker.go.set()
    for name, value in changes.items():
        setattr(tracker, name, value)
    return tracker


def at(*stamps_ns):
    return [ImageSet(stamp_ns, ()) for stamp_ns in stamps_ns]


def begin_at_start(forgets_state=False, forgets_clock=False):
    return StartRequest(lambda tracker: tracker.set_state(START), START, forgets_state, forgets_clock)


def test_every_set_is_tracked_and_the_latest_is_kept():
    loop = TrackingLoop(held())
    assert loop.tracked is None
    estimates = [loop.step(image_set) for image_set in at(10, 20, 20, 30)]
    assert [estimate.stamp_ns for estimate in estimates] == [10, 20, 20, 30] and loop.tracked is estimates[-1]
    assert loop.tracker.told == []


def test_only_stamps_that_go_back_reset_the_tracker():
    loop = TrackingLoop(held())
    for image_set in at(20, 10, 10, 15, 14):
        loop.step(image_set)
    assert loop.tracker.told == ["reset", "reset"]


def test_what_was_before_a_reset_is_forgotten_even_if_the_set_fails():
    loop = TrackingLoop(held(failing={10}))
    loop.step(*at(20))
    with pytest.raises(RuntimeError, match="no good"):
        loop.step(*at(10))
    assert loop.tracked is None and loop.tracker.told == ["reset"]
    loop.step(*at(11))
    assert loop.tracker.told == ["reset"]  # the stamp of a set that failed counts


def test_a_request_is_told_at_once_and_again_after_a_reset_until_it_is_followed():
    loop = TrackingLoop(held(failing={10}))
    loop.step(*at(20))
    request = begin_at_start()
    loop.begin(request)
    assert loop.tracker.told == [LAST] and loop.requests == {"": request} and loop.tracked is not None
    with pytest.raises(RuntimeError):
        loop.step(*at(10))
    assert loop.tracker.told == [LAST, "reset", LAST] and loop.requests == {"": request}
    loop.step(*at(11))
    assert loop.requests == {}
    loop.step(*at(5))
    assert loop.tracker.told == [LAST, "reset", LAST, "reset"]


@pytest.mark.parametrize("forgets_state", [False, True])
@pytest.mark.parametrize("forgets_clock", [False, True])
def test_requests_forget_what_they_say(forgets_state, forgets_clock):
    loop = TrackingLoop(held())
    loop.step(*at(20))
    loop.begin(begin_at_start(forgets_state, forgets_clock))
    assert (loop.tracked is None) == forgets_state
    loop.step(*at(10))
    assert loop.tracker.told == ([LAST] if forgets_clock else [LAST, "reset", LAST])


@pytest.mark.parametrize(
    ("status", "told"),
    [(Status.TRACKING, "take over"), (Status.DEGRADED, "take over"), (Status.LOST, "state"), (Status.INITIALIZING, "look anew")],
)
def test_another_tracker_begins_where_the_old_one_has_left_the_body(status, told):
    old, new = held(status=status), held()
    loop = TrackingLoop(old)
    for image_set in at(10, 20):
        loop.step(image_set)
    state = loop.tracked.state.to_values()[-1]
    loop.exchange(new)
    assert new.told == [{"take over": ("take over", old, 20), "state": state}.get(told, told)]
    assert loop.tracker is new and old.told == []


def test_another_tracker_that_cannot_take_over_begins_at_the_state():
    def refuse(old, image_set):
        raise TrackerError("of another size")

    loop = TrackingLoop(held())
    loop.step(*at(10))
    new = held(take_over=refuse)
    loop.exchange(new)
    assert new.told == [loop.tracked.state.to_values()[-1]]


def test_a_request_comes_before_what_the_old_tracker_has_left():
    loop = TrackingLoop(None)
    loop.begin(begin_at_start())
    first, second = held(), held()
    loop.exchange(first)
    loop.exchange(second)
    assert first.told == second.told == [LAST]


def test_without_a_tracker_nothing_is_tracked_and_what_is_known_is_kept():
    loop = TrackingLoop(held())
    loop.step(*at(10))
    loop.exchange(None)
    with pytest.raises(TrackerError, match="no tracker"):
        loop.step(*at(20))
    new = held()
    loop.exchange(new)
    np.testing.assert_equal(new.told, [loop.tracked.state.to_values()[-1]])
