"""Damaged images, as bytes that arrive: each can be used, or is refused in words that name the camera; nothing else comes out."""

import random
import subprocess
import sys

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")

from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage

from tracker_node.errors import SourceError, TrackerError
from tracker_node.loaders.images.source import open_source
from tracker_node.ros.conversions import bgr_of_compressed, decode_raw_image, image_message

PIXELS = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
N = 1500


def damaged(content: bytes, rng: random.Random, within: int) -> bytes:
    """Some bytes changed, most of them among the first; often cut off."""
    result = bytearray(content)
    for _ in range(rng.randrange(1, 5)):
        at = rng.randrange(min(within, len(result))) if rng.random() < 0.8 else rng.randrange(len(result))
        result[at] = rng.randrange(256)
    return bytes(result[: rng.randrange(len(result))] if rng.random() < 0.3 else result)


@pytest.mark.parametrize("encoding", ["bgr8", "mono8"])
def test_raw_images(encoding):
    rng, refused = random.Random(encoding), 0
    message = image_message(5, "frame", PIXELS if encoding == "bgr8" else PIXELS[..., 0], encoding)
    content = bytes(serialize_message(message))
    for _ in range(N):
        try:
            image = decode_raw_image("left", damaged(content, rng, 80))
            assert image.pixels.size > 0
            image.pixels.max()  # all of it can be read
        except SourceError as error:
            refused += 1
            assert "left" in str(error)
    assert 0.3 * N < refused < N


@pytest.mark.parametrize(("kind", "n_kept"), [(".jpg", 0), (".png", 33)])  # sizes of PNG are for the test below
def test_compressed_images(kind, n_kept):
    rng, refused = random.Random(kind), 0
    content = cv2.imencode(kind, PIXELS)[1].tobytes()
    for _ in range(N // 3):
        try:
            spoilt = content[:n_kept] + damaged(content[n_kept:], rng, 700)
            image = bgr_of_compressed("left", CompressedImage(format="jpeg", data=spoilt))
            assert image.pixels.ndim == 3
        except SourceError as error:
            refused += 1
            assert "left" in str(error)
    assert refused > 0.3 * N // 3


@pytest.mark.parametrize("side", [65500, 30000])
def test_a_jpeg_that_claims_to_be_huge(side):
    """In a process of its own: what OpenCV may read is decided when it is loaded."""
    content = bytearray(cv2.imencode(".jpg", PIXELS)[1].tobytes())
    frame = content.index(b"\xff\xc0")
    content[frame + 5 : frame + 9] = side.to_bytes(2, "big") * 2
    program = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))\n"
        "from tracker_node.ros.conversions import bgr_of_compressed\nfrom tracker_node.errors import SourceError\n"
        "from sensor_msgs.msg import CompressedImage\n"
        "try:\n    bgr_of_compressed('left', CompressedImage(data=sys.stdin.buffer.read()))\n"
        "except SourceError as error:\n    print(error)\n"
    )
    answer = subprocess.run([sys.executable, "-c", program], input=bytes(content), capture_output=True, timeout=60)
    assert answer.returncode == 0, answer.stderr.decode()[-500:]
    assert b"'left': cannot decode" in answer.stdout


@pytest.mark.parametrize("suffix", ["mp4", "avi"])
def test_video_files_that_are_cut_off_or_spoilt(suffix, tmp_path):
    """They give the images that can be read, or say what is wrong; the source is named."""
    whole = tmp_path / f"whole.{suffix}"
    writer = cv2.VideoWriter(str(whole), cv2.VideoWriter.fourcc(*("mp4v" if suffix == "mp4" else "MJPG")), 30.0, (64, 48))
    for i in range(20):
        writer.write(np.roll(PIXELS, i, axis=1))
    writer.release()
    rng, content, refused = random.Random(suffix), whole.read_bytes(), 0
    for _ in range(40):
        path = tmp_path / f"damaged.{suffix}"
        path.write_bytes(damaged(content, rng, 400))
        try:
            images = [image for _, image in open_source(path)]
            assert all(image is None or image.ndim == 3 for image in images)
        except TrackerError as error:
            refused += 1
            assert str(path) in str(error)
    assert refused > 3
