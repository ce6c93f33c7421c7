"""Videos of a variable frame rate are told from others, and their stamps are the container's times."""

import numpy as np
import pytest

from helpers.sources.variable_rate_video import set_times, write_video
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.doctor.diagnosis import examine
from tracker_node.doctor.recording import record
from tracker_node.loaders.images.source import SourceOptions, open_camera_source, open_source
from tracker_node.loaders.images.stamps import varying_times
from tracker_node.ros.ingest.cameras import chosen_cameras, open_cameras
from tracker_node.runs.image_sets import SourceStream
from tracker_node.synthesis.scenes.scene import looking_at
from tracker_node.tracking.config import SynchronizerConfig

N = 24
RNG = np.random.default_rng(3)
IMAGES = [np.full((48, 64, 3), 10 * i, np.uint8) for i in range(N)]
# As phones do it: 30 Hz in light, then fewer, and every image some milliseconds off its place
TIMES = np.cumsum([0.0, *([1 / 30] * 11), *([1 / 24] * (N - 12))]) + np.array([0.0, *RNG.uniform(-0.003, 0.003, N - 1)])
LENS = CameraModel(64, 48, np.array([[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]))


@pytest.fixture
def constant(tmp_path):
    return write_video(tmp_path / "constant.mp4", IMAGES)


@pytest.fixture
def varying(tmp_path):
    path = write_video(tmp_path / "varying.mp4", IMAGES)
    set_times(path, TIMES)
    return path


def camera(path, **changes) -> Camera:
    return Camera("cam1", LENS, looking_at(np.array([3.0, 0.0, 1.0]), np.zeros(3)), source=str(path), **changes)


def own_stamps(source) -> list[int]:
    return [stamp_ns for stamp_ns, _ in source]


def test_times_that_vary_are_the_stamps(varying):
    source = open_camera_source(camera(varying))
    np.testing.assert_allclose(1e-9 * np.array(own_stamps(source)), TIMES, atol=1e-4)
    assert source.note.startswith("variable frame rate: its images are ")
    assert len(varying_times(str(varying), N + 2)) == N + 2  # announced, but not there


@pytest.mark.parametrize("rate_hz", [30.0, 29.97, 24.0, 240.0])
def test_a_constant_rate_stays_as_it_is(tmp_path, rate_hz):
    """The stamps are those of the rate, to the nanosecond."""
    source = open_camera_source(camera(write_video(tmp_path / "constant.mp4", IMAGES, rate_hz)))
    assert own_stamps(source) == [round(i * 1e9 / source.rate_hz) for i in range(N)]
    assert source.note == ""


def test_times_rounded_to_milliseconds_are_a_constant_rate(constant):
    set_times(constant, np.round(np.arange(N) / 30, 3))
    assert open_source(constant).options.times_ns is None


def test_a_dropped_image_is_a_variable_rate(constant):
    times = np.arange(N) / 30
    times[15:] += 1 / 30
    set_times(constant, times)
    np.testing.assert_allclose(1e-9 * np.array(own_stamps(open_source(constant))), times, atol=1e-4)


def test_who_asks_for_a_rate_gets_it(varying):
    even = [round(i * 1e9 / 25) for i in range(N)]
    assert own_stamps(open_camera_source(camera(varying), SourceOptions(rate_hz=25.0))) == even
    by_rate = open_camera_source(camera(varying, stamps="rate"))
    assert len(set(np.diff(own_stamps(by_rate)) // 10)) == 1 and by_rate.note == ""


def test_stamps_go_on_from_where_a_part_begins_and_with_the_offset(varying):
    part = open_camera_source(camera(varying, time_offset_ns=5_000_000), SourceOptions(start=10, end=14))
    np.testing.assert_allclose(1e-9 * np.array(own_stamps(part)), TIMES[10:14] + 0.005, atol=1e-4)


def test_live_and_offline_and_the_doctor_have_the_same_stamps_and_say_so(varying):
    rig = CameraRig((camera(varying),))
    stream = SourceStream(rig, SynchronizerConfig(min_cameras=1))
    offline = [image_set.stamp_ns for image_set in stream]
    live = open_cameras(chosen_cameras(rig), SourceOptions()).recorded["cam1"]
    assert offline == own_stamps(live)
    assert stream.notes == [f"camera 'cam1': {live.note}"] and "variable frame rate" in live.note
    recordings = record(rig)
    assert recordings["cam1"].stamps_ns == offline[: len(recordings["cam1"])]
    assert any(note.startswith("cam1: variable frame rate") for note in examine(rig, recordings).notes)
