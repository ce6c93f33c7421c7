"""Robots from their descriptions, of boxes and cylinders and of mesh files, before cameras that another renderer draws."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from helpers.bodies.mesh_robot import folded, of_meshes
from helpers.studio.small_studio import RATE_HZ, Recording
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.constraints.collision import CollisionObjective
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.synthesis.scenes.scene import SceneConfig, Studio, make_rig
from tracker_node.synthesis.subjects.cones import ModelSubject
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.tracker import Tracker

ROBOT = Path(__file__).resolve().parents[3] / "config" / "models" / "robot_arm.urdf"
SCENE = SceneConfig(
    n_cameras=3, width=320, height=240, focal_px=270.0, radius=2.2, target_height=0.7, noise_levels=2.0, surroundings="clutter"
)
SMALL = from_dict({"modalities": ["region"], "region.first_scales": "8 5 3 2 1"})  # images, and a start nearby


@cache
def robot_at_work(n_images: int = 15) -> Recording:
    """It turns, reaches out to the end of its slide's way and back from it, on a base that stays."""
    t = np.arange(n_images) / RATE_HZ
    joints = np.stack([0.4 + 1.2 * t, 0.3 + 0.7 * np.sin(2.0 * t), 0.9 + 0.6 * np.sin(3.0 * t), np.minimum(0.16 + 0.4 * t, 0.25)])
    base = np.eye(4)
    base[:3, 3] = 0.1, -0.05, 0.0
    return filmed(load_model(ROBOT), tuple(State(base, q) for q in joints.T), SCENE)


def filmed(model: ArticulatedModel, states: tuple[State, ...], scene: SceneConfig) -> Recording:
    rig, subject, sets = make_rig(scene), ModelSubject(model), []
    with Studio(rig, scene) as studio:
        backgrounds = {camera.name: studio.empty_image(i, 0) for i, camera in enumerate(rig)}
        for i, state in enumerate(states):
            stamp_ns = 10**9 + round(i * 1e9 / RATE_HZ)
            images = studio.images(subject.mesh(Configuration(model, state)), i)
            shots = (CameraImage(c.name, stamp_ns, image) for c, image in zip(rig, images, strict=True))
            sets.append(ImageSet(stamp_ns, tuple(shots)))
    return Recording(rig, model, states, tuple(sets), backgrounds)


def test_a_robot_is_followed_to_the_end_of_its_slide():
    clip = robot_at_work()
    start = clip.states[0].retract(np.array([0.02, -0.015, 0.01, 0.02, -0.02, 0.03, 0.05, -0.05, 0.06, -0.02]))
    tracker = Tracker(clip.rig, clip.model, SMALL, None, start)
    found = [tracker.step(s) for s in clip.sets]
    assert {e.status for e in found[2:]} == {Status.TRACKING}
    joints = np.array([e.state.joint_positions for e in found])
    assert (joints <= clip.model.chain.upper).all()
    errors = joints[3:] - np.array([s.joint_positions for s in clip.states])[3:]
    assert np.abs(np.rad2deg(errors[:, :3])).max() < 2.0
    assert np.abs(errors[:, 3]).max() < 0.01  # meters
    assert clip.errors_mm(found)[3:].max() < 15.0


@pytest.mark.long
def test_a_robot_is_found_without_a_first_pose():
    clip = robot_at_work()
    tracker = Tracker(clip.rig, clip.model, from_dict({}), clip.backgrounds)
    found = [tracker.step(s) for s in clip.sets[:4]]
    assert found[-1].status is Status.DEGRADED and "turned" in found[-1].status_reason  # its column looks the same all around
    assert clip.errors_mm(found)[-1].max() < 15.0


def folding(model: ArticulatedModel, n_images: int = 10) -> tuple[State, ...]:
    """The arm folds until the hand is 37 mm from the column."""
    return tuple(State(np.eye(4), folded(model, 100.0 + 3.0 * i)) for i in range(n_images))


def test_a_robot_of_mesh_files_is_followed(tmp_path):
    model = of_meshes(tmp_path)
    clip = filmed(model, folding(model), SCENE)
    tracker = Tracker(clip.rig, model, SMALL, None, clip.states[0])
    found = [tracker.step(s) for s in clip.sets]
    assert Status.LOST not in {e.status for e in found}
    assert clip.errors_mm(found)[2:].max() < 15.0


def test_one_camera_does_not_put_a_hand_into_the_column(tmp_path):
    """From a start with the hand within it. Without the collisions it stays there, seen from the front."""
    model = of_meshes(tmp_path)
    clip = filmed(model, folding(model)[-3:], replace(SCENE, n_cameras=1))
    start, collisions = State(np.eye(4), folded(model, 140.0)), CollisionObjective(model)
    depths = []
    for config in (SMALL, replace(SMALL, collision=replace(SMALL.collision, enabled=False))):
        tracker = Tracker(clip.rig, model, config, None, start)
        depths.append([-collisions.gaps(tracker.step(s).state).min() for s in clip.sets][-1])
    assert depths[0] < 0.005
    assert depths[1] > 0.02
