"""Runs side by side: what is compared, what is not, and what of an estimated lag is to be doubted."""

from dataclasses import replace

import numpy as np
import pytest
from stick_person import PERIOD_NS, Motion, motion, write_run

from tracker_node.evaluation.association import Trajectories
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.report_summary import parameter_table, parse_target, summary_table
from tracker_node.evaluation.review import Review, Truth, review
from tracker_node.evaluation.run_data import load_run

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
