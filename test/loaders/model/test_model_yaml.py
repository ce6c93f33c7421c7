from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.bodies.bodies import crane, random_state
from helpers.numeric.rotations import directions, twists
from tracker_node.errors import FileFormatError
from tracker_node.geometry import se3, so3
from tracker_node.loaders.model.model_yaml import dump_model, load_model, transform_of
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone

MODEL = """
name: arm
links: [base, upper, fore]
joints:
  shoulder:
    parent: base
    child: upper
    xyz: [0, 0, 1]
    rpy_deg: [0, 90, 30]
    axes:
      - {name: swing, direction: [1, 0, 0], limits_deg: [-90, 90], neutral_deg: 10, stiffness: 2}
      - {name: roll, direction: [0, 0, 3]}
  elbow: {parent: upper, child: fore, xyz: [0, 0, -0.3], axes: [{name: bend, direction: [1, 1, 0], limits_deg: [-150, 0]}]}
shapes:
  sleeve: {link: upper, type: truncated_elliptical_cone, a: 0.05, b: 0.04, end_scale: 0.8, length: 0.3}
  stub: {link: upper, type: truncated_elliptical_cone, a: 0.05, b: 0.04, taper: -0.5, z1: -0.1, z2: 0.3}
  fist: {link: fore, type: ellipsoid, radii: [0.1, 0.1, 0.2], color_rgb: [1, 2, 3], xyz: [0, 0, -0.2]}
  stand: {link: base, type: box, size: [0.1, 0.1, 0.2]}
landmarks:
  elbow: {link: fore, xyz: [0, 0, 0]}
"""


def assert_same(a: ArticulatedModel, b: ArticulatedModel, tolerance: float = 1e-9) -> None:
    assert a.name == b.name
    assert a.chain.links == b.chain.links
    assert a.chain.dof_names == b.chain.dof_names
    assert [(j.name, j.parent, j.child) for j in a.chain.joints] == [(j.name, j.parent, j.child) for j in b.chain.joints]
    assert np.allclose(a.chain.offsets, b.chain.offsets, atol=tolerance)
    assert np.allclose(a.chain.directions, b.chain.directions, atol=1e-12)
    for x, y in zip(a.chain.axes, b.chain.axes, strict=True):
        assert np.allclose((x.lower, x.upper, x.neutral, x.stiffness), (y.lower, y.upper, y.neutral, y.stiffness), atol=1e-12)
    assert np.allclose(a.Ts_link_shape, b.Ts_link_shape, atol=tolerance)
    assert a.landmarks == b.landmarks
    for x, y in zip(a.shapes, b.shapes, strict=True):
        assert (x.name, x.link, x.color_rgb, type(x.primitive)) == (y.name, y.link, y.color_rgb, type(y.primitive))
        for value, other in zip(vars(x.primitive).values(), vars(y.primitive).values(), strict=True):
            assert np.array_equal(value, other)


