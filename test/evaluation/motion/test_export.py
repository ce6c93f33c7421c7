"""Runs in other programs' files, read back by those programs or by readers that are not ours."""

import errno
import os
import warnings
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import bvhio
import c3d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.bodies.moving_person import moving
from helpers.bodies.two_links import two_links
from helpers.motion import known_motions
from tracker_node.errors import FileFormatError, ModelError, UnknownNameError
from tracker_node.evaluation.motion.coordinates import load_coordinates, model_coordinates, opensim_coordinates
from tracker_node.evaluation.motion.export import FORMATS, ExportOptions, foot_events, markers_of
from tracker_node.evaluation.motion.isb_angles import isb_angles
from tracker_node.evaluation.motion.jumps import GRAVITY
from tracker_node.evaluation.motion.kinematics import state_kinematics
from tracker_node.evaluation.motion.run_export import TABLES, tables, write_tables
from tracker_node.loaders.motion.trc import NumberTable, dump_table
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State, from_variables
from tracker_node.model.humans.human import human_model
from tracker_node.runs.motion import RunMotion

GAPS = (0, 3, 4, 11)
Y_UP, Z_UP = ExportOptions(y_up=True), ExportOptions(y_up=False)


def opensim_markers(opensim: ModuleType, path: Path) -> tuple[list[str], np.ndarray]:
    """Labels and (n, m, 3) of a TRC file, as OpenSim reads it."""
    table = opensim.TimeSeriesTableVec3(str(path))
    flat = table.flatten()  # has to outlive its matrix
    numbers = np.array(flat.getMatrix().to_numpy())
    return list(table.getColumnLabels()), numbers.reshape(len(numbers), -1, 3)


@pytest.mark.parametrize(("options", "scale"), [(Y_UP, 1.0), (replace(Y_UP, unit="mm"), 1000.0), (Z_UP, 1.0)])
def test_opensim_reads_a_trc_with_its_gaps(opensim, tmp_path, options, scale):
    motion = moving(15, gaps=GAPS)
    FORMATS["trc"](motion, tmp_path / "a.trc", options)
    labels, read = opensim_markers(opensim, tmp_path / "a.trc")
    assert tuple(labels) == motion.model.landmark_names
    expected = scale * motion.landmarks_m()
    expected = expected[..., [1, 2, 0]] if options.y_up else expected
    assert np.flatnonzero(np.isnan(read).all(axis=(1, 2))).tolist() == list(GAPS)
    assert read[motion.valid] == pytest.approx(expected[motion.valid], abs=1e-9 * scale)


@settings(max_examples=15, deadline=None)
@given(st.sets(st.integers(0, 8), max_size=7), st.sampled_from(["m", "cm", "mm"]), st.booleans())
def test_any_gaps_arrive_in_opensim(opensim, tmp_path_factory, gaps, unit, y_up):
    path = tmp_path_factory.mktemp("trc") / "a.trc"
    motion = moving(9, gaps=tuple(gaps))
    FORMATS["trc"](motion, path, ExportOptions(y_up, unit))
    _, read = opensim_markers(opensim, path)
    assert np.array_equal(np.isfinite(read).all(axis=(1, 2)), motion.valid)


def test_names_of_openpose_and_a_choice_of_landmarks(opensim, tmp_path):
    options = replace(Y_UP, landmarks=("right_knee", "neck"), openpose_names=True)
    FORMATS["trc"](moving(5), tmp_path / "a.trc", options)
    labels, read = opensim_markers(opensim, tmp_path / "a.trc")
    assert labels == ["RKnee", "Neck"] and read.shape == (5, 2, 3)
    with pytest.raises(UnknownNameError, match="right_nee"):
        markers_of(moving(2), replace(Y_UP, landmarks=("right_nee",)))


