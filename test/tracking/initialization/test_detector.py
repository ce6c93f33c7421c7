"""Starts found in images alone: true poses are known, pictures are drawn at full size with distortion and noise."""

from itertools import pairwise

import numpy as np
import pytest

from helpers.cameras.start_scenes import largest_error_m, scene, standing
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid
from tracker_node.parallel import Workers
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.initialization.detector import PoseDetector, body_size
from tracker_node.tracking.limbs.tree import joint_groups
from tracker_node.tracking.poses import library_poses, other_side
from tracker_node.tracking.tracker import Tracker

SMALL = {
    "initialization.size_px": 56,
    "initialization.hypotheses": 24,
    "initialization.candidates": 2,
    "initialization.watch_sets": 6,
    "modalities": ["chamfer"],
}
CONFIG = from_dict(SMALL)
SCENE = scene()
WALKING = standing(
    SCENE.model, 0.25, -0.2, 2.2, left_hip_flexion=35, right_hip_flexion=-12, right_knee_flexion=30, left_knee_flexion=10,
    right_shoulder_elevation_front=55, left_elbow_flexion=40,
)  # fmt: skip


def finder(backgrounds=SCENE.backgrounds, rig=SCENE.rig, model=SCENE.model) -> PoseDetector:
    return PoseDetector(rig, model, CONFIG.initialization, backgrounds, Workers(1))


def test_a_person_is_found_with_plates_twice_the_same():
    images = SCENE.images(WALKING)
    starts = finder().find(images)
    assert largest_error_m(SCENE.model, starts[0].state, WALKING) < 0.2
    assert starts[0].score > 0.7
    assert all(a.score >= b.score for a, b in pairwise(starts))
    again = finder().find(images)
    np.testing.assert_array_equal(again[0].state.joint_positions, starts[0].state.joint_positions)


def test_a_tracker_without_an_initial_state_finds_the_person_and_follows():
    tracker = Tracker(SCENE.rig, SCENE.model, CONFIG, SCENE.backgrounds)
    nobody = tracker.step(SCENE.image_set(0, SCENE.images(None)))
    assert nobody.status is Status.INITIALIZING and "nothing of the size of a body differs from" in nobody.status_reason
    tracker.reset()
    for number in range(3):
        estimate = tracker.step(SCENE.image_set(number, SCENE.images(WALKING, number)))
    assert estimate.status in (Status.TRACKING, Status.DEGRADED)
    assert largest_error_m(SCENE.model, estimate.state, WALKING) < 0.1


def test_a_body_lost_for_long_is_looked_for_everywhere():
    config = from_dict(SMALL | {"initialization.after_lost_sets": 2})
    tracker = Tracker(SCENE.rig, SCENE.model, config, SCENE.backgrounds, WALKING)
    elsewhere = standing(SCENE.model, -0.8, 0.6, 0.4, left_hip_flexion=30, right_shoulder_elevation_front=80)
    there = [WALKING] * 2 + [elsewhere] * 5
    estimates = [tracker.step(SCENE.image_set(n, SCENE.images(state, n))) for n, state in enumerate(there)]
    assert estimates[2].status is Status.LOST
    assert largest_error_m(SCENE.model, estimates[3].state, elsewhere) > 0.8
    assert estimates[-1].status is not Status.LOST
    assert largest_error_m(SCENE.model, estimates[-1].state, elsewhere) < 0.15


def test_without_plates_it_watches_first_then_finds_what_moves():
    look = finder({})
    for number in range(CONFIG.initialization.watch_sets):
        state = WALKING.retract(np.concatenate([[0.03 * number, 0.02 * number, 0.0], np.zeros(SCENE.model.n_dof - 3)]))
        starts = look.find(SCENE.images(state, number))
        assert bool(starts) == (number == CONFIG.initialization.watch_sets - 1)
        assert starts or look.problem == f"watching what moves ({number + 1} of {CONFIG.initialization.watch_sets} image sets)"
    middle = Configuration(SCENE.model, state).Ts_world_shape[:, :3, 3].mean(axis=0)
    found = Configuration(SCENE.model, starts[0].state).Ts_world_shape[:, :3, 3].mean(axis=0)
    assert np.linalg.norm(found - middle) < 0.2  # the middle of the body, within the reach of an engine


