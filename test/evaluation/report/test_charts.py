"""Charts of a report: runs whose joints are all so many millimeters from truth, alone and side by side."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.stick_person import PERIOD_NS, motion, write_run
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.report import charts
from tracker_node.evaluation.review import Review, Truth, review
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.runs.load import load_run
from tracker_node.tracking.estimate import GRAY_LEVELS

N = 10
PERIOD_S = PERIOD_NS * 1e-9


@pytest.fixture(scope="module")
def reviewed(tmp_path_factory):
    """A review of a run whose truth is moved by ``up_m`` but for the last joint, which is moved by ``last_m``."""
    folder = tmp_path_factory.mktemp("runs")

    def made(name: str, up_m: float, last_m: float, told: bool = True) -> Review:
        whole = motion(N)
        run = load_run(write_run(folder / f"{name}{up_m}{last_m}", whole))
        positions = whole.landmarks_m + np.array([0.0, 0.0, up_m])
        positions[:, -1, 2] += last_m - up_m
        valid = np.ones(positions.shape[:2], dtype=bool)
        truth = Truth(Trajectories(whole.model.landmark_names, whole.stamps_ns, positions, valid)) if told else Truth()
        return review(run, whole.model, truth, EvaluationOptions(name, 0.0, "stamp"))

    return made


@pytest.fixture(scope="module")
def one(reviewed):
    return reviewed("one", 0.03, 0.06)


@pytest.fixture(scope="module")
def other(reviewed):
    return reviewed("other", 0.15, 0.15)


def mean_mm(found):
    return 30.0 + 30.0 / len(found.joints.joints) if last_is_judged(found) else 30.0


def last_is_judged(found):
    return found.model.landmark_names[-1] in found.joints.joints


def test_errors_are_in_millimetres_mean_and_worst(one):
    chart = charts.error_chart([one])
    lines = {line.label: line for line in chart.lines}
    assert list(lines) == ["mean", "worst joint", "mean without offsets"]
    np.testing.assert_allclose(lines["mean"].x, PERIOD_S * np.arange(N))
    np.testing.assert_allclose(lines["mean"].y, mean_mm(one), atol=1e-6)
    np.testing.assert_allclose(lines["worst joint"].y, 60.0 if last_is_judged(one) else 30.0, atol=1e-6)
    assert lines["mean without offsets"].y.max() < lines["mean"].y.min()
    assert lines["worst joint"].dashed and not lines["mean"].dashed
    assert (chart.levels, chart.bands, chart.note) == ([], [], "Distance to truth.")


def test_two_runs_have_their_names_and_colors(one, other):
    lines = charts.error_chart([one, other]).lines
    assert [line.label for line in lines] == ["one: mean", "one: worst joint", "other: mean", "other: worst joint"]
    assert lines[0].color == lines[1].color == charts.CYCLE[0]
    assert lines[2].color == lines[3].color == charts.CYCLE[1]
    np.testing.assert_allclose(lines[2].y, 150.0, atol=1e-6)


@pytest.mark.parametrize(("up_m", "level", "lost"), [(0.09, False, False), (0.15, True, False), (0.25, True, True)])
def test_the_level_of_lost_sets_is_drawn_where_it_is_near(reviewed, up_m, level, lost):
    chart = charts.error_chart([reviewed("x", up_m, up_m)])
    assert [value for value, _ in chart.levels] == ([200.0] if level else [])
    assert chart.bands == ([pytest.approx((-0.5 * PERIOD_S, (N - 0.5) * PERIOD_S))] if lost else [])
    assert ("Shaded" in chart.note) == lost


def test_without_truth_there_are_no_errors(reviewed):
    blind = reviewed("blind", 0.0, 0.0, told=False)
    assert charts.error_chart([blind]) is None
    assert charts.joint_bars([blind]) is None
    assert charts.joint_map(blind) is None
    assert charts.pck_chart([blind]) is None


def test_bars_are_of_each_joint(one, other):
    bars = charts.joint_bars([one])
    assert list(bars.categories) == [name.replace("_", " ") for name in one.joints.joints]
    assert [label for label, _, _ in bars.series] == [
        "as tracked",
        "without offset, in the segment",
        "without offset, in the world",
    ]
    tracked = dict(zip(one.joints.joints, bars.series[0][1], strict=True))
    for name, value in tracked.items():
        assert value == pytest.approx(60.0 if name == one.model.landmark_names[-1] else 30.0, abs=1e-6)
    assert np.max(bars.series[2][1]) < 1.0  # a constant offset
    both = charts.joint_bars([one, other])
    assert [(label, color) for label, _, color in both.series] == [("one", charts.CYCLE[0]), ("other", charts.CYCLE[1])]
    np.testing.assert_allclose(both.series[1][1], 150.0, atol=1e-6)


def test_the_map_has_a_row_of_each_joint(one, reviewed):
    cells = charts.joint_map(one)
    assert cells.values.shape == (N, len(one.joints.joints))
    np.testing.assert_allclose(cells.values[:, 0], 30.0, atol=1e-6)
    assert cells.top == pytest.approx(np.percentile(cells.values, 99))
    assert charts.joint_map(reviewed("near", 0.001, 0.001)).top == 5.0


def test_shares_within_a_distance(one):
    tracked, free = charts.pck_chart([one]).lines
    assert (tracked.x[0], tracked.x[-1], len(tracked.x)) == (0.0, pytest.approx(300.0), 121)
    assert tracked.y[tracked.x < 29.0].max() == 0.0
    assert tracked.y[tracked.x > 61.0].min() == 1.0
    assert free.dashed and not tracked.dashed
    assert charts.pck_chart([one]).y_max == 1.0
    assert [line.label for line in charts.pck_chart([one]).lines] == ["as tracked", "without offsets"]


def with_cameras(found: Review) -> Review:
    """The first of two cameras sees nothing in the fourth set."""
    residuals = np.stack([1.0 + np.arange(N), np.full(N, 0.5)], axis=1)
    residuals[3, 0] = 0.0
    return replace(found, run=replace(found.run, cameras=("a", "b"), camera_residuals=residuals))


def test_residuals_are_of_each_camera_and_of_all(one, other):
    (chart,) = charts.residual_charts([with_cameras(one)])
    first, second, together = chart.lines
    assert [line.label for line in chart.lines] == ["a", "b", "all cameras"]
    np.testing.assert_allclose(first.y, [1.0, 2.0, 3.0, np.nan, *range(5, 11)])
    np.testing.assert_allclose(second.y, 0.5)
    np.testing.assert_allclose(together.y, one.run.residual)
    assert [first.color, second.color] == list(charts.CYCLE[:2])
    whole, *each = charts.residual_charts([one, other])
    assert [line.label for line in whole.lines] == ["one", "other"] and whole.y_label == each[0].y_label == "rms [px]"
    assert [chart.title for chart in each] == ["Residuals of one per camera", "Residuals of other per camera"]
    colors = replace(other, run=replace(other.run, residual_unit=GRAY_LEVELS))
    labels = [chart.y_label for chart in charts.residual_charts([one, colors])]
    assert labels == ["rms [gray levels or px]", "rms [px]", "rms [gray levels]"]


def test_the_status_is_of_the_tracker_and_of_the_truth(one, other):
    strips = charts.status_strips([one])
    assert strips.rows == ["in all", "tracker's own"]
    assert [(s.row, s.label) for s in strips.strips] == [("in all", "near"), ("tracker's own", "tracking")]
    for strip in strips.strips:
        assert (strip.start, strip.end) == pytest.approx((-0.5 * PERIOD_S, (N - 0.5) * PERIOD_S))
    rows = charts.status_strips([one, other]).rows
    assert rows == [f"{name}: {row}" for name in ("one", "other") for row in ("in all", "tracker's own")]


def test_iterations_are_of_sets_with_a_state(one):
    first, *_ = charts.effort_charts([one])
    np.testing.assert_allclose(first.lines[0].y, one.run.iterations)
    assert first.y_label == "iterations"
