"""states.csv, joints.csv, poses.csv: bit-exact there and back; errors that name the place."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from helpers.sources.tables import read_numbers
from tracker_node.errors import FileFormatError
from tracker_node.geometry import so3
from tracker_node.loaders.motion import trajectory_file as tf
from tracker_node.loaders.motion.trajectory_file import dump_tum
from tracker_node.model.kinematic_chain import ROOT_DOF_NAMES

NAMES = (*ROOT_DOF_NAMES, "knee_flexion", "elbow_m")
reasons = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)
finite = st.floats(allow_nan=False, allow_infinity=False, width=64)


def state_row(values: np.ndarray, stamp_ns: int = 7, reason: str = "") -> tf.StateRow:
    return tf.StateRow(stamp_ns, "TRACKING", reason, np.asarray(values), 12.5, 1 / 3, 4, 6)


@settings(max_examples=50, deadline=None)
@given(values=st.lists(finite, min_size=8, max_size=8), stamp_ns=st.integers(-(2**62), 2**62), reason=reasons)
@example(values=[0.0] * 8, stamp_ns=0, reason="a\rb\r\nc")
def test_states_come_back_bit_for_bit(tmp_path_factory, values, stamp_ns, reason) -> None:
    path = tmp_path_factory.mktemp("states") / "states.csv"
    tf.write_states(path, tf.StateTrajectory(NAMES, (state_row(np.array(values), stamp_ns, reason),)))
    read = tf.read_states(path)
    assert read.dof_names == NAMES
    assert read.values.tobytes() == np.array([values]).tobytes()
    assert read.stamps_ns.tolist() == [stamp_ns]
    assert read.rows[0].reason == reason
    assert (read.rows[0].score, read.rows[0].residual) == (12.5, 1 / 3)
    assert (read.rows[0].iterations, read.rows[0].evaluations) == (4, 6)


def test_the_header_says_the_units(tmp_path: Path) -> None:
    tf.write_states(tmp_path / "states.csv", tf.StateTrajectory(NAMES, ()))
    assert (tmp_path / "states.csv").read_text() == (
        "stamp_ns,status,reason,root_x_m,root_y_m,root_z_m,root_rx_rad,root_ry_rad,root_rz_rad,knee_flexion_rad,elbow_m_rad,"
        "score,residual,iterations,evaluations\n"
    )


def test_joints_that_slide_have_metres(tmp_path: Path) -> None:
    units = ("m", "m", "m", "rad", "rad", "rad", "rad", "m")
    tf.write_states(tmp_path / "states.csv", tf.StateTrajectory(NAMES, (state_row(np.arange(8.0)),), units))
    assert "knee_flexion_rad,elbow_m_m,score" in (tmp_path / "states.csv").read_text()
    read = tf.read_states(tmp_path / "states.csv")
    assert (read.dof_names, read.dof_units) == (NAMES, units)


def test_a_row_is_in_the_file_as_soon_as_it_is_written(tmp_path: Path) -> None:
    writer = tf.StatesWriter(tmp_path / "states.csv", NAMES)
    writer.append(state_row(np.arange(8.0)))
    # not closed: the process might be killed now
    assert len(tf.read_states(tmp_path / "states.csv").rows) == 1
    writer.close()


def test_joints_come_back_and_missing_ones_stay_missing(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(3, 2, 3)) / 3
    valid = np.array([[True, True], [True, False], [True, True]])
    points[~valid] = 0.0
    stamps = np.array([10, 20, 30])
    tf.write_joints(tmp_path / "joints.csv", tf.Trajectories(("neck", "head"), stamps, points, valid))
    read = tf.read_joints(tmp_path / "joints.csv")
    assert read.names == ("neck", "head")
    assert read.stamps_ns.tolist() == [10, 20, 30]
    assert read.positions_m.tobytes() == points.tobytes()
    assert (read.valid == valid).all()


def test_rows_of_joints_may_come_in_any_order_but_time_steps_do_not(tmp_path: Path) -> None:
    """What was read had the order of the file, and nothing had to fit together."""
    (tmp_path / "joints.csv").write_text("stamp_ns,landmark,x,y,z\n20,neck,2,0,0\n10,neck,1,0,0\n20,head,3,0,0\n")
    read = tf.read_joints(tmp_path / "joints.csv")
    assert (read.names, read.stamps_ns.tolist()) == (("neck", "head"), [10, 20])
    assert read.positions_m[..., 0].tolist() == [[1.0, 0.0], [2.0, 3.0]] and read.valid.tolist() == [[True, False], [True, True]]
    assert read.at(np.array([15]))[0][0, 0].tolist() == [1.5, 0.0, 0.0]
    with pytest.raises(ValueError, match="increasing stamps"):
        tf.Trajectories(read.names, read.stamps_ns[::-1], read.positions_m, read.valid)
    with pytest.raises(ValueError, match=r"expected positions \(2, 1, 3\)"):
        tf.Trajectories(("neck",), read.stamps_ns, read.positions_m, read.valid)


def test_joints_writer_writes_what_the_reader_reads(tmp_path: Path) -> None:
    with tf.JointsWriter(tmp_path / "joints.csv", ("neck", "head")) as writer:
        writer.append(5, np.array([[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]]))
        with pytest.raises(ValueError, match=r"expected positions \(2, 3\), got \(1, 3\)"):
            writer.append(6, np.zeros((1, 3)))
    assert (tmp_path / "joints.csv").read_text().splitlines()[0] == "stamp_ns,landmark,x,y,z"
    assert tf.read_joints(tmp_path / "joints.csv").positions_m[0, 1].tolist() == [1.0, 2.0, 3.0]


def test_poses_come_back(tmp_path: Path) -> None:
    transform = np.eye(4)
    transform[:3, :3] = so3.exp(np.array([0.3, -1.2, 0.7]))
    transform[:3, 3] = [0.1, -2 / 3, 3.0]
    with tf.PosesWriter(tmp_path / "poses.csv") as writer:
        writer.append(99, transform)
    stamps_ns, (row,) = read_numbers(tmp_path / "poses.csv")
    assert stamps_ns.tolist() == [99]
    assert row[:3].tobytes() == transform[:3, 3].tobytes()
    assert row[3:].tobytes() == so3.xyzw_from_matrix(transform[:3, :3]).tobytes()
    np.testing.assert_allclose(Rotation.from_quat(row[3:]).as_matrix(), transform[:3, :3], atol=1e-12)
    assert (tmp_path / "poses.csv").read_text().startswith("stamp_ns,x_m,y_m,z_m,qx,qy,qz,qw\n")


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("5,TRACKING,,1,2,3,4,5,6,7,eight,0,0,1,1", "line 2, column 'elbow_m_rad'"),
        ("5,TRACKING,,1,2,3,4,5,6,7,nan,0,0,1,1", "finite"),
        ("5.5,TRACKING,,1,2,3,4,5,6,7,8,0,0,1,1", "column 'stamp_ns'"),
        ("5,TRACKING,,1,2,3", "expected 15 columns"),
    ],
)
def test_errors_name_the_place(tmp_path: Path, line: str, named: str) -> None:
    path = tmp_path / "states.csv"
    tf.write_states(path, tf.StateTrajectory(NAMES, ()))
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(FileFormatError, match=named):
        tf.read_states(path)


def test_another_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,x\n1,2\n")
    for read in (tf.read_states, tf.read_joints):
        with pytest.raises(FileFormatError, match="header"):
            read(tmp_path / "a.csv")
        with pytest.raises(FileFormatError, match="no such file"):
            read(tmp_path / "missing.csv")
    (tmp_path / "joints.csv").write_text("stamp_ns,landmark,x,y,z\n1,neck,0,0,0\n1,neck,0,0,1\n")
    with pytest.raises(FileFormatError, match="second one"):
        tf.read_joints(tmp_path / "joints.csv")


def test_lines_keep_nanoseconds_and_digits(tmp_path):
    stamps = np.array([1_700_000_000_123_456_789, 1_700_000_000_140_000_001], dtype=np.int64)
    positions = np.array([[1.0 / 3.0, -2.0, 3.0], [0.1, 0.2, 0.3]])
    quaternions = np.array([[0.0, 0.0, 0.6, 0.8], [1.0, 0.0, 0.0, 0.0]])
    dump_tum(stamps, positions, quaternions, tmp_path / "a.txt")
    lines = (tmp_path / "a.txt").read_text().splitlines()
    assert lines[1].split()[0] == "1700000000.123456789"
    table = np.loadtxt(tmp_path / "a.txt")  # as evo and the benchmark's own tools read it: '#' begins a comment
    assert table.shape == (2, 8)
    assert np.array_equal(table[:, 1:4], positions) and np.array_equal(table[:, 4:], quaternions)
