"""The time of a bag that is played: it runs at a rate, stands still, and is slept by."""

import threading
import time

import pytest

from tracker_node.errors import TrackerError
from tracker_node.ros.bag.player import BagTime

S = 1_000_000_000


@pytest.mark.parametrize("rate", [0.0009, 1001.0, -1.0, float("nan")])
def test_rates_that_nobody_can_mean_are_refused(rate):
    with pytest.raises(TrackerError, match=r"from 0\.001 to 1000"):
        BagTime(rate)


@pytest.fixture
def clock(monkeypatch):
    """The steady clock, set by hand."""

    class Clock:
        now_s = 100.0

    monkeypatch.setattr(time, "monotonic", lambda: Clock.now_s)
    return Clock


def test_a_bag_s_time_runs_at_its_rate(clock):
    bag = BagTime(2.0)
    bag.begin(7 * S)
    assert bag.now_ns() == 7 * S
    clock.now_s += 1.5
    assert bag.now_ns() == 10 * S
    bag.set_rate(0.5)
    assert bag.now_ns() == 10 * S
    clock.now_s += 4.0
    assert bag.now_ns() == 12 * S


def test_a_bag_that_has_not_begun_runs_from_zero_and_ticks_at_once(clock):
    clock.now_s = 0.0
    bag = BagTime()
    assert bag.tick_is_due(0.5) and bag.now_ns() == 0 and not bag.paused
    clock.now_s = 1.0
    assert bag.now_ns() == S
    standing = BagTime(paused=True)
    clock.now_s = 2.0
    assert standing.paused and standing.now_ns() == 0


@pytest.mark.parametrize("rate", [0.001, 1000.0])
def test_the_slowest_and_the_fastest_rate_are_taken(clock, rate):
    bag = BagTime(rate)
    clock.now_s += 2.0
    assert bag.now_ns() == round(2.0 * rate * S)


def test_a_rate_out_of_range_is_named():
    with pytest.raises(TrackerError, match=r"^rate: expected a positive number from 0\.001 to 1000, got 0\.0005$"):
        BagTime(0.0005)


def test_a_paused_bag_stands_still_and_goes_on_from_there(clock):
    bag = BagTime(1.0)
    bag.begin(S)
    clock.now_s += 2.0
    assert not bag.paused
    bag.pause(True)
    assert bag.paused
    clock.now_s += 50.0
    assert bag.now_ns() == 3 * S
    bag.pause(False)
    clock.now_s += 1.0
    assert bag.now_ns() == 4 * S
    waiting = BagTime(paused=True)
    waiting.begin(S)
    clock.now_s += 5.0
    assert waiting.now_ns() == S


def test_ticks_are_due_once_a_period(clock):
    bag = BagTime()
    bag.begin(0)
    assert bag.tick_is_due(0.5)
    clock.now_s += 0.25
    assert not bag.tick_is_due(0.5)
    clock.now_s += 0.25
    assert bag.tick_is_due(0.5)
    assert not bag.tick_is_due(0.5)
    bag.begin(0)
    assert bag.tick_is_due(0.5)


def slept_s(bag, until_ns, at_most_s):
    began = time.monotonic()
    bag.sleep(until_ns, at_most_s)
    return time.monotonic() - began


@pytest.mark.parametrize(
    ("rate", "paused", "until_s", "at_most_s", "expected_s"),
    [(2.0, False, 0.4, 5.0, 0.2), (0.5, False, 0.1, 5.0, 0.2), (1.0, False, 9.0, 0.2, 0.2), (1.0, True, 0.01, 0.2, 0.2),
     (1.0, False, -1.0, 5.0, 0.0)],
)  # fmt: skip
def test_sleep_is_of_the_bag_s_time(rate, paused, until_s, at_most_s, expected_s):
    bag = BagTime(rate, paused)
    bag.begin(3 * S)
    assert slept_s(bag, 3 * S + round(until_s * S), at_most_s) == pytest.approx(expected_s, abs=0.08)


@pytest.mark.parametrize("change", [lambda bag: bag.wake(), lambda bag: bag.pause(True), lambda bag: bag.set_rate(2.0)])
def test_changes_end_a_sleep(change):
    bag = BagTime()
    bag.begin(0)
    timer = threading.Timer(0.1, change, [bag])
    timer.start()
    assert slept_s(bag, 60 * S, 20.0) < 5.0
    timer.join()
