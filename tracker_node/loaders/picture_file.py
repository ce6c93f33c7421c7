"""Pictures that other files ask for, such as the textures of a model."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np

from ..errors import FileFormatError
from .decoding import decoded
from .limited_file import MEDIA_BYTES, read_bytes


def read_picture(file: str | Path, referrer: str | Path, field: str) -> np.ndarray:
    """Picture (h, w, 3) uint8 RGB; a gray one is read as gray RGB.

    Raises
    ------
    FileFormatError : naming ``referrer`` and ``field``, where the file is asked for.
    """
    file = Path(file)
    if not os.path.isfile(file):  # Path.is_file raises for a name that is too long
        raise FileFormatError(referrer, field, "an existing picture", str(file))
    picture = decoded(read_bytes(file, MEDIA_BYTES), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise FileFormatError(referrer, field, "a readable picture (PNG, JPEG, ...)", str(file))
    if picture.ndim == 2:
        picture = np.repeat(picture[:, :, None], 3, axis=2)
    if picture.dtype != np.uint8 or picture.shape[2] != 3:
        got = f"{picture.shape[2]} channels of {8 * picture.dtype.itemsize} bits in {file}"
        raise FileFormatError(referrer, field, "a picture of 1 or 3 channels of 8 bits", got)
    return np.ascontiguousarray(picture[:, :, ::-1])


def write_picture(picture: np.ndarray, file: str | Path) -> None:
    """Write (h, w, 3) uint8 RGB without loss, as PNG."""
    ok, encoded = cv2.imencode(".png", np.ascontiguousarray(picture[:, :, ::-1]))
    if not ok:
        raise ValueError(f"expected a picture that PNG can hold, got {picture.shape}")
    Path(file).write_bytes(encoded.tobytes())
