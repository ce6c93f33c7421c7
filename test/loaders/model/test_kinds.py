"""Files that are given for a body: each is told by its own name, and a robot description is one whatever its suffix."""

import pytest

from tracker_node.errors import FileFormatError, WrongKindOfFileError
from tracker_node.loaders.model.model_yaml import load_model

ROBOT = '<?xml version="1.0"?>\n<!-- <mujoco> was here -->\n<robot name="stick"><link name="base">'
ROBOT += '<visual><geometry><box size="1 1 1"/></geometry></visual></link></robot>'


@pytest.mark.parametrize(
    ("name", "content", "kind"),
    [
        ("a.xml", '<!-- an arm -->\n<mujoco model="a"><worldbody/></mujoco>', "a MuJoCo model"),
        ("a.osim", '<?xml version="1.0"?>\n<OpenSimDocument Version="40000"/>', "an OpenSim model"),
        ("a.sdf", '<sdf version="1.7"><model name="m"/></sdf>', "an SDF model"),
        ("a.bvh", "HIERARCHY\nROOT Hips\n", "a BVH file"),
    ],
)
def test_bodies_of_other_programs_are_named(tmp_path, name, content, kind):
    (tmp_path / name).write_text(content)
    with pytest.raises(WrongKindOfFileError) as told:
        load_model(tmp_path / name)
    assert str(told.value) == f"{tmp_path / name}: this is {kind}, not a body (a model.yaml or a URDF)"


@pytest.mark.parametrize("name", ["rod.obj", "rod.STL", "rod.glb"])
def test_a_mesh_belongs_into_a_model(tmp_path, name):
    with pytest.raises(FileFormatError, match="no such file"):
        load_model(tmp_path / name)
    (tmp_path / name).write_bytes(b"\xff\x00")
    with pytest.raises(WrongKindOfFileError, match=f"this is a mesh, not a body; .* under shapes, as `type: mesh, file: {name}`"):
        load_model(tmp_path / name)


@pytest.mark.parametrize("name", ["stick.xml", "stick.urdf", "stick"])
def test_a_robot_description_may_have_any_suffix(tmp_path, name):
    (tmp_path / name).write_text(ROBOT)
    assert load_model(tmp_path / name).name == "stick"
