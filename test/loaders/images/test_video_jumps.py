"""Images of a video in any order are those of reading it through, whatever a jump in the file ends at."""

import cv2
import numpy as np
import pytest

from tracker_node.loaders.images.source import open_source
from tracker_node.loaders.images.stamps import period_ns

N, WIDTH, HEIGHT, RATE_HZ = 90, 96, 64, 25.0
ORDER = [70, 30, 31, 89, 45, 2, 88, 44, 71]


def write_video(path, codec: str, n: int = N) -> None:
    """A noisy square wanders over a gradient: images are made from those before them."""
    rng = np.random.default_rng(0)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), RATE_HZ, (WIDTH, HEIGHT))
    assert writer.isOpened()
    gradient = np.tile(np.linspace(0, 200, WIDTH, dtype=np.uint8)[None, :, None], (HEIGHT, 1, 3))
    for i in range(n):
        image = gradient.copy()
        u, v = 3 + i % (WIDTH - 26), 3 + (2 * i) % (HEIGHT - 26)
        image[v : v + 20, u : u + 20] = rng.integers(0, 255, (20, 20, 3))
        writer.write(image)
    writer.release()


OPEN = cv2.VideoCapture


class Counted:
    """OpenCV's reader that counts images asked for; jumps end ``beside`` where they should, times are ``silent`` if so set."""

    asked, beside, silent = 0, 0, False

    def __init__(self, *arguments):
        self._capture = OPEN(*arguments)

    def __getattr__(self, name):
        return getattr(self._capture, name)

    def grab(self):
        Counted.asked += 1
        return self._capture.grab()

    def read(self):
        Counted.asked += 1
        return self._capture.read()

    def set(self, field, value):
        return self._capture.set(field, value + Counted.beside if field == cv2.CAP_PROP_POS_FRAMES else value)

    def get(self, field):
        return 0.0 if Counted.silent and field == cv2.CAP_PROP_POS_MSEC else self._capture.get(field)


@pytest.fixture
def counted(monkeypatch):
    for name, value in (("asked", 0), ("beside", 0), ("silent", False)):
        monkeypatch.setattr(Counted, name, value)
    monkeypatch.setattr(cv2, "VideoCapture", Counted)
    return Counted


def check_any_order(source, expected, order) -> None:
    for number in order:
        image = next(source.images(number))
        assert image.stamp_ns == expected[number][0]
        np.testing.assert_array_equal(image.bgr, expected[number][1])


@pytest.mark.parametrize(("suffix", "codec"), [("mp4", "mp4v"), ("avi", "MJPG"), ("avi", "XVID"), ("mkv", "mp4v")])
def test_any_order_is_that_of_reading_through(tmp_path, counted, suffix, codec):
    write_video(tmp_path / f"a.{suffix}", codec)
    source = open_source(tmp_path / f"a.{suffix}")
    expected = [(stamp_ns, bgr.copy()) for stamp_ns, bgr in source]
    assert len(expected) == N
    counted.asked = 0
    check_any_order(source, expected, ORDER)
    assert counted.asked < 3 * len(ORDER) + 60  # reading from the beginning would be hundreds


@pytest.mark.parametrize("beside", [-40, -3, 1, 5])
def test_a_jump_that_ends_elsewhere_does_no_harm(tmp_path, counted, beside):
    write_video(tmp_path / "a.mp4", "mp4v")
    source = open_source(tmp_path / "a.mp4")
    expected = [(stamp_ns, bgr.copy()) for stamp_ns, bgr in source]
    counted.beside = beside
    check_any_order(source, expected, ORDER)


def test_images_without_times_are_counted_from_the_beginning(tmp_path, counted):
    write_video(tmp_path / "a.mp4", "mp4v")
    counted.silent = True
    source = open_source(tmp_path / "a.mp4")
    expected = [(stamp_ns, bgr.copy()) for stamp_ns, bgr in source]
    check_any_order(source, expected, [70, 30])


def test_what_has_not_been_passed_is_read_on_to(tmp_path, counted):
    write_video(tmp_path / "a.mp4", "mp4v")
    expected = [(stamp_ns, bgr.copy()) for stamp_ns, bgr in open_source(tmp_path / "a.mp4")]
    source = open_source(tmp_path / "a.mp4")
    check_any_order(source, expected, [40])
    counted.asked = 0
    check_any_order(source, expected, [80])  # on from number 40
    assert counted.asked < 60


def test_a_part_of_a_file_has_the_numbers_of_the_whole(tmp_path):
    write_video(tmp_path / "a.mp4", "mp4v", 60)
    expected = [(stamp_ns, bgr.copy()) for stamp_ns, bgr in open_source(tmp_path / "a.mp4")]
    source = open_source(tmp_path / "a.mp4", start=30, end=50)
    assert [stamp_ns for stamp_ns, _ in source] == [stamp_ns for stamp_ns, _ in expected[30:50]]
    check_any_order(source, expected, [45, 31])
    assert len(list(source.images(44))) == 6


def test_a_real_recording_in_any_order(shared_data):
    """H.264 with images that are made from later ones."""
    source = open_source(shared_data / "pose2sim_balancing/videos/cam01.mp4", end=64, shrink=8)
    expected = [(stamp_ns, bgr.copy()) for stamp_ns, bgr in source]
    assert period_ns([stamp_ns for stamp_ns, _ in expected]) == pytest.approx(1e9 / source.rate_hz, rel=0.01)
    check_any_order(source, expected, [50, 25, 60, 59, 63])
