"""Small videos with a timecode, as cameras on a generator write them."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np


def write_timecoded(path: Path, timecode: str | None, rate: Fraction | int, n: int = 6) -> Path:
    """A gray video; None: without a timecode."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=rate)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        if timecode is not None:
            stream.metadata["timecode"] = timecode
        for i in range(n):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 30 + 20 * i, np.uint8), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path
