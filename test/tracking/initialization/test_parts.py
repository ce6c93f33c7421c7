"""Limbs of a start looked for elsewhere: a person is drawn, one arm of the start is wrong, colors have to tell where it is."""

import numpy as np
import pytest

from helpers.cameras.start_scenes import scene, standing
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.parallel import Workers
from tracker_node.tracking.assessment import Assessment
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import LimbReport, LimbStatus, Status
from tracker_node.tracking.initialization.detector import PoseDetector
from tracker_node.tracking.initialization.initializer import LimbRepair, Trial
from tracker_node.tracking.limbs.tree import limbs_of

SCENE = scene()
POSED = standing(SCENE.model, 0.1, -0.1, 0.7, left_shoulder_elevation_front=85, right_shoulder_elevation_front=-20)
ARM = next(limb for limb in limbs_of(SCENE.model) if limb.name == "left_hand")
CONFIG = from_dict({"initialization.size_px": 80})


def finder(images: list[np.ndarray], backgrounds: dict) -> PoseDetector:
    config = CONFIG.initialization
    look = PoseDetector(SCENE.rig, SCENE.model, config, backgrounds, Workers(1))
    look.watch(SCENE.images(None, 1))
    look.watch(images)
    return look


def with_arm_down(model: ArticulatedModel, state: State) -> State:
    joints = state.joint_positions.copy()
    joints[model.chain.axis_index("left_shoulder_elevation_front")] = np.radians(-30)
    return State(state.T_world_root, joints)


def tip(state: State) -> np.ndarray:
    T = Configuration(SCENE.model, state).Ts_world_link[ARM.end]
    return T[:3, :3] @ ARM.tip + T[:3, 3]


def repainted(images: list[np.ndarray]) -> list[np.ndarray]:
    """Other colors than those that the model states: red and blue exchanged, and both sides of the body made alike."""
    other = {
        tuple(SCENE.model.shapes[i].color_rgb): tuple(reversed(SCENE.model.shapes[j].color_rgb))
        for i, shape in enumerate(SCENE.model.shapes)
        for j, partner in enumerate(SCENE.model.shapes)
        if partner.name == shape.name.replace("left_", "right_")
    }
    result = []
    for image in images:
        painted = image.copy()
        for stated, seen in other.items():
            near = np.abs(image.astype(np.int64) - stated[::-1]).max(axis=2) < 12
            painted[near] = seen[::-1]
        result.append(painted)
    return result


@pytest.mark.parametrize("paint", [list, repainted], ids=["as stated", "as nobody has stated"])
def test_an_arm_is_proposed_where_it_is(paint):
    look = finder(paint(SCENE.images(POSED)), {})
    wrong = with_arm_down(SCENE.model, POSED)
    assert np.linalg.norm(tip(wrong) - tip(POSED)) > 0.5
    others = look.alternatives.find(wrong, ARM, np.zeros(len(SCENE.model.shapes), dtype=np.bool_), 4)
    off = [float(np.linalg.norm(tip(other) - tip(POSED))) for other in others]
    assert min(off) < 0.12
    own = np.flatnonzero(~ARM.dofs[6:])
    for other in others:
        np.testing.assert_array_equal(other.joint_positions[own], wrong.joint_positions[own])
        np.testing.assert_array_equal(other.T_world_root, wrong.T_world_root)


def test_proposals_are_apart_and_the_same_again():
    look = finder(SCENE.images(POSED), SCENE.backgrounds)
    wrong = with_arm_down(SCENE.model, POSED)
    nobody = np.zeros(len(SCENE.model.shapes), dtype=np.bool_)
    others = look.alternatives.find(wrong, ARM, nobody, 4)
    tips = [tip(wrong)] + [tip(other) for other in others[1:]]
    length = np.linalg.norm(tip(wrong) - Configuration(SCENE.model, wrong).Ts_world_link[np.flatnonzero(ARM.links)[0], :3, 3])
    gaps = [np.linalg.norm(a - b) for i, a in enumerate(tips) for b in tips[:i]]
    assert min(gaps) > 0.15 * length
    again = look.alternatives.find(wrong, ARM, nobody, 4)
    assert len(again) == len(others)
    for a, b in zip(others, again, strict=True):
        np.testing.assert_array_equal(a.joint_positions, b.joint_positions)


@pytest.fixture(scope="module")
def alternatives():
    return finder(SCENE.images(POSED), SCENE.backgrounds).alternatives


def test_colors_that_the_images_bear_out_are_half_believed(alternatives):
    stated = alternatives._stated
    told = stated.any(axis=1)
    counts = 1000.0 * stated
    found = alternatives._densities(counts.copy())
    whole = counts.sum(axis=0) / counts.sum()
    for shape in np.flatnonzero(told):
        own = (counts[shape] + 30.0 * whole) / (counts[shape].sum() + 30.0)
        np.testing.assert_allclose(found[shape], 0.5 * (own + stated[shape]), atol=1e-12)


def test_where_they_are_not_left_and_right_look_alike(alternatives):
    """All pixels of each shape in a color of its own that nobody states; shapes without pixels look like the whole body."""
    n, bins = alternatives._stated.shape
    free = np.flatnonzero(~(alternatives._stated > 1.0 / bins).any(axis=0))
    counts = np.zeros((n, bins))
    counts[np.arange(n), free[:n]] = 100.0
    names = [shape.name for shape in SCENE.model.shapes]
    empty = next(i for i, name in enumerate(names) if not name.startswith(("left_", "right_")))
    counts[empty] = 0.0
    found = alternatives._densities(counts.copy())
    np.testing.assert_allclose(found.sum(axis=1), 1.0)
    left = next(i for i, name in enumerate(names) if name.startswith("left_"))
    right = names.index(names[left].replace("left_", "right_"))
    np.testing.assert_array_equal(found[left], found[right])
    of_body = 1.0 / (n - 1)  # a color's share of the whole body
    assert found[left, free[left]] == pytest.approx((50.0 + 30.0 * of_body) / 130.0)
    assert found[empty, free[left]] == pytest.approx(of_body)


def test_the_length_of_a_limb_is_from_its_first_link_to_its_tip(alternatives):
    first = Configuration(SCENE.model, POSED).Ts_world_link[np.flatnonzero(ARM.links)[0], :3, 3]
    assert alternatives._length(POSED, ARM) == pytest.approx(np.linalg.norm(tip(POSED) - first))


def test_the_doubtful_limb_is_mended_and_no_other_is_touched():
    def judged(state: State) -> Trial:
        """As an engine would that knows the truth: the surer, the nearer the arm."""
        off = float(np.linalg.norm(tip(state) - tip(POSED)))
        tried.append(state)
        names = [limb.name for limb in limbs_of(SCENE.model)]
        limbs = tuple(LimbReport(name, LimbStatus.TRACKING, "", min(off, 0.9) if name == ARM.name else 0.01) for name in names)
        return Trial(state, Assessment(Status.DEGRADED, "", limbs=limbs, log_ratio=1000.0 - 100.0 * off))

    tried: list[State] = []
    wrong = with_arm_down(SCENE.model, POSED)
    mended = LimbRepair(SCENE.model, finder(SCENE.images(POSED), {}).alternatives)(judged(wrong), judged)
    assert np.linalg.norm(tip(mended.state) - tip(POSED)) < 0.12
    own = np.flatnonzero(~ARM.dofs[6:])
    for state in tried:
        np.testing.assert_array_equal(state.joint_positions[own], wrong.joint_positions[own])
