"""What a robot has said, at other times than those of its readings."""

import math
import threading
import time

import pytest

from tracker_node.observation.joint_states import JointStates

MS = 1_000_000


def line(step_ms: int = 10, n: int = 10) -> JointStates:
    states = JointStates()
    for k in range(n):
        states.add(k * step_ms * MS, [("a", 0.1 * k), ("b", 1.0)])
    return states


def test_between_readings_it_is_on_the_line_through_them():
    states = line()
    assert states.at(35 * MS) == pytest.approx({"a": 0.35, "b": 1.0}) and states.at(40 * MS) == {"a": 0.4, "b": 1.0}


def test_just_beyond_the_last_it_goes_on_and_far_beyond_nothing_is_said():
    states = line()
    assert states.at(110 * MS)["a"] == pytest.approx(1.1) and states.at(191 * MS) == {} and states.at(-6 * MS) == {}
    assert line(n=1).at(50 * MS) == {"a": 0.0, "b": 1.0}


def test_a_joint_that_turns_without_end_goes_on_where_its_readings_begin_anew():
    states = JointStates(endless=["a"])
    for k in range(10):
        angle = math.remainder(3.0 + 0.1 * k, math.tau)
        states.add(k * 10 * MS, [("a", angle), ("b", angle)])
    said = states.at(15 * MS)  # 3.15, between 3.1 and 3.2 - 2 pi
    assert said["a"] == pytest.approx(3.15) and said["b"] == pytest.approx(3.15 - math.pi)
    states = JointStates(endless=["a"])
    states.add(0, [("a", 3.1)])
    states.add(10 * MS, [("a", 3.2 - math.tau)])
    assert states.at(20 * MS)["a"] == pytest.approx(3.3 - math.tau)


def test_a_gap_says_nothing():
    states = line()
    states.add(600 * MS, [("a", 6.0)])
    assert "a" not in states.at(300 * MS) and states.at(600 * MS) == {"a": 6.0}


def test_a_stamp_far_ahead_does_not_push_the_others_out():
    states = JointStates(most=20)
    states.add(10**18, [("a", 7.0)])
    for k in range(100):
        states.add(k * 10 * MS, [("a", 0.1 * k)])
    assert states.at(985 * MS) == pytest.approx({"a": 9.85}) and states.at(1010 * MS) == pytest.approx({"a": 10.1})
    assert states.at(2000 * MS) == {}


def test_joints_have_readings_of_their_own_in_any_order():
    states = JointStates()
    for stamp, name, value in ((20, "a", 2.0), (15, "grip", 0.5), (0, "a", 0.0), (5, "grip", 0.3)):
        states.add(stamp * MS, [(name, value)])
    assert states.at(10 * MS) == pytest.approx({"a": 1.0, "grip": 0.4}) and set(states.names) == {"a", "grip"}


def test_old_readings_are_forgotten():
    states = JointStates(most=51)
    for k in range(1000):
        states.add(k * MS, [("a", float(k))])
    assert len(states._readings["a"]) == 51 and states.at(990 * MS) == {"a": 990.0}
    states.clear()
    assert states.at(990 * MS) == {} and not states.wait_beyond(0, 0.0)


def test_a_reading_is_waited_for():
    states = line()
    assert states.wait_beyond(90 * MS, 0.0) and not states.wait_beyond(91 * MS, 0.01)
    timer = threading.Timer(0.05, lambda: states.add(100 * MS, [("a", 1.0)]))
    timer.start()
    began = time.monotonic()
    assert states.wait_beyond(95 * MS, 30.0) and time.monotonic() - began < 20.0
    timer.join()
