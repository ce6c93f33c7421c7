import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.bodies.bodies import crane, random_state
from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.state_yaml import dump_state, load_state
from tracker_node.model.configuration import State

MODEL = crane()
STATE = """
model: crane
root: {xyz: [1, 2, 3], rpy_deg: [0, 0, 90]}
joints_deg: {pitch: 30, bend: 60}
"""


def load(tmp_path, text):
    (tmp_path / "state.yaml").write_text(text)
    return load_state(tmp_path / "state.yaml", MODEL)


def test_what_is_not_named_is_neutral(tmp_path):
    state = load(tmp_path, STATE)
    assert np.allclose(np.rad2deg(state.joint_positions), [0, 30, 0, 60])
    assert np.allclose(state.T_world_root[:3], [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]])
    assert np.allclose(load(tmp_path, "root: {xyz: [0, 0, 0]}").joint_positions, State.neutral(MODEL).joint_positions)


@pytest.mark.parametrize(("old", "new", "field"), [
    ("pitch: 30", "pich: 30", "joints_deg.pich"),
    ("pitch: 30", "pitch: 120", "joints_deg.pitch"),
    ("pitch: 30", "pitch: up", "joints_deg.pitch"),
    ("rpy_deg: [0, 0, 90]", "quaternion_xyzw: [0, 0, 0, 2]", "root.quaternion_xyzw"),
    ("rpy_deg", "quaternion_xyzw: [0, 0, 0, 1], rpy_deg", "root.rpy_deg"),
    ("xyz: [1, 2, 3], ", "", "root.xyz"),
    ("xyz: [1, 2, 3]", "xyz: [1, 2, 20000.0]", "root"),
    ("model: crane", "modell: crane", "modell"),
])  # fmt: skip
def test_errors_name_file_and_field(tmp_path, old, new, field):
    with pytest.raises(FileFormatError) as error:
        load(tmp_path, STATE.replace(old, new))
    assert error.value.field == field
    assert "state.yaml" in str(error.value)


@given(st.integers(0, 10**6))
def test_any_state_comes_back_from_its_file(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("state") / "state.yaml"
    state = random_state(MODEL, np.random.default_rng(seed), 1.0)
    dump_state(state, MODEL, path)
    again = load_state(path, MODEL)
    assert np.allclose(again.T_world_root, state.T_world_root, atol=1e-12)
    assert np.allclose(again.joint_positions, state.joint_positions, atol=1e-12)
