"""What a model file may hold: each limit, from both sides."""

import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.file_model import validate
from tracker_node.loaders.model.model_file import (
    LEAST_RANGE,
    AxisEntry,
    BoxEntry,
    ConeEntry,
    EllipsoidEntry,
    LoftEntry,
    MimicEntry,
    ModelFile,
)

AXIS = {"name": "bend", "direction": [0, 1, 0]}
CONE = {"link": "a", "type": "truncated_elliptical_cone", "a": 0.1, "b": 0.2}
BALL = {"link": "a", "type": "ellipsoid", "radii": [0.1, 0.2, 0.3]}
BOX = {"link": "a", "type": "box", "size": [0.1, 0.2, 0.3]}
SECTIONS = [{"z": 0.0, "half_x": 0.1, "half_y": 0.1}, {"z": 0.1, "half_x": 0.1, "half_y": 0.2}]
LOFT = {"link": "a", "type": "lofted", "sections": SECTIONS, "domes": [0.05, 0.06]}


def refused(kind, values, field, expected):
    """The one problem of these values is in this field."""
    with pytest.raises(FileFormatError) as told:
        validate(kind, values, "body.yaml")
    assert told.value.field == field
    assert expected in told.value.expected


def taken(kind, **values):
    return validate(kind, values, "body.yaml")


def test_an_axis_turns_by_degrees_or_slides_by_metres():
    turning = taken(AxisEntry, **AXIS, limits_deg=[-10, 20], neutral_deg=20)
    assert not turning.slides
    assert turning.limits_deg == (-10.0, 20.0)
    sliding = taken(AxisEntry, **AXIS, limits_m=[-0.1, 0.2], neutral_m=-0.1)
    assert sliding.slides
    assert sliding.limits_m == (-0.1, 0.2)


@pytest.mark.parametrize(
    ("given", "field", "expected"),
    [
        ({"limits_m": [0, 1], "limits_deg": [0, 1]}, "limits_deg", "or limits_m"),
        ({"limits_m": [0, 1], "neutral_deg": 0.0}, "neutral_deg", "or limits_m"),
        ({"neutral_m": 0.0}, "neutral_m", "or limits_m"),
        ({"limits_deg": [-10, 20], "neutral_deg": 20.1}, "neutral_deg", "an angle within the limits [-10, 20]"),
        ({"limits_deg": [-10, 20], "neutral_deg": -10.1}, "neutral_deg", "an angle"),
        ({"limits_m": [0.1, 0.2]}, "neutral_m", "a length within the limits [0.1, 0.2]"),
        ({"stiffness": -0.1}, "stiffness", "a number >= 0"),
        ({"direction": [0, 0, 0]}, "direction", "non-zero length"),
        ({"mimic": {"axis": "lead", "offset_m": 0.1}}, "mimic.offset_m", "own unit"),
        ({"limits_m": [0, 1], "mimic": {"axis": "lead", "offset_deg": 1}}, "mimic.offset_deg", "own unit"),
    ],
)
def test_what_an_axis_cannot_be(given, field, expected):
    refused(AxisEntry, AXIS | given, field, expected)


def test_an_axis_follows_another_in_its_own_unit():
    assert taken(AxisEntry, **AXIS, mimic={"axis": "lead", "offset_deg": 5}).mimic == MimicEntry(
        axis="lead", multiplier=1.0, offset_deg=5.0, offset_m=0.0
    )
    assert taken(AxisEntry, **AXIS, limits_m=[0, 1], mimic={"axis": "lead", "offset_m": 0.1}).mimic.offset_m == 0.1
    assert taken(AxisEntry, **AXIS, stiffness=0).stiffness == 0.0


@pytest.mark.parametrize("limits", [[1, 1], [1, 0], [0, LEAST_RANGE], [0], [0, 1, 2], [0, True], ["0", 1], 3, [0, float("inf")]])
@pytest.mark.parametrize(("field", "unit"), [("limits_deg", "degrees"), ("limits_m", "meters")])
def test_limits_are_two_numbers_in_order(field, unit, limits):
    refused(AxisEntry, AXIS | {field: limits}, field, f"[lower, upper] in {unit}")
    assert taken(AxisEntry, **AXIS, **{field: [0, 2 * LEAST_RANGE]})


