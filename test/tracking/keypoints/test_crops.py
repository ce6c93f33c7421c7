"""Where a detector should look: squares around the body, its head up."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from helpers.bodies.detected_people import HUMAN, places, posed, standing
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import Landmark
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.keypoints.crop import mapped
from tracker_node.tracking.keypoints.crops import crops_of

RIG, TRUE = circle_rig(3), posed(7)


def turned(rig: CameraRig, angle: float) -> CameraRig:
    """The first camera turned about its optical axis, clockwise: what it sees turns the other way."""
    first, *others = rig.cameras
    turn = se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, angle])), np.zeros(3))
    return replace(rig, cameras=(replace(first, T_world_cam=first.T_world_cam @ turn), *others))


def test_a_square_has_the_root_in_its_middle_and_the_body_in_its_circle():
    body = Configuration(HUMAN, TRUE)
    for camera, crop in zip(RIG, crops_of(HUMAN, RIG, TRUE), strict=True):
        center, _ = camera.project(TRUE.T_world_root[None, :3, 3])
        np.testing.assert_allclose(crop.center, center[0])
        points = np.vstack(
            [body.landmarks_world, body.Ts_world_shape[:, :3, 3], TRUE.T_world_root[:3, 3] + 0.5 * TRUE.T_world_root[:3, 2]]
        )
        far = np.linalg.norm(camera.project(points)[0] - center, axis=1).max()
        assert crop.size == pytest.approx(2.5 * far)


def neck_of(state: State) -> np.ndarray:
    return Configuration(HUMAN, state).landmarks_world[HUMAN.landmark_index("neck")]


@pytest.mark.parametrize("angle", [0.0, 0.5, -1.2, 3.0])
def test_the_top_of_the_trunk_is_up_in_the_square(angle):
    rig, state = turned(RIG, angle), standing()
    crop = crops_of(HUMAN, rig, state)[0]
    assert np.angle(np.exp(1j * (crop.angle + angle))) == pytest.approx(0.0, abs=0.03)
    pixels = rig.cameras[0].project(np.array([state.T_world_root[:3, 3], neck_of(state)]))[0]
    to_image = crop.to_image(256)
    low, high = (pixels - to_image[:, 2]) @ np.linalg.inv(to_image[:, :2]).T
    np.testing.assert_allclose(low, [127.5, 127.5], atol=1e-6)
    assert abs(high[0] - 127.5) < 1e-6 and high[1] < 110.0


def test_somebody_who_bends_down_is_turned_by_the_trunk():
    """Seen from the side: by more than half of a right angle, while the pelvis is upright."""
    camera = RIG.cameras[0]
    bent = standing(0.0, 0.0, 0.2 + 0.5 * np.pi, abdomen_flexion=70.0, torso_flexion=45.0)
    crop = crops_of(HUMAN, RIG, bent)[0]
    root, neck = camera.project(np.array([bent.T_world_root[:3, 3], neck_of(bent)]))[0]
    assert crop.angle == pytest.approx(np.arctan2(neck[0] - root[0], root[1] - neck[1]))
    assert abs(crop.angle) > 0.25 * np.pi


def test_up_is_the_highest_landmark_of_the_trunk():
    """Others of the trunk are lower, and the head and hands of those who raise them higher."""
    low = Landmark("navel", HUMAN.chain.links[0], (0.1, 0.0, 0.15))
    model = replace(HUMAN, landmarks=(low, *HUMAN.landmarks))
    state = standing(model=model, abdomen_flexion=50.0, head_flexion=30.0)
    for crop, expected in zip(crops_of(model, RIG, state), crops_of(HUMAN, RIG, state), strict=True):
        assert crop.angle == expected.angle


def test_a_body_without_such_a_landmark_is_up_along_its_root():
    model = crane()
    state = State.neutral(model, standing(0.0, 0.0, 0.4).T_world_root)
    for camera, crop in zip(RIG, crops_of(model, RIG, state), strict=True):
        root, above = camera.project(np.array([state.T_world_root[:3, 3], state.T_world_root[:3, 3] + [0.0, 0.0, 0.5]]))[0]
        assert crop.angle == pytest.approx(np.arctan2(above[0] - root[0], root[1] - above[1])) and abs(crop.angle) < 0.1


def test_all_points_are_within_the_square():
    for camera, crop in zip(RIG, crops_of(HUMAN, RIG, TRUE), strict=True):
        to_image = crop.to_image(256)
        inside = (camera.project(places(TRUE))[0] - to_image[:, 2]) @ np.linalg.inv(to_image[:, :2]).T
        assert inside.min() > 0.0 and inside.max() < 255.0
        np.testing.assert_allclose(mapped(to_image, inside), camera.project(places(TRUE))[0])


def test_a_body_behind_a_camera_or_beside_its_image_is_not_seen():
    camera = RIG.cameras[0]
    x, y = 2.0 * camera.center[:2]
    crops = crops_of(HUMAN, RIG, standing(x, y))
    assert crops[0] is None
    along = np.array([-y, x]) / np.hypot(x, y)
    for sign, seen in ((0.2, True), (4.0, False), (-4.0, False)):
        crop = crops_of(HUMAN, RIG, standing(*(sign * along)))[0]
        assert (crop is not None) is seen, sign


def test_a_body_partly_in_the_image_is_seen():
    """Its root is beside the image, by less than its size."""
    camera = RIG.cameras[0]
    along = np.array([-np.sin(0.2), np.cos(0.2)])
    seen = []
    for far in np.linspace(1.5, 3.5, 41):
        state = standing(*(far * along))
        (u, v), crop = camera.project(state.T_world_root[None, :3, 3])[0][0], crops_of(HUMAN, RIG, state)[0]
        body = Configuration(HUMAN, state)
        points = np.vstack([body.landmarks_world, body.Ts_world_shape[:, :3, 3], state.T_world_root[:3, 3] + [0.0, 0.0, 0.5]])
        radius = np.linalg.norm(camera.project(points)[0] - [u, v], axis=1).max()
        inside = -radius < u < 640.0 + radius and -radius < v < 480.0 + radius
        assert (crop is not None) == inside
        seen.append((inside, u < 0.0 or u > 640.0))
    assert (True, True) in seen and (False, True) in seen


def test_a_body_that_is_too_small_is_not_looked_for():
    far = CameraRig(tuple(replace(c, T_world_cam=_back(c.T_world_cam, 60.0)) for c in RIG))
    crops = crops_of(HUMAN, far, standing())
    assert crops == [None] * 3
    assert None not in crops_of(
        HUMAN, CameraRig(tuple(replace(c, T_world_cam=_back(c.T_world_cam, 20.0)) for c in RIG)), standing()
    )


def _back(T: np.ndarray, by_m: float) -> np.ndarray:
    result = T.copy()
    result[:3, 3] -= by_m * T[:3, 2]
    return result