def test_c3d_has_landmarks_with_residuals_and_angles(tmp_path):
    motion = moving(15, gaps=GAPS)
    FORMATS["c3d"](motion, tmp_path / "a.c3d", replace(Z_UP, unit="mm", isb_angles=True))
    with (tmp_path / "a.c3d").open("rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = c3d.Reader(stream)
        frames = np.array([points for _, points, _ in reader.read_frames()])
    labels = [label.strip() for label in reader.point_labels]
    n = len(motion.model.landmarks)
    assert labels[:n] == list(motion.model.landmark_names) and "LeftKneeAngles" in labels
    assert reader.get("POINT:DESCRIPTIONS").string_array[0].strip().startswith(f"{labels[0]}, fixed to ")
    assert np.flatnonzero((frames[..., 3] == -1.0).all(axis=1)).tolist() == list(GAPS)
    assert frames[motion.valid][:, :n, :3] == pytest.approx(1000.0 * motion.landmarks_m()[motion.valid], abs=2e-3)
    flexion = motion.values[:, motion.model.chain.dof_names.index("left_knee_flexion")]
    assert frames[motion.valid, labels.index("LeftKneeAngles"), 0] == pytest.approx(np.rad2deg(flexion)[motion.valid], abs=1e-3)


def run_of(known) -> RunMotion:
    values, rate_hz = np.array([state.to_values() for state in known.states]), 60.0
    return RunMotion(known.model, known.stamps_ns, values, np.ones(len(values), dtype=bool), 1e9 / rate_hz, uniform=True)


def test_c3d_has_events_of_feet_by_strides_or_by_contacts():
    """Somebody who jumps, and somebody who walks."""
    jump, walk = (run_of(known) for known in (known_motions.jump(2.6, 60.0), known_motions.walk(seconds=6.0)))
    events = foot_events(jump)
    assert [event.label for event in events if event.context == "Left"] == ["Foot Off", "Foot Strike"]
    assert events[-1].time_s - events[0].time_s == pytest.approx(2.0 * 2.6 / GRAVITY, abs=0.1)
    strikes = [event.time_s for event in foot_events(walk) if (event.context, event.label) == ("Right", "Foot Strike")]
    assert np.diff(strikes) == pytest.approx(np.full(len(strikes) - 1, known_motions.STRIDE_S), abs=0.02)
    assert len(strikes) >= 3


@pytest.mark.parametrize("degrees", [True, False])
def test_a_mot_in_opensim_leaves_out_the_rows_of_gaps(opensim, tmp_path, degrees):
    motion = moving(15, gaps=GAPS)
    FORMATS["mot"](motion, tmp_path / "a.mot", replace(Y_UP, degrees=degrees))
    storage = opensim.Storage(str(tmp_path / "a.mot"))
    assert storage.getSize() == 15 - len(GAPS) and storage.isInDegrees() == degrees
    read = opensim.TimeSeriesTable(str(tmp_path / "a.mot"))
    assert list(read.getIndependentColumn()) == motion.times_s[motion.valid].tolist()
    knee = read.getDependentColumn("left_knee_flexion").to_numpy()
    flexion = motion.values[motion.valid, motion.model.chain.dof_names.index("left_knee_flexion")]
    assert knee == pytest.approx(np.rad2deg(flexion) if degrees else flexion)


@pytest.mark.parametrize("options", [Y_UP, replace(Z_UP, degrees=False)])
def test_coordinates_of_the_model_come_back_as_the_same_poses(tmp_path, options):
    motion = moving(12, gaps=(5,))
    FORMATS["sto"](motion, tmp_path / "a.sto", options)
    names, stamps, values, valid = load_coordinates(tmp_path / "a.sto", motion.model, options.y_up)
    assert stamps == pytest.approx(motion.stamps_ns - motion.stamps_ns[0], abs=1)  # with a row amid the gap
    assert np.array_equal(valid, np.repeat(motion.valid[:, None], len(names), axis=1))
    assert names[:6] == ("x", "y", "z", "somersault", "tilt", "twist")
    for row, expected in zip(values[motion.valid], motion.landmarks_m()[motion.valid], strict=True):
        assert Configuration(motion.model, from_variables(row)).landmarks_world == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("y_up", "column", "axis"), [(True, "root_x", "y"), (True, "root_y", "z"), (True, "z", "x"), (False, "root_y", "y")]
)
def test_a_single_coordinate_of_the_root_is_read_along_its_axis(tmp_path, y_up, column, axis):
    names, valid = ("left_knee_flexion", column), np.ones((3, 2), dtype=bool)
    written = NumberTable(names, np.arange(3) / 60.0, np.full((3, 2), 0.5), valid, in_degrees=False)
    dump_table(written, tmp_path / "a.mot")
    names, _, values, _ = load_coordinates(tmp_path / "a.mot", human_model(), y_up)
    assert names == (axis, "left_knee_flexion") and np.all(values == 0.5)


