"""What phones write beside plain images: 59.94 Hz, and a turn that whoever shows the video has to make."""

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from tracker_node.loaders.images.source import open_source

RATE = Fraction(60000, 1001)
TURNS = {90: (0, 1, -1, 0), 180: (-1, 0, 0, -1), 270: (0, -1, 1, 0)}


def write(path: Path, turn_deg: int = 0) -> Path:
    """Images of 96 x 64 whose upper left quarter is white, with a turn (clockwise) in the header of their track."""
    image = np.full((64, 96, 3), 20, np.uint8)
    image[:32, :48] = 235
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=RATE)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        for _ in range(12):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode(None))
    if turn_deg:
        data = bytearray(path.read_bytes())
        a, b, c, d = (part << 16 for part in TURNS[turn_deg])
        place = data.index(b"tkhd") + 44  # the matrix, behind version, times, number, duration, layer and volume
        struct.pack_into(">9i", data, place, a, b, 0, c, d, 0, 0, 0, 1 << 30)
        path.write_bytes(bytes(data))
    return path


@pytest.mark.parametrize("name", ["a.mp4", "a.mov"])
def test_times_at_59_94_hz(tmp_path, name):
    source = open_source(write(tmp_path / name))
    stamps = [stamp_ns for stamp_ns, _ in source]
    assert source.rate_hz == pytest.approx(float(RATE), rel=1e-9)
    assert np.abs(np.array(stamps) - np.arange(12) * 1e9 / float(RATE)).max() <= 1.0  # ns


@pytest.mark.parametrize(("turn_deg", "white"), [(0, (0, 0)), (90, (0, 1)), (180, (1, 1)), (270, (1, 0))])
def test_images_stand_as_the_phone_was_held(tmp_path, turn_deg, white):
    """``white``: row and column of the white quarter, which a turn clockwise moves from the upper left to the upper right."""
    source = open_source(write(tmp_path / "a.mp4", turn_deg))
    _, image = next(iter(source))
    height, width = (64, 96) if turn_deg % 180 == 0 else (96, 64)
    assert image.shape == (height, width, 3) and (source.native_width, source.native_height) == (width, height)
    quarters = image.mean(axis=2).reshape(2, height // 2, 2, width // 2).mean(axis=(1, 3))
    assert np.unravel_index(quarters.argmax(), (2, 2)) == white and quarters.max() > 200 > 60 > np.sort(quarters.ravel())[-2]
