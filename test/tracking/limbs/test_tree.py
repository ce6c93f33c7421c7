"""What belongs to which limb."""

import numpy as np
import pytest

from helpers.bodies.stick_person import person
from helpers.bodies.two_links import two_links
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid
from tracker_node.synthesis.subjects.figure import figure_model
from tracker_node.tracking.limbs.tree import limbs_of, stages_of

HUMAN = human_model()


@pytest.mark.parametrize("model", [person(), human_model(), figure_model(), two_links()], ids=lambda model: model.name)
def test_everything_belongs_to_one_limb_which_its_degrees_of_freedom_move(model):
    limbs = limbs_of(model)
    for masks in ([limb.dofs for limb in limbs], [limb.links for limb in limbs], [limb.shapes for limb in limbs]):
        assert (np.sum(masks, axis=0) == 1).all()
    rng = np.random.default_rng(1)
    state = State(np.eye(4), rng.uniform(-0.3, 0.3, model.chain.n_axes))
    before = Configuration(model, state).Ts_world_shape
    for limb in limbs[1:]:
        after = Configuration(model, state.retract(np.where(limb.dofs, 0.2, 0.0))).Ts_world_shape
        moved = np.abs(after - before).max(axis=(1, 2)) > 1e-6
        assert (moved == limb.shapes).all()


def test_limbs_of_the_human():
    model = human_model()
    limbs = {limb.name: limb for limb in limbs_of(model)}
    assert list(limbs) == ["pelvis", "left_foot", "right_foot", "head", "left_hand", "right_hand"]
    hand = limbs["left_hand"]
    assert [name for name, own in zip(model.chain.links, hand.links, strict=True) if own] == [
        "left_clavicle", "left_upper_arm", "left_forearm", "left_hand",
    ]  # fmt: skip
    wrist = model.landmark_positions[model.landmark_index("left_wrist")]
    assert model.chain.links[hand.end] == "left_forearm" and (hand.tip == wrist).all()
    foot = [name for name, own in zip(model.chain.links, limbs["right_foot"].links, strict=True) if own]
    assert set(foot) == {"right_thigh", "right_shank", "right_foot"}


def test_a_rigid_body_is_all_trunk():
    model = ArticulatedModel("ball", KinematicChain(("ball",), ()), (Shape("ball", "ball", Ellipsoid((0.1, 0.1, 0.1))),))
    (trunk,) = limbs_of(model)
    assert trunk.dofs.all() and trunk.shapes.all()


def test_welded_fingers_do_not_end_an_arm():
    eye = np.eye(4)
    joints = (
        Joint("shoulder", "base", "arm", eye, (Axis("bend", (0.0, 1.0, 0.0)),)),
        Joint("one", "arm", "finger_1", eye),
        Joint("two", "arm", "finger_2", eye),
        Joint("other", "base", "tail", eye, (Axis("wag", (0.0, 0.0, 1.0)),)),
    )
    chain = KinematicChain(("base", "arm", "finger_1", "finger_2", "tail"), joints)
    shapes = tuple(Shape(link, link, Ellipsoid((0.1, 0.1, 0.1))) for link in chain.links)
    names = [[chain.links[i] for i in np.flatnonzero(limb.links)] for limb in limbs_of(ArticulatedModel("x", chain, shapes))]
    assert names == [["base"], ["arm", "finger_1", "finger_2"], ["tail"]]


def test_stages_cover_every_degree_of_freedom_once_and_go_outward():
    stages = stages_of(HUMAN.chain)
    np.testing.assert_array_equal(sum(stage.dofs.astype(int) for stage in stages), 1)
    assert stages[0].variables == [0, 1, 2, 3, 4, 5] and stages[0].links.all()
    order = [next(i for i, stage in enumerate(stages) if name in stage.name.split(", ")) for name in
             ("abdomen", "torso", "left_clavicle", "left_upper_arm", "left_forearm")]  # fmt: skip
    assert order == sorted(set(order))
    assert {name for stage in stages for name in stage.name.split(", ")} >= {"left_thigh", "right_shank", "head"}


@pytest.mark.parametrize("part", [*stages_of(HUMAN.chain), *limbs_of(HUMAN)[1:]], ids=lambda part: part.name)
def test_a_part_moves_its_links_and_no_others(part):
    """By forward kinematics on random motions of its degrees of freedom."""
    rng, n = np.random.default_rng(2), HUMAN.n_dof
    state = State.neutral(HUMAN).retract(rng.normal(0.0, 0.2, n))
    moved = state.retract(np.where(part.dofs, rng.normal(0.0, 0.3, n), 0.0))
    before, after = (Configuration(HUMAN, s).Ts_world_link for s in (state, moved))
    np.testing.assert_array_equal(np.abs(after - before).max(axis=(1, 2)) > 1e-9, part.links)


def gripper(finger_m: float, hangs_on_root: bool) -> ArticulatedModel:
    """An arm of a meter with two fingers; it leaves a base that has a tail too, or is all there is."""
    eye, turn = np.eye(4), (0.0, 1.0, 0.0)
    out = eye.copy()
    out[2, 3] = 1.0
    joints = [
        Joint("shoulder", "base", "arm", eye, (Axis("bend", turn),)),
        Joint("one", "arm", "finger_1", out, (Axis("close_1", turn),)),
        Joint("two", "arm", "finger_2", out, (Axis("close_2", turn),)),
    ]
    if not hangs_on_root:
        joints.append(Joint("other", "base", "tail", eye, (Axis("wag", (0.0, 0.0, 1.0)),)))
    links = ("base", "arm", "finger_1", "finger_2", "tail")[: 2 + len(joints) - 1]
    radii = {"finger_1": finger_m, "finger_2": finger_m}
    shapes = tuple(Shape(link, link, Ellipsoid((radii.get(link, 0.2),) * 3)) for link in links)
    return ArticulatedModel("x", KinematicChain(links, tuple(joints)), shapes)


@pytest.mark.parametrize(
    ("finger_m", "hangs_on_root", "expected"),
    [
        (0.03, True, [["base", "arm", "finger_1", "finger_2"]]),
        (0.03, False, [["base"], ["arm", "finger_1", "finger_2"], ["tail"]]),
        (0.2, True, [["base", "arm"], ["finger_1"], ["finger_2"]]),
        (0.2, False, [["base", "arm"], ["finger_1"], ["finger_2"], ["tail"]]),
    ],
)  # fmt: skip
def test_fingers_too_small_to_be_judged_belong_to_the_arm(finger_m, hangs_on_root, expected):
    model = gripper(finger_m, hangs_on_root)
    limbs = limbs_of(model)
    found = [[model.chain.links[i] for i in np.flatnonzero(limb.links)] for limb in limbs]
    assert found[0] == expected[0] and sorted(found) == sorted(expected)
    for masks in ([limb.dofs for limb in limbs], [limb.shapes for limb in limbs]):
        assert (np.sum(masks, axis=0) == 1).all()
