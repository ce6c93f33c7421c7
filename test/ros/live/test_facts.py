"""What a live view remembers: figures of states, and statuses, in plain values."""

import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from tracker_msgs.msg import TrackedState

from tracker_node.ros import live_view as live_facts
from tracker_node.ros.conversions import stamp_message
from tracker_node.ros.live_view import LiveDiagnostics, LiveTracker


def state(age_s=0.05, status=1, **fields):
    message = TrackedState(status=status, residual=1.5, residual_unit="px", total_ms=20.0, **fields)
    message.header.stamp = stamp_message(time.time_ns() - round(age_s * 1e9))
    return message


def points(*messages):
    tracker = LiveTracker()
    for message in messages:
        tracker.take(message)
    return tracker.points_after(0)


def test_states_are_numbered_from_one_on():
    tracker = LiveTracker()
    for _ in range(3):
        tracker.take(state())
    assert [point.number for point in tracker.points_after(0)] == [1, 2, 3]
    assert [point.number for point in tracker.points_after(2)] == [3]
    assert tracker.points_after(3) == []


def test_old_states_are_forgotten_and_the_numbers_go_on(monkeypatch):
    monkeypatch.setattr(live_facts, "HISTORY", 2)
    assert [point.number for point in points(state(), state(), state())] == [2, 3]


def test_a_point_has_the_figures_of_its_state():
    (point,) = points(state(0.25))
    assert (point.status, point.residual, point.total_ms) == (live_facts.Status(1).name, 1.5, 20.0)
    assert point.latency_ms == pytest.approx(250.0, abs=30.0)
    (unknown,) = points(state(status=99))
    assert unknown.status == "STATUS 99"
    (nothing,) = points(TrackedState(residual=float("nan"), total_ms=float("inf")))
    assert (nothing.residual, nothing.total_ms) == (None, None)


@pytest.mark.parametrize(("age_s", "known"), [(-0.05, True), (-0.3, False), (599.0, True), (601.0, False)])
def test_stamps_of_another_clock_have_no_latency(age_s, known):
    (point,) = points(state(age_s))
    assert (point.latency_ms is not None) == known
    if known:
        assert point.latency_ms == pytest.approx(1e3 * age_s, abs=40.0)


def test_the_rate_is_of_two_seconds():
    tracker = LiveTracker()
    assert tracker.rate_hz() == 0.0
    for _ in range(6):
        tracker.take(state())
    assert tracker.rate_hz() == 3.0


def test_states_older_than_two_seconds_are_not_of_the_rate(monkeypatch):
    tracker = LiveTracker()
    tracker.take(state())
    now_s = time.monotonic()
    tracker.take(state())
    monkeypatch.setattr(time, "monotonic", lambda: now_s + 1.9)
    assert tracker.rate_hz() == 1.0
    monkeypatch.setattr(time, "monotonic", lambda: now_s + 2.5)
    assert tracker.rate_hz() == 0.0


def test_facts_are_plain_values():
    assert LiveTracker().facts() is None
    tracker = LiveTracker()
    message = state(
        status_reason="two cameras", model="stick", iterations=4, dof_names=["x", "y"], values=[1.0, float("nan")],
        limbs=["arm", "leg"], limb_status=[1, 77], limb_lost_probability=[0.25, 0.5], limb_reasons=["", "hidden"],
        cameras=["a"], camera_residuals=[2.5], camera_samples=[30],
    )  # fmt: skip
    message.header.stamp = stamp_message(1_500_000_000)
    tracker.take(message)
    facts = tracker.facts()
    assert 0.0 <= facts.pop("age_s") < 5.0
    name = live_facts._name(live_facts.Status, 1)
    assert facts == {
        "status": name, "reason": "two cameras", "model": "stick", "stamp_s": pytest.approx(1.5),
        "residual": 1.5, "residual_unit": "px", "iterations": 4, "dofs": [["x", 1.0], ["y", None]],
        "limbs": [["arm", live_facts.LimbStatus(1).name, 0.25, ""], ["leg", "LIMBSTATUS 77", 0.5, "hidden"]],
        "cameras": [["a", 2.5, 30]],
    }  # fmt: skip
    assert tracker.latest is message


def test_the_newest_status_of_every_part_is_kept_by_name():
    def status(name, level, text, part=""):
        values = [KeyValue(key="k", value=text)]
        return DiagnosticStatus(name=name, hardware_id=part, level=level, message=text, values=values)

    diagnostics = LiveDiagnostics()
    diagnostics.take(DiagnosticArray(status=[status("b", b"\x02", "bad"), status("a", b"\x00", "one", "1")]))
    diagnostics.take(DiagnosticArray(status=[status("b", b"\x01", "better"), status("a", b"\x03", "other", "2")]))
    facts = diagnostics.facts()
    assert all(0.0 <= fact.pop("age_s") < 5.0 for fact in facts)
    assert [(f["name"], f["hardware_id"], f["level"], f["message"]) for f in facts] == [
        ("a", "1", 0, "one"), ("a", "2", 3, "other"), ("b", "", 1, "better"),
    ]  # fmt: skip
    assert facts[2]["values"] == [["k", "better"]]


def test_levels_are_bytes_lists_or_numbers():
    assert [live_facts._level(level) for level in (b"\x02", [3], 1)] == [2, 3, 1]
