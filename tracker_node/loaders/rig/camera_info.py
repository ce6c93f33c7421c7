"""Lenses in the YAML of ROS's camera calibration tools and camera drivers, and where camera_info_manager keeps them.

A place is a URL: ``file:///home/me/left.yaml``, ``package://my_rig/calibration/left.yaml``; ``${NAME}`` is the camera's name and
``${ROS_HOME}`` the folder of that environment variable, or ``~/.ros``. An empty URL is
``file://${ROS_HOME}/camera_info/${NAME}.yaml``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...camera.distortion import COEFFICIENT_COUNTS, used_coefficients
from ...camera.model import CameraModel
from ...errors import FileFormatError
from ..yaml_file import read_mapping, write_mapping
from .lens import array_of, is_side, lens_of, size_of

_NAMES = {"fisheye": "equidistant"}  # what OpenCV's tools call it


def load_camera_info(path: str | Path) -> tuple[str, CameraModel]:
    """Camera name (the file's stem when it gives none) and lens of a camera_info YAML file.

    The projection matrix of a rectified stereo pair is not used: images are taken as the camera gives them.

    Raises
    ------
    FileFormatError : naming the field that is missing or wrong.
    CalibrationError : when the camera is not calibrated (K[0] = 0, as drivers without a calibration publish).
    """
    values = read_mapping(path)
    name = str(values.get("camera_name") or Path(path).stem)
    width, height = values.get("image_width"), values.get("image_height")
    size = size_of(path, "image_height" if is_side(width) else "image_width", width, height)
    K = _matrix(path, values, "camera_matrix")
    kind = str(values.get("distortion_model", "plumb_bob") or "none")
    kind = _NAMES.get(kind, kind)
    if kind not in COEFFICIENT_COUNTS:
        raise FileFormatError(path, "distortion_model", f"one of {sorted(COEFFICIENT_COUNTS)}", kind)
    coefficients = np.zeros(0) if kind == "none" else used_coefficients(kind, _matrix(path, values, "distortion_coefficients"))
    if coefficients.size not in COEFFICIENT_COUNTS[kind]:
        expected = f"{' or '.join(map(str, COEFFICIENT_COUNTS[kind]))} coefficients of {kind}"
        raise FileFormatError(path, "distortion_coefficients.data", expected, coefficients.tolist())
    fields = ("camera_matrix.data", "distortion_coefficients.data")
    return name, lens_of(path, fields, name, size, K, coefficients, kind == "equidistant")


def dump_camera_info(name: str, model: CameraModel, path: str | Path) -> None:
    """Write a lens so that ROS camera drivers can read it (no rectification, projection equal to K).

    Parameters
    ----------
    name, model, path : camera; its lens; YAML file.
    """
    projection = np.hstack([model.K, np.zeros((3, 1))])
    coefficients = model.distortion if model.distortion.size else np.zeros(5)
    values: dict[str, Any] = {
        "image_width": model.width,
        "image_height": model.height,
        "camera_name": name,
        "camera_matrix": _table(model.K),
        "distortion_model": "plumb_bob" if model.distortion_model == "none" else model.distortion_model,
        "distortion_coefficients": _table(coefficients[None]),
        "rectification_matrix": _table(np.eye(3)),
        "projection_matrix": _table(projection),
    }
    write_mapping(values, path)


def _table(matrix: np.ndarray) -> dict[str, Any]:
    return {"rows": matrix.shape[0], "cols": matrix.shape[1], "data": [float(v) for v in matrix.ravel()]}


def _matrix(path: str | Path, values: dict[str, Any], key: str) -> np.ndarray:
    table = values.get(key)
    if not isinstance(table, dict) or "data" not in table:
        raise FileFormatError(path, key, "a matrix with rows, cols and data", table)
    return array_of(path, f"{key}.data", table["data"], (len(table["data"]),) if isinstance(table["data"], list) else None)


DEFAULT_URL = "file://${ROS_HOME}/camera_info/${NAME}.yaml"
_FIELD = "camera_info_url"


def camera_info_path(url: str, camera: str, environment: Mapping[str, str] = os.environ) -> Path:
    """The file that a URL names, which need not exist.

    Parameters
    ----------
    url, camera : empty for the default; name of the camera.
    environment : variables, of which ``ROS_HOME``, ``HOME`` and ``AMENT_PREFIX_PATH`` are read.

    Returns
    -------
    Path.

    Raises
    ------
    FileFormatError : another scheme, an unknown ``${...}``, a relative path, or a package that is not installed.
    """
    text = _substituted(url or DEFAULT_URL, camera, environment)
    scheme, _, rest = text.partition("://")
    if scheme == "file" and rest.startswith("/"):
        return Path(rest)
    package, slash, path = rest.partition("/")
    if scheme == "package" and package and slash and path:
        return _share_folder(package, url, environment) / path
    raise FileFormatError(camera, _FIELD, "file:///PATH or package://PACKAGE/PATH", url)


def load_lens(url: str, camera: str) -> CameraModel | None:
    """The lens that is kept at a URL.

    Parameters
    ----------
    url, camera : as of `camera_info_path`.

    Returns
    -------
    Lens; None where there is none yet.

    Raises
    ------
    FileFormatError : the URL, or the file, is wrong.
    CalibrationError : the file is that of an uncalibrated camera.
    """
    path = camera_info_path(url, camera)
    return load_camera_info(path)[1] if os.path.exists(path) else None


def save_lens(url: str, camera: str, lens: CameraModel) -> Path:
    """Keep a lens at a URL, whole or not at all; folders are made as needed.

    Parameters
    ----------
    url, camera : as of `camera_info_path`.
    lens : that is written.

    Returns
    -------
    Path of the file.

    Raises
    ------
    FileFormatError : the URL is wrong, or the file cannot be written.
    """
    path = camera_info_path(url, camera)
    try:
        dump_camera_info(camera, lens, path)
    except OSError as error:
        raise FileFormatError(path, "(file)", "a place to write to", error.strerror or str(error)) from None
    return path


def _substituted(url: str, camera: str, environment: Mapping[str, str]) -> str:
    home = environment.get("ROS_HOME") or os.path.join(environment.get("HOME", os.path.expanduser("~")), ".ros")
    known = {"NAME": camera, "ROS_HOME": home}

    def value(match: re.Match[str]) -> str:
        if match[1] not in known:
            raise FileFormatError(camera, _FIELD, f"one of {', '.join('${' + name + '}' for name in known)}", match[0])
        return known[match[1]]

    return re.sub(r"\$\{(\w*)\}", value, url)


def _share_folder(package: str, url: str, environment: Mapping[str, str]) -> Path:
    prefixes = [prefix for prefix in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    for prefix in prefixes:
        if (Path(prefix) / "share" / package).is_dir():
            return Path(prefix) / "share" / package
    raise FileFormatError(url, _FIELD, f"a package that is installed in one of {prefixes}", package)