def opensim_person(opensim: ModuleType, model: ArticulatedModel):
    """A person with the coordinates of Rajagopal's model, put together in OpenSim from lengths alone.

    The torso is its only link between pelvis and arms: our abdomen is as stiff as the clavicles in what drives it.
    """
    person, bodies = opensim.Model(), {}
    still = Configuration(model, State(np.eye(4), np.zeros(model.chain.n_axes))).Ts_world_link[:, :3, 3]
    place = {name: point[[0, 2, 1]] * [1.0, 1.0, -1.0] for name, point in zip(model.chain.links, still, strict=True)}

    def add(name, parent, axes, coordinates):
        body = opensim.Body(name, 1.0, opensim.Vec3(0), opensim.Inertia(1, 1, 1))
        transform = opensim.SpatialTransform()
        for i, (axis, coordinate) in enumerate(zip(axes, coordinates, strict=True)):
            part = transform.updTransformAxis(i)
            part.setAxis(opensim.Vec3(*axis))
            # It copies the function; setFunction would take one that Python frees as well
            part.set_function(opensim.LinearFunction(1.0, 0.0) if coordinate else opensim.Constant(0.0))
            if coordinate:
                part.setCoordinateNames(opensim.ArrayStr(coordinate, 1))
        zero = opensim.Vec3(0)
        offset = opensim.Vec3(*(place[name] - place[parent] if parent else np.zeros(3)))
        frame = bodies[parent] if parent else person.getGround()
        joint = opensim.CustomJoint(f"{name}_joint", frame, offset, zero, body, zero, zero, transform)
        person.addBody(body)
        person.addJoint(joint)
        bodies[name] = body

    x, y, z = np.eye(3)
    still_there = ("", "", "")
    add("pelvis", "", (z, x, y, x, y, z),
        ("pelvis_tilt", "pelvis_list", "pelvis_rotation", "pelvis_tx", "pelvis_ty", "pelvis_tz"))  # fmt: skip
    add("torso", "pelvis", (z, x, y, x, y, z), ("lumbar_extension", "lumbar_bending", "lumbar_rotation", *still_there))
    for side, sign in (("right", 1.0), ("left", -1.0)):
        letter, mirrored = side[0], (z, sign * x, sign * y, x, y, z)
        hip = [f"{name}_{letter}" for name in ("hip_flexion", "hip_adduction", "hip_rotation")]
        shoulder = [f"{name}_{letter}" for name in ("arm_flex", "arm_add", "arm_rot")]
        add(f"{side}_thigh", "pelvis", mirrored, (*hip, *still_there))
        add(f"{side}_shank", f"{side}_thigh", (-z, x, y, x, y, z), (f"knee_angle_{letter}", "", "", *still_there))
        add(f"{side}_upper_arm", "torso", mirrored, (*shoulder, *still_there))
        add(f"{side}_forearm", f"{side}_upper_arm", (z, x, y, x, y, z), (f"elbow_flex_{letter}", "", "", *still_there))
    person.finalizeConnections()
    return person


def stiff(motion: RunMotion, model: ArticulatedModel) -> RunMotion:
    """Without what Rajagopal's model has no coordinate for: its trunk is one body, its knee a hinge; it has no clavicles."""
    names, values = model.chain.dof_names, motion.values.copy()
    values[:, [i for i, name in enumerate(names) if "abdomen" in name or "clavicle" in name or "knee_internal" in name]] = 0.0
    return replace(motion, values=values)


def test_opensim_puts_the_joints_where_we_have_them(opensim, tmp_path):
    """The MOT drives a model that OpenSim holds; its forward kinematics must give our landmarks."""
    model = human_model()
    motion = stiff(moving(8, model), model)
    FORMATS["mot"](motion, tmp_path / "a.mot", replace(Y_UP, opensim=True))
    table = opensim.TimeSeriesTable(str(tmp_path / "a.mot"))
    person = opensim_person(opensim, model)
    state = person.initSystem()
    driven = [name for name in table.getColumnLabels() if person.getCoordinateSet().contains(name)]
    assert len(driven) == person.getNumCoordinates()
    moved = np.array([table.getDependentColumn(name).to_numpy() for name in driven])
    assert np.abs(moved).max(axis=1).min() > 0.01, "a coordinate that stays zero would show nothing"
    compared = set()
    for i in range(8):
        for name in driven:
            degrees = table.getDependentColumn(name)[i]
            person.getCoordinateSet().get(name).setValue(state, degrees if "_t" in name[-3:] else np.deg2rad(degrees), False)
        person.realizePosition(state)
        for landmark, expected in zip(model.landmarks, motion.landmarks_m()[i], strict=True):
            if person.getBodySet().contains(landmark.link):
                x, y, z = landmark.position
                place = person.getBodySet().get(landmark.link).findStationLocationInGround(state, opensim.Vec3(x, z, -y))
                assert place.to_numpy() == pytest.approx(expected[[1, 2, 0]], abs=1e-6), (i, landmark.name)
                compared.add(landmark.name)
    assert {f"{side}_{name}" for side in ("left", "right") for name in ("elbow", "wrist", "knee", "ankle")} < compared