def test_a_still_scene_without_plates_is_no_person():
    look = finder({})
    for number in range(CONFIG.initialization.watch_sets):
        assert look.find(SCENE.images(WALKING, number)) == []
    assert "nothing of the size of a body moves" in look.problem


def test_too_few_images_are_told():
    images = [SCENE.images(WALKING)[0], None, None, None]
    look = finder()
    assert look.find(images) == []
    assert look.problem == "1 of 4 cameras have an image, 2 are needed to find a start"


def test_one_camera_finds_the_person_where_it_looks():
    alone = scene(1)
    starts = finder(alone.backgrounds, alone.rig).find(alone.images(WALKING))
    camera = alone.rig.cameras[0]
    true, _ = camera.project(Configuration(SCENE.model, WALKING).landmarks_world)
    found, _ = camera.project(Configuration(SCENE.model, starts[0].state).landmarks_world)
    assert np.abs(found.mean(axis=0) - true.mean(axis=0)).max() < 8.0  # pixels, of a body of 110


def test_an_initial_state_is_waited_for_where_the_search_is_off():
    tracker = Tracker(SCENE.rig, SCENE.model, from_dict({"initialization": {"enabled": False}}), SCENE.backgrounds)
    estimate = tracker.step(SCENE.image_set(0, SCENE.images(WALKING)))
    assert (estimate.status, estimate.status_reason) == (Status.INITIALIZING, "no initial state has been given")


def test_limbs_are_the_unbranched_stretches():
    axes = [axis.name for axis in SCENE.model.chain.axes]
    groups = [{axes[i] for i in limb} for limb in joint_groups(SCENE.model.chain)]
    assert {len(group) for group in groups} == {6, 2, 8, 5} and len(groups) == 6
    assert {name for group in groups for name in group} == set(axes)
    assert any({"left_knee_flexion", "left_hip_flexion"} <= group and "right_knee_flexion" not in group for group in groups)


def test_other_sides_change_places():
    assert other_side(["left_knee", "bend", "right_knee", "left_toe"]).tolist() == [2, 1, 0, 3]


def test_postures_keep_the_limits_and_begin_with_neutral():
    chain = SCENE.model.chain
    rows = library_poses(SCENE.model, 8, 0)
    assert np.all(rows >= chain.lower) and np.all(rows <= chain.upper)
    np.testing.assert_array_equal(rows[0], [axis.neutral for axis in chain.axes])
    raised = rows[:, chain.axis_index("left_shoulder_elevation_front")] > np.radians(150)
    other = rows[:, chain.axis_index("right_shoulder_elevation_front")] > np.radians(150)
    assert (raised & ~other).any() and (other & ~raised).any() and (raised & other).any()


def test_a_body_without_joints_has_one_posture():
    box = ArticulatedModel("box", KinematicChain(("box",), ()), (Shape("box", "box", Box((0.2, 0.12, 0.08))),))
    assert library_poses(box, 8, 0).shape == (1, 0)
    assert joint_groups(box.chain) == []


@pytest.mark.parametrize("radii", [(0.1, 0.2, 0.5), (0.5, 0.2, 0.1)])
def test_the_size_of_a_body_is_its_longest_side(radii):
    ball = ArticulatedModel("ball", KinematicChain(("ball",), ()), (Shape("ball", "ball", Ellipsoid(radii)),))
    assert body_size(ball) == pytest.approx(1.0)


def test_a_person_whom_some_cameras_see_in_part_is_found():
    aside = standing(SCENE.model, 1.4, 0.9, -0.6, left_shoulder_elevation_front=80, right_hip_flexion=30)
    covered = [
        np.mean(SCENE.rig.cameras[i].model.in_image(camera.project(Configuration(SCENE.model, aside).landmarks_world)[0]))
        for i, camera in enumerate(SCENE.rig)
    ]
    assert sorted(covered)[:2] < [0.6, 0.8]
    starts = finder().find(SCENE.images(aside))
    assert starts and largest_error_m(SCENE.model, starts[0].state, aside) < 0.25
