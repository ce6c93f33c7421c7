import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.shape_parameters import GROUPS, ShapeSpace, half_extents, tapered
from tracker_node.model.shapes.primitives import Ellipsoid, TruncatedCone


def _changed(space: ShapeSpace, **values: float):
    s = np.zeros(len(space))
    for name, value in values.items():
        s[space.names.index(name.replace("__", " "))] = value
    return space.body(s)


def _landmarks(model):
    return dict(zip(model.landmark_names, Configuration(model, State.neutral(model)).landmarks_world, strict=True))


def test_size_scales_everything():
    model = human_model()
    space = ShapeSpace(model)
    large = _changed(space, size=np.log(1.1))
    for name, place in _landmarks(large).items():
        assert np.allclose(place, 1.1 * _landmarks(model)[name])
    for a, b in zip(model.shapes, large.shapes, strict=True):
        assert np.allclose(half_extents(b.primitive), 1.1 * half_extents(a.primitive))


def test_a_length_moves_what_hangs_on_the_bone_on_both_sides():
    model = human_model()
    longer = _changed(ShapeSpace(model), length__thigh=np.log(1.2))
    before, after = _landmarks(model), _landmarks(longer)
    thigh = before["left_hip"][2] - before["left_knee"][2]
    for side in ("left", "right"):
        for joint in ("knee", "ankle", "heel"):
            assert np.allclose(after[f"{side}_{joint}"] - before[f"{side}_{joint}"], [0.0, 0.0, -0.2 * thigh])
        assert np.allclose(after[f"{side}_wrist"], before[f"{side}_wrist"])
    a, b = (next(s for s in m.shapes if s.name == "left_thigh").primitive for m in (model, longer))
    assert b.z2 - b.z1 == pytest.approx(1.2 * (a.z2 - a.z1))
    assert (b.a, b.b, b.k * b.z1) == pytest.approx((a.a, a.b, a.k * a.z1))  # no thicker, the same taper


def test_sides_are_apart_where_asked_for():
    model = human_model()
    space = ShapeSpace(model, symmetric=False)
    longer = _changed(space, length__left_thigh=0.1)
    assert _landmarks(longer)["left_knee"][2] < _landmarks(model)["left_knee"][2] - 0.02
    assert np.allclose(_landmarks(longer)["right_knee"], _landmarks(model)["right_knee"])
    assert len(space) > len(ShapeSpace(model))


def test_symmetric_bodies_are_mirror_images():
    model, rng = human_model(), np.random.default_rng(3)
    space = ShapeSpace(model)
    body = space.body(rng.normal(size=len(space)) * space.sigmas)
    places = _landmarks(body)
    shapes = {
        shape.name: (shape, T)
        for shape, T in zip(body.shapes, Configuration(body, State.neutral(body)).Ts_world_shape, strict=True)
    }
    for name, place in places.items():
        if name.startswith("left_"):
            assert np.allclose(places[f"right_{name[5:]}"], place * [1.0, -1.0, 1.0])
    for name, (shape, T) in shapes.items():
        if name.startswith("left_"):
            other, T_other = shapes[f"right_{name[5:]}"]
            assert half_extents(other.primitive) == pytest.approx(half_extents(shape.primitive))
            if isinstance(shape.primitive, TruncatedCone):
                assert other.primitive.k == pytest.approx(shape.primitive.k)
            assert np.allclose(T_other[:3, 3], T[:3, 3] * [1.0, -1.0, 1.0])


def test_a_taper_keeps_the_mean_of_the_end_radii():
    cone = TruncatedCone(0.05, 0.04, -0.6, -0.1, 0.3)
    other = tapered(cone, 0.3)
    before = np.array([cone.a * (1 + cone.k * z) for z in (cone.z1, cone.z2)])
    after = np.array([other.a * (1 + other.k * z) for z in (other.z1, other.z2)])
    assert np.log((after[1] / after[0]) / (before[1] / before[0])) == pytest.approx(0.3)
    assert np.prod(after) == pytest.approx(np.prod(before))
    assert other.b / other.a == pytest.approx(cone.b / cone.a)
    assert tapered(Ellipsoid((1.0, 2.0, 3.0)), 0.3) == Ellipsoid((1.0, 2.0, 3.0))


def test_any_body_has_parameters_and_only_the_groups_asked_for():
    space = ShapeSpace(crane(), groups=("length", "girth"))
    assert {p.group for p in space.parameters} == {"length", "girth"}
    assert "length arm" in space.names and "girth counterweight" in space.names
    with pytest.raises(ValueError, match="groups"):
        ShapeSpace(crane(), groups=("weight",))
    assert {p.group for p in ShapeSpace(human_model()).parameters} == set(GROUPS)
