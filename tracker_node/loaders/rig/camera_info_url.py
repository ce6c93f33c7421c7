"""Where lenses are kept, in the grammar of ROS's camera_info_manager.

``file:///home/me/left.yaml``, ``package://my_rig/calibration/left.yaml``; ``${NAME}`` is the camera's name and ``${ROS_HOME}``
the folder of that environment variable, or ``~/.ros``. An empty URL is ``file://${ROS_HOME}/camera_info/${NAME}.yaml``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

from ...camera.model import CameraModel
from ...errors import FileFormatError
from .camera_info_yaml import dump_camera_info, load_camera_info

DEFAULT_URL = "file://${ROS_HOME}/camera_info/${NAME}.yaml"
_FIELD = "camera_info_url"


def camera_info_path(url: str, camera: str, environment: Mapping[str, str] = os.environ) -> Path:
    """The file that a URL names, which need not exist.

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


def load_lens(url: str, camera: str, environment: Mapping[str, str] = os.environ) -> CameraModel | None:
    """The lens that is kept there; None where there is none yet.

    Raises
    ------
    FileFormatError : the URL, or the file, is wrong.
    CalibrationError : the file is that of an uncalibrated camera.
    """
    path = camera_info_path(url, camera, environment)
    return load_camera_info(path)[1] if os.path.exists(path) else None


def save_lens(url: str, camera: str, lens: CameraModel, environment: Mapping[str, str] = os.environ) -> Path:
    """Keep a lens there, whole or not at all; folders are made as needed. Returns the file.

    Raises
    ------
    FileFormatError : the URL is wrong, or the file cannot be written.
    """
    path = camera_info_path(url, camera, environment)
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
