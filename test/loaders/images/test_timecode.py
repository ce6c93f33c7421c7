"""Timecode: labels against counted images, and files with and without."""

from fractions import Fraction

import numpy as np
import pytest

from helpers.sources.timecoded_video import count_pairs, write_timecoded
from tracker_node.errors import FileFormatError
from tracker_node.loaders.images.video_tracks import Timecode, read_timecode

NTSC, DOUBLE = Fraction(30000, 1001), Fraction(60000, 1001)


def labels(rate, dropped, n):
    """Labels of ``n`` images from zero on, one by one, as SMPTE ST 12-1 counts."""
    whole, numbers = round(rate), (0, 0, 0, 0)
    for _ in range(n):
        h, m, s, f = numbers
        yield f"{h:02d}:{m:02d}:{s:02d}{';' if dropped else ':'}{f:02d}"
        f += 1
        if f == whole:
            f, s = 0, s + 1
        if s == 60:
            s, m = 0, m + 1
            if m == 60:
                h, m = h + 1, 0
            if dropped and m % 10:
                f = whole // 15
        numbers = h, m, s, f


@pytest.mark.parametrize(("rate", "dropped"), [(25, False), (NTSC, False), (NTSC, True), (DOUBLE, True), (24, False)])
def test_every_image_is_one_period_later_than_the_one_before(rate, dropped):
    n = round(rate) * 60 * 21
    found = np.array([Timecode(label, float(rate)).seconds for label in labels(rate, dropped, n)])
    np.testing.assert_allclose(found, np.arange(n) / float(rate), atol=1e-9)


def test_dropped_numbers_keep_to_the_time_of_day():
    for rate in (NTSC, DOUBLE):
        assert Timecode("12:00:00;00", float(rate)).seconds == pytest.approx(43200.0, abs=0.06)
    assert Timecode("12:00:00:00", float(NTSC)).seconds == pytest.approx(43243.2)


@pytest.mark.parametrize(("name", "label", "rate"), [("a.mov", "10:11:12:05", 25), ("b.mp4", "23:59:59;28", NTSC)])
def test_the_timecode_of_a_file(tmp_path, name, label, rate):
    found = read_timecode(write_timecoded(tmp_path / name, label, rate))
    assert found.label == label and found.rate_hz == found.counted_hz == pytest.approx(float(rate))


@pytest.mark.parametrize("name", ["a.mov", "b.mp4"])
def test_above_30_hz_the_file_says_whether_images_or_pairs_of_them_are_counted(tmp_path, name):
    images = read_timecode(write_timecoded(tmp_path / name, "01:00:00:55", DOUBLE))
    assert images.label == "01:00:00:55" and images.counted_hz == pytest.approx(float(DOUBLE))
    assert images.seconds == pytest.approx((3600 * 60 + 55) / float(DOUBLE))
    pairs = read_timecode(count_pairs(tmp_path / name, 3600 * 30 + 27))
    assert pairs.label == "01:00:00:27" and pairs.rate_hz == pytest.approx(float(DOUBLE))
    assert pairs.seconds == pytest.approx((3600 * 30 + 27) / float(NTSC))
    assert images.seconds - pairs.seconds == pytest.approx(1.0 / float(DOUBLE))  # the first or the second of the pair
    assert pairs.sigma_s == pytest.approx(2.0 * images.sigma_s) == pytest.approx(1001 / 30000 / 12**0.5)


def test_a_file_that_does_not_say_what_is_counted_is_less_sure():
    assert Timecode("01:00:00:24", 25.0).sigma_s == pytest.approx(0.04 / 12**0.5)  # no doubt up to 30
    assert Timecode("01:00:00:40", 60.0).sigma_s == pytest.approx(1 / 60 / 12**0.5)  # nor where the number tells
    doubtful = Timecode("01:00:00:24", 60.0)
    other = Timecode("01:00:00:24", 60.0, 30.0)
    assert doubtful.sigma_s * 12**0.5 > abs(doubtful.seconds - other.seconds) > 0.3


def test_what_has_no_timecode_is_named(tmp_path):
    bare, text = write_timecoded(tmp_path / "bare.mp4", None, 25), tmp_path / "text.mp4"
    text.write_text("no video")
    for path, expected, got in (
        (bare, "a timecode", "none"), (text, "a video", ""), (tmp_path / "gone.mov", "a video", "no such file"),
        (tmp_path, "a video", "a folder"),
    ):  # fmt: skip
        with pytest.raises(FileFormatError) as caught:
            read_timecode(path)
        assert caught.value.file == str(path) and expected in str(caught.value) and got in str(caught.value)
