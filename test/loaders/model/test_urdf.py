"""Robot descriptions: kinematics against the specification, what a file may hold, and how it is said what is wrong."""

import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.bodies.bodies import crane, gantry, random_state
from helpers.bodies.robot_text import ROBOT
from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.mesh_file import write_mesh
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.model.state_yaml import dump_state, load_state
from tracker_node.loaders.model.urdf_writer import urdf_of
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import ENDLESS_RAD, Following
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone


def written(folder: Path, text: str = ROBOT, name: str = "arm.urdf") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def poses_by_the_specification(path: Path, values: dict[str, float]) -> dict[str, np.ndarray]:
    """T_root_link of every link: scipy's rotations, and the words of wiki.ros.org/urdf/XML/joint."""
    robot = ElementTree.parse(path).getroot()
    joints = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}

    def numbers(element, attribute, default):
        return np.array([float(x) for x in (default if element is None else element.get(attribute, default)).split()])

    def pose(link: str) -> np.ndarray:
        if link not in joints:
            return np.eye(4)
        joint = joints[link]
        fixed, motion, value = np.eye(4), np.eye(4), values.get(joint.get("name"), 0.0)
        fixed[:3, 3] = numbers(joint.find("origin"), "xyz", "0 0 0")
        fixed[:3, :3] = Rotation.from_euler("xyz", numbers(joint.find("origin"), "rpy", "0 0 0")).as_matrix()
        axis = numbers(joint.find("axis"), "xyz", "1 0 0")
        axis = axis / np.linalg.norm(axis)
        if joint.get("type") == "prismatic":
            motion[:3, 3] = value * axis
        elif joint.get("type") in ("revolute", "continuous"):
            motion[:3, :3] = Rotation.from_rotvec(value * axis).as_matrix()
        return pose(joint.find("parent").get("link")) @ fixed @ motion

    return {link.get("name"): pose(link.get("name")) for link in robot.findall("link")}


@pytest.mark.parametrize("seed", range(3))
def test_kinematics_are_those_of_the_specification(tmp_path, seed):
    path = written(tmp_path)
    model = load_model(path)
    assert (model.name, model.chain.dof_names[6:]) == ("arm", ("turntable", "lift", "elbow"))
    state = State(np.eye(4), np.random.default_rng(seed).uniform([-9.0, 0.1, -0.5], [9.0, 0.5, 2.0]))
    expected = poses_by_the_specification(path, dict(zip(model.chain.dof_names[6:], state.joint_positions, strict=True)))
    configuration = Configuration(model, state)
    for link, pose in zip(model.chain.links, configuration.Ts_world_link, strict=True):
        np.testing.assert_allclose(pose, expected[link], atol=1e-12)
    marks = dict(zip(model.landmark_names, configuration.landmarks_world, strict=True))
    assert set(marks) == {"turntable", "lift", "elbow", "stuck", "base"}
    np.testing.assert_allclose(marks["elbow"], expected["forearm"][:3, 3], atol=1e-12)


def test_limits_units_and_shapes(tmp_path):
    model = load_model(written(tmp_path))
    turntable, lift, elbow = model.chain.axes
    assert turntable.endless and (turntable.lower, turntable.upper) == (-ENDLESS_RAD, ENDLESS_RAD)
    assert (lift.prismatic, lift.lower, lift.upper, lift.neutral) == (True, 0.1, 0.5, 0.1)
    assert (elbow.prismatic, elbow.lower, elbow.upper, elbow.neutral) == (False, -0.5, 2.0, 0.0)
    assert model.chain.dof_units[6:] == ("rad", "m", "rad")
    shapes = {shape.name: shape for shape in model.shapes}
    assert list(shapes) == ["base", "tube", "column", "forearm", "forearm_top", "forearm_bottom"]
    assert shapes["base"].primitive == Box((0.3, 0.2, 0.1))
    assert shapes["base"].T_link_shape[2, 3] == 0.05
    assert shapes["tube"].primitive == TruncatedCone(0.05, 0.05, 0.0, -0.2, 0.2)
    assert shapes["column"].primitive == Ellipsoid((0.07, 0.07, 0.07))
    assert [shapes[name].color_rgb for name in ("base", "tube", "column")] == [(51, 102, 153), (255, 0, 0), (255, 0, 0)]
    assert not shapes["forearm"].has_color
    assert shapes["forearm_top"].T_link_shape[2, 3] == 0.15


