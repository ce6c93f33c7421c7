"""Tables of the report: a run that is 30 mm beside the truth, and has been lost twice."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.bodies.stick_person import PERIOD_NS, motion, write_run
from tracker_node.evaluation.consistency import NeesSeries
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.report import tables
from tracker_node.evaluation.review import Review, Truth, review
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.runs.load import load_run

N = 12
STATUS = ["TRACKING"] * 3 + ["LOST"] * 2 + ["TRACKING"] * 6 + ["LOST"]


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> Review:
    whole = motion(N)
    run = load_run(write_run(tmp_path_factory.mktemp("runs") / "run", whole, STATUS))
    positions = whole.landmarks_m + np.array([0.0, 0.0, 0.03])
    valid = np.ones(positions.shape[:2], dtype=bool)
    truth = Truth(Trajectories(whole.model.landmark_names, whole.stamps_ns, positions, valid))
    return review(run, whole.model, truth, EvaluationOptions("walk", 0.0, "stamp"))


@pytest.fixture
def blind(found) -> Review:
    return replace(found, joints=None, directions=None)


def test_without_truth_there_are_no_tables_of_errors(blind):
    for made in (tables.joint_table, tables.direction_table, tables.segment_table, tables.dof_table, tables.nees_table,
                 tables.offset_table, tables.bone_table):  # fmt: skip
        assert made(blind) is None
    assert tables.timing_table([blind]) is None


def test_errors_of_each_joint_and_of_all(found):
    table = tables.joint_table(found)
    assert (table.key, table.rows[-1][0], len(table.rows)) == ("joints_walk", "all joints", len(found.joints.joints) + 1)
    assert [row[0] for row in table.rows[:-1]] == [name.replace("_", " ") for name in found.joints.joints]
    for row in table.rows:
        assert row[1:5] == pytest.approx([30.0] * 4, abs=1e-6)
        assert all(value < 30.0 for value in row[5:])
    assert [column.group for column in table.columns] == ["", *["as tracked"] * 4, *["without constant offset"] * 4]


def test_offsets_are_tracked_minus_true_in_millimetres(found):
    table = tables.offset_table(found)
    assert [column.title for column in table.columns] == ["joint", "segment", "x [mm]", "y [mm]", "z [mm]", "length [mm]"]
    for row, offset in zip(table.rows, found.joints.offsets_m, strict=True):
        assert row[2:5] == pytest.approx(1000.0 * offset)
        assert row[5] == pytest.approx(np.sqrt(sum(value**2 for value in row[2:5])))


def test_lines_between_joints_that_moved_together_keep_their_direction(found):
    table = tables.direction_table(found)
    assert table.key == "segments_walk" and len(table.rows) == len(found.directions.bones)
    for row in table.rows:
        assert " – " in row[0] and "_" not in row[0]
        assert row[1:5] == pytest.approx([0.0] * 4, abs=1e-4) and row[9:13] == pytest.approx([30.0] * 4, abs=1e-6)
    assert [column.group for column in table.columns[1::4]] == [
        "direction [°]", "without offsets [°]", "middle [mm]", "without offsets [mm]",
    ]  # fmt: skip


def test_bones_have_their_lengths_on_both_sides(found):
    table = tables.bone_table(found)
    for row in table.rows:
        assert row[1] == pytest.approx(row[3]) and row[2] == pytest.approx(row[4], abs=1e-6)
    assert [column.group for column in table.columns[1:]] == ["tracked [mm]"] * 2 + ["truth [mm]"] * 2


def test_every_loss_with_its_times_and_its_end(found, blind):
    period = PERIOD_NS * 1e-9
    table = tables.loss_table([blind])
    assert [row[:2] for row in table.rows] == [["walk", "tracker's own"]] * 2
    assert table.rows[0][2:] == [pytest.approx(3 * period), pytest.approx(4 * period), 2, ""]
    assert table.rows[1][2:] == [pytest.approx(11 * period), pytest.approx(11 * period), 1, "not found again"]
    assert [row[1] for row in tables.loss_table([found]).rows] == ["in all"] * 2 + ["tracker's own"] * 2
    assert tables.loss_table([]) is None


def test_percentiles_of_every_stage(found):
    run = SimpleNamespace(details=SimpleNamespace(timings_ms=np.arange(101.0)[:, None] * [1.0, 2.0, 3.0]))
    run.details.timings_ms = np.vstack([run.details.timings_ms, [np.nan, 1.0, 1.0]])  # a set that does not tell
    table = tables.timing_table([replace(found, run=run)])
    assert table.rows[0] == ["walk", "observe", 50.0, 95.0, 99.0, 100.0, 101]
    assert table.rows[1] == ["walk", "optimize", 100.0, 190.0, 198.0, 200.0, 101]
    assert table.rows[2][:3] == ["walk", "total", 150.0]
    assert [column.title for column in table.columns] == [
        "run",
        "stage",
        "p50 [ms]",
        "p95 [ms]",
        "p99 [ms]",
        "max [ms]",
        "image sets",
    ]


def test_consistency_is_said_in_words(blind):
    bounds = np.array([[0.8, 1.2]] * 3)
    raw = NeesSeries(("left_hip", "b", "c"), 3, np.array([[1.2, 1.21, 0.79]]), bounds)
    free = NeesSeries(("left_hip", "b", "c"), 3, np.array([[0.8, np.nan, 2.0]]), bounds)
    assert tables.nees_table(replace(blind, landmark_nees=raw)) is None
    rows = tables.nees_table(replace(blind, landmark_nees=raw, landmark_nees_free=free)).rows
    assert rows[0] == ["left hip", 1.2, 0.8, 1.2, "within", 0.8, 0.8, 1.2, "within"]
    assert (rows[1][4], rows[1][8], rows[2][4], rows[2][8]) == ("too sure", "", "too cautious", "too sure")
