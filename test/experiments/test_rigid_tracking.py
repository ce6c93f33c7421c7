"""Experiments on a score that is known in closed form: how far a state is from a known one."""

from types import SimpleNamespace

import numpy as np
import pytest

from tracker_node.experiments.rigid_tracking import (
    VARIABLES,
    basin,
    error_metrics,
    motion_ranges,
    moved,
    pose_error,
    profile,
    success_rate,
    table1,
    track,
)
from tracker_node.experiments.somersault.experiments import START_ERROR, start_errors
from tracker_node.geometry import se3
from tracker_node.model.configuration import State, from_variables
from tracker_node.report.html import text_table

TRUTH = from_variables(np.array([0.3, -0.2, 1.1, 3.5, 0.1, 0.7]))


class DistanceScore:
    """Rises with the distance of the position (mm) from the truth's; infinite beyond ``edge_mm``."""

    def __init__(self, edge_mm=np.inf):
        self.edge_mm = edge_mm

    def score(self, state):
        distance = 1e3 * np.linalg.norm(state.T_world_root[:3, 3] - TRUTH.T_world_root[:3, 3])
        return distance if distance <= self.edge_mm else np.inf

    def scores(self, states):
        return np.array([self.score(state) for state in states])


@pytest.mark.parametrize("index", range(6))
def test_errors_are_told_by_variable_and_unit(index):
    change = np.zeros(6)
    change[index] = 3.0
    error = pose_error(moved(TRUTH, change), TRUTH)
    assert np.allclose(error, change, atol=1e-9)


def test_directions_are_those_of_the_world():
    up = TRUTH.retract(np.array([0, 0, 0.004, 0, 0, 0]))
    assert pose_error(up, TRUTH)[VARIABLES.index("vertical")] == pytest.approx(4.0)
    forward = TRUTH.retract(np.array([0.004, 0, 0, 0, 0, 0]))
    assert pose_error(forward, TRUTH)[VARIABLES.index("ap")] == pytest.approx(4.0)


def test_full_turns_are_no_error():
    turned = from_variables(np.array([0.3, -0.2, 1.1, 3.5 - 2 * np.pi, 0.1, 0.7]))
    assert np.allclose(pose_error(turned, TRUTH), 0.0, atol=1e-9)


def test_rms_and_maximum():
    errors = np.zeros((4, 6))
    errors[:, 0] = [1.0, -5.0, 1.0, 1.0]
    errors[:, 5] = [0.1, 0.1, -0.1, 0.1]
    metrics = error_metrics("a.b", errors)
    assert metrics["a.b.vertical_rms_mm"] == pytest.approx(np.sqrt(7.0)) and metrics["a.b.vertical_max_mm"] == 5.0
    assert metrics["a.b.twist_rms_deg"] == pytest.approx(0.1) and metrics["a.b.ap_max_mm"] == 0.0
    assert len(metrics) == 12


def test_tracking_starts_from_the_estimate_before_and_counts():
    shown, starts = [], []

    def fit(start):
        starts.append(start)
        return SimpleNamespace(state=start.retract(np.array([0.01, 0, 0, 0, 0, 0])), evaluations=60 + 12 * len(starts))

    tracked = track(shown.append, 3, TRUTH, fit)
    assert shown == [0, 1, 2] and starts[0] is TRUTH
    assert [s.T_world_root[0, 3] for s in starts] == pytest.approx([0.3, 0.31, 0.32])
    assert tracked.evaluations_per_variable == pytest.approx(14.0)
    assert np.allclose(tracked.errors([TRUTH] * 3)[:, VARIABLES.index("ap")], [10.0, 20.0, 30.0])


def test_profile_moves_one_variable():
    changes = np.array([-20.0, 0.0, 10.0])
    assert np.allclose(profile(DistanceScore(), TRUTH, "lateral", changes), np.abs(changes))
    assert np.allclose(profile(DistanceScore(), TRUTH, "tilt", changes), 0.0)


def test_basin_ends_where_the_score_falls_or_cannot_be_told():
    changes = np.arange(-5.0, 6.0) * 10.0
    scores = np.array([9.0, 8.0, 9.0, 4.0, 1.5, 1.0, 3.0, 4.0, 5.0, np.inf, np.inf])
    assert basin(changes, scores) == (0.0, 30.0, 30.0)
    shifted = np.array([np.inf, 5.0, 4.0, 3.0, 2.0, 1.0, 0.5, 3.0, 2.0, 4.0, 5.0])
    assert basin(changes, shifted) == (10.0, 50.0, 10.0)


def test_share_of_starts_from_which_a_fit_arrives():
    shown = []

    def pull(state):  # a fit that arrives from less than 100 mm and 10 degrees only
        tangent = state.difference(TRUTH)
        near = np.linalg.norm(tangent[:3]) < 0.1 and np.linalg.norm(tangent[3:6]) < np.deg2rad(10.0)
        return SimpleNamespace(state=TRUTH if near else state, evaluations=1)

    def rate(fit, truth, distance_mm, angle_deg, trials):
        return success_rate(shown.append, truth, fit, distance_mm, angle_deg, trials)

    assert rate(pull, [TRUTH], 99.0, 9.0, 20) == 1.0
    assert rate(pull, [TRUTH], 101.0, 9.0, 20) == rate(pull, [TRUTH], 99.0, 11.0, 20) == 0.0
    shown.clear()
    elsewhere = State(se3.exp(np.full(6, 2.0)), np.zeros(0))  # where that fit stays put
    assert rate(pull, [TRUTH, elsewhere], 20.0, 5.0, 4) == 0.5
    assert shown == [0, 1, 0, 1]


def test_table_stands_beside_the_paper():
    errors = np.zeros((2, 6))
    errors[:, 0] = [3.0, -4.0]
    motion = motion_ranges(np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [1.0, 0.01, 1.79, 2 * np.pi, np.deg2rad(8.0), np.pi]]))
    assert np.allclose(motion, [790.0, 1000.0, 10.0, 360.0, 8.0, 180.0])
    rows = table1({"ours": errors}, motion)
    assert rows[1] == ["vertical", "790 mm", "790 mm", "8.0 / 4.8 mm", "4.00 / 3.54 mm"]
    assert rows[2][0] == "A-P" and rows[6][3] == "0.6 / 0.3 deg"
    lines = text_table(rows).splitlines()
    assert len(lines) == 7 and len({len(line) for line in lines}) == 1  # columns end below each other


def test_several_starts_have_their_median_and_their_range():
    each = np.stack([np.full((4, 6), value) for value in (3.0, -1.0, 7.0)])
    metrics = error_metrics("a", each)
    assert metrics["a.vertical_rms_mm"] == 3.0 and metrics["a.twist_max_deg"] == 3.0
    assert (metrics["a.vertical_rms_low_mm"], metrics["a.vertical_rms_high_mm"]) == (1.0, 7.0)
    assert "a.vertical_rms_low_mm" not in error_metrics("a", each[0])
    assert error_metrics("a", each[:1]) == error_metrics("a", each[0])
    rows = table1({"ours": each}, np.ones(6))
    assert rows[1][-1] == "3.00 / 3.00 mm (1.00 to 7.00)"


def test_starts_differ_in_their_signs_alone():
    starts = start_errors(10)
    assert starts[0] == pytest.approx(START_ERROR) and np.abs(starts) == pytest.approx(np.tile(np.abs(START_ERROR), (10, 1)))
    assert len({tuple(row) for row in starts.tolist()}) == 10 and np.array_equal(starts[:3], start_errors(3))
