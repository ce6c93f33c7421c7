"""Images there and back, also straight from the serialized bytes that a raw subscription gives."""

import contextlib
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CompressedImage, Image

from tracker_node.errors import SourceError
from tracker_node.ros.conversions import (
    ImageBuffer,
    bgr_of_compressed,
    camera_image_of,
    decode_raw_image,
    image_message,
    jpeg_message,
    stamp_message,
    stamp_ns_of,
)
from tracker_node.runs.messages import jpeg_of


def noise(height: int, width: int, encoding: str, seed: int = 0) -> np.ndarray:
    shape = (height, width) if encoding == "mono8" else (height, width, 3)
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


@given(st.integers(-(2**31) * 10**9, (2**31 - 1) * 10**9))
def test_stamps_there_and_back(stamp_ns: int):
    assert stamp_ns_of(stamp_message(stamp_ns)) == stamp_ns


@pytest.mark.parametrize("encoding", ["bgr8", "rgb8", "mono8"])
def test_there_and_back(encoding: str):
    pixels = noise(7, 5, encoding)
    image = camera_image_of("left", image_message(12_000_000_034, "left_optical_frame", pixels, encoding))
    assert (image.camera, image.stamp_ns, image.encoding) == ("left", 12_000_000_034, encoding)
    assert np.array_equal(image.pixels, pixels)


@pytest.mark.parametrize("encoding", ["bgr8", "mono8"])
@pytest.mark.parametrize("frame_id", ["", "a", "ab", "abc", "abcd", "left_optical_frame"])  # every alignment
def test_serialized_there_and_back(encoding: str, frame_id: str):
    pixels = noise(6, 9, encoding)
    data = serialize_message(image_message(-5, frame_id, pixels, encoding))
    image = decode_raw_image("left", data)
    assert (image.stamp_ns, image.encoding) == (-5, encoding)
    assert np.array_equal(image.pixels, pixels)
    assert not image.pixels.flags.owndata and not image.pixels.flags.writeable


def test_big_endian():
    pixels = noise(2, 3, "mono8")
    body = struct.pack(">iI", 7, 8) + struct.pack(">I", 2) + b"f\0" + b"\0\0"
    body += struct.pack(">II", 2, 3) + struct.pack(">I", 6) + b"mono8\0" + b"\0" + b"\0"
    body += struct.pack(">II", 3, 6) + pixels.tobytes()
    image = decode_raw_image("left", b"\x00\x00\x00\x00" + body)
    assert image.stamp_ns == 7_000_000_008 and np.array_equal(image.pixels, pixels)


@pytest.mark.parametrize("encoding", ["bgr8", "mono8"])
def test_padded_rows_become_as_others(encoding: str):
    """Compiled code is made for contiguous images that are not changed: other kinds would be compiled in the middle of a run."""
    pixels = noise(4, 5, encoding)
    width = pixels.reshape(4, -1).shape[1]
    rows = np.full((4, 20), 99, np.uint8)
    rows[:, :width] = pixels.reshape(4, width)
    message = Image(height=4, width=5, encoding=encoding, step=20, data=rows.tobytes())
    packed = Image(height=4, width=5, encoding=encoding, step=width, data=pixels.tobytes())
    for padded, other in (
        (camera_image_of("left", message), camera_image_of("left", packed)),
        (decode_raw_image("left", serialize_message(message)), decode_raw_image("left", serialize_message(packed))),
    ):
        assert np.array_equal(padded.pixels, pixels) and not padded.pixels.flags.writeable
        assert padded.pixels.flags.c_contiguous and other.pixels.flags.c_contiguous


ACROSS, DOWN = np.meshgrid(np.linspace(20, 220, 12), np.linspace(60, 180, 8))
SMOOTH = np.dstack([ACROSS, DOWN, np.full((8, 12), 90.0)]).astype(np.uint8)
GRAY = SMOOTH[:, :, 0]


