"""What the report does with time: gaps without a state, runs that begin later than others, truth of a part of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from helpers.bodies.stick_person import PERIOD_NS, Motion, motion, write_run
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.metrics import times_with_gaps
from tracker_node.evaluation.report.builder import curves
from tracker_node.evaluation.report.charts import error_chart, joint_map, status_strips
from tracker_node.evaluation.report.kinematics import ANGLES, VELOCITIES
from tracker_node.evaluation.report.tables import loss_table
from tracker_node.evaluation.review import Review, Truth, review
from tracker_node.evaluation.truth.files import TrueStates
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.model.configuration import variable_names
from tracker_node.runs.load import load_run

N = 20
PERIOD_S = PERIOD_NS * 1e-9


def joints_of(tracked: Motion) -> Truth:
    positions = tracked.landmarks_m
    valid = np.ones(positions.shape[:2], dtype=bool)
    return Truth(Trajectories(tracked.model.landmark_names, tracked.stamps_ns, positions, valid))


def judged(folder: Path, sets: list[int], name: str = "x", truth: Truth | None = None, first_image: int = 0) -> Review:
    """A perfect run of some of the sets; its stamps count from its own first image."""
    whole = motion(N)
    part = Motion(whole.model, whole.stamps_ns[sets], tuple(whole.states[i] for i in sets))
    run = load_run(write_run(folder / name, part))
    shifted = replace(run, stamps_ns=run.stamps_ns - first_image * PERIOD_NS)
    options = EvaluationOptions(name, 0.0, "first", first_image=first_image)
    return review(shifted, whole.model, joints_of(whole) if truth is None else truth, options)


def test_a_gap_is_a_loss_with_a_time_until_it_was_found_again(tmp_path):
    found = judged(tmp_path, [*range(5), *range(9, N)])
    figures = found.metrics()
    assert (figures["x.lost_sets"], figures["x.losses"], figures["x.not_reacquired"]) == (4, 1, 0)
    assert figures["x.reacquisition_s_max"] == pytest.approx(4 * PERIOD_S)
    (row,) = loss_table([found]).rows
    assert row[2:5] == [pytest.approx(5 * PERIOD_S), pytest.approx(8 * PERIOD_S), 4]
    (band,) = error_chart([found]).bands
    assert band == pytest.approx((4.5 * PERIOD_S, 8.5 * PERIOD_S))
    (lost,) = [s for s in status_strips([found]).strips if s.label == "lost"]
    assert (lost.start, lost.end) == pytest.approx(band)


def test_no_line_runs_across_a_gap(tmp_path):
    found = judged(tmp_path, [*range(5), *range(9, N)])
    errors, cells = error_chart([found]).lines[0], joint_map(found)
    whole, filtered = [(errors.x, errors.y), (cells.times, cells.values[:, 0])], []
    for curve in curves([found]).curves:
        of = filtered if curve.group in (ANGLES, VELOCITIES) else whole
        of += [(line.x, line.y) for _, lines in curve.panels for line in lines]
    for x, y in whole + filtered:
        inside = (x > 4.5 * PERIOD_S) & (x < 8.5 * PERIOD_S)
        assert inside.any() and np.isnan(y[inside]).all()
    assert all(np.isfinite(y[(x < 4.5 * PERIOD_S) | (x > 8.5 * PERIOD_S)]).all() for x, y in whole)
    assert len(filtered) > 10 and all(np.isfinite(y[x > 8.5 * PERIOD_S]).any() for x, y in filtered)


@pytest.mark.parametrize(("missing", "added"), [(1, 1), (2, 2), (1_000_000_000, 2)])
def test_a_gap_of_any_length_takes_two_instants(missing, added):
    times, sets = times_with_gaps(np.array([0.0, 0.1, 0.2 + 0.1 * missing]), 0.1)
    assert (sets == -1).sum() == added and times[2] == pytest.approx(0.2) and sets[-1] == 2
    assert times[-2] == pytest.approx(0.1 + 0.1 * missing)


def test_runs_that_begin_elsewhere_stand_where_they_belong(tmp_path):
    """One of the first half, one of the second: the wrist's path goes on from one to the other, and so does the truth."""
    early, late = judged(tmp_path, list(range(10)), "early"), judged(tmp_path, list(range(10, N)), "late", first_image=10)
    chart = error_chart([early, late])
    assert chart.lines[0].x == pytest.approx(np.arange(10) * PERIOD_S)
    assert chart.lines[2].x == pytest.approx(np.arange(10, N) * PERIOD_S)
    (wrist,) = [curve for curve in curves([early, late]).curves if curve.name == "left wrist"]
    true, mine, other = wrist.panels[2][1]
    assert [line.label for line in (true, mine, other)] == ["truth", "early", "late"]
    told = np.isfinite(true.y)
    assert true.x[told] == pytest.approx(np.arange(N) * PERIOD_S)
    assert true.y[told] == pytest.approx(np.concatenate([mine.y, other.y]))


def test_curves_of_a_group_begin_with_one_that_has_truth_and_say_what_they_stand_beside(tmp_path):
    told, alone = judged(tmp_path, list(range(N))), judged(tmp_path, list(range(N)), "alone", Truth())
    made = curves([alone, replace(told, states=None)]).curves
    first = next(curve for curve in made if curve.group == "landmarks")
    assert made[0].group == ANGLES and first.panels[0][1][0].label == "truth"
    assert curves([alone]).note.endswith("landmarks, and the model's degrees of freedom.")
    assert "one run beside the other" in curves([alone, replace(alone, name="b")]).note
    assert "against the truth" in curves([told]).note


def test_truth_of_angles_alone_counts_every_angle(tmp_path):
    """The first joint is 4 degrees off, and the truth knows nothing of the root."""
    whole = motion(N)
    names = variable_names(whole.model)[6:]
    values = np.array([state.joint_positions for state in whole.states])
    values[:, 0] += np.deg2rad(4.0)
    for count in (len(names), 3):
        states = TrueStates(names[:count], whole.stamps_ns, values[:, :count], np.ones((N, count), dtype=bool))
        figures = judged(tmp_path, list(range(N)), truth=Truth(states=states)).metrics()
        assert figures["x.joint_angle_deg"] == pytest.approx(4.0 / count)
