"""What becomes of an image between its source and its publication: colors, sizes, JPEG."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tracker_node.camera.rig import CaptureSettings
from tracker_node.errors import SourceError
from tracker_node.loaders.decoding import Preparation, decode_jpeg, decoded_message, is_plain_jpeg, jpeg_size
from tracker_node.loaders.images.source import SourceOptions, open_source

WIDTH, HEIGHT = 64, 48
CHANNEL = {"b": 0, "g": 1, "r": 2}


def picture(phase: float = 0.0) -> np.ndarray:
    """Smooth colors, each channel its own."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    channels = [128 + 90 * np.sin(0.05 * u * (k + 1) + 0.04 * v + phase + k) for k in range(3)]
    return np.stack(channels, axis=2).astype(np.uint8)


def mosaic(image: np.ndarray, pattern: str) -> np.ndarray:
    """What a sensor behind such a filter measures; pattern: colors of the first two lines."""
    result = np.empty(image.shape[:2], np.uint8)
    for k, color in enumerate(pattern):
        result[k // 2 :: 2, k % 2 :: 2] = image[k // 2 :: 2, k % 2 :: 2, CHANNEL[color]]
    return result


def jpeg(image: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()


def write(folder: Path, images: list[np.ndarray], suffix: str = ".png") -> Path:
    folder.mkdir()
    for i, image in enumerate(images):
        cv2.imwrite(str(folder / f"{i}{suffix}"), image)
    return folder


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_a_mosaic_becomes_the_colors_it_was_made_from(tmp_path: Path, pattern: str):
    truth = picture()
    folder = write(tmp_path / "a", [mosaic(truth, pattern)])
    (_, bgr), *_ = open_source(folder, capture=CaptureSettings(bayer=pattern))
    assert np.abs(bgr[2:-2, 2:-2].astype(int) - truth[2:-2, 2:-2]).max() <= 12
    (native,) = open_source(folder, capture=CaptureSettings(bayer=pattern, publish="native")).images()
    assert native.encoding == f"bayer_{pattern}8" and np.array_equal(native.pixels, mosaic(truth, pattern))
    assert np.array_equal(native.bgr, bgr)


def test_a_mosaic_halved_is_the_picture_halved(tmp_path: Path):
    truth = picture()
    folder = write(tmp_path / "a", [mosaic(truth, "rggb")])
    (_, small), *_ = open_source(folder, shrink=2, capture=CaptureSettings(bayer="rggb"))
    expected = truth.reshape(HEIGHT // 2, 2, WIDTH // 2, 2, 3).mean(axis=(1, 3))
    assert np.abs(small[2:-2, 2:-2] - expected[2:-2, 2:-2]).max() <= 6


def test_shrinking_is_area_averaging(tmp_path: Path):
    folder = write(tmp_path / "a", [picture()])
    source = open_source(folder, shrink=4)
    assert (source.width, source.height) == (WIDTH // 4, HEIGHT // 4)
    (_, small), *_ = source
    expected = picture().reshape(HEIGHT // 4, 4, WIDTH // 4, 4, 3).mean(axis=(1, 3))
    assert np.abs(small - expected).max() <= 0.51


@pytest.mark.parametrize("factor", [2, 4, 8])
def test_a_jpeg_is_decoded_at_the_smaller_size_in_the_same_place(factor: int):
    """Also with sizes that the decoder cannot halve exactly, which are resampled."""
    truth = cv2.GaussianBlur(picture(), (0, 0), 2.0)
    size = (WIDTH // factor, HEIGHT // factor)
    small = decode_jpeg(jpeg(truth), size)
    expected = truth.reshape(HEIGHT // factor, factor, WIDTH // factor, factor, 3).mean(axis=(1, 3))
    assert small.shape == (size[1], size[0], 3)
    assert np.abs(small[1:-1, 1:-1] - expected[1:-1, 1:-1]).max() <= 5
    assert decode_jpeg(jpeg(truth[:, :-1]), (31, 24)).shape == (24, 31, 3)


def test_mono(tmp_path: Path):
    gray = cv2.cvtColor(picture(), cv2.COLOR_BGR2GRAY)
    folder = write(tmp_path / "a", [gray])
    (image,) = open_source(folder, capture=CaptureSettings(publish="mono")).images()
    assert image.encoding == "mono8" and np.array_equal(image.pixels, gray)
    (image,) = open_source(folder, capture=CaptureSettings(publish="native")).images()
    assert image.encoding == "mono8" and np.array_equal(image.pixels, gray)
    (_, bgr), *_ = open_source(folder)
    assert np.array_equal(bgr, np.dstack([gray] * 3))


@pytest.mark.parametrize("kind", ["folder", "video"])
def test_jpeg_images_are_passed_on_as_they_are(tmp_path: Path, kind: str):
    if kind == "folder":
        path = write(tmp_path / "a", [picture(p) for p in (0.0, 0.5, 1.0)], ".jpg")
        expected = [(path / f"{i}.jpg").read_bytes() for i in range(3)]
    else:
        path = tmp_path / "a.avi"
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25.0, (WIDTH, HEIGHT))
        for p in (0.0, 0.5, 1.0):
            writer.write(picture(p))
        writer.release()
        file = path.read_bytes()
        expected = None
    images = list(open_source(path, capture=CaptureSettings(publish="jpeg")).images())
    assert [image.encoding for image in images] == ["jpeg"] * 3 and all(image.pixels is None for image in images)
    if expected is not None:
        assert [image.jpeg for image in images] == expected
    else:
        assert all(image.jpeg in file for image in images)
    for p, image in zip((0.0, 0.5, 1.0), images, strict=True):
        assert jpeg_size(image.jpeg) == (WIDTH, HEIGHT)
        assert np.abs(image.bgr.astype(int) - picture(p)).mean() < 4


def test_what_is_no_jpeg_is_not_passed_on(tmp_path: Path):
    path = write(tmp_path / "a", [picture()])
    with pytest.raises(SourceError, match=r"no frame header|does not give JPEG"):
        list(open_source(path, capture=CaptureSettings(publish="jpeg")).images())
    video = tmp_path / "a.mp4"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter_fourcc(*"mp4v"), 25.0, (WIDTH, HEIGHT))
    writer.write(picture())
    writer.release()
    with pytest.raises(SourceError, match="no video of JPEG images"):
        list(open_source(video, capture=CaptureSettings(publish="jpeg")).images())


@pytest.mark.parametrize("settings", [{"publish": "jpeg"}, {"publish": "native", "bayer": "rggb"}])
def test_what_cannot_be_resampled_is_said(settings: dict):
    with pytest.raises(SourceError, match="cannot be resampled"):
        Preparation(CaptureSettings(**settings), (10, 10), "cam1")


def test_damaged_jpeg():
    data = jpeg(picture())
    for cut in (b"", data[:3], data[:20], b"\x89PNG" + data):
        with pytest.raises(SourceError, match="no frame header"):
            jpeg_size(cut)


@pytest.mark.parametrize("name", ["a.mp4", "a.png", "images"])
def test_a_file_that_is_not_what_its_name_says(tmp_path: Path, name: str):
    """A picture called a video, a video called a picture, text in a folder of pictures."""
    target = tmp_path / name
    if name == "images":
        target.mkdir()
        (target / "0.png").write_text("not a picture")
    elif name == "a.mp4":
        target.write_bytes(b"<html>not found</html>" * 50)
    else:
        target.write_bytes(b"\0" * 5000)
    with pytest.raises(SourceError, match=r"cannot be|can be read"):
        open_source(target, SourceOptions())


def test_compressed_mosaics_have_their_colors_and_images_lie_as_in_the_file():
    colors = np.full((8, 8, 3), (200, 30, 90), np.uint8)
    mosaic = np.empty((8, 8), np.uint8)  # rggb, of BGR colors
    mosaic[0::2, 0::2], mosaic[1::2, 1::2] = colors[0::2, 0::2, 2], colors[1::2, 1::2, 0]
    mosaic[0::2, 1::2], mosaic[1::2, 0::2] = colors[0::2, 1::2, 1], colors[1::2, 0::2, 1]
    png = cv2.imencode(".png", mosaic)[1].tobytes()
    found = decoded_message(png, "bayer_rggb8; png compressed ")
    np.testing.assert_array_equal(found[2:6, 2:6], colors[2:6, 2:6])
    np.testing.assert_array_equal(decoded_message(png, "mono8; png compressed "), np.repeat(mosaic[..., None], 3, axis=2))
    gray = cv2.imencode(".jpg", mosaic)[1].tobytes()
    assert is_plain_jpeg(gray, "mono8; jpeg compressed") and not is_plain_jpeg(gray, "bayer_rggb8; jpeg compressed")
    assert not is_plain_jpeg(png, "mono8; jpeg compressed")
    already = cv2.imencode(".png", colors)[1].tobytes()
    np.testing.assert_array_equal(decoded_message(already, "bayer_rggb8; png compressed bgr8"), colors)
    assert decoded_message(b"nonsense", "jpeg") is None
    wide = np.random.default_rng(0).integers(0, 255, (16, 32, 3), np.uint8)
    jpeg = cv2.imencode(".jpg", wide)[1].tobytes()
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"  # orientation 6: held on its side
    held = jpeg[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + jpeg[2:]
    assert cv2.imdecode(np.frombuffer(held, np.uint8), cv2.IMREAD_COLOR).shape == (32, 16, 3)
    np.testing.assert_array_equal(decoded_message(held, "jpeg"), decode_jpeg(jpeg))
