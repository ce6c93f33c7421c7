import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker_node.errors import FileFormatError, UnknownNameError
from tracker_node.loaders.motion.trc import MarkerTrajectories, dump_trc, load_trc, without_subject

HEADER = (
    "PathFileType\t4\t(X/Y/Z)\tt.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "60\t60\t2\t2\tmm\t60\t1\t2\n"
    "Frame#\tTime\tHip\t\t\tKnee\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
)


def load(tmp_path, text, **options):
    (tmp_path / "t.trc").write_text(text)
    return load_trc(tmp_path / "t.trc", **options)


def test_units_and_axes(tmp_path):
    markers = load(tmp_path, HEADER + "1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.5\t10\t20\t30\t40\t50\t60\n")
    assert markers.names == ("Hip", "Knee")
    assert np.allclose(markers.positions_m[0, 0], [0.003, 0.001, 0.002])  # z up: X = z, Y = x, Z = y
    assert markers.times_s.tolist() == [0.0, 0.5]
    assert markers.rate_hz == 60.0
    assert markers.valid.all()
    assert markers.index("Knee") == 1
    with pytest.raises(UnknownNameError, match="Toe"):
        markers.index("Toe")
    as_they_are = load(tmp_path, HEADER.replace("\tmm\t", "\tcm\t") + "1\t0.0\t1\t2\t3\t4\t5\t6\n", y_up=False)
    assert np.allclose(as_they_are.positions_m[0, 0], [0.01, 0.02, 0.03])


def test_gaps_are_marked_and_hold_no_nan(tmp_path):
    rows = "1\t0.0\t1\t2\t3\t\t\t\n\n2\t0.1\t1\t2\t3\n3\t0.2\tNaN\t2\t3\t4\t5\t6\t\n4\t0.3\t0\t0\t0\t4\t\t6\n"
    markers = load(tmp_path, HEADER + rows)
    assert markers.valid.tolist() == [[True, False], [True, False], [False, True], [False, False]]
    assert np.isfinite(markers.positions_m).all()
    assert np.all(markers.positions_m[~markers.valid] == 0.0)


def test_spaces_instead_of_tabs_and_an_empty_line_after_the_header(tmp_path):
    markers = load(tmp_path, HEADER.replace("\t", "  ").replace("Hip      Knee", "Hip Knee") + "\n1 0.0 1 2 3 4 5 6\n")
    assert markers.positions_m.shape == (1, 2, 3)


@pytest.mark.parametrize(("old", "new", "field"), [
    ("PathFileType", "Something", "line 1"),
    ("\tmm\t", "\tfurlongs\t", "Units"),
    ("Hip\t\t\tKnee", "Hip\t\t\tHip", "line 4"),
    ("Hip\t\t\tKnee", "\t\t\t", "line 4"),
    ("1\t0.0\t1", "1\t0.0\tone", "line 6"),
    ("5\t6\n2", "5\t6\t7\n2", "line 6"),
    ("\t0.5\t", "\t0.0\t", "Time"),
    ("\t0.5\t", "\t\t", "Time"),
    ("60\t60\t2", "fast\t60\t2", "DataRate"),
])  # fmt: skip
def test_errors_name_file_and_line(tmp_path, old, new, field):
    text = HEADER + "1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.5\t10\t20\t30\t40\t50\t60\n"
    assert old in text
    with pytest.raises(FileFormatError) as error:
        load(tmp_path, text.replace(old, new, 1))
    assert error.value.field == field
    assert "t.trc" in str(error.value)


def test_a_file_that_ends_early_is_named(tmp_path):
    for text in ("", HEADER[:60], HEADER):
        with pytest.raises(FileFormatError):
            load(tmp_path, text)


def test_a_missing_rate_comes_from_the_times(tmp_path):
    rows = "1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.04\t10\t20\t30\t40\t50\t60\n"
    assert np.isclose(load(tmp_path, HEADER.replace("60\t60\t2", "0\t0\t2") + rows).rate_hz, 25.0)


coordinates = st.floats(-1e3, 1e3).filter(lambda v: v != 0.0)


@given(st.integers(1, 4), st.integers(1, 5), st.booleans(), st.data())
def test_any_trajectories_come_back(tmp_path_factory, n_markers, n_rows, y_up, data):
    path = tmp_path_factory.mktemp("trc") / "a.trc"
    values = data.draw(st.lists(coordinates, min_size=3 * n_markers * n_rows, max_size=3 * n_markers * n_rows))
    valid = np.array(data.draw(st.lists(st.booleans(), min_size=n_markers * n_rows, max_size=n_markers * n_rows)))
    valid = valid.reshape(n_rows, n_markers)
    positions = np.array(values).reshape(n_rows, n_markers, 3) * valid[:, :, None]
    names = tuple(f"M {i}" for i in range(n_markers))
    written = MarkerTrajectories(names, np.arange(n_rows) / 60.0, positions, 60.0, valid)
    dump_trc(written, path, y_up)
    read = load_trc(path, y_up)
    assert read.names == names
    assert np.array_equal(read.valid, valid)
    assert np.array_equal(read.positions_m, positions)
    assert np.array_equal(read.times_s, written.times_s)


def test_a_real_file(shared_data):
    markers = load_trc(shared_data / "pose2sim_balancing" / "Pose2Sim_markers.trc")
    assert markers.positions_m.shape == (100, 21, 3)
    assert markers.valid.all()
    heights = markers.positions_m[:, :, 2].mean(axis=0)
    assert (
        heights[markers.index("Head")]
        > heights[markers.index("Neck")]
        > heights[markers.index("RHip")]
        > heights[markers.index("RHeel")]
    )


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (("Anna:LKnee", "Anna:RKnee", "*12"), ("LKnee", "RKnee", "*12")),
        (("day:Anna:LKnee", "day:Anna:RKnee"), ("LKnee", "RKnee")),
        (("Anna:LKnee", "Ben:LKnee"), ("Anna:LKnee", "Ben:LKnee")),
        (("Anna:LKnee", "LKnee"), ("Anna:LKnee", "LKnee")),
        (("Anna:LKnee", "Anna:"), ("Anna:LKnee", "Anna:")),
        (("LKnee", "RKnee"), ("LKnee", "RKnee")),
    ],
)
def test_the_only_subject_is_left_out_of_names(names, short):
    assert without_subject(names) == short
