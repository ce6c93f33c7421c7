"""What a tracker lives through: starts beyond the limits, things that look the same from all around, holes, and an empty room."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from helpers.studio.small_studio import RATE_HZ, Recording, recording
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.run_review import unobservable_text
from tracker_node.geometry import se3, so3
from tracker_node.loaders.model.state_yaml import dump_state, load_state
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Mesh, TruncatedCone
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.runs.offline import _Record
from tracker_node.synthesis.scenes.scene import SceneConfig, Studio, make_rig
from tracker_node.synthesis.subjects.cones import ModelSubject
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

ONE_CAMERA = SceneConfig(
    n_cameras=1, width=320, height=240, focal_px=290.0, radius=1.5, target_height=0.3, noise_levels=2.0, surroundings="clutter"
)
REGION = from_dict({"modalities": ["region"], "region.first_scales": "8 5 3 2 1"})  # for small images


@cache
def turning(kind: str, n_images: int = 10) -> Recording:
    """A bottle, or a tent without a floor, that turns and moves aside before one camera."""
    corners = np.array([[-0.2, -0.2, -0.15], [0.25, -0.1, -0.15], [0.0, 0.25, -0.15], [0.02, 0.0, 0.3]])
    tent, bottle = Mesh(corners, [[0, 1, 3], [1, 2, 3], [2, 0, 3]]), TruncatedCone(0.1, 0.1, -0.8, -0.2, 0.2)
    shape = Shape(kind, kind, bottle if kind == "bottle" else tent, np.eye(4), (200, 40, 30))
    marks = (Landmark("middle", kind, (0.0, 0.0, 0.0)), Landmark("top", kind, (0.0, 0.0, 0.2)))
    model, rig = ArticulatedModel(kind, KinematicChain((kind,), ()), (shape,), marks), make_rig(ONE_CAMERA)
    poses = [(so3.exp([0.3, 0.2, 0.1 + 0.05 * i]), np.array([0.01 * i, 0.0, 0.35])) for i in range(n_images)]
    states = tuple(State(se3.from_rotation_translation(*pose), np.zeros(0)) for pose in poses)
    subject, sets = ModelSubject(model), []
    with Studio(rig, ONE_CAMERA) as studio:
        for i, state in enumerate(states):
            stamp_ns = 10**9 + round(i * 1e9 / RATE_HZ)
            images = studio.images(subject.mesh(Configuration(model, state)), i)
            shots = (CameraImage(c.name, stamp_ns, image) for c, image in zip(rig, images, strict=True))
            sets.append(ImageSet(stamp_ns, tuple(shots)))
    return Recording(rig, model, states, tuple(sets), {})


def tracked(clip: Recording) -> list[TrackEstimate]:
    tracker = Tracker(clip.rig, clip.model, REGION, None, clip.states[0])
    return [tracker.step(s) for s in clip.sets]


def test_what_one_camera_cannot_see_shows_in_the_covariance():
    """The turn of a bottle about its own axis, and how far away it is."""
    clip = turning("bottle")
    last = tracked(clip)[-1]
    T, C = last.state.T_world_root, last.covariance
    spread, axes = np.linalg.eigh(C[3:6, 3:6])
    assert abs(axes[:, 2] @ T[:3, 2]) > 0.9
    assert np.sqrt(spread[2]) > 3.0 * np.sqrt(spread[1])
    told = np.linalg.eigh(last.information[3:6, 3:6])[1][:, 0]  # of the images alone: nothing of that turn
    assert abs(told @ T[:3, 2]) > 0.999
    sight = T[:3, 3] - clip.rig.cameras[0].center
    sight /= np.linalg.norm(sight)
    deviations, directions = np.linalg.eigh(C[:3, :3])
    assert abs(directions[:, 2] @ sight) > 0.96
    assert deviations[2] > 4.0 * deviations[1]
    axis, truth = T[:3, 2], clip.states[-1].T_world_root[:3, 2]
    assert np.rad2deg(np.arccos(min(1.0, axis @ truth))) < 4.0
    assert clip.errors_mm([last])[0].shape == (2,)


def test_what_one_camera_cannot_see_is_named_by_an_offline_run_and_its_report():
    clip = turning("bottle")
    record = _Record(clip.model)
    for estimate in tracked(clip):
        record.add(estimate)
    assert record.unobservable_sets == {"root rotation about some axis": len(clip.sets)}
    found = {"what": "root rotation about some axis", "sets": len(clip.sets)}
    (said,) = unobservable_text({"unobservable": [found]})
    assert found["what"] in said and unobservable_text({"unobservable": []}) == []


def test_a_mesh_with_a_hole_is_tracked():
    clip = turning("tent")
    found = tracked(clip)
    assert {e.status for e in found} == {Status.TRACKING}
    assert clip.errors_mm(found).max() < 15.0


def test_a_start_beyond_the_limits_is_put_at_them():
    """Both knees overstretched by 17 degrees more than they can be."""
    clip = recording()
    chain, angles = clip.model.chain, clip.states[0].joint_positions.copy()
    beyond = [chain.axis_index(name) for name in ("left_knee_flexion", "right_knee_flexion")]
    angles[beyond] = chain.lower[beyond] - 0.3
    tracker = Tracker(clip.rig, clip.model, REGION, clip.backgrounds, State(clip.states[0].T_world_root, angles))
    found = [tracker.step(s) for s in clip.sets]
    assert all((e.state.joint_positions >= chain.lower).all() for e in found)
    assert np.median(clip.errors_mm(found)[-1]) < 15.0


def test_a_file_with_a_pose_beyond_the_limits_says_which(tmp_path):
    clip = recording()
    angles = clip.states[0].joint_positions.copy()
    angles[clip.model.chain.axis_index("left_elbow_flexion")] = -0.5
    dump_state(State(np.eye(4), angles), clip.model, tmp_path / "start.yaml")
    expected = r"start\.yaml: field 'joints_deg\.left_elbow_flexion': expected an angle in \[-5, 155\] degrees, got -28\.6"
    with pytest.raises(FileFormatError, match=expected):
        load_state(tmp_path / "start.yaml", clip.model)


def test_a_body_that_vanishes_is_lost_and_comes_back():
    """As if a curtain were drawn before every camera, and opened again."""
    clip = recording()

    def at(image_set: ImageSet, i: int, empty: bool) -> ImageSet:
        stamp_ns = 10**9 + round(i * 1e9 / RATE_HZ)
        pixels = [clip.backgrounds[m.camera] if empty else m.pixels for m in image_set.images]
        shots = (replace(m, stamp_ns=stamp_ns, pixels=p) for m, p in zip(image_set.images, pixels, strict=True))
        return ImageSet(stamp_ns, tuple(shots))

    sets = [at(clip.sets[min(i, 2)], i, 3 <= i < 8) for i in range(16)]
    tracker = Tracker(clip.rig, clip.model, REGION, clip.backgrounds, clip.states[0])
    found = [tracker.step(s) for s in sets]
    assert found[2].status is Status.TRACKING
    assert {e.status for e in found[5:8]} == {Status.LOST}
    assert found[-1].status is not Status.LOST
    truth = Configuration(clip.model, clip.states[2]).landmarks_world
    errors = np.linalg.norm(Configuration(clip.model, found[-1].state).landmarks_world - truth, axis=1)
    assert np.median(errors) < 0.015