def mosaic(pattern: str) -> np.ndarray:
    result = np.empty(GRAY.shape, np.uint8)
    for k, color in enumerate(pattern):
        result[k // 2 :: 2, k % 2 :: 2] = SMOOTH[k // 2 :: 2, k % 2 :: 2, "bgr".index(color)]
    return result


def paired(order: str) -> np.ndarray:
    """Y, U and V of pairs of pixels in this order of bytes (ITU-R BT.601)."""
    blue, green, red = (SMOOTH[:, :, k].astype(float) for k in range(3))
    y = 16.0 + (65.738 * red + 129.057 * green + 25.064 * blue) / 256.0
    u = 128.0 + (-37.945 * red - 74.494 * green + 112.439 * blue) / 256.0
    v = 128.0 + (112.439 * red - 94.154 * green - 18.285 * blue) / 256.0
    parts = {"0": y[:, ::2], "1": y[:, 1::2], "u": 0.5 * (u[:, ::2] + u[:, 1::2]), "v": 0.5 * (v[:, ::2] + v[:, 1::2])}
    return np.rint(np.stack([parts[each] for each in order], axis=2)).astype(np.uint8)


def wide(pixels: np.ndarray, order: str = "<") -> np.ndarray:
    return (pixels.astype(np.uint16) * 257).astype(f"{order}u2")


@pytest.mark.parametrize(
    ("encoding", "sent", "got", "off"),
    [
        ("bgra8", np.dstack([SMOOTH, GRAY]), SMOOTH, 0),
        ("8UC4", np.dstack([SMOOTH, GRAY]), SMOOTH, 0),
        ("rgba8", np.dstack([SMOOTH[:, :, ::-1], GRAY]), SMOOTH, 0),
        ("yuv422", paired("u0v1"), SMOOTH, 12),
        ("uyvy", paired("u0v1"), SMOOTH, 12),
        ("yuv422_yuy2", paired("0u1v"), SMOOTH, 12),
        ("mono16", wide(GRAY), GRAY, 0),
        ("bgr16", wide(SMOOTH), SMOOTH, 0),
        ("rgb16", wide(SMOOTH[:, :, ::-1]), SMOOTH, 0),
        *((f"bayer_{pattern}8", mosaic(pattern), SMOOTH, 20) for pattern in ("rggb", "bggr", "gbrg", "grbg")),
        ("bayer_gbrg16", wide(mosaic("gbrg")), SMOOTH, 20),
    ],
)
@pytest.mark.parametrize("padding", [0, 6])
def test_what_other_cameras_send_is_converted(encoding: str, sent: np.ndarray, got: np.ndarray, off: int, padding: int):
    """Colors between the pixels of a mosaic, or of a pair, are guessed: off at the borders."""
    rows = np.pad(np.frombuffer(sent.tobytes(), np.uint8).reshape(8, -1), ((0, 0), (0, padding)))
    message = Image(height=8, width=12, encoding=encoding, step=rows.shape[1], data=rows.tobytes())
    for image in (camera_image_of("left", message), decode_raw_image("left", serialize_message(message))):
        assert image.encoding == ("mono8" if encoding == "mono16" else "bgr8")
        assert np.abs(image.pixels.astype(int) - got)[2:-2, 2:-2].max() <= off
        assert image.pixels.flags.c_contiguous and not image.pixels.flags.writeable


def test_the_order_of_bytes_of_wide_numbers_is_that_of_the_message():
    data = wide(GRAY, ">").tobytes()
    message = Image(height=8, width=12, encoding="mono16", is_bigendian=1, step=24, data=data)
    for image in (camera_image_of("left", message), decode_raw_image("left", serialize_message(message))):
        assert np.array_equal(image.pixels, GRAY)


def test_twelve_bits_in_the_lower_ones_are_named():
    """Nothing would be seen in an image that is nearly black."""
    data = (GRAY.astype("<u2") << 4).tobytes()
    message = Image(height=GRAY.shape[0], width=GRAY.shape[1], encoding="mono16", step=2 * GRAY.shape[1], data=data)
    with pytest.raises(SourceError, match="none above 4095: 12 bits"):
        camera_image_of("left", message)


def test_half_a_pair_is_refused():
    message = Image(height=2, width=3, encoding="yuv422", step=6, data=bytes(12))
    with pytest.raises(SourceError, match=r"left.*yuv422 of 3x2 pixels cannot be converted"):
        camera_image_of("left", message)


def test_a_long_encoding_is_not_quoted_whole():
    message = Image(height=1, width=1, encoding="x" * 3000, step=3, data=b"123")
    with pytest.raises(SourceError, match="image encoding: expected one of") as refused:
        decode_raw_image("left", serialize_message(message))
    assert len(str(refused.value)) < 600


def test_buffer_is_used_again():
    buffer = ImageBuffer("f", 5, 4)
    first = buffer.fill(1, noise(4, 5, "bgr8", 1))
    second = buffer.fill(2, noise(4, 5, "bgr8", 2))
    assert first is second
    received = deserialize_message(serialize_message(second), Image)
    assert np.array_equal(camera_image_of("c", received).pixels, noise(4, 5, "bgr8", 2))
    with pytest.raises(ValueError, match="expected uint8 pixels"):
        buffer.fill(3, noise(5, 4, "bgr8"))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"encoding": "16UC1"}, "16UC1"),
        ({"step": 3}, "contradicts itself"),
        ({"height": 400}, "contradicts itself"),
        ({"height": 0}, "contradicts itself"),
    ],
)
def test_unusable_images_are_named(change: dict, named: str):
    message = image_message(0, "f", noise(4, 5, "bgr8"))
    for field, value in change.items():
        setattr(message, field, value)
    for image in (lambda: camera_image_of("left", message), lambda: decode_raw_image("left", serialize_message(message))):
        with pytest.raises(SourceError, match=f"left.*{named}"):
            image()


@given(st.integers(0, 200))
def test_truncated_bytes_never_crash(length: int):
    data = serialize_message(image_message(0, "frame", noise(4, 5, "bgr8")))
    whole = 4 + 4 * 5 * 3 + 52
    if length < whole - 8:
        with pytest.raises(SourceError):
            decode_raw_image("left", data[:length])


@given(st.binary(max_size=120))
def test_noise_never_crashes(data: bytes):
    with contextlib.suppress(SourceError):
        decode_raw_image("left", data)


def test_compressed():
    smooth = np.full((48, 64, 3), (30, 120, 220), np.uint8)
    message = jpeg_message(77, "f", jpeg_of(smooth))
    assert "jpeg" in message.format
    image = bgr_of_compressed("left", message)
    assert image.stamp_ns == 77 and np.abs(image.pixels.astype(int) - smooth).max() <= 3
    with pytest.raises(SourceError, match="left"):
        bgr_of_compressed("left", CompressedImage(format="jpeg", data=b"nonsense"))
    with pytest.raises(SourceError, match="left"):
        bgr_of_compressed("left", CompressedImage(format="jpeg"))


def test_a_stamp_that_is_none_is_refused():
    message = image_message(5, "f", noise(2, 2, "mono8"), "mono8")
    message.header.stamp.nanosec = 4_000_000_000
    jpeg = jpeg_message(5, "f", jpeg_of(noise(8, 8, "bgr8")))
    jpeg.header.stamp.nanosec = 10**9
    for read in (
        lambda: camera_image_of("left", message),
        lambda: decode_raw_image("left", serialize_message(message)),
        lambda: bgr_of_compressed("left", jpeg),
    ):
        with pytest.raises(SourceError, match=r"left.*header.stamp.nanosec: expected less than 1000000000, got"):
            read()
