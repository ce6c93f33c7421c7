"""Robot descriptions written of a body: every attribute of joints and shapes, by hand."""

from xml.etree import ElementTree

import numpy as np
import pytest

from tracker_node.loaders.model.urdf_writer import urdf_of
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.kinematic_chain import ENDLESS_RAD, Axis, Following, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone


def at(x: float, y: float, z: float, rotation=None) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    pose[:3, :3] = np.eye(3) if rotation is None else rotation
    return pose


def robot(joints: tuple[Joint, ...] = (), shapes: tuple[Shape, ...] = (), links=("a",)) -> ElementTree.Element:
    text = urdf_of(ArticulatedModel("thing", KinematicChain(links, joints), shapes))
    assert text.startswith('<?xml version="1.0"?>\n<robot name="thing">')
    return ElementTree.fromstring(text)


def test_joints_have_a_link_for_each_axis():
    axes = (
        Axis("turn", (0.0, 0.0, 1.0), -1.5, 2.0),
        Axis("slide", (1.0, 0.0, 0.0), -0.5, 0.25, prismatic=True, mimic=Following("turn", 2.0, 0.125)),
        Axis("spin", (0.0, 1.0, 0.0), -ENDLESS_RAD, ENDLESS_RAD),
    )
    joints = (Joint("j", "a", "b", at(1, 2, 3), axes), Joint("weld", "b", "c", at(4, 5, 6)))
    made = robot(joints, links=("a", "b", "c"))
    assert [(item.tag, item.get("name")) for item in made] == [
        ("link", "a"), ("joint", "turn"), ("link", "b_after_turn"), ("joint", "slide"), ("link", "b_after_slide"),
        ("joint", "spin"), ("link", "b"), ("joint", "weld"), ("link", "c"),
    ]  # fmt: skip
    turn, slide, spin, weld = made.findall("joint")
    assert [joint.get("type") for joint in (turn, slide, spin, weld)] == ["revolute", "prismatic", "continuous", "fixed"]
    ends = [(joint.find("parent").get("link"), joint.find("child").get("link")) for joint in (turn, slide, spin, weld)]
    assert ends == [("a", "b_after_turn"), ("b_after_turn", "b_after_slide"), ("b_after_slide", "b"), ("b", "c")]
    assert [joint.find("origin").get("xyz") for joint in (turn, slide, spin, weld)] == ["1 2 3", "0 0 0", "0 0 0", "4 5 6"]
    assert [joint.find("axis").get("xyz") for joint in (turn, slide, spin)] == ["0 0 1", "1 0 0", "0 1 0"]
    assert weld.find("axis") is None and weld.find("limit") is None
    assert turn.find("limit").attrib == {"lower": "-1.5", "upper": "2", "effort": "0", "velocity": "100"}
    assert slide.find("limit").get("upper") == "0.25" and spin.find("limit").attrib == {"effort": "0", "velocity": "100"}
    assert slide.find("mimic").attrib == {"joint": "turn", "multiplier": "2", "offset": "0.125"}
    assert turn.find("mimic") is None


def visual(primitive, pose=None) -> tuple[ElementTree.Element, np.ndarray, np.ndarray]:
    """The geometry, and x y z and roll pitch yaw of the origin."""
    made = robot(shapes=(Shape("s", "a", primitive, np.eye(4) if pose is None else pose, (255, 51, 0)),))
    (one,) = made.findall("link/visual")
    assert one.get("name") == "s" and one.find("material").get("name") == "s_color"
    assert one.find("material/color").get("rgba") == "1 0.2 0 1"
    origin = one.find("origin")
    (geometry,) = one.find("geometry")
    return geometry, *(np.array([float(word) for word in origin.get(key).split()]) for key in ("xyz", "rpy"))


DOWN_X = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # a quarter turn about y: z points along x


def test_shapes():
    geometry, xyz, rpy = visual(Box((1.0, 2.0, 3.0)), at(1, 2, 3))
    assert (geometry.tag, geometry.get("size"), xyz.tolist(), rpy.tolist()) == ("box", "1 2 3", [1, 2, 3], [0, 0, 0])
    geometry, *_ = visual(Ellipsoid((0.1, 0.2, 0.6)))
    assert (geometry.tag, geometry.get("radius")) == ("sphere", "0.3")
    # Radius 0.6 at its own zero, sqrt(0.4 * 0.9); its middle is at z = 2, where it is half as large
    geometry, xyz, rpy = visual(TruncatedCone(0.4, 0.9, -0.25, 1.0, 3.0), at(5, 0, 0, DOWN_X))
    assert (geometry.tag, geometry.get("radius"), geometry.get("length")) == ("cylinder", "0.3", "2")
    assert xyz == pytest.approx([7.0, 0.0, 0.0]) and rpy == pytest.approx([0.0, np.pi / 2, 0.0])
    mesh = Mesh([[0.0, 0, 0], [2, 0, 0], [0, 4, 0]], [[0, 1, 2]])  # flat: a box as good as without depth
    geometry, xyz, _ = visual(mesh, at(5, 0, 1, DOWN_X))
    assert (geometry.tag, geometry.get("size")) == ("box", "2 4 1e-06") and xyz == pytest.approx([5.0, 2.0, 0.0])


def test_shapes_stand_on_their_links():
    ball = Ellipsoid((0.1, 0.1, 0.1))
    shapes = (Shape("x", "b", ball), Shape("y", "a", ball), Shape("z", "b", ball))
    made = robot((Joint("j", "a", "b", np.eye(4)),), shapes, ("a", "b"))
    assert [[one.get("name") for one in link.findall("visual")] for link in made.findall("link")] == [["y"], ["x", "z"]]


@pytest.mark.parametrize("angles", [(0.1, -0.2, 0.3), (2.0, 1.0, -3.0), (0.0, np.pi / 2, 0.7), (0.0, -np.pi / 2, -0.7)])
def test_roll_pitch_and_yaw_about_fixed_axes(angles):
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    _, _, rpy = visual(Box((1.0, 1.0, 1.0)), at(0, 0, 0, about_z @ about_y @ about_x))
    assert rpy == pytest.approx(angles, abs=1e-8)
