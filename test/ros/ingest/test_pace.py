"""When recorded images are due."""

import threading
import time

import pytest

from tracker_node.ros.ingest.outlet import Pace

S = 1_000_000_000


def test_the_first_image_is_due_at_once_and_sets_the_time_of_day():
    pace = Pace()
    began = time.monotonic()
    assert pace.wait(5 * S, threading.Event()) < 0.1
    assert time.monotonic() - began < 0.2
    assert 5 * S + pace.epoch_ns == pytest.approx(time.time_ns(), abs=0.2 * S)


def test_a_later_image_is_waited_for():
    pace, never = Pace(), threading.Event()
    pace.wait(5 * S, never)
    began, epoch_ns = time.monotonic(), pace.epoch_ns
    assert pace.wait(5 * S + S // 5, never) < 0.1
    assert 0.15 < time.monotonic() - began < 0.4
    assert pace.epoch_ns == epoch_ns


def test_what_is_late_is_told_in_seconds():
    pace, never = Pace(), threading.Event()
    pace.wait(5 * S, never)
    assert pace.wait(2 * S, never) == pytest.approx(3.0, abs=0.1)


def test_nothing_is_waited_for_when_it_ends():
    pace, stop = Pace(), threading.Event()
    pace.wait(0, stop)
    stop.set()
    began = time.monotonic()
    assert pace.wait(60 * S, stop) == 0.0
    assert time.monotonic() - began < 0.2
