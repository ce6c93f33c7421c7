"""Runs side by side: what is compared, what is not, and what of an estimated lag is to be doubted."""

import re
from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.stick_person import PERIOD_NS, Motion, motion, write_run
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.report.summary import (
    HIGHER,
    LOWER,
    METRICS,
    Metric,
    _difference,
    comparison_table,
    parameter_table,
    parse_target,
    summary_table,
)
from tracker_node.evaluation.review import Review, Truth, review
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.report.document import Cell
from tracker_node.runs.load import load_run

N = 40


def judged(folder, n: int = N, name: str = "a", lost: int = 0, shift: int = 0, lag: float | None = 0.0) -> Review:
    """A perfect run of n sets, the first of them LOST by its own word; truth ``shift`` images early."""
    whole = motion(N + 10)
    part = Motion(whole.model, whole.stamps_ns[:n], whole.states[:n])
    run = load_run(write_run(folder / name, part, ["LOST"] * lost + ["TRACKING"] * (n - lost)))
    positions, valid = whole.landmarks_m, np.ones((N + 10, len(whole.model.landmark_names)), dtype=bool)
    truth = Trajectories(whole.model.landmark_names, whole.stamps_ns - shift * PERIOD_NS, positions, valid)
    return review(run, whole.model, Truth(truth), EvaluationOptions(name, lag))


def test_counts_of_runs_of_other_lengths_are_not_judged(tmp_path):
    long, short = judged(tmp_path, lost=6), judged(tmp_path, 20, "b", lost=3)
    table = summary_table([long, short], {})
    marks = {row[-1].value: row[3].mark for row in table.rows}
    assert marks["lost_sets"] == marks["said_lost_sets"] == ""
    assert "Counts of runs with other numbers of image sets have none." in table.note
    alike = summary_table([long, judged(tmp_path, name="c", lost=3)], {})
    assert {row[-1].value: row[3].mark for row in alike.rows}["lost_sets"] == "better" and "Counts" not in alike.note


def test_parameters_are_those_of_runs_that_tell_theirs(tmp_path):
    runs = [judged(tmp_path, name=name) for name in "abc"]
    told = [{"parameters": {"x": 1, "y": 2}}, {}, {"parameters": {"x": 1, "y": 3}}]
    reviews = [replace(r, run=replace(r.run, info=info)) for r, info in zip(runs, told, strict=True)]
    table = parameter_table(reviews)
    assert [column.title for column in table.columns] == ["parameter", "a", "c"] and table.rows == [["y", "2", "3"]]
    assert parameter_table(reviews[:2]) is None


def test_a_lag_at_the_end_of_the_search_or_of_few_sets_is_doubted(tmp_path):
    assert judged(tmp_path, shift=1, lag=None).problems == []
    (beyond,) = judged(tmp_path, shift=4, lag=None).problems
    assert "+2.00 images, is at the end of the range" in beyond
    (few,) = judged(tmp_path, 12, lag=None).problems
    assert "from 12 image sets" in few
    assert list(judged(tmp_path, 12, shift=4, lag=2.0).problems) == []


@pytest.mark.parametrize("text", ["a<=nan", "a<=inf", "a<=", "a<=x", "<=5", "a=5", ""])
def test_targets_that_nothing_can_meet_or_miss_are_refused(text):
    with pytest.raises(ValueError, match="expected KEY<=NUMBER or KEY>=NUMBER"):
        parse_target(text)


@pytest.mark.parametrize(
    ("digits", "better", "first", "other", "text", "mark"),
    [
        (1, LOWER, 10.0, 9.0, "-1.0 better", "better"), (1, LOWER, 10.0, 11.26, "+1.3 worse", "worse"),
        (2, HIGHER, 0.5, 0.75, "+0.25 better", "better"), (2, HIGHER, 0.5, 0.25, "-0.25 worse", "worse"),
        (1, LOWER, 10.0, 10.04, "0.0", ""), (0, 0, 10, 12, "+2", ""), (0, 0, 10, 10, "0", ""), (1, 0, 10.0, 9.0, "-1.0", ""),
    ],
)  # fmt: skip
def test_differences_say_which_is_better(digits, better, first, other, text, mark):
    cell = _difference(Metric("k", "", "", "", digits, better), first, other)
    assert (cell.value, cell.mark) == (text, mark)