def test_coordinates_of_opensim_are_read_as_our_axes(tmp_path):
    motion = moving(6)
    FORMATS["mot"](motion, tmp_path / "a.mot", replace(Y_UP, opensim=True))
    names, _, values, _ = load_coordinates(tmp_path / "a.mot", motion.model)
    assert {"left_hip_flexion", "right_hip_abduction", "left_knee_flexion", "right_elbow_flexion"} <= set(names)
    for name in ("left_hip_flexion", "right_hip_abduction", "left_hip_internal_rotation", "right_knee_flexion"):
        expected = motion.values[:, motion.model.chain.dof_names.index(name)]
        assert values[:, names.index(name)] == pytest.approx(expected, abs=1e-9), name


def test_tables_of_another_body_are_refused(tmp_path):
    FORMATS["mot"](moving(3), tmp_path / "a.mot", replace(Y_UP, opensim=True))
    with pytest.raises(FileFormatError, match="column names"):
        load_coordinates(tmp_path / "a.mot", two_links())
    with pytest.raises(ModelError, match="pelvis"):
        opensim_coordinates(moving(2, two_links()))


def test_bvh_fills_gaps_and_says_so(tmp_path):
    whole, motion = moving(15), moving(15, gaps=GAPS)
    assert FORMATS["bvh"](whole, tmp_path / "whole.bvh", Y_UP) == []
    (said,) = FORMATS["bvh"](motion, tmp_path / "a.bvh", Y_UP)
    assert "4 frames" in said
    root = bvhio.readAsHierarchy(str(tmp_path / "a.bvh"))
    knee = next(joint for joint, _, _ in root.layout() if joint.Name == "left_shank")
    for frame in (2, 3, 11):
        root.loadPose(frame)
        expected = whole.landmarks_m()[frame, motion.model.landmark_index("left_knee")]
        assert np.array(knee.PositionWorld)[[2, 0, 1]] == pytest.approx(expected, abs=0.02 if frame in GAPS else 2e-6)


@pytest.mark.parametrize(("options", "link"), [(Z_UP, "pelvis"), (replace(Y_UP, link="left_hand"), "left_hand")])
def test_tum_leaves_out_gaps_and_has_the_pose_of_a_link(tmp_path, options, link):
    from scipy.spatial.transform import Rotation

    motion = moving(15, gaps=GAPS)
    FORMATS["tum"](motion, tmp_path / "a.txt", options)
    table = np.loadtxt(tmp_path / "a.txt")
    Ts = motion.Ts_world_link()[motion.valid, motion.model.chain.link_index(link)]
    assert table[:, 0] == pytest.approx(motion.stamps_ns[motion.valid] * 1e-9, abs=1e-9)
    order = [1, 2, 0] if options.y_up else [0, 1, 2]
    assert table[:, 1:4] == pytest.approx(Ts[:, order, 3])
    assert Rotation.from_quat(table[:, 4:]).as_matrix() == pytest.approx(Ts[:, order, :3])


def test_csv_tables_have_units_in_their_columns_and_empty_cells_in_gaps(tmp_path):
    motion = moving(40, gaps=(20,))
    kinematics = state_kinematics(motion, 20.0)
    options = replace(Z_UP, unit="mm", isb_angles=True)
    write_tables(kinematics.motion, tmp_path / "t", tables(kinematics.motion, options, kinematics))
    read = {path.stem: np.genfromtxt(path, delimiter=",", names=True) for path in (tmp_path / "t").iterdir()}
    assert set(read) == set(TABLES)
    knee = kinematics.motion.landmarks_m()[:, motion.model.landmark_index("left_knee")]
    column = read["landmarks"]["left_knee_z_mm"]
    assert np.flatnonzero(np.isnan(column)).tolist() == [20]
    assert np.delete(column, 20) == pytest.approx(1000.0 * np.delete(knee[:, 2], 20))
    slope = (column[32] - column[30]) * 30.0
    assert read["landmark_velocities"]["left_knee_z_mm_per_s"][31] == pytest.approx(slope, abs=5.0)
    angles = isb_angles(kinematics.motion)
    flexion = np.rad2deg(angles.radians[:, angles.joints.index("LeftHip"), 0])
    assert np.delete(read["isb_angles"]["left_hip_flexion_deg"], 20) == pytest.approx(np.delete(flexion, 20))
    assert read["state_velocities"]["root_x_mm_per_s"][31] == pytest.approx(300.0, abs=1.0)
    assert read["coordinates"]["root_x_mm"][0] == pytest.approx(1000.0 * kinematics.motion.values[0, 0])


