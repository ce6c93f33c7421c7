"""Network streams on the loopback: RTSP, UDP and HTTP, through OpenCV, broken off and connected to again."""

import itertools
import socket
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from helpers.ros.processes import wait_until
from helpers.sources.mjpeg_server import MjpegServer, number_of
from helpers.sources.stream_servers import HEIGHT, WIDTH, RtspServer, UdpServer, write_stream
from tracker_node.errors import SourceError
from tracker_node.loaders.decoding import decode_jpeg
from tracker_node.loaders.images.live_capture import LiveSource, StreamCapture


@pytest.fixture(scope="module")
def stream(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write_stream(tmp_path_factory.mktemp("stream") / "camera.ts")


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@pytest.mark.parametrize(
    "serve", [RtspServer, lambda stream, port=0: UdpServer(stream, port or free_port())], ids=["rtsp", "udp"]
)
def test_a_stream_breaks_and_comes_back(stream: bytes, serve: Callable):
    server, images = serve(stream), []
    source = LiveSource(lambda: StreamCapture(server.url, 1), retry_s=(0.05, 0.2))
    reader = threading.Thread(target=lambda: images.extend(source), daemon=True)
    reader.start()
    wait_until(lambda: source.connection.received >= 10)
    server.close()
    wait_until(lambda: not source.connection.connected)
    assert "no more images" in source.connection.problem or "no answer" in source.connection.problem
    n = source.connection.received
    again = serve(stream, int(server.url.rpartition(":")[2].partition("/")[0]))
    wait_until(lambda: source.connection.received >= n + 10)
    assert source.connection.connected and source.connection.times == 2
    source.close()
    reader.join(timeout=20.0)
    again.close()
    assert all(image.shape == (HEIGHT, WIDTH, 3) for _, image in images)
    levels = [image.mean() for _, image in images]
    forward = [0.0 < b - a < 6.0 for a, b in itertools.pairwise(levels)]
    assert sum(forward) >= len(forward) - 2, levels  # one after the other, but where it began anew
    assert [stamp for stamp, _ in images] == sorted({stamp for stamp, _ in images})


def test_the_first_images_are_not_those_that_were_stored_while_it_was_opened():
    """Numbers of images that follow each other in time; those before were read to find out what the stream is."""
    server = MjpegServer(rate_hz=30.0)
    capture = StreamCapture(server.url, 1)
    numbers = [number_of(decode_jpeg(capture.read()[1])) for _ in range(5)]
    capture.close()
    server.close()
    assert [(b - a) % 20 for a, b in itertools.pairwise(numbers)] == [1, 1, 1, 1]
    assert numbers[0] > 0


@pytest.mark.parametrize("url", ["http://127.0.0.1:9/", "rtsp://127.0.0.1:9/camera"])
def test_nobody_there(url: str):
    with pytest.raises(SourceError, match="no answer, or no video"):
        StreamCapture(url, 1)


def test_a_password_stays_out_of_the_message():
    with pytest.raises(SourceError) as caught:
        StreamCapture("rtsp://admin:s3cret@127.0.0.1:9/camera", 1)
    assert "rtsp://***@127.0.0.1:9/camera" in str(caught.value) and "s3cret" not in str(caught.value)


def test_a_page_that_is_no_video(tmp_path: Path):
    server = MjpegServer(lambda i: b"<html>" + bytes(np.zeros(2000, np.uint8)), rate_hz=200.0)
    source = LiveSource(lambda: StreamCapture(server.url, 1), retry_s=(0.05, 0.2))
    for _, content in source:
        with pytest.raises(SourceError, match="no frame header"):
            decode_jpeg(content)
        source.close()
    server.close()
