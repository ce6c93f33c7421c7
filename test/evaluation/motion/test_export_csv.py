"""Tables of a motion for spreadsheets, by hand-made numbers."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.moving_person import moving
from helpers.bodies.two_links import two_links
from tracker_node.evaluation.motion.export import ExportOptions
from tracker_node.evaluation.motion.kinematics import StateKinematics
from tracker_node.evaluation.motion.run_export import TABLES, MotionTable, tables, write_tables
from tracker_node.model.articulated import Landmark

Z_UP, Y_UP = ExportOptions(y_up=False), ExportOptions(y_up=True)


def by_name(motion, options, kinematics=None):
    return {table.name: table for table in tables(motion, options, kinematics)}


def column(table, name):
    return table.values[:, table.columns.index(name)]


def with_derivatives(motion):
    """Kinematics whose numbers tell their columns: 1, 2, 3... and ten times that."""
    numbers = np.tile(np.arange(1.0, motion.values.shape[1] + 1), (len(motion), 1))
    return StateKinematics(motion, numbers, 10.0 * numbers, np.zeros(motion.values.shape[1] + 1))


def test_names_of_all_tables():
    assert TABLES == (
        "landmarks", "landmark_velocities", "landmark_accelerations", "coordinates", "state_velocities", "state_accelerations",
        "isb_angles", "isb_angle_velocities", "isb_angle_accelerations",
        "center_of_mass", "center_of_mass_velocities", "center_of_mass_accelerations",
    )  # fmt: skip
    motion = moving(20)
    assert list(by_name(motion, Z_UP)) == ["landmarks", "center_of_mass", "coordinates"]
    assert list(by_name(motion, replace(Z_UP, isb_angles=True))) == ["landmarks", "center_of_mass", "coordinates", "isb_angles"]
    assert sorted(by_name(motion, Z_UP, with_derivatives(motion))) == sorted((*TABLES[:6], *TABLES[9:]))
    assert sorted(by_name(motion, replace(Z_UP, isb_angles=True), with_derivatives(motion))) == sorted(TABLES)


def test_rows_with_stamps_times_and_empty_cells(tmp_path):
    motion = moving(2, rate_hz=10.0)
    values, valid = np.array([[1.5, -2.0], [0.25, 7.0]]), np.array([[True, False], [True, True]])
    write_tables(motion, tmp_path / "new" / "folder", [MotionTable("landmarks", ("a_m", "b_m"), values, valid)])
    written = (tmp_path / "new" / "folder" / "landmarks.csv").read_text().splitlines()
    assert written[0] == "stamp_ns,time_s,a_m,b_m"
    first, second = (line.split(",") for line in written[1:])
    assert first[0] == "5000000000" and float(first[1]) == 0.0 and float(first[2]) == 1.5 and first[3] == ""
    assert second[0] == "5100000000" and float(second[1]) == pytest.approx(0.1) and [float(x) for x in second[2:]] == [0.25, 7.0]


def test_tables_of_an_earlier_export_go_and_other_files_stay(tmp_path):
    for name in ("landmarks", "isb_angles", "state_velocities", "my_own"):
        (tmp_path / f"{name}.csv").write_text("earlier")
    empty = np.zeros((1, 1))
    write_tables(moving(1), tmp_path, [MotionTable("landmarks", ("a",), empty, empty == 0)])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["landmarks.csv", "my_own.csv"]
    assert (tmp_path / "my_own.csv").read_text() == "earlier" != (tmp_path / "landmarks.csv").read_text()


def test_landmarks_in_the_axes_and_units_of_the_file():
    motion = moving(3, gaps=(1,))
    j = motion.model.landmark_index("right_knee")
    x, y, z = motion.landmarks_m()[2, j]
    options = replace(Z_UP, landmarks=("neck", "right_knee"), unit="mm", openpose_names=True)
    table = by_name(motion, options)["landmarks"]
    assert table.columns == ("Neck_x_mm", "Neck_y_mm", "Neck_z_mm", "RKnee_x_mm", "RKnee_y_mm", "RKnee_z_mm")
    assert table.values[2, 3:] == pytest.approx([1000 * x, 1000 * y, 1000 * z])
    assert table.valid.tolist() == [[True] * 6, [False] * 6, [True] * 6]
    turned = by_name(motion, replace(Y_UP, landmarks=("right_knee",), unit="cm"))["landmarks"]
    assert turned.columns == ("right_knee_x_cm", "right_knee_y_cm", "right_knee_z_cm")
    assert turned.values[2] == pytest.approx([100 * y, 100 * z, 100 * x])


def test_a_lost_limb_empties_only_its_own_landmarks():
    motion = moving(2)
    unknown = np.zeros((2, len(motion.model.chain.links)), dtype=bool)
    unknown[1, motion.model.landmark_links[motion.model.landmark_index("right_knee")]] = True
    options = replace(Z_UP, landmarks=("neck", "right_knee"))
    table = by_name(replace(motion, unknown_links=unknown), options)["landmarks"]
    assert table.valid.tolist() == [[True] * 6, [True] * 3 + [False] * 3]


def test_coordinates_have_lengths_and_angles_in_their_own_units():
    motion = moving(3, gaps=(0,))
    chain = motion.model.chain
    bent = motion.values[2, chain.dof_names.index("left_knee_flexion")]
    degrees = by_name(motion, replace(Z_UP, unit="cm"))["coordinates"]
    assert column(degrees, "left_knee_flexion_deg")[2] == pytest.approx(np.rad2deg(bent))
    lengths = [name for name in degrees.columns if name.endswith("_cm")]
    assert len(lengths) == 3 and degrees.values[2, degrees.columns.index(lengths[0])] == pytest.approx(100 * motion.values[2, 0])
    assert degrees.valid.shape == degrees.values.shape
    assert degrees.valid.all(axis=1).tolist() == degrees.valid.any(axis=1).tolist() == [False, True, True]
    radians = by_name(motion, replace(Z_UP, degrees=False))["coordinates"]
    assert column(radians, "left_knee_flexion_rad")[2] == pytest.approx(bent)
    assert any(name.startswith("pelvis_tilt_") for name in by_name(motion, replace(Y_UP, opensim=True))["coordinates"].columns)


def test_derivatives_of_the_state_turn_with_the_axes_of_the_file():
    motion = replace(moving(12), model=moving(1).model)
    names = motion.model.chain.dof_names
    found = by_name(motion, replace(Y_UP, unit="mm", degrees=True), with_derivatives(motion))
    velocity, acceleration = found["state_velocities"], found["state_accelerations"]
    assert velocity.columns[0] == f"{names[0]}_mm_per_s" and acceleration.columns[0] == f"{names[0]}_mm_per_s2"
    assert velocity.columns[3] == f"{names[3]}_deg_per_s" and velocity.columns[-1] == f"{names[-1]}_deg_per_s"
    degree = 57.29577951308232
    expected = [2000.0, 3000.0, 1000.0, 5 * degree, 6 * degree, 4 * degree, 7 * degree]
    assert velocity.values[4, :7] == pytest.approx(expected)
    assert acceleration.values[4, :7] == pytest.approx(10 * np.array(expected))
    same = by_name(motion, replace(Z_UP, degrees=False), with_derivatives(motion))["state_velocities"]
    assert same.values[4, :7] == pytest.approx([1, 2, 3, 4, 5, 6, 7])
    assert same.columns[3] == f"{names[3]}_rad_per_s"


def test_velocities_of_landmarks_are_those_of_their_places():
    """A root that travels 0.5 m/s faster every second along x: its landmark has this acceleration, and its speed."""
    model = replace(two_links(), landmarks=(Landmark("tip", "upper", (0.0, 0.0, 0.0)),))
    motion = moving(14, model, gaps=(12,), rate_hz=10.0)
    t = np.arange(14) * 0.1
    values = np.zeros_like(motion.values)
    values[:, 0] = 0.25 * t**2
    motion = replace(motion, values=values * motion.valid[:, None])
    found = by_name(motion, replace(Z_UP, unit="cm"), with_derivatives(motion))
    velocity, acceleration = found["landmark_velocities"], found["landmark_accelerations"]
    assert velocity.columns == ("tip_x_cm_per_s", "tip_y_cm_per_s", "tip_z_cm_per_s")
    assert acceleration.columns == ("tip_x_cm_per_s2", "tip_y_cm_per_s2", "tip_z_cm_per_s2")
    assert velocity.values[6] == pytest.approx([30.0, 0.0, 0.0]) and acceleration.values[6] == pytest.approx([50.0, 0.0, 0.0])
    assert velocity.valid.all(axis=1).tolist() == [True] * 12 + [False] * 2  # a single sample after the gap has no derivative
    assert np.array_equal(acceleration.valid, velocity.valid)


def test_isb_angles_in_the_units_asked_for():
    motion = moving(3, gaps=(1,))
    flexion = motion.values[2, motion.model.chain.dof_names.index("left_knee_flexion")]
    table = by_name(motion, replace(Z_UP, isb_angles=True))["isb_angles"]
    knee = [name for name in table.columns if "left_knee" in name]
    assert knee == ["left_knee_flexion_deg", "left_knee_internal_rotation_deg"]
    assert all(name.endswith("_deg") for name in table.columns)
    assert table.values[2, table.columns.index(knee[0])] == pytest.approx(np.rad2deg(flexion), abs=1e-6)
    assert table.valid.all(axis=1).tolist() == [True, False, True] and not table.valid[1].any()
    radians = by_name(motion, replace(Z_UP, isb_angles=True, degrees=False))["isb_angles"]
    assert radians.columns[0].endswith("_rad") and radians.values == pytest.approx(np.deg2rad(table.values))
