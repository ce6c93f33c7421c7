"""What the tracker says when the body, or one limb, cannot be seen or is not where it was told; pictures by another renderer."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import seen_by
from helpers.studio.small_studio import Recording, recording
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import N_ROOT_DOF
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import LimbStatus, Status
from tracker_node.tracking.limbs.tree import limbs_of
from tracker_node.tracking.tracker import Tracker

# The images are small: the first lines need not be as long as in large ones
CONFIG = from_dict({"modalities": ["region"], "initialization.enabled": False, "region.first_scales": "5 4 3 2 2 1 1"})


@pytest.fixture(scope="module")
def clip() -> Recording:
    return recording()


def tracker_of(clip: Recording) -> Tracker:
    return Tracker(clip.rig, clip.model, CONFIG, None, clip.states[0])


def boarded_up(image_set, seed: int):
    """Every camera sees nothing but a board with random patches."""
    rng = np.random.default_rng(seed)

    def board(pixels):
        height, width = pixels.shape[:2]
        patches = rng.integers(0, 255, (-(-height // 16), -(-width // 16), 3), dtype=np.uint8)
        return np.ascontiguousarray(np.kron(patches, np.ones((16, 16, 1), np.uint8))[:height, :width])

    return replace(image_set, images=tuple(replace(image, pixels=board(image.pixels)) for image in image_set.images))


@pytest.mark.long
def test_everything_occluded_is_lost_and_comes_back(clip):
    tracker, still = tracker_of(clip), clip.sets[0]
    before = [tracker.step(replace_stamp(still, i)) for i in range(4)]
    assert {e.status for e in before[1:]} == {Status.TRACKING}
    hidden = [tracker.step(replace_stamp(boarded_up(still, i), 4 + i)) for i in range(5)]
    assert [e.status for e in hidden[2:]] == [Status.LOST] * 3  # within three image sets
    assert all(np.isfinite(e.state.to_values()).all() and np.isfinite(e.covariance).all() for e in hidden)
    spread = [np.sqrt(np.linalg.eigvalsh(e.covariance)[-1]) for e in (before[-1], hidden[-1])]
    assert spread[1] > 2.0 * spread[0]
    after = [tracker.step(replace_stamp(still, 9 + i)) for i in range(4)]
    assert after[-1].status is Status.TRACKING
    assert errors_mm(clip, after[-1]).max() < 45.0


def errors_mm(clip: Recording, estimate) -> np.ndarray:
    """Of the landmarks, against the first image set."""
    return clip.errors_mm([estimate])[0]


def replace_stamp(image_set, number: int):
    """The same images, so many image periods later."""
    stamp = image_set.stamp_ns + number * 33_333_333
    return replace(image_set, stamp_ns=stamp, images=tuple(replace(image, stamp_ns=stamp) for image in image_set.images))


def test_an_arm_that_is_put_elsewhere_is_named_and_found_again(clip):
    tracker = tracker_of(clip)
    first = [tracker.step(replace_stamp(clip.sets[0], i)) for i in range(3)][-1]
    assert all(limb.status is LimbStatus.TRACKING for limb in first.limbs)
    arm = next(limb for limb in limbs_of(clip.model) if limb.name == "left_hand")
    angles = first.state.joint_positions.copy()
    own = arm.dofs[N_ROOT_DOF:]
    raised = np.clip(angles + 1.6, clip.model.chain.lower, clip.model.chain.upper)
    tracker.set_state(State(first.state.T_world_root, np.where(own, raised, angles)))
    told = [tracker.step(replace_stamp(clip.sets[0], 3 + i)) for i in range(8)]
    statuses = [{limb.name: limb.status for limb in e.limbs} for e in told]
    lost = [by_name["left_hand"] is not LimbStatus.TRACKING for by_name in statuses]
    errors = np.array([errors_mm(clip, e) for e in told])
    wrist = clip.model.landmark_index("left_wrist")
    assert all(flag for flag, error in zip(lost[2:], errors[2:, wrist], strict=True) if error > 150.0)
    assert errors[-1].max() < 60.0 and told[-1].status is Status.TRACKING
    for e, flag in zip(told, lost, strict=True):
        assert not (flag and e.status is Status.TRACKING)


@pytest.mark.parametrize("n_cameras", [1, 2])
def test_one_camera_says_that_clothes_leave_the_depth_of_a_person_open(clip, n_cameras):
    rig = replace(clip.rig, cameras=clip.rig.cameras[:n_cameras])
    first = replace(clip.sets[0], images=clip.sets[0].images[:n_cameras])
    estimate = Tracker(rig, clip.model, CONFIG, clip.backgrounds, clip.states[0]).step(first)
    sight = estimate.state.T_world_root[:3, 3] - rig.cameras[0].center
    distance = float(np.linalg.norm(sight))
    along_m = float(np.sqrt(sight @ estimate.covariance[:3, :3] @ sight)) / distance
    alone = n_cameras == 1
    assert (along_m > 0.2 * distance) == alone and (along_m < 0.05) == (not alone)
    assert any("its depth is known to" in limb.reason for limb in estimate.limbs) == alone
    assert any(limb.status is LimbStatus.TRACKING for limb in estimate.limbs) != alone


def test_a_depth_that_several_cameras_have_told_is_known_for_some_sets(clip):
    one = [replace(image_set, images=image_set.images[:1]) for image_set in clip.sets[1:3]]
    tracker = Tracker(clip.rig, clip.model, CONFIG, clip.backgrounds, clip.states[0])
    said = [tracker.step(image_set) for image_set in [clip.sets[0], *one]]
    assert not any("depth" in limb.reason for estimate in said for limb in estimate.limbs)


def test_a_body_where_no_detector_sees_anybody_of_those_that_it_sees_is_lost_after_fifteen_sets():
    clip, config = recording(16), from_dict({"modalities": ["region", "keypoints"], "initialization.enabled": False})
    beside = State(clip.states[0].T_world_root.copy(), clip.states[0].joint_positions)
    beside.T_world_root[:3, 3] += (1.2, -0.8, 0.0)
    people, tracker, said = seen_by(clip.rig, beside), Tracker(clip.rig, clip.model, config, clip.backgrounds, clip.states[0]), []
    for image_set in clip.sets:
        images = zip(image_set.images, people, strict=True)
        said.append(tracker.step(replace(image_set, images=tuple(replace(image, people=(p,)) for image, p in images))))
    assert [estimate.status is Status.LOST for estimate in said] == [False] * 14 + [True] * 2
    assert said[14].status_reason.startswith("people are seen, but nobody where the body is, though its outline fits: are names")
    assert not any(limb.status is LimbStatus.TRACKING for limb in said[-1].limbs)