def test_model_and_state_go_through_our_own_files(tmp_path):
    model = load_model(written(tmp_path))
    dump_model(model, tmp_path / "arm.yaml")
    again = load_model(tmp_path / "arm.yaml")
    state = State(random_state(model, np.random.default_rng(0)).T_world_root, np.array([1.0, 0.25, -0.4]))
    dump_state(state, model, tmp_path / "state.yaml")
    assert "joints_m:\n  lift: 0.25" in (tmp_path / "state.yaml").read_text()
    loaded = load_state(tmp_path / "state.yaml", again)
    np.testing.assert_allclose(loaded.joint_positions, state.joint_positions, atol=1e-12)
    np.testing.assert_allclose(
        Configuration(again, loaded).Ts_world_shape, Configuration(model, state).Ts_world_shape, atol=1e-12
    )
    assert [a.endless for a in again.chain.axes] == [True, False, False]


@pytest.mark.parametrize("model", [crane(), gantry(), human_model()], ids=lambda m: m.name)
def test_what_is_written_for_rviz_is_read_again(tmp_path, model):
    (tmp_path / "robot.urdf").write_text(urdf_of(model))
    again = load_model(tmp_path / "robot.urdf")
    order = [model.chain.axis_index(axis.name) for axis in again.chain.axes]
    assert sorted(order) == list(range(model.chain.n_axes))
    assert [axis.unit for axis in again.chain.axes] == [model.chain.axes[i].unit for i in order]
    np.testing.assert_allclose(again.chain.lower, model.chain.lower[order], rtol=1e-8)
    np.testing.assert_allclose(again.chain.upper, model.chain.upper[order], rtol=1e-8)
    state = random_state(model, np.random.default_rng(1))
    before, after = Configuration(model, state), Configuration(again, State(state.T_world_root, state.joint_positions[order]))
    for i, link in enumerate(model.chain.links):
        np.testing.assert_allclose(after.Ts_world_link[again.chain.link_index(link)], before.Ts_world_link[i], atol=1e-7)
    looks = [sorted((s.name, s.link, s.color_rgb) for s in body.shapes) for body in (model, again)]
    assert looks[0] == looks[1]


BALLS = """<robot name="b"><link name="world"/>
<link name="torso"><collision><geometry><sphere radius="0.2"/></geometry></collision></link>
<link name="arm"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="free" type="floating"><parent link="world"/><child link="torso"/></joint>
<joint name="shoulder" type="spherical"><parent link="torso"/><child link="arm"/><origin xyz="0 0.3 0"/></joint></robot>"""


def test_a_ball_joint_is_three_turns_and_the_world_is_left_out(tmp_path):
    model = load_model(written(tmp_path, BALLS))
    assert model.chain.links == ("torso", "arm")
    assert model.chain.dof_names[6:] == ("shoulder_x", "shoulder_y", "shoulder_z")
    assert [s.name for s in model.shapes] == ["torso", "arm"]  # collision geometry, as nothing else is there
    angles = np.array([0.3, -0.4, 0.5])
    rotation = Configuration(model, State(np.eye(4), angles)).Ts_world_link[1][:3, :3]
    np.testing.assert_allclose(rotation, Rotation.from_euler("XYZ", angles).as_matrix(), atol=1e-12)


GRIPPER = """<robot name="gripper"><link name="palm"><visual><geometry><box size="0.1 0.1 0.02"/></geometry></visual></link>
<link name="left"><visual><geometry><box size="0.02 0.02 0.1"/></geometry></visual></link>
<link name="right"><visual><geometry><box size="0.02 0.02 0.1"/></geometry></visual></link>
<link name="dial"><visual><geometry><sphere radius="0.02"/></geometry></visual></link>
<joint name="left_finger" type="prismatic"><parent link="palm"/><child link="left"/><axis xyz="1 0 0"/>
  <limit lower="0.01" upper="0.05"/></joint>
<joint name="right_finger" type="prismatic"><parent link="palm"/><child link="right"/><axis xyz="-1 0 0"/>
  <limit lower="0" upper="0.06"/><mimic joint="left_finger" offset="0.005"/></joint>
<joint name="gauge" type="revolute"><parent link="palm"/><child link="dial"/><limit lower="-3" upper="3"/>
  <mimic joint="right_finger" multiplier="-40"/></joint></robot>"""


