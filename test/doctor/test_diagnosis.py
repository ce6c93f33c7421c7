"""The doctor names what is wrong with a rig, and says nothing of one that is sound."""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.calibration import _planted_faults as faults
from helpers.cameras.moving_balls import N_IMAGES, RATE_HZ, ball_images, balls_rig
from tracker_node.doctor.diagnosis import examine
from tracker_node.doctor.recording import CameraRecording


@pytest.fixture(scope="module")
def clip():
    rig = balls_rig()
    return faults.Clip(rig, ball_images(rig), dict.fromkeys(rig.names, RATE_HZ))


def recordings_of(clip):
    result = {}
    for name in clip.rig.names:
        result[name] = CameraRecording(name, len(clip.images[name]), clip.rates_hz[name])
        for i, image in enumerate(clip.images[name]):
            result[name].add(round(i * 1e9 / clip.rates_hz[name]), image)
    return result


def told(clip):
    return [(finding.fault, finding.cameras) for finding in examine(clip.rig, recordings_of(clip)).findings]


def test_a_sound_rig_gives_no_alarm(clip):
    assert told(clip) == []


QUICK = ("wrong_resolution", "moved_camera", "interlaced_video", "low_image_rate")
SLOW = (
    "swapped_cameras", "mirrored_axis", "millimeters", "bad_extrinsics", "wrong_focal_length", "clock_offset", "exposure_change",
    "duplicate_images",
)  # fmt: skip


@pytest.mark.parametrize("fault", [*QUICK, *(pytest.param(fault, marks=pytest.mark.long) for fault in SLOW)])
def test_each_fault_alone_is_named_with_its_camera_and_nothing_else(fault, clip):
    planted = faults.PLANTED[fault]
    assert told(planted.plant(clip)) == [(planted.fault, tuple(clip.rig.names[i] for i in planted.cameras))]


@pytest.mark.long
def test_the_focal_length_that_is_fitted_is_what_was_planted(clip):
    focal = examine(*_rig_and_recordings(faults.wrong_focal_length(clip, 1.15))).findings[0]
    assert focal.values["factor"] == pytest.approx(1.0 / 1.15, abs=0.02)


@pytest.mark.long
def test_what_is_fitted_is_what_was_planted(clip):
    clock = examine(*_rig_and_recordings(faults.clock_offset(clip, 0.2))).findings[0]
    assert clock.values["late_s"] == pytest.approx(-0.2, abs=0.02)
    assert "time_offset_s: 0.2" in clock.sentence
    place = examine(*_rig_and_recordings(faults.bad_extrinsics(clip, 4.0))).findings[0]
    assert place.values["turned_deg"] == pytest.approx(4.0, abs=1.5)


@pytest.mark.long
def test_one_place_in_millimetres_among_metres(clip):
    transform = clip.rig.cameras[2].T_world_cam.copy()
    transform[:3, 3] *= 1000.0
    assert told(clip.with_camera(2, T_world_cam=transform)) == [("unit", ("cam3",))]


@pytest.mark.long
def test_axes_as_in_opengl(clip):
    flipped = tuple(replace(c, T_world_cam=c.T_world_cam @ np.diag([1.0, -1.0, -1.0, 1.0])) for c in clip.rig)
    (finding,) = examine(*_rig_and_recordings(replace(clip, rig=replace(clip.rig, cameras=flipped)))).findings
    assert (finding.fault, finding.cameras) == ("mirrored", ()) and "OpenGL" in finding.sentence


@pytest.mark.long
def test_places_that_are_inverted(clip):
    inverted = tuple(replace(c, T_world_cam=c.T_cam_world) for c in clip.rig)
    assert ("place", ()) in told(replace(clip, rig=replace(clip.rig, cameras=inverted)))


def test_of_two_cameras_either_may_be_wrong_and_the_doctor_says_so(clip):
    pair = replace(clip, rig=clip.rig.subset(["cam1", "cam2"]))
    (finding,) = examine(*_rig_and_recordings(faults.clock_offset(pair, 0.2))).findings
    assert finding.fault == "clock"
    assert "may as well be the other" in finding.sentence


def test_a_still_scene_cannot_be_judged_and_says_so(clip):
    rng = np.random.default_rng(0)
    first = {name: images[0] // 2 for name, images in clip.images.items()}
    still = {n: [image + rng.integers(0, 2, image.shape, dtype=np.uint8) for _ in range(12)] for n, image in first.items()}
    examination = examine(*_rig_and_recordings(replace(clip, images=still)))
    assert examination.findings == ()
    assert any("too little moves" in note for note in examination.notes)


def test_a_camera_without_images_is_named_and_the_others_are_compared(clip):
    examination = examine(clip.rig, {**recordings_of(clip), "cam2": CameraRecording("cam2", 0, 1.0, problems=["no such file"])})
    assert [(f.fault, f.cameras) for f in examination.findings] == [("source", ("cam2",))]
    assert "no such file" in examination.findings[0].sentence
    assert len(examination.diagnosis.after) == 3


def test_a_recording_keeps_no_full_images_but_one(clip):
    recording = recordings_of(clip)["cam1"]
    assert len(recording) == N_IMAGES
    assert all(image.ndim == 2 and max(image.shape) <= 320 for image in recording.small)


def _rig_and_recordings(clip):
    return clip.rig, recordings_of(clip)
