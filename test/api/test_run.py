"""Tables of pandas and xarray hold what the files of a run hold."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.moving_person import moving, write_run
from tracker_node import load_run, open_recording
from tracker_node.errors import MissingExtraError, ModelError
from tracker_node.evaluation.motion.isb_angles import isb_angles
from tracker_node.loaders.motion.trajectory_file import read_joints, read_states


@pytest.fixture(scope="module")
def run(folder):
    return load_run(folder / "by_command")


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    """Forty sets, the fifth without a state."""
    return load_run(write_run(tmp_path_factory.mktemp("person") / "run", moving(40, gaps=(4,))))


def test_states_are_those_of_the_file(run, folder):
    table, file = run.states(), read_states(folder / "by_command" / "states.csv")
    assert np.array_equal(table["stamp_ns"], file.stamps_ns) and table["status"].tolist() == [row.status for row in file.rows]
    assert np.array_equal(table[list(file.dof_names)], file.values)
    assert table["residual"].tolist() == [row.residual for row in file.rows]
    assert table.index.name == "time_s" and table.index[0] == 0.0 and table.index[1] == pytest.approx(1.0 / 30.0)


def test_what_is_printed_is_short(run, folder):
    """All arrays of a run were 53 000 characters at the end of a notebook's cell."""
    model = "<ArticulatedModel 'arm_and_trunk': 3 links, 9 degrees of freedom, 3 shapes, 3 landmarks>"
    assert repr(run.model) == model and repr(run.model.chain) == "<KinematicChain: 3 links from 'trunk' on, 9 degrees of freedom>"
    data = f"<RunData {folder / 'by_command'}: 6 image sets in 0.17 s, 6 TRACKING, cameras cam01, cam02, cam03>"
    assert repr(run) == f"<Run of {model}\n {data}>" and str(run.data) == data
    recording = open_recording(folder / "recording.yaml")
    assert repr(recording.rig) == "<CameraRig: cam01 160x120, cam02 160x120, cam03 160x120>"
    assert repr(recording) == f"<Recording of {model} from a given state\n by region in {recording.rig!r}>"
    searched = replace(recording, initial_state=None, person=[0, 0, 1])
    assert "which is searched for at [0.0, 0.0, 1.0]\n" in repr(searched) and len(repr(searched)) < 400


def test_joints_are_those_of_the_file(run, folder):
    table, file = run.joints(), read_joints(folder / "by_command" / "joints.csv")
    assert tuple(table.columns.unique("landmark")) == file.names == run.model.landmark_names
    for i, name in enumerate(file.names):
        assert list(table[name].columns) == ["x", "y", "z"]
        assert np.allclose(table[name], file.positions_m[:, i], rtol=0.0, atol=1e-12)


def test_joint_angles_are_the_states_in_degrees(run):
    angles, states = run.joint_angles(), run.states()
    assert list(angles.columns) == ["shoulder_x", "shoulder_y", "elbow_flexion"]
    assert np.allclose(np.radians(angles), states[list(angles.columns)], atol=1e-15)
    assert np.array_equal(run.joint_angles(unit="rad"), states[list(angles.columns)])


def test_angles_after_the_isb_are_those_of_the_export_and_gaps_are_nan(person):
    angles, expected = person.joint_angles("isb"), isb_angles(person.motion)
    assert list(angles.columns) == expected.columns()[0]
    column = [name for triple in expected.names for name in triple].index("left_knee_flexion")
    found = np.degrees(expected.radians.reshape(len(person), -1)[:, column])
    assert np.array_equal(np.delete(angles["left_knee_flexion"].to_numpy(), 4), np.delete(found, 4))
    assert angles.iloc[4].isna().all() and person.joints().iloc[4].isna().all()
    assert not angles.drop(angles.index[4]).isna().any().any()


def test_a_convention_or_unit_that_is_not_known_is_refused(run):
    with pytest.raises(ValueError, match="isb"):
        run.joint_angles("grood")
    with pytest.raises(ValueError, match="deg"):
        run.joint_angles(unit="turns")
    with pytest.raises(ModelError, match="no two segments of a person"):
        run.joint_angles("isb")


def test_the_dataset_has_everything_under_labels(run):
    data = run.to_xarray()
    assert dict(data.sizes) == {
        "time": 6, "dof": 9, "landmark": 3, "axis": 3, "camera": 3, "dof_2": 9, "limb": len(run.data.details.limbs),
    }  # fmt: skip
    assert np.array_equal(data["state"], run.data.values) and data["status"].values.tolist() == list(run.status)
    elbow = data["position"].sel(landmark="elbow")
    assert np.array_equal(elbow, run.joints()["elbow"].to_numpy()) and data["position"].attrs["units"] == "m"
    assert np.array_equal(data["covariance"], run.data.details.covariances)
    assert data["unit"].sel(dof="elbow_flexion") == "rad" and data["unit"].sel(dof="root_x") == "m"
    assert set(np.unique(data["limb_status"])) <= {"TRACKING", "DEGRADED", "UNSEEN", "LOST"}


def test_a_run_without_a_bag_has_no_covariances(person):
    data = person.to_xarray()
    assert "covariance" not in data and "limb_status" not in data and data.sizes["time"] == 40


@pytest.mark.parametrize(("package", "accessor"), [("pandas", "states"), ("pandas", "joint_angles"), ("xarray", "to_xarray")])
def test_a_missing_package_is_named_with_the_line_that_installs_it(run, monkeypatch, package, accessor):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=rf"{package} is not installed; pip install 'tracker_node\[data\]'"):
        getattr(run, accessor)()
