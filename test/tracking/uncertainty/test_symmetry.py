"""Turns that no image tells are found in models, left out of the information, and said of a body that is found again."""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.contour.box import box_states, image_sets, rig_around
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.tracker import Tracker
from tracker_node.tracking.uncertainty.covariance import without_direction
from tracker_node.tracking.uncertainty.modes import symmetry_of, turn_sigma

RED, GREEN = (200, 30, 30), (30, 200, 30)
CYLINDER = TruncatedCone(0.05, 0.05, 0.0, -0.1, 0.1)
RIG = rig_around([(0.0, 30.0), (75.0, 30.0)])


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    return se3.from_rotation_translation(np.eye(3), np.array([x, y, z]))


def rigid(*shapes: Shape, symmetric: bool = False) -> ArticulatedModel:
    return ArticulatedModel("thing", KinematicChain(("thing",), ()), shapes, symmetric=symmetric)


def shape(primitive, T: np.ndarray | None = None, color: tuple[int, int, int] = RED, link: str = "thing") -> Shape:
    return Shape(f"s{id(T)}", link, primitive, np.eye(4) if T is None else T, color)


def mesh_of(box: tuple[float, float, float]) -> Mesh:
    corners = 0.5 * np.array(box) * [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
             [1, 5, 7], [1, 7, 3]]  # fmt: skip
    return Mesh(corners, np.array(faces))


@pytest.mark.parametrize(("shapes", "degrees"), [
    ([shape(Box((0.2, 0.13, 0.08)))], [180]),
    ([shape(mesh_of((0.2, 0.13, 0.08)))], [180]),
    ([shape(Box((0.1, 0.1, 0.2)))], [90, 180]),
    ([shape(Ellipsoid((0.05, 0.08, 0.2)))], [180]),
    ([shape(CYLINDER)], [35, 60, 72, 90, 120, 180]),
    ([shape(Box((0.2, 0.13, 0.08))), shape(Box((0.2, 0.13, 0.08)), at(z=0.08), GREEN)], [180]),  # about z alone
    ([shape(CYLINDER), shape(Box((0.04, 0.01, 0.06)), at(x=0.07, z=0.03))], []),  # a handle
    ([shape(Box((0.2, 0.13, 0.08))), shape(Box((0.05, 0.05, 0.05)), at(0.12, 0.05, 0.03))], []),
])  # fmt: skip
def test_turns_are_those_of_the_shape_and_its_colors(shapes, degrees):
    assert np.degrees(symmetry_of(rigid(*shapes)).turns).round().tolist() == degrees


def test_any_turn_of_a_ball_will_do():
    ball = rigid(shape(Ellipsoid((0.1, 0.1, 0.1)), at(x=0.3)))
    state = State.neutral(ball)
    spins = symmetry_of(ball).spins(Configuration(ball, state))
    assert np.linalg.matrix_rank(np.array(spins)[:, 3:6]) == 3
    for spin in spins:
        middle = Configuration(ball, state.retract(1e-3 * spin)).Ts_world_shape[0, :3, 3]
        assert np.linalg.norm(middle - (0.3, 0.0, 0.0)) < 1e-4
    assert turn_sigma(ball, state, np.eye(6)) < 1e-6


def test_links_that_are_welded_are_one_thing():
    T = se3.from_rotation_translation(so3.exp(np.array([0.0, 0.6, 0.0])), np.array([0.1, 0.0, 0.2]))
    chain = KinematicChain(("base", "head"), (Joint("weld", "base", "head", T),))
    neck = TruncatedCone(0.02, 0.02, 0.0, 0.1, 0.2)
    bottle = ArticulatedModel("m", chain, (shape(CYLINDER, link="head"), shape(neck, link="head")))
    symmetry = symmetry_of(bottle)
    assert symmetry.axis is not None and abs(symmetry.axis[1] @ T[:3, 2]) > 0.999
    across = np.cross(symmetry.axis[0] - T[:3, 3], T[:3, 2])
    assert np.linalg.norm(across) < 2e-3  # of a sample's mean
    handled = ArticulatedModel("m", chain, (*bottle.shapes, shape(Box((0.04, 0.01, 0.06)), at(x=0.07, z=0.03), link="head")))
    assert symmetry_of(handled).turns == ()


