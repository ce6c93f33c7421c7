"""Small videos with a timecode, as cameras on a generator write them."""

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np


def write_timecoded(
    path: Path, timecode: str | None, rate: Fraction | int, n: int = 6, size: tuple[int, int] = (64, 48)
) -> Path:  # fmt: skip
    """A gray video of this width and height; None: without a timecode."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=rate)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        if timecode is not None:
            stream.metadata["timecode"] = timecode
        for i in range(n):
            frame = av.VideoFrame.from_ndarray(np.full((*size[::-1], 3), 30 + 20 * i, np.uint8), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def count_pairs(path: Path, frames: int) -> Path:
    """Make a video of 59.94 Hz that numbers every image one that numbers pairs of them, of which ``frames`` have passed.

    Some cameras do that (SMPTE ST 12-1 ends at 30 a second); the libraries here write the former alone.
    """
    data, counted = path.read_bytes(), struct.pack(">IIB", 60000, 1001, 60)
    assert data.count(counted) == 1
    data = data.replace(counted, struct.pack(">IIB", 30000, 1001, 30))
    described = data.index(struct.pack(">IIB", 30000, 1001, 30))
    (place,) = struct.unpack_from(">I", data, data.index(b"stco", described) + 12)  # of the one sample of its track
    path.write_bytes(data[:place] + struct.pack(">I", frames) + data[place + 4 :])
    return path