def test_fingers_follow_each_other(tmp_path):
    """Also through our own file, through the text for RViz, and in a pose that names the leader only."""
    model = load_model(written(tmp_path, GRIPPER))
    dump_model(model, tmp_path / "gripper.yaml")
    (tmp_path / "again.urdf").write_text(urdf_of(model))
    (tmp_path / "state.yaml").write_text("root: {xyz: [0, 0, 0]}\njoints_m: {left_finger: 0.03}\n")
    for body in (model, load_model(tmp_path / "gripper.yaml"), load_model(tmp_path / "again.urdf")):
        assert [axis.mimic for axis in body.chain.axes] == [
            None, Following("left_finger", 1.0, 0.005), Following("right_finger", -40.0, 0.0)
        ]  # fmt: skip
        np.testing.assert_allclose(State.neutral(body).joint_positions, [0.01, 0.015, -0.6])
        np.testing.assert_allclose(load_state(tmp_path / "state.yaml", body).joint_positions, [0.03, 0.035, -1.4])


def test_joints_that_follow_each_other_in_a_circle_are_refused(tmp_path):
    circle = GRIPPER.replace('upper="0.05"/></joint>', 'upper="0.05"/><mimic joint="right_finger"/></joint>')
    with pytest.raises(FileFormatError, match=r"left_finger.*a joint that does not follow this one"):
        load_model(written(tmp_path, circle))
    ghost = GRIPPER.replace('<mimic joint="left_finger" offset="0.005"/>', '<mimic joint="ghost"/>')
    follower = '<mimic joint="right_finger"/></joint>'
    first = ghost.replace('upper="0.05"/></joint>', f'upper="0.05"/>{follower}')
    with pytest.raises(FileFormatError, match=r"another joint that moves.*ghost"):
        load_model(written(tmp_path, first))


@pytest.fixture
def pyramid() -> Mesh:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    return Mesh(vertices, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def mesh_robot(filename: str, scale: str = "1 1 1") -> str:
    mesh = f'<mesh filename="{filename}" scale="{scale}"/>'
    return f'<robot name="m"><link name="l"><visual><geometry>{mesh}</geometry></visual></link></robot>'


def test_meshes_are_found_scaled_and_mirrored(tmp_path, pyramid, monkeypatch):
    folder = tmp_path / "my_robot" / "urdf"
    folder.mkdir(parents=True)
    file = write_mesh(pyramid, tmp_path / "my_robot" / "meshes" / "pyramid")
    for where in ("../meshes/pyramid.obj", "package://my_robot/meshes/pyramid.obj", f"file://{file}"):
        mesh = load_model(written(folder, mesh_robot(where, "2 3 -0.5"))).shapes[0].primitive
        np.testing.assert_allclose(mesh.vertices, pyramid.vertices * [2.0, 3.0, -0.5])
        assert volume(mesh) == pytest.approx(3.0 * volume(pyramid))  # positive: its faces still look outward
    elsewhere = written(tmp_path, mesh_robot("package://arm_description/pyramid.obj"), "elsewhere.urdf")
    with pytest.raises(FileFormatError, match=r"geometry.mesh.filename.*package 'arm_description'.*AMENT_PREFIX_PATH"):
        load_model(elsewhere)
    write_mesh(pyramid, tmp_path / "prefix" / "share" / "arm_description" / "pyramid")
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join(["/nowhere", str(tmp_path / "prefix")]))
    assert len(load_model(elsewhere).shapes) == 1