def test_colors_of_faces_count_where_they_are_compared():
    faces = np.array([RED, GREEN, RED, RED, RED, RED], dtype=np.float64)
    box = rigid(shape(Box((0.2, 0.13, 0.08), face_colors_rgb=faces)))
    assert symmetry_of(box).turns and len(symmetry_of(box, by_texture=True).turns) == 1  # about x
    patterned = rigid(shape(Box((0.2, 0.13, 0.08), textures=(np.zeros((4, 4, 3), np.uint8), *[None] * 5))))
    assert symmetry_of(patterned).turns and not symmetry_of(patterned, by_texture=True).turns


def test_a_turn_about_an_axis_of_revolution_moves_no_point_of_the_axis():
    T = se3.from_rotation_translation(so3.exp(np.array([0.3, -0.5, 0.2])), np.array([0.05, -0.02, 0.1]))
    model = rigid(shape(CYLINDER, T))
    state = State.neutral(model, se3.from_rotation_translation(so3.exp(np.array([1.0, 0.4, -0.7])), np.array([0.3, 0.2, 1.0])))
    symmetry = symmetry_of(model)
    (spin,) = symmetry.spins(Configuration(model, state))
    before, after = (Configuration(model, s).Ts_world_shape[0] for s in (state, state.retract(1e-3 * spin)))
    for z in (-0.1, 0.0, 0.1):
        np.testing.assert_allclose(se3.apply(after, [0, 0, z]), se3.apply(before, [0, 0, z]), atol=5e-6)
    assert np.linalg.norm(se3.apply(after, [0.05, 0, 0]) - se3.apply(before, [0.05, 0, 0])) == pytest.approx(5e-5, rel=0.05)


def test_the_roll_of_a_limb_that_ends_in_a_body_of_revolution_is_found():
    axes = tuple(Axis(name, direction) for name, direction in (("bend", (1.0, 0, 0)), ("roll", (0, 0, 1.0))))
    chain = KinematicChain(("base", "head"), (Joint("neck", "base", "head", at(z=0.3), axes),))

    def with_head(head: Shape) -> ArticulatedModel:
        return ArticulatedModel("m", chain, (shape(Box((0.2, 0.1, 0.3)), link="base"), head))

    round_head = with_head(shape(TruncatedCone(0.08, 0.08, 0.5, 0.0, 0.2), link="head"))
    assert [round_head.chain.dof_names[dof] for dof in symmetry_of(round_head).dofs] == ["roll"]
    (spin,) = symmetry_of(round_head).spins(Configuration(round_head, State.neutral(round_head)))
    np.testing.assert_array_equal(np.flatnonzero(spin), [7])
    assert symmetry_of(with_head(shape(Box((0.1, 0.1, 0.2)), at(z=0.1), link="head"))).dofs == ()
    assert symmetry_of(with_head(shape(CYLINDER, at(x=0.05), link="head"))).dofs == ()


@pytest.mark.parametrize(("base", "degrees"), [
    (CYLINDER, [35, 60, 72, 90, 120, 180]), (Box((0.2, 0.2, 0.3)), [90, 180]), (Box((0.2, 0.1, 0.3)), [180]),
])  # fmt: skip
def test_a_robot_may_stand_turned_on_a_base_that_looks_the_same(base, degrees):
    turn, lift = Axis("turn", (0, 0, 1.0)), Axis("lift", (0, 1.0, 0))
    T = se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, 0.4])), np.array([0.0, 0.0, 0.2]))
    chain = KinematicChain(("base", "arm"), (Joint("shoulder", "base", "arm", T, (turn, lift)),))
    shapes = [shape(Box((0.4, 0.05, 0.05)), at(x=0.2), link="arm")]
    model = ArticulatedModel("robot", chain, (*shapes, shape(base, link="base")))
    symmetry = symmetry_of(model)
    assert np.degrees(symmetry.turns).round().tolist() == degrees
    assert (symmetry.base == 6) == (base is CYLINDER)
    for spin in symmetry.spins(Configuration(model, State.neutral(model))):
        before, after = (Configuration(model, State.neutral(model).retract(k * spin)) for k in (0.0, 1e-3))
        np.testing.assert_allclose(after.Ts_world_link[1], before.Ts_world_link[1], atol=2e-6)
        assert so3.log(after.Ts_world_link[0][:3, :3]) == pytest.approx([0.0, 0.0, -1e-3], abs=1e-6)
    hip = Joint("hip", "base", "leg", at(z=-0.2), (replace(lift, name="hip"),))
    two = KinematicChain(("base", "arm", "leg"), (*chain.joints, hip))
    legged = ArticulatedModel("robot", two, (*model.shapes, *(replace(each, link="leg") for each in shapes)))
    assert symmetry_of(legged).turns == ()


