"""Videos of a variable frame rate for tests: an MP4 file of OpenCV with other times in its container."""

import struct
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

_PARENTS = (b"moov", b"trak", b"mdia", b"minf", b"stbl")


def write_video(path: Path, images: Sequence[np.ndarray], rate_hz: float = 30.0) -> Path:
    """An MP4 file at a constant rate."""
    height, width = images[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), rate_hz, (width, height))
    assert writer.isOpened()
    for image in images:
        writer.write(image)
    writer.release()
    return path


def set_times(path: Path, times_s: Sequence[float]) -> None:
    """Give each image of an MP4 file a time of its own: the table of durations (``stts``) is replaced by one line an image."""
    data = path.read_bytes()
    assert data.index(b"mdat") < data.index(b"moov")  # otherwise places of images would have to be changed, too
    scale = struct.unpack_from(">I", data, data.index(b"mdhd") + 4 + 12)[0]
    ticks = np.round(np.array(times_s) * scale).astype(int)
    steps = [*np.diff(ticks), int(np.median(np.diff(ticks)))]
    at = data.index(b"stts") - 4
    (size,) = struct.unpack_from(">I", data, at)
    table = b"".join(struct.pack(">II", 1, int(step)) for step in steps)
    box = struct.pack(">I4sII", 16 + len(table), b"stts", 0, len(steps)) + table
    changed = bytearray(data[:at] + box + data[at + size :])
    for name in _PARENTS:
        place = data.index(name) - 4
        assert place < at
        (old,) = struct.unpack_from(">I", changed, place)
        struct.pack_into(">I", changed, place, old + len(box) - size)
    _set_durations(changed, sum(steps) / scale)
    path.write_bytes(bytes(changed))


def _set_durations(data: bytearray, seconds: float) -> None:
    """Of the film, the track, its media and its edit list: what is beyond is not shown."""
    scale = struct.unpack_from(">I", data, data.index(b"mvhd") + 16)[0]
    own_scale = struct.unpack_from(">I", data, data.index(b"mdhd") + 16)[0]
    for name, offset, per_s in ((b"mvhd", 20, scale), (b"tkhd", 24, scale), (b"mdhd", 20, own_scale), (b"elst", 12, scale)):
        struct.pack_into(">I", data, data.index(name) + offset, round(seconds * per_s))
