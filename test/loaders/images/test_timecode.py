"""Timecode: labels against counted images, and files with and without."""

from fractions import Fraction

import numpy as np
import pytest

from helpers.sources.timecoded_video import write_timecoded
from tracker_node.errors import FileFormatError
from tracker_node.loaders.images.timecode import Timecode, read_timecode

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
    assert found.label == label and found.rate_hz == pytest.approx(float(rate))


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
