"""A camera that is turned by less than motion tells is named by people's joints."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import posed, seen_by
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.camera.rig import CameraRig
from tracker_node.doctor.people import common_joints, compared
from tracker_node.doctor.recording import CameraRecording, Look
from tracker_node.geometry import se3, so3

RIG, N_LOOKS, PERIOD_NS = circle_rig(4), 12, 100_000_000


def recordings_of(rig: CameraRig = RIG, noise_px: float = 2.0, n: int = N_LOOKS) -> dict[str, CameraRecording]:
    """What cameras of a rig see of somebody who moves, as a network has it."""
    rng = np.random.default_rng(3)
    recordings = {name: CameraRecording(name, n, 10.0) for name in rig.names}
    for k in range(n):
        for name, person in zip(rig.names, seen_by(rig, posed(k)), strict=True):
            noisy = replace(person, pixels=person.pixels + rng.normal(0.0, noise_px, person.pixels.shape))
            recordings[name].looks.append(Look(k * PERIOD_NS, (noisy,)))
    return recordings


def turned(index: int, degrees: float, axis: int = 1) -> CameraRig:
    """The rig with a camera that is said to look elsewhere."""
    camera = RIG.cameras[index]
    T = se3.from_rotation_translation(so3.exp(np.radians(degrees) * np.eye(3)[axis]), np.zeros(3))
    cameras = list(RIG.cameras)
    cameras[index] = replace(camera, T_world_cam=camera.T_world_cam @ T)
    return replace(RIG, cameras=tuple(cameras))


def found(rig: CameraRig, recordings: dict[str, CameraRecording]):
    joints = common_joints(rig.cameras, recordings)
    assert joints is not None
    return compared(*joints)


def test_no_camera_of_a_sound_rig_is_named():
    comparison = found(RIG, recordings_of())
    assert comparison.turn is None and comparison.sound and comparison.rig.names == RIG.names


@pytest.mark.parametrize(("index", "degrees", "axis"), [(0, 0.6, 0), (2, -0.6, 1), (3, 1.0, 0)])
def test_a_camera_that_is_turned_is_named_with_the_turn(index, degrees, axis):
    comparison = found(turned(index, degrees, axis), recordings_of())
    turn = comparison.turn
    mended = comparison.rig.cameras[index].T_world_cam[:3, :3].T @ RIG.cameras[index].T_world_cam[:3, :3]
    assert comparison.sound and np.degrees(np.linalg.norm(so3.log(mended))) < 0.15
    assert turn.camera == RIG.names[index] and RIG.names[index] not in turn.rivals
    assert turn.turned_deg == pytest.approx(abs(degrees), abs=0.15)
    assert turn.after_px < turn.before_px


def test_images_of_another_moment_are_not_compared():
    """A camera that looked between the others has nothing in common with them; three are left."""
    recordings = recordings_of()
    late = recordings[RIG.names[1]]
    late.looks[:] = [replace(look, stamp_ns=look.stamp_ns + PERIOD_NS // 2) for look in late.looks]
    assert common_joints(RIG.cameras, recordings) is None


@pytest.mark.parametrize("without", [2, 4])
def test_too_few_cameras_with_people_are_not_compared(without):
    recordings = recordings_of()
    for name in RIG.names[:without]:
        recordings[name].looks[:] = [replace(look, people=()) for look in recordings[name].looks]
    assert common_joints(RIG.cameras, recordings) is None


def test_a_camera_without_people_is_left_out():
    recordings = recordings_of()
    recordings[RIG.names[0]].looks[:] = [replace(look, people=()) for look in recordings[RIG.names[0]].looks]
    rig, joints = common_joints(RIG.cameras, recordings)
    assert rig.names == RIG.names[1:] and joints.shape[0] == N_LOOKS and joints.shape[2] == 3


def test_a_recording_looks_for_people_now_and_then():
    class Detector:
        seen = 0

        def detect(self, image, expected=()):
            self.seen += 1
            return ()

    detector = Detector()
    recording = CameraRecording("cam", 96, 30.0, detector=detector)
    for k in range(96):
        recording.add(round(k * 1e9 / 30.0), np.full((24, 32, 3), k, dtype=np.uint8))
    assert detector.seen == len(recording.looks) == 24
    assert np.ptp(np.diff([look.stamp_ns for look in recording.looks])) <= 34_000_000


def test_a_camera_with_another_focal_length_is_not_taken_for_a_turned_one():
    camera = RIG.cameras[1]
    K = camera.model.K.copy()
    K[[0, 1], [0, 1]] *= 1.15
    zoomed = replace(RIG, cameras=(RIG.cameras[0], replace(camera, model=replace(camera.model, K=K)), *RIG.cameras[2:]))
    comparison = found(zoomed, recordings_of())
    assert comparison.turn is None and not comparison.sound
