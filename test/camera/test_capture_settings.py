"""What is asked of a source of images."""

import pytest

from tracker_node.camera.rig import CaptureSettings


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"pixel_format": "MJP"}, "a pixel format of four capitals or digits, got 'MJP'"),
        ({"pixel_format": "MJPGX"}, "a pixel format"),
        ({"pixel_format": "mjpg"}, "a pixel format"),
        ({"pixel_format": ""}, "a pixel format"),
        ({"rate_hz": 0.0}, "expected a positive rate_hz, got 0.0"),
        ({"rate_hz": -1.0}, "expected a positive rate_hz"),
        ({"rate_hz": 1e7}, "expected a positive rate_hz"),
        ({"exposure_us": 0.0}, "expected a positive exposure_us, got 0.0"),
        ({"exposure_us": 1e7}, "expected a positive exposure_us"),
        ({"exposure_us": float("nan")}, "expected a positive exposure_us, got nan"),
        ({"bayer": "rgbg"}, r"a Bayer pattern of .*'rggb'.*, got 'rgbg'"),
        ({"publish": "gray"}, r"one of .*'color', 'mono', 'native', 'jpeg'.* to publish, got 'gray'"),
    ],
)
def test_refusals(fields, said):
    with pytest.raises(ValueError, match=said):
        CaptureSettings(**fields)


def test_what_is_allowed():
    for text in ("MJPG", "Y16 ", "BA81"):
        assert CaptureSettings(pixel_format=text).pixel_format == text
    assert CaptureSettings(rate_hz=0.001, exposure_us=9_999_999.0).rate_hz == 0.001
    for publish in ("color", "mono", "native", "jpeg"):
        assert CaptureSettings(publish=publish).publish == publish
    assert CaptureSettings().publish == "color" and CaptureSettings().bayer is None


@pytest.mark.parametrize(
    ("text", "pattern"), [("RGGB", "rggb"), ("BA81", "bggr"), ("GBRG", "gbrg"), ("GRBG", "grbg"), ("GREY", None)]
)
def test_mosaics_by_their_pixel_format(text, pattern):
    assert CaptureSettings(pixel_format=text).bayer == pattern
    assert CaptureSettings(pixel_format=text, bayer="grbg").bayer == "grbg"  # what is said counts
    assert CaptureSettings(bayer="bggr").bayer == "bggr"


def test_what_only_a_device_can_do():
    assert CaptureSettings().of_device == ()
    assert CaptureSettings(rate_hz=5.0, publish="mono", bayer="rggb", camera_info_url="file:a").of_device == ()
    settings = CaptureSettings("MJPG", 5.0, 100.0, 0, {"focus": 1, "zoom": 2})
    assert settings.of_device == ("pixel_format", "exposure_us", "gain", "focus", "zoom")