WRONG = {
    "no file": (None, "an existing file"),
    "no xml": ("robot: arm", "expected XML"),
    "cut off": (ROBOT[:700], r"line 14, column .*expected XML"),
    "no robot": ("<model/>", "expected <robot>"),
    "xacro": (ROBOT.replace('length="0.4"', 'length="${height}"'), "xacro FILE > robot.urdf"),
    "no links": ('<robot name="r"/>', "at least one <link>"),
    "no name": (ROBOT.replace('<robot name="arm">', "<robot>"), "'robot.name': expected text, got 'nothing'"),
    "no geometry": ('<robot name="r"><link name="a"/></robot>', r"<visual> or <collision> with <geometry>.*none in 1 links"),
    "empty geometry": (
        ROBOT.replace('<sphere radius="0.07"/>', ""),
        r"link\[column\].visual.geometry': expected one of <box>.*nothing",
    ),
    "bad geometry": (ROBOT.replace('sphere radius="0.07"', "torus"), r"link\[column\].visual.geometry'.*<torus>"),
    "negative": (
        ROBOT.replace('radius="0.05"', 'radius="-1"'),
        r"link\[column\].visual\[tube\].geometry.cylinder.radius.*positive",
    ),
    "word": (ROBOT.replace("0.3 0.2 0.1", "0.3 0.2 tall"), r"link\[base\].visual.geometry.box.size': expected 3 finite numbers"),
    "not finite": (ROBOT.replace('lower="-0.5"', 'lower="nan"'), r"joint\[elbow\].limit.lower': expected a finite number"),
    "two numbers": (ROBOT.replace('xyz="0.1 0 0"', 'xyz="0.1 0"'), r"joint\[elbow\].origin.xyz': expected 3 finite numbers"),
    "no axis": (ROBOT.replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"'), r"joint\[elbow\].axis.xyz': expected a direction"),
    "limits": (ROBOT.replace('upper="2"', 'upper="-2"'), r"joint\[elbow\].limit.upper': expected an upper limit >= the lower"),
    "no limits": (
        ROBOT.replace('<limit lower="-0.5" upper="2" effort="1" velocity="1"/>', ""),
        r"joint\[elbow\]': expected a <limit>",
    ),
    "joint type": (ROBOT.replace('type="revolute"', 'type="planar"', 1), r"joint\[elbow\].type': expected one of .*got 'planar'"),
    "floating": (ROBOT.replace('type="revolute"', 'type="floating"', 1), r"joint\[elbow\].type': .*the root floats"),
    "mimic": (ROBOT.replace("<dynamics", '<mimic joint="stuck"/><dynamics'), r"joint\[elbow\].mimic.joint': .*got 'stuck'"),
    "unknown link": (
        ROBOT.replace('child link="tool"', 'child link="tol"'),
        r"joint\[stuck\].child.link': expected a link.*'tol'",
    ),
    "two roots": (ROBOT.replace('<link name="tool"/>', '<link name="tool"/><link name="x"/>'), r"'joint': .*one root.*base.*x"),
    "cycle": (ROBOT.replace('child link="column"', 'child link="base"'), "'joint': expected a tree"),
    "same link": (ROBOT.replace('link name="tool"', 'link name="base"'), r"link\[base\].name': expected each link once"),
    "same joint": (ROBOT.replace('joint name="stuck"', 'joint name="lift"'), r"joint\[lift\].name': expected each joint once"),
    "root's name": (
        BALLS.replace('name="shoulder"', 'name="root"'),
        r"joint\[root\].name': .*\(the root has this one\), got 'root_x'",
    ),
    "material": (
        ROBOT.replace('<material name="steel"/>', '<material name="stel"/>'),
        r"visual.material': .*\['steel'\], got 'stel'",
    ),
    "color": (ROBOT.replace("0.2 0.4 0.6 1", "20 40 60 1"), r"material\[steel\].color.rgba': expected 4 numbers of 0..1"),
    "mesh": (mesh_robot("nothing.stl"), r"mesh.filename': expected an existing mesh file.*nothing.stl"),
    "flat": (mesh_robot("nothing.stl", "1 0 1"), "mesh.scale': expected 3 numbers other than zero"),
    "web": (mesh_robot("http://robots.org/a.stl"), r"mesh.filename': expected a path, file:// or package://"),
    "two shapes": (ROBOT.replace('<sphere radius="0.07"/>', '<sphere radius="1"/><sphere radius="2"/>'), "<sphere>, <sphere>"),
    "two axes": (
        ROBOT.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><axis xyz="0 1 0"/>'),
        "expected one <axis>, got '2 of them'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_said(tmp_path, what):
    text, message = WRONG[what]
    path = tmp_path / "wrong.urdf"
    if text is not None:
        path.write_text(text)
    with pytest.raises(FileFormatError, match=message) as error:
        load_model(path)
    assert str(path) in str(error.value)


def test_a_xacro_file_is_refused_kindly(tmp_path):
    with pytest.raises(FileFormatError, match=r"xacro FILE > robot\.urdf"):
        load_model(written(tmp_path, ROBOT, "arm.urdf.xacro"))


def test_text_ended_as_in_c_is_read(tmp_path):
    assert load_model(written(tmp_path, ROBOT + "\0")).n_dof == 9


@pytest.mark.skipif("TRACKER_SHARED_DATA" not in os.environ, reason="TRACKER_SHARED_DATA is not set")
def test_a_humanoid_of_another_program():
    """pybullet's: y up, balls and capsules, collision geometry only, and a joint called like a link."""
    model = load_model(Path(os.environ["TRACKER_SHARED_DATA"]) / "bullet_motions" / "humanoid.urdf")
    assert model.n_dof == 6 + 8 * 3 + 4
    marks = dict(zip(model.landmark_names, Configuration(model, State.neutral(model)).landmarks_world, strict=True))
    np.testing.assert_allclose(marks["chest"], [0.0, 0.944604, 0.0])
    assert marks["left_knee"][1] < marks["left_hip"][1] < marks["neck"][1]
    assert {type(shape.primitive) for shape in model.shapes} == {Box, Ellipsoid, TruncatedCone}


BOX = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'


def urdf(tmp_path, inside):
    path = tmp_path / "small.urdf"
    path.write_text(f'<robot name="small">{inside}</robot>')
    return load_model(path)


def joined(kind, axis, lower, upper):
    joint = f'<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="{axis}"/>'
    limits = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint>'
    return f'<link name="a">{BOX}</link><link name="b">{BOX}</link>{joint}{limits}'


def test_shapes_of_a_link_are_numbered_past_names_that_there_are(tmp_path):
    model = urdf(
        tmp_path,
        f'<link name="a">{BOX * 3}</link><link name="a_2">{BOX}</link>'
        '<joint name="j" type="fixed"><parent link="a"/><child link="a_2"/></joint>',
    )
    assert sorted(shape.name for shape in model.shapes) == ["a", "a_2", "a_3", "a_4"]


@pytest.mark.parametrize(("kind", "place"), [("prismatic", (0.0, 0.3, 0.0)), ("revolute", (0.0, 0.0, 0.0))])
def test_a_joint_that_cannot_move_is_welded_where_it_stands(tmp_path, kind, place):
    model = urdf(tmp_path, joined(kind, "0 1 0", 0.3, 0.3))
    assert model.n_dof == 6
    body = Configuration(model, State.neutral(model))
    T = body.Ts_world_shape[[shape.name for shape in model.shapes].index("b")]
    np.testing.assert_allclose(T[:3, 3], place, atol=1e-12)
    turn = 0.3 if kind == "revolute" else 0.0
    np.testing.assert_allclose(T[:3, 0], [np.cos(turn), 0.0, -np.sin(turn)], atol=1e-12)


@pytest.mark.parametrize("infinite", ["1e16", "inf", "6283.2"])
def test_a_turn_between_infinite_limits_has_no_end(tmp_path, infinite):
    assert urdf(tmp_path, joined("revolute", "0 1 0", f"-{infinite}", infinite)).chain.axes[0].endless


def test_a_model_file_names_a_description_and_the_geometry_that_is_seen(tmp_path):
    collision = "<collision><geometry><sphere radius='0.2'/></geometry></collision>"
    (tmp_path / "small.urdf").write_text(f'<robot name="small"><link name="a">{BOX}{collision}</link></robot>')
    for text, kind in (("", Box), ("geometry: visual", Box), ("geometry: collision", Ellipsoid)):
        (tmp_path / "robot.yaml").write_text(f"urdf: small.urdf\n{text}\n")
        assert [type(shape.primitive) for shape in load_model(tmp_path / "robot.yaml").shapes] == [kind]
    for text, said in (("urdf: other.urdf", "urdf': expected an existing file"), ("urdf: small.urdf\nlinks: [a]", "links")):
        (tmp_path / "robot.yaml").write_text(text)
        with pytest.raises(FileFormatError, match=said):
            load_model(tmp_path / "robot.yaml")


@pytest.mark.parametrize(("stated", "limit"), [("2.5", 2.5), ("0", np.inf), ("inf", np.inf), ("100", np.inf)])
def test_how_fast_a_joint_is_comes_back(tmp_path, stated, limit):
    model = urdf(tmp_path, joined("revolute", "0 1 0", -1, 1).replace('velocity="1"', f'velocity="{stated}"'))
    assert model.chain.axes[0].velocity_limit == limit
    (tmp_path / "again.urdf").write_text(urdf_of(model))
    assert load_model(tmp_path / "again.urdf").chain.axes[0].velocity_limit == limit


@pytest.mark.parametrize(("lower", "upper", "neutral"), [(-1, 2, 0.0), (0.5, 2, 0.5), (-2, -0.5, -0.5)])
def test_neutral_is_zero_or_the_limit_next_to_it(tmp_path, lower, upper, neutral):
    (axis,) = urdf(tmp_path, joined("revolute", "0 1 0", lower, upper)).chain.axes
    assert (axis.lower, axis.upper, axis.neutral, axis.prismatic) == (lower, upper, neutral, False)
    assert urdf(tmp_path, joined("prismatic", "0 1 0", lower, upper)).chain.axes[0].prismatic