@pytest.fixture
def model_path(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(MODEL)
    return path


def test_everything_arrives(model_path):
    model = load_model(model_path)
    assert model.chain.dof_names[6:] == ("swing", "roll", "bend")
    swing, roll, bend = model.chain.axes
    assert np.allclose(np.rad2deg((swing.lower, swing.upper, swing.neutral)), (-90, 90, 10))
    assert swing.stiffness == 2.0
    assert roll.direction == (0.0, 0.0, 1.0)
    assert np.allclose(np.rad2deg((roll.lower, roll.upper)), (-180, 180))
    assert np.allclose(bend.direction, np.array([1, 1, 0]) / np.sqrt(2))
    sleeve, stub, fist, stand = (shape.primitive for shape in model.shapes)
    assert np.isclose(sleeve.a * (1 + sleeve.k * sleeve.z2), 0.8 * 0.05)
    assert (sleeve.z1, sleeve.z2) == (0.0, 0.3)
    assert stub == TruncatedCone(0.05, 0.04, -0.5, -0.1, 0.3)
    assert fist == Ellipsoid((0.1, 0.1, 0.2))
    assert stand == Box((0.1, 0.1, 0.2))
    assert model.shapes[2].color_rgb == (1, 2, 3)
    # R = Rz(30) Ry(90): the upper arm's z points where Rz(30) takes x
    assert np.allclose(model.chain.offsets[1][:3, 2], [np.cos(np.pi / 6), 0.5, 0.0])


BAD = [
    ("parent: upper", "parent: uper", "joints.elbow.parent"),
    ("child: fore", "child: four", "joints.elbow.child"),
    ("parent: base", "parent: fore", "joints.shoulder.parent"),  # a cycle
    ("parent: base", "parent: upper", "joints.shoulder.parent"),  # on itself
    ("child: upper", "child: fore", "joints.elbow.child"),
    ("links: [base, ", "links: [base, base, ", "links"),
    ("links: [base, ", "links: [base, spare, ", "links"),
    ("links: [base, upper, fore]", "links: []", "links"),
    ("name: roll", "name: swing", "joints.shoulder.axes.1.name"),
    ("name: roll", "name: root_rx", "joints.shoulder.axes.1.name"),
    ("[-150, 0]", "[0, -150]", "joints.elbow.axes.0.limits_deg"),
    ("[-150, 0]", "[10, 150]", "joints.elbow.axes.0.neutral_deg"),
    ("[0, 0, 3]", "[0, 0, 0]", "joints.shoulder.axes.1.direction"),
    ("stiffness: 2", "stiffness: -2", "joints.shoulder.axes.0.stiffness"),
    ("xyz: [0, 0, 1]", "xyz: [0, 0]", "joints.shoulder.xyz"),
    ("link: fore, type", "link: x, type", "shapes.fist.link"),
    ("type: box", "type: bax", "shapes.stand"),
    ("type: box, ", "", "shapes.stand"),
    ("size: [0.1, 0.1, 0.2]", "sise: [0.1, 0.1, 0.2]", "shapes.stand.sise"),
    ("radii: [0.1, 0.1", "radii: [0.1, 0", "shapes.fist.radii"),
    ("[1, 2, 3]", "[1, 2, 300]", "shapes.fist.color_rgb"),
    ("length: 0.3", "length: -1", "shapes.sleeve.length"),
    (", length: 0.3", "", "shapes.sleeve.length"),
    ("end_scale: 0.8", "end_scale: 0.8, taper: 1", "shapes.sleeve.end_scale"),
    ("taper: -0.5", "taper: -4", "shapes.stub.taper"),
    ("z1: -0.1, ", "", "shapes.stub.z1"),
    ("z1: -0.1", "z1: 0.4", "shapes.stub.z2"),
    ("a: 0.05, b", "a: wide, b", "shapes.sleeve.a"),
    ("type: box, size: [0.1, 0.1, 0.2]", "type: mesh, file: none.stl", "shapes.stand.file"),
    ("elbow: {link: fore", "elbow: {link: hand", "landmarks.elbow.link"),
    ("name: arm", "nom: arm", "nom"),
]


@pytest.mark.parametrize(("old", "new", "field"), BAD)
def test_errors_name_file_and_field(model_path, old, new, field):
    assert MODEL.count(old) >= 1
    model_path.write_text(MODEL.replace(old, new, 1))
    with pytest.raises(FileFormatError) as error:
        load_model(model_path)
    assert error.value.field == field
    assert str(model_path) in str(error.value)


def test_a_link_named_twice_is_said_to_be(model_path):
    model_path.write_text(MODEL.replace("[base, upper, fore]", "[base, upper, fore, upper, fore]"))
    with pytest.raises(FileFormatError, match=r"'links': expected each link once, got \['fore', 'upper'\]"):
        load_model(model_path)


def test_turns_do_not_matter_of_a_thing_only(model_path, tmp_path):
    model_path.write_text(MODEL + "symmetric: true\n")
    with pytest.raises(FileFormatError, match=r"'symmetric': expected false of a body with joints.*got \['elbow', 'shoulder'\]"):
        load_model(model_path)
    thing = ArticulatedModel("t", KinematicChain(("t",), ()), (Shape("b", "t", Box((0.1, 0.2, 0.3))),), symmetric=True)
    dump_model(thing, tmp_path / "t.yaml")
    assert load_model(tmp_path / "t.yaml").symmetric and not load_model(_written(tmp_path, MODEL)).symmetric


def test_a_body_in_its_clothes_is_written_and_read(tmp_path):
    dump_model(replace(load_model(_written(tmp_path, MODEL)), clothed=True), tmp_path / "c.yaml")
    assert load_model(tmp_path / "c.yaml").clothed and not load_model(_written(tmp_path, MODEL)).clothed


def _written(folder: Path, text: str) -> Path:
    (folder / "other.yaml").write_text(text)
    return folder / "other.yaml"


def test_a_cycle_is_spelled_out(model_path):
    model_path.write_text(MODEL.replace("parent: base", "parent: fore"))
    with pytest.raises(FileFormatError, match="upper -> fore -> upper"):
        load_model(model_path)


def test_a_mesh_that_is_none_is_named(model_path, tmp_path):
    (tmp_path / "bad.stl").write_bytes(b"nothing of the kind")
    model_path.write_text(MODEL.replace("type: box, size: [0.1, 0.1, 0.2]", "type: mesh, file: bad.stl"))
    with pytest.raises(FileFormatError, match="mesh"):
        load_model(model_path)


@pytest.mark.parametrize("model", [crane(), human_model()], ids=lambda m: m.name)
def test_dumped_it_comes_back(model, tmp_path):
    dump_model(model, tmp_path / "sub" / "m.yaml", "written by a test")
    again = load_model(tmp_path / "sub" / "m.yaml")
    assert_same(again, model)
    state = random_state(model, np.random.default_rng(0))
    assert np.allclose(Configuration(again, state).landmarks_world, Configuration(model, state).landmarks_world, atol=1e-12)
    assert (tmp_path / "sub" / "m.yaml").read_text().startswith("# written by a test\n")


def test_a_mesh_in_millimetres(model_path, tmp_path):
    dump_model(crane(), tmp_path / "crane.yaml")
    text = (tmp_path / "crane.yaml").read_text().replace("file: crane_plate.obj", "file: crane_plate.obj\n    scale: 0.001")
    (tmp_path / "crane.yaml").write_text(text)
    assert np.allclose(
        load_model(tmp_path / "crane.yaml").shapes[4].primitive.vertices, 0.001 * crane().shapes[4].primitive.vertices
    )


@given(twists)
def test_roll_pitch_yaw_there_and_back(twist):
    T = se3.exp(twist)
    assert np.allclose(transform_of(tuple(T[:3, 3]), np.rad2deg(so3.to_roll_pitch_yaw(T[:3, :3]))), T, atol=1e-12)


@pytest.mark.parametrize("pitch", [90.0, -90.0, 89.9999999])
def test_roll_pitch_yaw_at_the_singular_pitch(pitch):
    T = transform_of((0.0, 0.0, 0.0), (25.0, pitch, -70.0))
    assert np.allclose(transform_of((0.0, 0.0, 0.0), np.rad2deg(so3.to_roll_pitch_yaw(T[:3, :3]))), T, atol=1e-12)


sizes = st.floats(1e-3, 2.0)
angles = st.floats(0.0, 3.0)
colors = st.tuples(*[st.integers(0, 255)] * 3)
primitives = st.one_of(
    st.builds(lambda a, b, k, z1, length: (a, b, k, z1, z1 + length), sizes, sizes, st.floats(-0.2, 0.2), st.floats(-2, 2), sizes)
    .filter(lambda v: v[4] > v[3])
    .map(lambda v: TruncatedCone(*v)),
    st.tuples(sizes, sizes, sizes).map(Ellipsoid),
    st.tuples(sizes, sizes, sizes).map(Box),
    st.tuples(sizes, sizes, sizes).map(lambda s: Mesh(np.diag(s), [[0, 1, 2]])),
)


@st.composite
def models(draw):
    n = draw(st.integers(1, 5))
    links = tuple(f"link{i}" for i in range(n))
    joints = []
    for i in range(1, n):
        axes = []
        for j in range(draw(st.integers(0, 3))):
            lower, upper = -draw(angles), draw(angles) + 0.01
            direction = tuple(float(v) for v in draw(directions))
            neutral = draw(st.floats(0.0, 1.0)) * (upper - lower) + lower
            axes.append(Axis(f"q{i}_{j}", direction, lower, upper, min(max(neutral, lower), upper), draw(angles)))
        parent = links[draw(st.integers(0, i - 1))]
        joints.append(Joint(f"joint{i}", parent, links[i], se3.exp(draw(twists)), tuple(axes)))
    places = [se3.exp(draw(twists)) for _ in range(draw(st.integers(0, 3)))]
    shapes = tuple(
        Shape(f"shape{i}", draw(st.sampled_from(links)), draw(primitives), place, draw(colors)) for i, place in enumerate(places)
    )
    landmarks = tuple(Landmark(f"mark {i}", link, (i * 0.1, 1 / 3, -1e-9)) for i, link in enumerate(links))
    return ArticulatedModel("any name: with # signs", KinematicChain(links, tuple(joints)), shapes, landmarks)


@settings(max_examples=60, deadline=None)
@given(models())
def test_any_body_comes_back_from_its_file(tmp_path_factory, model):
    path = tmp_path_factory.mktemp("model") / "m.yaml"
    dump_model(model, path)
    assert_same(load_model(path), model, 1e-11)


def test_limits_in_radians_are_refused(model_path):
    """As degrees they let no joint move."""
    text = MODEL.replace("limits_deg: [-90, 90], neutral_deg: 10", "limits_deg: [-1.57, 1.57]").replace("[-150, 0]", "[-2.6, 0]")
    model_path.write_text(text)
    assert len(load_model(model_path).chain.axes) == 3  # of two with limits nobody can tell
    model_path.write_text(text.replace("{name: roll,", "{name: roll, limits_deg: [-3.14, 3.14],"))
    with pytest.raises(FileFormatError, match=r"expected degrees, got 'limits of at most 3\.14, which are radians'"):
        load_model(model_path)
