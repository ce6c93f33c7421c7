"""Camera calibrations in the TOML that Pose2Sim, aniposelib, FreeMoCap and Caliscope share.

One table per camera: ``size`` [width, height], ``matrix`` (3 x 3), ``distortions`` (4 or 5 coefficients; 4 of the
equidistant model with ``fisheye = true``), ``rotation`` (Rodrigues vector, radians) and ``translation`` (meters), both from
the world to the camera. Cameras that Caliscope marks as ``ignore`` are left out. The programs differ in the names of the
tables, in how a rotation is written and in what else has to be there; FreeMoCap 2 once wrote ``image_size``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...errors import FileFormatError, UnknownNameError
from ...geometry import se3, so3
from ..source_address import identifier
from ..whole_file import read_text, write_whole
from .lens import array_of, lens_of, pose_of, rig_of, size_of


def load_pose2sim(path: str | Path) -> CameraRig:
    """The rig of a Pose2Sim or aniposelib TOML file; cameras in the order of the file, named by ``name`` or their table.

    Raises
    ------
    FileFormatError : when the file, a field or a shape is not as described above.
    CalibrationError : for a camera without calibration (focal length 0).
    """
    path = Path(path)
    tables = _tables(path)
    found = _cameras(tables)
    cameras = {key: value for key, value in found.items() if not value.get("ignore")}
    if found and not cameras:
        raise FileFormatError(path, "ignore", "a camera that is not to be ignored", f"ignore = true of {', '.join(found)}")
    if not cameras:
        raise FileFormatError(path, "(top level)", "one table per camera with size, matrix, rotation, translation", list(tables))
    return rig_of(path, "name", [_camera(path, key, table) for key, table in cameras.items()])


def cameras_in_toml(path: str | Path) -> dict[str, str]:
    """Table -> name of each camera of such a file, in its order, those to be ignored too."""
    return {key: _name(key, table) for key, table in _cameras(_tables(Path(path))).items()}


def _tables(path: Path) -> dict:
    try:
        return tomllib.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(path, "(file)", "a TOML file", str(error)) from error


def _cameras(tables: Mapping) -> dict[str, dict]:
    return {key: value for key, value in _flat(tables).items() if _SIZES & value.keys() or "matrix" in value}


def _name(key: str, table: Mapping) -> str:
    return identifier(str(table.get("name", key)))


def _flat(tables: Mapping) -> dict[str, dict]:
    """Camera tables, wherever they are: at the top, or in ``[cameras.NAME]``."""
    nested = tables.get("cameras")
    source = nested if isinstance(nested, dict) else tables
    return {key: value for key, value in source.items() if isinstance(value, dict)}


_SIZES = {"size", "image_size"}


def _camera(path: Path, key: str, table: dict) -> Camera:
    for field in ("matrix", "rotation", "translation"):
        if field not in table:
            expected = f"the {field} of a calibrated camera, or ignore = true, which leaves the camera out"
            raise FileFormatError(path, f"{key}.{field}", expected, "none")
    name = _name(key, table)
    size = size_of(path, f"{key}.size", *array_of(path, f"{key}.size", table.get("size", table.get("image_size")), (2,)).tolist())
    K = array_of(path, f"{key}.matrix", table["matrix"], (3, 3))
    coefficients = array_of(path, f"{key}.distortions", table.get("distortions", []))
    fields, fisheye = (f"{key}.matrix", f"{key}.distortions"), bool(table.get("fisheye", False))
    lens = lens_of(path, fields, name, size, K, coefficients, fisheye)
    rotation, translation = (array_of(path, f"{key}.{part}", table.get(part)) for part in ("rotation", "translation"))
    return Camera(name, lens, se3.inverse(pose_of(path, f"{key}.rotation", rotation, translation)))


DIALECTS = ("pose2sim", "anipose", "caliscope")


def dump_calibration_toml(rig: CameraRig, path: str | Path, dialect: str = "pose2sim") -> None:
    """Write lenses and poses, from the world to the camera, meters.

    Parameters
    ----------
    rig, path : cameras; TOML file.
    dialect : one of `DIALECTS`.

    Raises
    ------
    UnknownNameError : for a dialect that is not of `DIALECTS`.
    """
    if dialect not in DIALECTS:
        raise UnknownNameError("dialect", dialect, DIALECTS)
    tables = [_table(i, camera, dialect) for i, camera in enumerate(rig)]
    if dialect != "caliscope":
        tables.append("[metadata]\nadjusted = false\nerror = 0.0\n")
    write_whole(path, "\n".join(tables))


def _table(index: int, camera: Camera, dialect: str) -> str:
    lens, transform = camera.model, camera.T_cam_world
    title = {"pose2sim": camera.name, "anipose": f"cam_{index}", "caliscope": f"cameras.{index}"}[dialect]
    lines = [f"[{title}]"]
    if dialect == "caliscope":
        lines += [f"cam_id = {index}", "rotation_count = 0", "error = 0.0", "grid_count = 0", "ignore = false"]
    rotation = transform[:3, :3] if dialect == "caliscope" else so3.log(transform[:3, :3])
    lines += [
        f'name = "{camera.name}"',
        f"size = [{lens.width}, {lens.height}]",
        f"matrix = {_text(lens.K)}",
        f"distortions = {_text(lens.distortion if lens.distortion.size else np.zeros(5))}",
        f"rotation = {_text(rotation)}",
        f"translation = {_text(transform[:3, 3])}",
        f"fisheye = {'true' if lens.distortion_model == 'equidistant' else 'false'}",
    ]
    return "\n".join(lines) + "\n"


def _text(array: np.ndarray) -> str:
    return repr(np.asarray(array, dtype=float).tolist())
