"""Sound tracks of videos, and sound files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import FileFormatError, extra_module


@dataclass(frozen=True, eq=False)
class SoundTrack:
    """The sound of a file, all channels together.

    Attributes
    ----------
    rate_hz : of the samples.
    after_images_s : of the first sample, seconds after the first image of the same file; 0 in a file without images.
    samples : (n,) float32.
    """

    rate_hz: float
    after_images_s: float
    samples: np.ndarray


def read_sound(path: str | Path, seconds: float = 60.0) -> SoundTrack:
    """The beginning of a sound track. How it stands to the images of its file is taken as the file says.

    Parameters
    ----------
    path, seconds : a video or a sound file; how much of it is read.

    Returns
    -------
    The sound.

    Raises
    ------
    FileFormatError : no such file, or none with sound.
    MissingExtraError : the extra ``sound`` is not installed.
    """
    av = extra_module("av", "sound")
    if not Path(path).is_file():
        raise FileFormatError(path, "(file)", "a video or a sound file", "a folder" if Path(path).is_dir() else "no such file")
    try:
        with av.open(str(path)) as container:
            if not container.streams.audio:
                raise FileFormatError(path, "(content)", "a sound track", "none")
            stream = container.streams.audio[0]
            images_s = _start_s(container.streams.video[0]) if container.streams.video else None
            first_s, parts, n = None, [], 0
            for frame in container.decode(stream):
                first_s = float(frame.pts * frame.time_base) if first_s is None and frame.pts is not None else first_s
                values = frame.to_ndarray()
                loudest = np.iinfo(values.dtype).max if np.issubdtype(values.dtype, np.integer) else 1.0
                values = values.astype(np.float32) / loudest
                channels = max(frame.layout.nb_channels, 1)
                values = values.mean(axis=0) if values.shape[0] > 1 else values.reshape(-1, channels).mean(axis=1)
                parts.append(values)
                n += len(values)
                if n >= seconds * stream.rate:
                    break
    except (av.error.FFmpegError, OSError) as error:
        raise FileFormatError(path, "(content)", "a video or a sound file that can be decoded", str(error)) from None
    if not parts:
        raise FileFormatError(path, "(content)", "a sound track", "an empty one")
    after = (first_s or 0.0) - (images_s if images_s is not None else first_s or 0.0)
    return SoundTrack(float(stream.rate), after, np.concatenate(parts).astype(np.float32))


def _start_s(stream) -> float:
    return float((stream.start_time or 0) * stream.time_base)
