"""Videos of another size than their calibration: what sizes, rotation and black bars tell, and what is refused."""

import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at
from tracker_node.calibration.video_pixels import camera_of_video, pixel_fits, rig_of_videos
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import CalibrationError, UnknownNameError

POINTS = np.random.default_rng(2).uniform((-0.4, -0.4, 0.6), (0.4, 0.4, 1.4), (40, 3))
LENS = CameraModel(640, 480, np.array([[600.0, 0.0, 331.0], [0.0, 590.0, 228.0], [0.0, 0.0, 1.0]]), "plumb_bob",
                   np.array([0.05, -0.02, 0.004, -0.003, 0.001]))  # fmt: skip


@pytest.fixture
def camera() -> Camera:
    return look_at((2.0, 0.5, 1.4), (0.0, 0.0, 1.0), LENS, "cam01")


def film(path: Path, image: np.ndarray) -> str:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, image.shape[1::-1])
    for _ in range(5):
        writer.write(image)
    writer.release()
    return str(path)


def gray(width: int, height: int) -> np.ndarray:
    return np.full((height, width, 3), 120, np.uint8)


def state_a_turn(path: str, clockwise: bool) -> None:
    """Write a quarter turn into the header of an MP4 file, as phones do."""
    content = Path(path).read_bytes()
    at = content.index(b"tkhd") + 44
    one = 65536 if clockwise else -65536
    assert struct.unpack(">9i", content[at : at + 36])[0] == 65536
    Path(path).write_bytes(content[:at] + struct.pack(">9i", 0, one, 0, -one, 0, 0, 0, 0, 1 << 30) + content[at + 36 :])


@pytest.mark.parametrize("clockwise", [True, False])
def test_a_stated_turn_is_found_and_projects_as_the_turned_image(camera, tmp_path, clockwise):
    image = gray(640, 480)
    pixels, valid = camera.project(POINTS)
    chosen = next(p for p, ok in zip(pixels, valid, strict=True) if ok and 30 < p[0] < 600 and 30 < p[1] < 440)
    cv2.circle(image, tuple(np.round(chosen).astype(int)), 12, (255, 255, 255), cv2.FILLED)
    path = film(tmp_path / "cam01.mp4", image)
    state_a_turn(path, clockwise)
    told = []
    turned = camera_of_video(replace(camera, source=path), None, told.append)
    assert (turned.model.width, turned.model.height) == (480, 640)
    assert f"turned {'clockwise' if clockwise else 'counterclockwise'} by a quarter" in told[0]
    seen, _ = turned.project(POINTS)
    u, v = pixels[:, 0], pixels[:, 1]
    expected = np.column_stack([479 - v, u] if clockwise else [v, 639 - u])
    np.testing.assert_allclose(seen[valid], expected[valid], atol=1e-8)
    _, shown = cv2.VideoCapture(path).read()  # as it is decoded: the dot lies where the turned camera sees its point
    at = seen[np.flatnonzero((pixels == chosen).all(axis=1))[0]]
    bright = np.argwhere(shown[..., 0] > 220).mean(axis=0)[::-1]
    assert np.abs(bright - at).max() < 1.0


def test_half_the_size_and_odd_sizes(camera, tmp_path):
    for width, height in ((320, 240), (1280, 960), (214, 160)):
        found = camera_of_video(replace(camera, source=film(tmp_path / f"{width}.mp4", gray(width, height))), None, print)
        before, valid = camera.project(POINTS)
        scale = np.array([width / 640, height / 480])
        np.testing.assert_allclose(found.project(POINTS)[0][valid], ((before + 0.5) * scale - 0.5)[valid], atol=1e-8)


def test_a_turn_that_nothing_states_may_be_either(camera, tmp_path):
    source = film(tmp_path / "cam01.mp4", gray(480, 640))
    said = r"clockwise\), or .*counterclockwise\); say which with --pixel-map cam01=clockwise"
    with pytest.raises(CalibrationError, match=said):
        camera_of_video(replace(camera, source=source), None, print)
    found = camera_of_video(replace(camera, source=source), "counterclockwise", print)
    before, valid = camera.project(POINTS)
    np.testing.assert_allclose(found.project(POINTS)[0][valid][:, 0], before[valid][:, 1], atol=1e-8)
    with pytest.raises(CalibrationError, match="quarter turn, got 320x240"):
        camera_of_video(replace(camera, source=film(tmp_path / "small.mp4", gray(320, 240))), "clockwise", print)


def test_black_bars_settle_what_sizes_leave_open():
    image = gray(640, 640)
    image[:80] = image[-80:] = 3
    found = pixel_fits((640, 480), (640, 640), images=image[None])
    assert [fit.kind for fit in found] == ["bars"]
    np.testing.assert_allclose(found[0].pixel_map, [[1.0, 0.0, 0.0], [0.0, 1.0, 80.0]])
    for shown in (gray(640, 640), np.zeros((640, 640, 3), np.uint8)):  # no bars; a dark room, which may have some
        assert [fit.kind for fit in pixel_fits((640, 480), (640, 640), images=shown[None])] == ["cut", "stretched"]


def test_what_no_way_explains_is_refused(camera, tmp_path):
    source = film(tmp_path / "cam01.mp4", gray(360, 640))
    with pytest.raises(CalibrationError, match=r"expected 640x480, got 360x640 .*neither resampling nor a turn"):
        camera_of_video(replace(camera, source=source), None, print)
    with pytest.raises(UnknownNameError, match="cam09"):
        rig_of_videos(CameraRig((camera,)), {"cam09": "cut"}, print)
    with pytest.raises(UnknownNameError, match="stretched"):
        rig_of_videos(CameraRig((camera,)), {"cam01": "other"}, print)
    skewed = replace(camera, model=replace(LENS, K=np.array([[600.0, 1.0, 331.0], [0.0, 590.0, 228.0], [0.0, 0.0, 1.0]])))
    with pytest.raises(CalibrationError, match="without a skew"):
        camera_of_video(replace(skewed, source=film(tmp_path / "turned.mp4", gray(480, 640))), "clockwise", print)


def test_cameras_without_a_recording_stay(camera, tmp_path):
    sources = {"b": "v4l2:/dev/video0", "c": str(tmp_path / "no.mp4")}
    cameras = (camera, *(replace(camera, name=name, source=source) for name, source in sources.items()))
    assert rig_of_videos(CameraRig(cameras), {}, print).cameras == cameras


def test_a_choice_that_nothing_needs_is_refused(camera, tmp_path):
    with pytest.raises(CalibrationError, match=r"cam01.*a recording that is there"):
        rig_of_videos(CameraRig((replace(camera, source=None),)), {"cam01": "cut"}, print)
    same = replace(camera, source=film(tmp_path / "cam01.mp4", gray(640, 480)))
    with pytest.raises(CalibrationError, match="the size of the calibration"):
        rig_of_videos(CameraRig((same,)), {"cam01": "cut"}, print)
