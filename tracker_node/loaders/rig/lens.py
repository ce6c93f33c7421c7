"""Cameras of other programs' calibrations: names, lenses and poses, with the same checks for all formats.

Every function takes the file and the field for its messages.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...camera.model import CameraModel, plausible
from ...camera.rig import Camera, CameraRig
from ...errors import CalibrationError, FileFormatError
from ...geometry import se3, so3
from ..file_model import LARGEST, is_number

MOST_PX = 100_000  # of a side of an image
_KINDS = {0: "none", 4: "plumb_bob", 5: "plumb_bob", 8: "rational_polynomial"}


def array_of(path: str | Path, field: str, value: object, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Numbers of a file as an array; infinities, not-a-number and numbers above `LARGEST` are refused.

    Parameters
    ----------
    path, field : for messages.
    value, shape : what stands there; the shape that it must have, None for any.

    Returns
    -------
    float64 of that shape.

    Raises
    ------
    FileFormatError : other values.
    """
    expected = f"numbers, none above {LARGEST:g}" if shape is None else f"{' x '.join(map(str, shape))} numbers"
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FileFormatError(path, field, expected, value) from error
    if (shape is not None and array.shape != shape) or not np.all(np.abs(array) <= LARGEST):
        raise FileFormatError(path, field, expected, value)
    return array


def is_side(pixels: Any) -> bool:
    """Whether an image can have so many pixels on a side: a whole number up to `MOST_PX`."""
    return is_number(pixels) and 1 <= pixels <= MOST_PX and int(pixels) == pixels


def size_of(path: str | Path, field: str, width: Any, height: Any) -> tuple[int, int]:
    """Size of a camera's images.

    Parameters
    ----------
    path, field : for messages.
    width, height : what stands there.

    Returns
    -------
    (width, height), pixels.

    Raises
    ------
    FileFormatError : no whole numbers of pixels from 1 to `MOST_PX`.
    """
    if not (is_side(width) and is_side(height)):
        raise FileFormatError(path, field, f"a width and a height of 1 to {MOST_PX} whole pixels", (width, height))
    return int(width), int(height)


def lens_of(
    path: str | Path,
    fields: tuple[str, str],
    camera: str,
    size: tuple[int, int],
    K: np.ndarray,
    coefficients: np.ndarray,
    fisheye: bool = False,
) -> CameraModel:
    """Lens of a camera matrix and coefficients, whose number stands for the distortion model.

    Parameters
    ----------
    path, fields, camera : for messages; the fields are those of matrix and coefficients.
    size, K : (width, height), px; (3, 3) or (9,).
    coefficients, fisheye : 0, 4, 5 or 8; 4 of the equidistant model.

    Returns
    -------
    A lens that can be a real one.

    Raises
    ------
    CalibrationError : focal length 0, the mark of an uncalibrated camera.
    FileFormatError : another matrix, another number of coefficients, values that no lens has.
    """
    if K.size != 9:
        raise FileFormatError(path, fields[0], "9 numbers, a 3 x 3 matrix", K.tolist())
    K = K.reshape(3, 3)
    if K[0, 0] == 0.0 or K[1, 1] == 0.0:
        raise CalibrationError(camera, f"uncalibrated (K[0] = 0) in {path}")
    if K[1, 0] or K[2, 0] or K[2, 1] or K[2, 2] != 1.0:
        raise FileFormatError(path, fields[0], "[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]", K.tolist())
    if not fisheye:
        if coefficients.size > 8 and not coefficients[8:].any():
            coefficients = coefficients[:8]  # thin prism and tilt that are not used
        if coefficients.size in _KINDS and not coefficients.any():  # as of the message camera_info
            coefficients = np.zeros(0)
    if (coefficients.size != 4) if fisheye else (coefficients.size not in _KINDS):
        expected = "4 coefficients of a fisheye lens" if fisheye else "0, 4, 5 or 8 coefficients"
        raise FileFormatError(path, fields[1], expected, coefficients.tolist())
    kind = "equidistant" if fisheye else _KINDS[coefficients.size]
    try:
        return plausible(CameraModel(*size, K, kind, coefficients))
    except ValueError as error:
        raise FileFormatError(path, fields[0], "a lens that can be built", str(error)) from error


def pose_of(path: str | Path, field: str, rotation: np.ndarray, translation: np.ndarray, tolerance: float = 1e-5) -> np.ndarray:
    """Rigid transform of a rotation and a translation.

    Parameters
    ----------
    path, field : for messages; the field is that of the rotation.
    rotation, translation : matrix (9 numbers) or rotation vector (3, radians); 3 numbers, meters.
    tolerance : how far the rotation may be from a proper one.

    Returns
    -------
    T (4, 4), the nearest rigid one.

    Raises
    ------
    FileFormatError : other numbers of them, no proper rotation.
    """
    if rotation.size not in (3, 9) or translation.size != 3:
        expected = "a rotation (3 x 3, or a rotation vector in radians) and a translation of 3 numbers"
        raise FileFormatError(path, field, expected, rotation.tolist())
    matrix = so3.exp(rotation.ravel()) if rotation.size == 3 else rotation.reshape(3, 3)
    pose = se3.from_rotation_translation(matrix, translation.ravel())
    if not se3.is_rigid(pose, tolerance):
        raise FileFormatError(path, field, "a proper rotation", rotation.tolist())
    return se3.nearest_rigid(pose)


def rig_of(path: str | Path, field: str, cameras: Sequence[Camera]) -> CameraRig:
    """Rig of cameras that all have names of their own.

    Parameters
    ----------
    path, field : for messages.
    cameras : in the order of the file.

    Returns
    -------
    Rig.

    Raises
    ------
    FileFormatError : no camera, or a name given twice.
    """
    names = [camera.name for camera in cameras]
    if not cameras or len(set(names)) != len(names):
        raise FileFormatError(path, field, "cameras, each with a different name", names or "none")
    return CameraRig(tuple(cameras))