def test_a_cone_from_its_length_or_its_ends():
    assert taken(ConeEntry, **CONE, length=0.4).span == (0.0, 0.4)
    assert taken(ConeEntry, **CONE, z1=-0.1, z2=0.3).span == (-0.1, 0.3)


def test_a_cone_s_taper_is_given_or_follows_from_its_end():
    assert taken(ConeEntry, **CONE, length=0.4).taper_per_m == 0.0
    assert taken(ConeEntry, **CONE, length=0.4, taper=-0.5).taper_per_m == -0.5
    half = taken(ConeEntry, **CONE, length=0.4, end_scale=0.5)
    assert 1.0 + half.taper_per_m * 0.4 == pytest.approx(0.5)  # half as thick at its end
    upper = taken(ConeEntry, **CONE, z1=0.1, z2=0.2, end_scale=3.0)
    assert 1.0 + upper.taper_per_m * 0.2 == pytest.approx(3.0)  # relative to z = 0


@pytest.mark.parametrize(
    ("given", "field", "expected"),
    [
        ({}, "length", "either length or z1 and z2"),
        ({"length": 1, "z1": 0, "z2": 1}, "length", "either length"),
        ({"length": 1, "z2": 1}, "length", "either length"),
        ({"z1": 0}, "z2", "z1 and z2"),
        ({"z2": 1}, "z1", "z1 and z2"),
        ({"z1": 1, "z2": 1}, "z2", "z1 < z2"),
        ({"length": 1, "taper": -0.5, "end_scale": 0.5}, "end_scale", "either taper or end_scale"),
        ({"z1": -1, "z2": 0, "end_scale": 0.5}, "end_scale", "taper"),
        ({"length": 1, "taper": -1}, "taper", "without its tip"),
        ({"z1": -1, "z2": 1, "taper": 1}, "taper", "without its tip"),
        ({"length": 0}, "length", "positive"),
    ],
)
def test_what_a_cone_cannot_be(given, field, expected):
    refused(ConeEntry, CONE | given, field, expected)


def test_a_cone_may_be_a_hair_before_its_tip():
    assert taken(ConeEntry, **CONE, length=1.0, taper=-0.999).taper_per_m == -0.999


@pytest.mark.parametrize("radii", [[0.1, 0.2], [0.1, 0.2, 0.3, 0.4], [0.1, 0, 0.3], [1, -1, 1], [1, True, 1], 0.1, ["1", 1, 1]])
def test_radii_are_three_positive_numbers(radii):
    refused(EllipsoidEntry, BALL | {"radii": radii}, "radii", "3 positive numbers")


@pytest.mark.parametrize("color", [[0, 0], [0, 0, 256], [0, 0, -1], [0, 0, 1.0], [0, 0, True], 3, [0, 0, 0, 0]])
def test_a_color_is_three_bytes(color):
    refused(EllipsoidEntry, BALL | {"color_rgb": color}, "color_rgb", "whole numbers of 0..255")
    assert taken(EllipsoidEntry, **BALL, color_rgb=[0, 128, 255]).color_rgb == (0, 128, 255)


def test_values_keep_their_places():
    assert taken(EllipsoidEntry, **BALL).radii == (0.1, 0.2, 0.3)
    assert taken(LoftEntry, **LOFT).domes == (0.05, 0.06)


def test_faces_of_a_box_have_names():
    assert taken(BoxEntry, **BOX, face_colors_rgb={"+x": [1, 2, 3]}, textures={"-z": "a.png"}).textures == {"-z": "a.png"}
    refused(BoxEntry, BOX | {"face_colors_rgb": {"x": [1, 2, 3]}}, "face_colors_rgb", "a face, one of")
    refused(BoxEntry, BOX | {"textures": {"up": "a.png"}}, "textures", "a face, one of")


@pytest.mark.parametrize("domes", [[0.1], [0.1, 0.2, 0.3], [0.1, 0.0], [0.1, True], 0.1])
def test_domes_are_two_positive_numbers(domes):
    refused(LoftEntry, LOFT | {"domes": domes}, "domes", "2 positive numbers")


@pytest.mark.parametrize("spacing", [0.0009, True, "1"])
def test_rings_are_a_millimetre_apart_at_least(spacing):
    refused(LoftEntry, LOFT | {"ring_spacing": spacing}, "ring_spacing", ">= 0.001")
    assert taken(LoftEntry, **LOFT, ring_spacing=0.001).ring_spacing == 0.001


