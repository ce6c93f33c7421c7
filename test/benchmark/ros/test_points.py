"""``benchmark/ros/points.py``: what counts as lost, and as a rate."""

import pytest

from benchmark.ros.points import _Heard, figures_of

S = 10**9
PERIOD_NS = S // 30


def test_rates_and_losses_of_what_has_come():
    sent = [S + i * PERIOD_NS for i in range(60)]
    states = [(stamp, stamp + 20_000_000, 1) for i, stamp in enumerate(sent) if i != 7]
    points = [(stamp, stamp + 200_000_000, 1) for stamp in sent[::10]]
    heard = _Heard(sent, states, [arrival for _, arrival, _ in points], points)
    figures = figures_of(heard, S, 3 * S)
    assert (figures["live_points.lost"], figures["live_points.sets"], figures["live_points.not_tracking"]) == (1, 60, 0)
    assert figures["points.rate_hz"] == figures["live_points.used_hz"] == 3.0
    assert figures["points.late_ms_p50"] == pytest.approx(200.0)
    assert figures["live_points.latency_ms_p50"] == pytest.approx(20.0)
    assert figures["points.without_people"] == 0
