"""Refinement of a rig from the joints of a person who walks about, beside another one whom only some cameras see."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig, disturbed
from tracker_node.calibration.points.rig_refinement import collect_joints, refine_rig, rigid_alignment
from tracker_node.errors import CalibrationError
from tracker_node.geometry import se3

N_IMAGES, N_JOINTS = 40, 12


def walk(seed: int = 2) -> np.ndarray:
    """Joints (n_images, n_joints, 3) of somebody whose limbs swing while they walk in a circle."""
    rng = np.random.default_rng(seed)
    rest = rng.uniform([-0.3, -0.3, 0.1], [0.3, 0.3, 1.8], (N_JOINTS, 3))
    phase = np.linspace(0.0, 2.0 * np.pi, N_IMAGES)[:, None, None]
    swing = 0.15 * np.sin(3.0 * phase + rng.uniform(0.0, 6.0, (1, N_JOINTS, 3)))
    path = 0.5 * np.concatenate([np.cos(phase), np.sin(phase), 0.0 * phase], axis=2)
    return rest + swing + path


def seen_people(rig, joints: np.ndarray, noise_px: float = 1.0, lag: int = 0) -> list[list[np.ndarray]]:
    """Per camera and image the people found: the walker, and in the first two cameras somebody else before him."""
    rng = np.random.default_rng(7)
    people = []
    for index, camera in enumerate(rig):
        images = []
        for i in range(N_IMAGES):
            shown = joints[max(i - lag, 0)] if index == 2 else joints[i]
            pixels, visible = camera.project(shown)
            found = np.column_stack([pixels + rng.normal(size=pixels.shape) * noise_px, 0.7 * visible])
            other = found + np.array([150.0, -40.0 * index, 0.0])
            images.append(np.array([other, found] if index < 2 else [found]))
        people.append(images)
    return people


def test_the_walker_is_picked_out_and_the_rig_found_again():
    true = circle_rig()
    joints = walk()
    given = disturbed(true)
    picked = collect_joints(given, seen_people(true, joints))
    assert picked.shape == (N_IMAGES, N_JOINTS, 4, 3)
    refined = refine_rig(given, picked)
    assert refined.converged
    for name, figures in refined.cameras.items():
        assert figures.rms_after_px < 1.6, name
        assert figures.n_points == N_IMAGES * N_JOINTS
    assert refined.cameras["cam03"].rms_before_px > 5.0
    # World frame of the given rig, whose first camera is right: joints stay within what its other cameras were off.
    offset = refined.points - joints
    assert np.linalg.norm(offset, axis=-1).mean() < 0.04
    T = rigid_alignment(refined.points.reshape(-1, 3), joints.reshape(-1, 3))
    assert np.linalg.norm(se3.apply(T, refined.points) - joints, axis=-1).mean() < 0.012


def test_a_late_camera_is_reported():
    rig = circle_rig()
    refined = refine_rig(rig, collect_joints(rig, seen_people(rig, walk(), noise_px=0.3, lag=1)))
    lags = {name: figures.lag_images for name, figures in refined.cameras.items()}
    others = np.mean([lags["cam01"], lags["cam02"], lags["cam04"]])
    assert lags["cam03"] - others > 0.5


def test_low_confidence_joints_do_not_count():
    rig = circle_rig()
    joints = collect_joints(rig, seen_people(rig, walk()))
    joints[:, 0, :, :2] += 90.0 * np.random.default_rng(0).normal(size=(N_IMAGES, 4, 2))
    joints[:, 0, :, 2] = 0.1
    refined = refine_rig(rig, joints)
    assert all(figures.rms_after_px < 1.6 for figures in refined.cameras.values())
    assert not refined.valid[:, 0].any() and refined.valid[:, 1:].all()


def test_too_little_is_said_by_name():
    rig = circle_rig()
    people = seen_people(rig, walk())
    people[3] = [np.zeros((0, 0, 3))] * N_IMAGES
    with pytest.raises(CalibrationError, match="camera 'cam04': none of its people is seen by another camera"):
        collect_joints(rig, people)
    with pytest.raises(CalibrationError, match="fewer than 20 joints"):
        refine_rig(rig, np.zeros((3, 4, 4, 3)))


def test_detectors_with_different_joints_do_not_mix():
    rig = circle_rig()
    people = seen_people(rig, walk())
    people[2] = [group[:, :-2] for group in people[2]]
    with pytest.raises(CalibrationError, match="camera 'cam03': its people have 10 joints, those before them 12"):
        collect_joints(rig, people)


def test_rigid_alignment_ignores_far_pairs():
    rng = np.random.default_rng(4)
    points = rng.normal(size=(200, 3))
    T = se3.exp(np.array([0.3, -0.2, 0.1, 0.4, -0.3, 0.8]))
    targets = se3.apply(T, points)
    targets[:30] += rng.normal(size=(30, 3)) * 3.0
    np.testing.assert_allclose(rigid_alignment(points, targets), T, atol=1e-4)
