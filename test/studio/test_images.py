"""Images in any order are those of the files."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.small_clip import RATE_HZ, make_clip
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import FileFormatError, SourceError, UnknownNameError
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.studio import images as images_module
from tracker_node.studio.images import RecordedImages, _Recent


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return make_clip(tmp_path_factory.mktemp("clip"), n_images=6)


@pytest.fixture(scope="module")
def images(clip):
    return RecordedImages(load_rig(clip.rig_file))


def test_any_order(clip, images):
    for number in (4, 1, 2, 5, 0, 3):
        expected = cv2.imread(str(clip.folder / f"cam02/{number:04d}.png"))
        np.testing.assert_array_equal(images.bgr("cam02", number), expected)


def test_sets_are_those_of_the_stamps(images):
    assert [s.stamp_ns for s in images.sets] == [round(i * 1e9 / RATE_HZ) for i in range(6)]
    assert images.sets[3].numbers == {"cam01": 3, "cam02": 3, "cam03": 3}
    image_set = images.image_set(3)
    assert image_set.cameras == ("cam01", "cam02", "cam03") and image_set.images[0].stamp_ns == images.sets[3].stamp_ns
    assert images.number_at("cam01", images.sets[3].stamp_ns) == 3 and images.number_at("cam01", 17) is None


def test_jpeg_shows_the_image(clip, images):
    expected = cv2.imread(str(clip.folder / "cam01/0002.png"))
    shown = cv2.imdecode(np.frombuffer(images.jpeg("cam01", 2), np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape == expected.shape and np.abs(shown.astype(int) - expected).mean() < 4
    half = cv2.imdecode(np.frombuffer(images.jpeg("cam01", 2, 2), np.uint8), cv2.IMREAD_COLOR)
    assert half.shape == (60, 80, 3)


def test_what_is_not_there_is_named(images):
    with pytest.raises(UnknownNameError, match="cam01, cam02, cam03"):
        images.bgr("cam09", 0)
    for number in (-1, 6):
        with pytest.raises(FileFormatError, match=r"\[0, 5\]"):
            images.bgr("cam01", number)
    with pytest.raises(FileFormatError, match="below 6"):
        images.image_set(6)


def test_a_file_that_is_gone_is_an_error_and_the_others_go_on(tmp_path):
    clip = make_clip(tmp_path, n_images=3)
    images = RecordedImages(load_rig(clip.rig_file))
    (tmp_path / "cam01/0001.png").write_bytes(b"no image")
    with pytest.raises(SourceError, match="image 1 cannot be read"):
        images.bgr("cam01", 1)
    assert images.bgr("cam01", 2).shape == (120, 160, 3)


def test_a_rig_without_sources_has_no_images(tmp_path):
    clip = make_clip(tmp_path, n_images=1)
    images = RecordedImages(clip.rig)  # its sources are relative to a folder elsewhere
    assert images.sets == () and images.cameras == () and "cam01" in images.problems[0]


def test_what_is_kept_is_bounded():
    recent = _Recent(100, len)
    for i in range(20):
        recent.put(i, bytes(30))
        assert recent.get(0) is not None or i >= 3
        recent.get(i - 1)
    assert sum(recent.get(i) is not None for i in range(20)) == 3 and recent.get(19) is not None


def test_a_jump_back_in_a_video_does_not_read_it_anew(tmp_path, monkeypatch):
    """What is not kept any more is read from a place near it."""
    clip = make_clip(tmp_path, n_images=1)
    path, n = tmp_path / "cam01.avi", 80
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), RATE_HZ, (160, 120))
    for i in range(n):
        writer.write(np.full((120, 160, 3), 3 * i, np.uint8))
    writer.release()
    rig = CameraRig((replace(load_rig(clip.rig_file)["cam01"], source=str(path)),))
    monkeypatch.setattr(images_module, "_DECODED_BYTES", 1)
    images = RecordedImages(rig)
    reader = images._readers["cam01"]
    assert [round(images.bgr("cam01", i).mean() / 3) for i in range(n)] == list(range(n))
    read = []
    monkeypatch.setattr(type(reader._source), "_pass", lambda self, i, capture: read.append(i))
    assert round(images.bgr("cam01", 50).mean() / 3) == 50
    assert read[-1] == 50 and len(read) <= 3
