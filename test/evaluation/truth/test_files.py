"""Truth from TRC and CSV."""

import numpy as np
import pytest

from helpers.bodies.stick_person import motion, write_truth
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.truth.files import load_true_states, load_truth
from tracker_node.loaders.motion.c3d_file import dump_c3d
from tracker_node.loaders.motion.trc import MarkerTrajectories, dump_trc


def test_trc_with_the_names_of_openpose(tmp_path):
    positions = np.random.default_rng(0).normal(size=(4, 2, 3))
    valid = np.array([[True, True], [True, False], [True, True], [True, True]])
    positions[~valid] = 0.0
    times = 0.5 + np.arange(4) / 60.0
    dump_trc(MarkerTrajectories(("RShoulder", "Neck"), times, positions, 60.0, valid), tmp_path / "a.trc", y_up=True)
    truth = load_truth(tmp_path / "a.trc")
    assert truth.names == ("right_shoulder", "neck")
    assert truth.stamps_ns.tolist() == [500_000_000, 516_666_667, 533_333_333, 550_000_000]
    assert truth.positions_m == pytest.approx(positions)
    assert truth.valid.tolist() == valid.tolist()


@pytest.mark.parametrize("file_y_up", [True, False])
def test_c3d_says_itself_which_axis_is_up(tmp_path, file_y_up):
    positions = np.random.default_rng(0).normal(size=(4, 2, 3))
    valid = np.array([[True, True], [True, False], [True, True], [True, True]])
    positions[~valid] = 0.0
    markers = MarkerTrajectories(("RShoulder", "Neck"), np.arange(4) / 60.0, positions, 60.0, valid)
    dump_c3d(markers, tmp_path / "a.c3d", file_y_up)
    truth = load_truth(tmp_path / "a.c3d")
    assert truth.names == ("right_shoulder", "neck")
    assert truth.positions_m == pytest.approx(positions, abs=1e-6)  # single precision
    assert truth.valid.tolist() == valid.tolist()


@pytest.mark.parametrize("times", [(0.0, 1e-12, 1.0), (0.0, 1.0, 1e300)])
def test_times_that_make_no_stamps_are_refused(tmp_path, times):
    valid = np.ones((3, 1), dtype=bool)
    dump_trc(MarkerTrajectories(("Neck",), np.array(times), np.ones((3, 1, 3)), 60.0, valid), tmp_path / "a.trc")
    with pytest.raises(FileFormatError, match="times"):
        load_truth(tmp_path / "a.trc")


def test_a_landmark_under_two_names_is_refused(tmp_path):
    positions, valid = np.ones((2, 2, 3)), np.ones((2, 2), dtype=bool)
    dump_trc(MarkerTrajectories(("RKnee", "right_knee"), np.arange(2.0), positions, 1.0, valid), tmp_path / "a.trc")
    with pytest.raises(FileFormatError, match="right_knee"):
        load_truth(tmp_path / "a.trc")


def test_csv(tmp_path):
    tracked = motion(3)
    truth = load_truth(write_truth(tmp_path / "truth.csv", tracked))
    assert truth.names == tracked.model.landmark_names
    assert truth.positions_m == pytest.approx(tracked.landmarks_m, abs=0)


def test_other_files_are_refused(tmp_path):
    with pytest.raises(FileFormatError, match=r"\.trc, \.c3d or \.csv"):
        load_truth(tmp_path / "truth.txt")
    (tmp_path / "empty.csv").write_text("stamp_ns,landmark,x,y,z\n")
    with pytest.raises(FileFormatError, match="at least one row"):
        load_truth(tmp_path / "empty.csv")
    (tmp_path / "nothing.csv").write_text("")
    for load in (load_truth, load_true_states):
        with pytest.raises(FileFormatError, match="field 'header'"):
            load(tmp_path / "nothing.csv")