@pytest.mark.parametrize(("first", "other"), [(None, 1.0), (1.0, None), (float("nan"), 1.0), (1.0, float("inf"))])
def test_what_is_not_known_has_no_difference(first, other):
    assert _difference(Metric("k", "", "", ""), first, other) == Cell(None)


@pytest.mark.parametrize(
    ("text", "key", "shown", "met", "missed"),
    [
        ("mpjpe_mm<=60", "mpjpe_mm", "≤ 60", 60.0, 60.1),
        (" iou_a >= 0.8", "iou_a", "≥ 0.8", 0.8, 0.79),
        ("a<=-1e1", "a", "≤ -10", -11, 0),
    ],
)
def test_targets_are_bounds_that_may_be_reached(text, key, shown, met, missed):
    found, target = parse_target(text)
    assert (found, str(target)) == (key, shown)
    assert target.met_by(met)
    assert not target.met_by(missed)
    assert not target.met_by(float("nan"))


def test_targets_have_a_column_and_mark_the_values(tmp_path):
    run = judged(tmp_path, lost=6)
    targets = dict(map(parse_target, ("said_lost_sets<=6", "image_sets>=41", "nothing<=1")))
    table = summary_table([run], targets)
    assert [column.title for column in table.columns] == ["metric", "value", "", "target", "meaning", "key"]
    rows = {row[-1].value: row for row in table.rows}
    assert (rows["a.said_lost_sets"][1].mark, rows["a.said_lost_sets"][3]) == ("good", "≤ 6")
    assert rows["a.image_sets"][1] == Cell(40.0, "bad", 0)
    assert (rows["a.nothing"][1].value, rows["a.nothing"][1].mark, rows["a.nothing"][4]) == (None, "bad", "was not measured")
    assert rows["a.mpjpe_mm"][1].mark == ""


def test_of_several_runs_each_has_a_difference_to_the_first(tmp_path):
    runs = [judged(tmp_path, name=name) for name in "abc"]
    two, three = summary_table(runs[:2], {}), summary_table(runs, {})
    assert [column.title for column in two.columns] == ["metric", "a", "b", "difference", "", "meaning", "key"]
    assert [(column.title, column.group) for column in three.columns][4:6] == [(n, "difference to a") for n in "bc"]
    assert "Differences are to a" in three.note
    assert {row[-1].value for row in two.rows} >= {"mpjpe_mm", "image_sets"}
    assert summary_table(runs[:1], {}).note == ""


def test_joints_are_compared_where_two_runs_have_them(tmp_path):
    runs = [judged(tmp_path, name=name) for name in "ab"]
    assert comparison_table(runs[:1]) is None
    table = comparison_table(runs)
    names = runs[0].joints.joints
    assert [row[0] for row in table.rows] == [name.replace("_", " ") for name in names]
    assert [(column.title, column.group) for column in table.columns[1:]] == [
        ("a", "mean error [mm]"), ("b", "mean error [mm]"), ("b", "difference to a"),
    ]  # fmt: skip
    np.testing.assert_allclose([row[1] for row in table.rows], runs[0].joints.raw.per_joint_mm())
    assert {row[3].value for row in table.rows} == {"0.0"}


@pytest.mark.parametrize("metric", METRICS, ids=lambda metric: metric.key)
def test_metrics_have_keys_and_titles_for_people(metric):
    assert re.fullmatch(r"[a-z][a-z0-9_]*\*?", metric.key)
    assert metric.title[0].isupper() or metric.title[0] in "…5"
    assert metric.unit in ("", "mm", "m", "s", "°", "%", "images", "px", "gray levels", "ms", "m/s", "steps/min")
    assert metric.better == (HIGHER if "fraction" in metric.meaning or metric.key == "iou_*" else min(metric.better, 0))
