"""Devices of this computer: what is none, what may not be used, and, with the system calls answered, what a camera gives."""

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from helpers.sources.v4l2_camera import HEIGHT, WIDTH, V4l2Camera
from tracker_node.camera.rig import CaptureSettings
from tracker_node.errors import SourceError
from tracker_node.loaders.images.live_capture import check_live_settings
from tracker_node.loaders.images.v4l2_device import VideoDevice
from tracker_node.loaders.source_address import parse_source

GAIN, AUTO_EXPOSURE, EXPOSURE, BRIGHTNESS = 0x00980913, 0x009A0901, 0x009A0902, 0x00980900

READ = """
import json, sys, time
from tracker_node.camera.rig import CaptureSettings
from tracker_node.errors import TrackerError
from tracker_node.loaders.images.live_capture import DeviceCapture
settings, size, device_stamps = json.loads(sys.argv[2])
try:
    capture = DeviceCapture(sys.argv[1], size, CaptureSettings(**settings), device_stamps)
except TrackerError as error:
    sys.exit(str(error))
images = []
for _ in range(4):
    stamp_ns, content = capture.read()
    what = content.hex() if isinstance(content, bytes) else [*content.shape, int(content.mean())]
    images.append([what, 1e-6 * (time.time_ns() - stamp_ns)])
print(json.dumps(images))
"""


@pytest.fixture
def camera(tmp_path: Path) -> V4l2Camera:
    return V4l2Camera(tmp_path)


def read(camera: V4l2Camera, settings: dict, size=(WIDTH, HEIGHT), device_stamps: bool = True) -> list:
    """Four images, each with its age in ms; SystemExit with what was said when there are none."""
    command = [sys.executable, "-c", READ, str(camera.path), json.dumps([settings, size, device_stamps])]
    done = subprocess.run(command, env={**os.environ, **camera.env}, capture_output=True, text=True, timeout=60)
    if done.returncode:
        raise SystemExit(done.stderr.strip())
    return json.loads(done.stdout)


def test_color_images_with_the_stamps_of_the_device(camera: V4l2Camera):
    images = read(camera, {"pixel_format": "YUYV", "rate_hz": 100})
    assert all(what[:3] == [HEIGHT, WIDTH, 3] for what, _ in images)
    assert [what[3] for what, _ in images] == sorted(what[3] for what, _ in images)
    assert min(age_ms for _, age_ms in images) >= 6.9
    assert min(age_ms for _, age_ms in read(camera, {"rate_hz": 100}, device_stamps=False)) < 6.9


def test_jpeg_images_as_the_camera_makes_them(camera: V4l2Camera):
    assert {what for what, _ in read(camera, {"pixel_format": "MJPG", "rate_hz": 100})} == {camera.jpeg.hex()}


def test_grey_images_at_another_size(camera: V4l2Camera):
    images = read(camera, {"pixel_format": "GREY", "rate_hz": 100}, size=(32, 24))
    assert all(what[:2] == [24, 32] and len(what) == 3 for what, _ in images)
    values = [what[2] for what, _ in images]
    assert [b - a for a, b in pairwise(values)] == [10, 10, 10]


def test_exposure_and_gain_are_set_in_the_right_order(camera: V4l2Camera):
    read(camera, {"exposure_us": 4000.0, "gain": 12, "controls": {"brightness": -3}, "rate_hz": 100})
    assert camera.controls_set() == [(AUTO_EXPOSURE, 1), (BRIGHTNESS, -3), (EXPOSURE, 40), (GAIN, 12)]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"gain": 1000}, "control gain: expected a value from 0 to 100, got 1000"),
        (
            {"controls": {"zoom": 1}},
            "unknown control of .* 'zoom'; valid: auto_exposure, brightness, exposure_time_absolute, gain",
        ),
        ({"pixel_format": "H264"}, "expected pixel format H264, the device gives YUYV"),
    ],
)
def test_what_a_camera_cannot_do_is_said(camera: V4l2Camera, settings: dict, said: str):
    with pytest.raises(SystemExit, match=said):
        read(camera, settings)


@pytest.mark.parametrize("path", ["/dev/null", "/dev/zero"])
def test_a_device_that_is_no_camera(path: str):
    with pytest.raises(SourceError, match=rf"{path}.*is not a video device"):
        VideoDevice(path)


def test_what_is_no_device_or_is_not_there(tmp_path: Path):
    (tmp_path / "clip.mp4").touch()
    with pytest.raises(SourceError, match="is not a video device"):
        VideoDevice(str(tmp_path / "clip.mp4"))
    with pytest.raises(SourceError, match="no such device, is it plugged in"):
        VideoDevice(str(tmp_path / "usb-absent-index0"))


def test_a_device_without_permission(tmp_path: Path):
    """The kernel refuses: as another user where tests run as root, who may use every device."""
    code = f"""
from tracker_node.errors import SourceError
from tracker_node.loaders.images.v4l2_device import VideoDevice
import os
if os.getuid() == 0:
    os.setuid(65534)
try:
    VideoDevice({str(tmp_path / "secret" / "video0")!r})
except SourceError as error:
    print(error)
"""
    (tmp_path / "secret").mkdir(mode=0o700)
    (tmp_path / "secret" / "video0").symlink_to("/dev/null")
    if os.getuid():
        (tmp_path / "secret").chmod(0)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    (tmp_path / "secret").chmod(0o700)
    assert "no permission to use this device" in done.stdout, done.stderr


def test_settings_of_a_device_for_a_stream_are_refused():
    stream, settings = parse_source("rtsp://host/path"), CaptureSettings(exposure_us=4000.0, controls={"brightness": 1})
    with pytest.raises(SourceError, match="exposure_us, brightness can be set for v4l2: sources only"):
        check_live_settings(stream, settings, None)
    with pytest.raises(SourceError, match="asks for device stamps; this source has capture"):
        check_live_settings(stream, CaptureSettings(), "device")
    check_live_settings(parse_source("v4l2:/dev/video0"), settings, "device")