def test_sections_of_a_loft_go_up():
    third = {"z": 0.1, "half_x": 0.1, "half_y": 0.1}
    refused(LoftEntry, LOFT | {"sections": [*SECTIONS, third]}, "sections.2.z", "(z > 0.1)")
    with pytest.raises(FileFormatError):
        taken(LoftEntry, **LOFT | {"sections": SECTIONS[:1]})


def test_a_loft_is_what_its_sections_say():
    sections = [{"z": 0.0, "half_x": 0.1, "half_y": 0.2, "x": 0.3, "y": 0.4}, SECTIONS[1]]
    loft = taken(LoftEntry, **LOFT | {"sections": sections}).loft
    first = loft.sections[0]
    assert (first.z, first.half_x, first.half_y, first.x, first.y) == (0.0, 0.1, 0.2, 0.3, 0.4)
    assert loft.domes == (0.05, 0.06)


def model(**changed):
    joints = {
        "ab": {"parent": "a", "child": "b", "axes": [{"name": "lead", "direction": [1, 0, 0]}]},
        "bc": {"parent": "b", "child": "c", "axes": [AXIS]},
    }
    return {"name": "m", "links": ["a", "b", "c"], "joints": joints} | changed


def joint(parent, child, *axes):
    return {"parent": parent, "child": child, "axes": list(axes)}


def test_a_tree_is_taken():
    assert list(taken(ModelFile, **model()).joints) == ["ab", "bc"]
    assert taken(ModelFile, name="one", links=["a"]).shapes == {}


@pytest.mark.parametrize(
    ("changed", "field", "expected"),
    [
        ({"links": ["a", "b", "c", "a"]}, "links", "each link once"),
        ({"shapes": {"s": BALL | {"link": "x"}}}, "shapes.s.link", "one of ['a', 'b', 'c']"),
        ({"landmarks": {"m": {"link": "x", "xyz": [0, 0, 0]}}}, "landmarks.m.link", "a link, one of"),
        ({"joints": {"ab": joint("x", "b"), "bc": joint("b", "c")}}, "joints.ab.parent", "a link"),
        ({"joints": {"ab": joint("a", "x"), "bc": joint("b", "c")}}, "joints.ab.child", "a link"),
        ({"joints": {"ab": joint("a", "b")}}, "links", "a joint to each other link than 'a'"),
        ({"joints": {"ab": joint("a", "b"), "cb": joint("c", "b")}}, "joints.cb.child", "(joint 'ab' does)"),
    ],
)
def test_what_does_not_fit_together(changed, field, expected):
    refused(ModelFile, model(**changed), field, expected)


def test_a_cycle_is_told_from_parent_to_child():
    cycle = {"ba": joint("b", "a"), "ab": joint("a", "b")}
    with pytest.raises(FileFormatError) as told:
        validate(ModelFile, model(joints=cycle, links=["a", "b"]), "body.yaml")
    assert told.value.got == "the cycle a -> b -> a"
    assert told.value.field == "joints.ba.parent"


def test_names_of_axes_are_their_own():
    lead = {"name": "lead", "direction": [1, 0, 0]}
    twice = {"ab": joint("a", "b", lead), "bc": joint("b", "c", AXIS, lead)}
    refused(ModelFile, model(joints=twice), "joints.bc.axes.1.name", "(joint 'ab' has this one)")
    root = {"ab": joint("a", "b", lead | {"name": "root_x"}), "bc": joint("b", "c")}
    refused(ModelFile, model(joints=root), "joints.ab.axes.0.name", "(the root has this one)")


def test_an_axis_follows_one_that_there_is():
    def following(name):
        return model(joints={
            "ab": joint("a", "b", {"name": "lead", "direction": [1, 0, 0]}),
            "bc": joint("b", "c", AXIS | {"mimic": {"axis": name}}),
        })  # fmt: skip

    assert taken(ModelFile, **following("lead")).joints["bc"].axes[0].mimic.axis == "lead"
    for name in ("bend", "nobody"):
        refused(ModelFile, following(name), "joints.bc.axes.0.mimic.axis", "one of ['lead']")