def test_tables_take_the_places_of_earlier_ones_only_when_all_are_on_the_disk(tmp_path, monkeypatch):
    motion = moving(8)
    write_tables(motion, tmp_path, tables(motion, Z_UP))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert len(before) > 1
    calls = []

    def full(number: int) -> None:
        calls.append(number)
        if len(calls) == len(before):
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_tables(moving(9), tmp_path, tables(moving(9), Z_UP))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_axes_of_the_file_turn_velocities_too(tmp_path):
    motion = moving(40)
    kinematics = state_kinematics(motion, 20.0)
    found = {table.name: table for table in tables(kinematics.motion, replace(Y_UP, degrees=False), kinematics)}
    velocity = found["state_velocities"]
    assert velocity.columns[:4] == ("root_x_m_per_s", "root_y_m_per_s", "root_z_m_per_s", "root_rx_rad_per_s")
    assert velocity.values[:, :3] == pytest.approx(kinematics.velocity[:, [1, 2, 0]])
    assert velocity.values[:, 3:6] == pytest.approx(kinematics.velocity[:, [4, 5, 3]])
    assert model_coordinates(motion, True).values[:, 2] == pytest.approx(motion.values[:, 0])


def test_a_body_without_landmarks_has_no_markers():
    model = replace(human_model(), landmarks=())
    with pytest.raises(FileFormatError, match="landmarks"):
        markers_of(moving(2, model), Y_UP)


def test_only_a_c3d_of_too_many_frames_warns_of_them(tmp_path, monkeypatch):
    from tracker_node.evaluation.motion import export

    assert export.MOST_FRAMES == 65535  # of a 16-bit number
    monkeypatch.setattr(export, "MOST_FRAMES", 4)
    assert FORMATS["c3d"](moving(4), tmp_path / "a.c3d", Z_UP) == []
    (said,) = FORMATS["c3d"](moving(5), tmp_path / "a.c3d", Z_UP)
    assert said.startswith("5 frames: ") and said.endswith("see the first 4")


def test_a_bvh_says_how_many_frames_it_invents(tmp_path):
    path = tmp_path / "a.bvh"
    assert FORMATS["bvh"](moving(4, rate_hz=50.0), path, Z_UP) == []
    assert "Frame Time: 0.02" in path.read_text() and "Frames: 4" in path.read_text()
    assert FORMATS["bvh"](moving(6, gaps=(2, 3)), path, Z_UP) == ["BVH cannot mark gaps: 2 frames are interpolated"]
    for name in ("trc", "sto", "tum"):
        assert FORMATS[name](moving(6, gaps=(2, 3)), tmp_path / f"a.{name}", Z_UP) == []


def test_tum_has_the_pose_of_the_root_or_of_the_link_asked_for(tmp_path):
    motion, path = moving(4, two_links(), gaps=(1,)), tmp_path / "a.tum"
    for options, link in ((Z_UP, 0), (replace(Z_UP, link="lower"), 1), (replace(Y_UP, link="lower"), 1)):
        FORMATS["tum"](motion, path, options)
        rows = np.loadtxt(path)
        assert len(rows) == 3
        assert rows[:, 0] == pytest.approx(motion.stamps_ns[[0, 2, 3]] * 1e-9)
        expected = motion.Ts_world_link()[3, link]
        order = [1, 2, 0] if options.y_up else [0, 1, 2]
        assert rows[2, 1:4] == pytest.approx(expected[order, 3], abs=1e-9)
        qx, qy, qz, qw = rows[2, 4:]
        # First column of the rotation of a unit quaternion.
        first = [1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy + qz * qw), 2 * (qx * qz - qy * qw)]
        assert first == pytest.approx(expected[order, 0], abs=1e-6)