def test_information_without_a_direction_knows_nothing_of_it_and_all_of_the_others_that_is_independent():
    rng = np.random.default_rng(3)
    J, direction = rng.normal(size=(20, 6)), rng.normal(size=6)
    H = J.T @ J
    left = without_direction(H, direction)
    np.testing.assert_allclose(left @ direction, 0.0, atol=1e-9)
    # What is known of the rest is as if a parameter along the direction were unknown
    free = np.column_stack([np.linalg.qr(np.column_stack([direction, rng.normal(size=(6, 5))]))[0][:, 1:], direction])
    whole = np.linalg.inv(free.T @ H @ free)[:5, :5]
    np.testing.assert_allclose(np.linalg.inv((free.T @ left @ free)[:5, :5]), whole, rtol=1e-8)


def test_what_is_not_told_of_a_bottle_is_said_not_to_be():
    bottle = rigid(shape(CYLINDER), shape(TruncatedCone(0.02, 0.02, 0.0, 0.1, 0.15), None))
    states = box_states(bottle, 8, 4)
    tracker = Tracker(RIG, bottle, from_dict({}), None, states[0])
    for one in image_sets(RIG, bottle, states):
        estimate = tracker.step(one)
    (spin,) = symmetry_of(bottle).spins(Configuration(bottle, estimate.state))
    sigma = np.sqrt(spin @ estimate.covariance @ spin) / (spin @ spin)
    off = estimate.state.difference(states[-1])
    assert estimate.status is Status.TRACKING and np.linalg.norm(off[:3]) < 2e-3
    assert np.degrees(sigma) > 60.0 and np.sqrt(np.linalg.eigvalsh(estimate.covariance)[:5]).max() < 0.02


def hidden(one: ImageSet) -> ImageSet:
    return ImageSet(one.stamp_ns, tuple(CameraImage(i.camera, i.stamp_ns, np.full_like(i.pixels, 90)) for i in one.images))


@pytest.mark.parametrize("symmetric", [False, True])
def test_a_box_that_is_found_again_may_have_been_turned_unless_that_does_not_matter(symmetric):
    box = rigid(shape(Box((0.2, 0.13, 0.08))), symmetric=symmetric)
    states = [box_states(box, 1, 4)[0]] * 30
    tracker, told = Tracker(RIG, box, from_dict({}), None, states[0]), []
    for k, one in enumerate(image_sets(RIG, box, states)):
        told.append(tracker.step(hidden(one) if 5 <= k < 25 else one))
    assert [e.status for e in told[:5]] == [Status.TRACKING] * 5 and all(e.status is Status.LOST for e in told[7:25])
    last = told[-1]
    assert np.linalg.norm(last.state.difference(states[-1])[:3]) < 2e-3
    if symmetric:
        assert last.status is Status.TRACKING
    else:
        reason = "where it was found it may as well be turned by 180 degrees"
        assert (last.status, last.status_reason) == (Status.DEGRADED, reason)
        tracker.set_state(states[-1])  # somebody knows
        assert tracker.step(one).status is Status.TRACKING


def test_a_camera_without_images_is_no_doubt_of_how_a_box_is_turned():
    rig, box = rig_around([(0.0, 30.0), (75.0, 30.0), (150.0, 30.0)]), rigid(shape(Box((0.2, 0.13, 0.08))))
    states = box_states(box, 6, 4)
    tracker = Tracker(rig, box, from_dict({}), None, states[0])
    for k, one in enumerate(image_sets(rig, box, states)):
        estimate = tracker.step(ImageSet(one.stamp_ns, one.images[: 2 if k in (2, 3, 4) else 3]))
        assert estimate.status is (Status.DEGRADED if k in (2, 3, 4) else Status.TRACKING)
        assert tracker._track.doubt == 0.0


def test_the_spin_of_a_bottle_is_no_doubt_of_how_it_is_turned():
    bottle = rigid(shape(CYLINDER), shape(TruncatedCone(0.02, 0.02, 0.0, 0.1, 0.15), None))
    states = box_states(bottle, 8, 4)
    tracker = Tracker(RIG, bottle, from_dict({}), None, states[0])
    for k, one in enumerate(image_sets(RIG, bottle, states)):
        estimate = tracker.step(ImageSet(one.stamp_ns, one.images[: 1 if k == 4 else 2]))
    assert estimate.status is Status.TRACKING
