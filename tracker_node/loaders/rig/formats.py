"""Which program has written a calibration, and what another program's format cannot hold."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

from ...errors import FileFormatError
from ..whole_file import read_text
from .control_points import N_COEFFICIENTS, dlt_lines, is_decimal
from .rig_yaml import CameraEntry, RigFile

TOML, CAMERA_INFO, OPENCV, QUALISYS, DLT, RIG = "toml", "camera_info", "opencv", "qualisys", "dlt", "rig"
OPENCAP = "opencap"
_CALIBRATION = ("image_size", "K", "distortion_model", "distortion", "T_world_cam", "pixel_map", "file_image_size")
_CAMERA_INFO_KEY = re.compile(r"""^["']?camera_matrix["']?[ \t]*:""", re.MULTILINE)  # of YAML, at its top
_RIG_KEY = re.compile(r"""^["']?cameras["']?[ \t]*:""", re.MULTILINE)
_TOML_TABLE = re.compile(r"^\[[^\[\]\n]+\][ \t]*$", re.MULTILINE)
_ARGUS_COLUMNS = 12  # of a camera profile: number, focal length, size, center, aspect, five of distortion
_KNOWN = (
    "a calibration: Pose2Sim, aniposelib, FreeMoCap or Caliscope TOML, ROS camera_info YAML, OpenCV YAML, XML or JSON, Qualisys"
    " XML, OpenCap pickles, or eleven lines of DLT coefficients"
)


def detect(path: str | Path) -> str:
    """The format of a calibration file, by its content, whatever its extension; a pickle by its name alone.

    Raises
    ------
    FileFormatError : a file that cannot be read, or is none of these.
    """
    if Path(path).suffix == ".pickle":
        return OPENCAP
    text = read_text(path)
    start = text.lstrip("\ufeff \t\r\n")
    if start.startswith("<"):
        if "<opencv_storage" in start:
            return OPENCV
        if "<calibration" in start:
            return QUALISYS
        if "<Cameras" in start and "SENSOR_SIZE=" in start:
            way = "a calibration of Vicon (.xcp): Pose2Sim makes TOML of it, which is read here"
            raise FileFormatError(path, "(file)", _KNOWN, way)
        raise FileFormatError(path, "(file)", _KNOWN, "other XML")
    if start.startswith("%YAML") or start.startswith("{"):
        return OPENCV
    rows = dlt_lines(start).values()
    if rows and all(is_decimal(cell) for row in rows for cell in row):
        if len(rows) != N_COEFFICIENTS:
            got = f"{len(rows)} lines of numbers"
            if all(len(row) == _ARGUS_COLUMNS and row[0] == str(number) for number, row in enumerate(rows, start=1)):
                got = "lenses of Argus (camera profile); import its DLT coefficients"
            raise FileFormatError(path, "(file)", f"{N_COEFFICIENTS} lines of DLT coefficients", got)
        return DLT
    wrong = ""
    try:
        if tomllib.loads(text):
            return TOML
    except (ValueError, RecursionError) as error:  # a number of too many digits is no TOMLDecodeError
        wrong = str(error)
    if _CAMERA_INFO_KEY.search(text):
        return CAMERA_INFO
    if _RIG_KEY.search(text):
        return RIG
    if wrong and _TOML_TABLE.search(text):
        raise FileFormatError(path, "(file)", "a TOML file", wrong)
    raise FileFormatError(path, "(file)", _KNOWN, start[:40])


def detect_all(paths: Sequence[str | Path]) -> str:
    """The one format of several files.

    Raises
    ------
    FileFormatError : they are not of one format.
    """
    kinds = [detect(path) for path in paths]
    for path, kind in zip(paths, kinds, strict=True):
        if kind != kinds[0]:
            raise FileFormatError(path, "(file)", f"a file of the kind of {paths[0]} ({kinds[0]})", kind)
    return kinds[0]


def dropped(rig_file: RigFile, target: str) -> list[str]:
    """What of a rig another format cannot hold.

    Parameters
    ----------
    rig_file, target : rig; one of the constants of this module.

    Returns
    -------
    A few words each.
    """
    entries = rig_file.cameras
    sentences = []
    for field, info in CameraEntry.model_fields.items():
        names = [name for name, entry in entries.items() if getattr(entry, field) != info.get_default(call_default_factory=True)]
        if field not in _CALIBRATION and names:
            sentences.append(f"{field} ({', '.join(names)})")
    if any(entry.pixel_map is not None for entry in entries.values()):
        sentences.append("pixel maps as such: they are folded into the lenses")
    if rig_file.lights:
        sentences.append("lights")
    if target == CAMERA_INFO:
        sentences.append("the places of the cameras")
    if target == DLT:
        distorted = [name for name, entry in entries.items() if any(entry.distortion)]
        sentences += [f"distortion ({', '.join(distorted)})"] if distorted else []
        sentences.append("names and image sizes of the cameras")
    return sentences
