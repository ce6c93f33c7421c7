"""Who is who across cameras."""

import numpy as np

from helpers.cameras.camera_rigs import circle_rig, disturbed
from tracker_node.calibration.points.rig_refinement import associate_people

RNG = np.random.default_rng(11)
JOINTS = RNG.uniform([-0.4, -0.4, 0.1], [0.4, 0.4, 1.8], (15, 3))


def seen(camera, joints, confidence=0.8):
    pixels, visible = camera.project(joints)
    return np.column_stack([pixels, confidence * visible])


def test_the_same_person_is_chosen_in_any_order():
    rig = disturbed(circle_rig(), distance=0.02, angle=0.01)
    other = JOINTS[::-1] + np.array([0.8, 0.5, 0.0])
    people = []
    for index, camera in enumerate(circle_rig()):
        pair = [seen(camera, JOINTS), seen(camera, other)]
        people.append(np.array(pair[::-1] if index % 2 else pair[: 1 + (index == 2)]))
    joints, n_cameras = associate_people(rig, people)
    assert n_cameras == 4
    for camera, found in zip(circle_rig(), joints, strict=True):
        np.testing.assert_array_equal(found, seen(camera, JOINTS))


def test_a_camera_that_sees_somebody_else_stays_out():
    rig = circle_rig()
    people = [np.array([seen(camera, JOINTS)]) for camera in rig]
    people[1] = np.array([seen(rig.cameras[1], JOINTS + np.array([1.2, 0.0, 0.0]))])
    joints, n_cameras = associate_people(rig, people)
    assert n_cameras == 3
    assert not joints[1].any() and joints[0].any()


def test_nobody_in_common_is_zero_cameras():
    rig = circle_rig()
    people = [np.zeros((0, 0, 3)) for _ in rig]
    people[2] = np.array([seen(rig.cameras[2], JOINTS)])
    joints, n_cameras = associate_people(rig, people)
    assert n_cameras == 0
    assert joints.shape == (4, 15, 3) and not joints.any()
