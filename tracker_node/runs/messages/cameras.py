"""Images and lenses in messages: sensor_msgs/CameraInfo (REP-104), Image, CompressedImage."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...camera.distortion import COEFFICIENT_COUNTS, used_coefficients
from ...camera.model import CameraModel, plausible
from ...errors import CalibrationError, shown
from .parts import Content, header

CAMERA_INFO, IMAGE = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
_LONGEST_SIDE = 16384  # pixels; images of the background are brought to the size that a message claims
_LARGEST = 1e9  # of a number in K
_JPEG = "bgr8; jpeg compressed bgr8"


def image(stamp_ns: int, frame_id: str, pixels: np.ndarray, encoding: str = "bgr8") -> Content:
    """sensor_msgs/Image of uint8 pixels (height, width[, 3]).

    Parameters
    ----------
    stamp_ns : time of exposure.
    frame_id : name of the camera's optical frame.
    pixels : (height, width[, 3]) uint8.
    encoding : ``bgr8``, ``mono8`` or another of ROS.

    Returns
    -------
    content : the message as field -> value.
    """
    height, width = pixels.shape[:2]
    return {
        "header": header(stamp_ns, frame_id),
        "height": height,
        "width": width,
        "encoding": encoding,
        "is_bigendian": 0,
        "step": width * (pixels.shape[2] if pixels.ndim == 3 else 1),
        "data": pixels.reshape(-1),
    }


def compressed_image(stamp_ns: int, frame_id: str, jpeg: np.ndarray | bytes) -> Content:
    """sensor_msgs/CompressedImage of the bytes of a JPEG.

    Parameters
    ----------
    stamp_ns : time of exposure.
    frame_id : name of the camera's optical frame.
    jpeg : bytes, or (n,) uint8.

    Returns
    -------
    content : the message as field -> value.
    """
    return {"header": header(stamp_ns, frame_id), "format": _JPEG, "data": np.frombuffer(jpeg, np.uint8)}


def jpeg_of(bgr: np.ndarray) -> np.ndarray:
    """(n,) uint8, the bytes of a JPEG of an image (height, width[, 3]).

    Parameters
    ----------
    bgr : (height, width[, 3]) uint8.

    Returns
    -------
    jpeg : (n,) uint8.
    """
    _, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 90])
    return encoded.reshape(-1)


def camera_info(stamp_ns: int, frame_id: str, model: CameraModel) -> Content:
    """sensor_msgs/CameraInfo of a lens; R and P are those of an unrectified single camera.

    Parameters
    ----------
    stamp_ns : time of exposure.
    frame_id : name of the camera's optical frame.
    model : the lens, in the pixels of the images.

    Returns
    -------
    content : the message as field -> value.
    """
    name = "plumb_bob" if model.distortion_model == "none" else model.distortion_model
    coefficients = [float(v) for v in model.distortion] or [0.0] * 5
    if name == "plumb_bob" and len(coefficients) == 4:
        coefficients.append(0.0)  # k3; ROS writes five
    return {
        "header": header(stamp_ns, frame_id),
        "height": model.height,
        "width": model.width,
        "distortion_model": name,
        "d": coefficients,
        "k": model.K.ravel(),
        "r": np.eye(3).ravel(),
        "p": np.hstack([model.K, np.zeros((3, 1))]).ravel(),
    }


def lens_of(camera: str, message: Any) -> CameraModel:
    """Lens for the pixels of the images that go with a sensor_msgs/CameraInfo, of a graph or of a bag.

    Region of interest and binning are applied to K; coefficients that are all zero are no distortion.

    Parameters
    ----------
    camera : its name, for messages.
    message : the CameraInfo.

    Returns
    -------
    lens : for the pixels of the images.

    Raises
    ------
    CalibrationError : K[0] = 0 (the mark of an uncalibrated camera), a distortion model that is not known, numbers that are
        no lens's, or images without pixels or larger than 16384 on a side.
    """
    K = np.array(message.k, dtype=np.float64).reshape(3, 3)
    if K[0, 0] == 0.0:
        raise CalibrationError(camera, "uncalibrated: camera_info has K[0] = 0")
    name = message.distortion_model or "none"
    if name == "fisheye":
        name = "equidistant"
    coefficients = np.array(message.d, dtype=np.float64)
    if not coefficients.any() and name in ("none", "plumb_bob", "rational_polynomial"):
        name, coefficients = "none", np.zeros(0)
    coefficients = used_coefficients(name, coefficients)
    if name not in COEFFICIENT_COUNTS or coefficients.size not in COEFFICIENT_COUNTS[name]:
        known = ", ".join(f"{key} with {' or '.join(map(str, n))}" for key, n in COEFFICIENT_COUNTS.items())
        got = f"{shown(name)} with {coefficients.size}"
        raise CalibrationError(camera, f"distortion in camera_info: expected {known} coefficients, got {got}")
    try:
        _check_numbers(K, coefficients)
        lens = plausible(CameraModel(_side(message.width), _side(message.height), K, name, coefficients))
        return _cropped_and_binned(lens, message)
    except ValueError as error:
        raise CalibrationError(camera, f"camera_info: {error}") from error


def _check_numbers(K: np.ndarray, coefficients: np.ndarray) -> None:
    if not (np.abs(K) <= _LARGEST).all() or K[1, 0] != 0.0 or tuple(K[2]) != (0.0, 0.0, 1.0):
        raise ValueError(f"expected K = [fx, skew, cx, 0, fy, cy, 0, 0, 1], got {K.ravel().tolist()}")
    if not np.isfinite(coefficients).all():
        raise ValueError(f"expected finite distortion coefficients, got {coefficients.tolist()}")


def _side(pixels: int) -> int:
    if not 1 <= pixels <= _LONGEST_SIDE:
        raise ValueError(f"expected images of 1 to {_LONGEST_SIDE} pixels on each side, got {pixels}")
    return int(pixels)


def _cropped_and_binned(model: CameraModel, message: Any) -> CameraModel:
    roi = message.roi
    x, y = int(roi.x_offset), int(roi.y_offset)
    width, height = _side(int(roi.width) or model.width), _side(int(roi.height) or model.height)
    if x + width > model.width or y + height > model.height:
        got = f"x_offset {x}, y_offset {y}, width {width}, height {height}"
        raise ValueError(f"roi: expected a part of the {model.width}x{model.height} image, got {got}")
    if (x, y, width, height) != (0, 0, model.width, model.height):
        model = model.mapped(np.array([[1.0, 0.0, -x], [0.0, 1.0, -y]]), width, height)
    bx, by = max(int(message.binning_x), 1), max(int(message.binning_y), 1)
    if (bx, by) != (1, 1):
        model = model.resized(_side(model.width // bx), _side(model.height // by))
    return model
