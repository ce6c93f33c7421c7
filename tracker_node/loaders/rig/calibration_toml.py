"""Camera calibrations in the TOML that Pose2Sim, aniposelib and Caliscope share.

One table per camera: ``size`` [width, height], ``matrix`` (3 x 3), ``distortions`` (4 or 5 coefficients; 4 of the
equidistant model with ``fisheye = true``), ``rotation`` (Rodrigues vector, radians) and ``translation`` (meters), both from
the world to the camera. Cameras that Caliscope marks as ``ignore`` are left out. The three programs differ in the names of the
tables, in how a rotation is written and in what else has to be there.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...camera.model import CameraModel, plausible
from ...camera.rig import Camera, CameraRig
from ...errors import CalibrationError, FileFormatError, UnknownNameError
from ...geometry import se3, so3
from ..whole_file import read_text, write_whole
from .lens import identifier


def load_pose2sim(path: str | Path) -> CameraRig:
    """The rig of a Pose2Sim or aniposelib TOML file; cameras in the order of the file, named by ``name`` or their table.

    Raises
    ------
    FileFormatError : when the file, a field or a shape is not as described above.
    CalibrationError : for a camera without calibration (focal length 0).
    """
    path = Path(path)
    try:
        tables = tomllib.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(path, "(file)", "a TOML file", str(error)) from error
    cameras = {key: value for key, value in _flat(tables).items() if "matrix" in value and not value.get("ignore")}
    if not cameras:
        raise FileFormatError(path, "(top level)", "one table per camera with size, matrix, rotation, translation", list(tables))
    built = tuple(_camera(path, key, table) for key, table in cameras.items())
    names = [camera.name for camera in built]
    if len(set(names)) != len(names):
        raise FileFormatError(path, "name", "a different name for each camera", names)
    return CameraRig(built)


def _flat(tables: Mapping) -> dict[str, dict]:
    """Camera tables, wherever they are: at the top, or in ``[cameras.NAME]``."""
    nested = tables.get("cameras")
    source = nested if isinstance(nested, dict) else tables
    return {key: value for key, value in source.items() if isinstance(value, dict)}


def _camera(path: Path, key: str, table: dict) -> Camera:
    name = identifier(str(table.get("name", key)))
    size = _numbers(path, f"{key}.size", table.get("size"), (2,))
    if not np.all((size >= 1) & (size <= 100_000) & (size == np.round(size))):
        raise FileFormatError(path, f"{key}.size", "width and height in whole pixels", table.get("size"))
    K = _numbers(path, f"{key}.matrix", table["matrix"], (3, 3))
    if K[0, 0] == 0.0 or K[1, 1] == 0.0:
        raise CalibrationError(name, f"uncalibrated: focal length 0 in {path}")
    if K[1, 0] or K[2, 0] or K[2, 1] or K[2, 2] != 1.0:
        raise FileFormatError(path, f"{key}.matrix", "[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]", K.tolist())
    coefficients = _numbers(path, f"{key}.distortions", table.get("distortions", []), None)
    fisheye = bool(table.get("fisheye", False))
    counts = (4,) if fisheye else (0, 4, 5, 8)
    if coefficients.size not in counts:
        expected = f"{' or '.join(map(str, counts))} coefficients{' of a fisheye lens' if fisheye else ''}"
        raise FileFormatError(path, f"{key}.distortions", expected, coefficients.tolist())
    kind = "equidistant" if fisheye else {0: "none", 8: "rational_polynomial"}.get(coefficients.size, "plumb_bob")
    rotation = _numbers(path, f"{key}.rotation", table.get("rotation"), None)
    if rotation.size == 3:
        rotation = so3.exp(rotation.ravel())
    translation = _numbers(path, f"{key}.translation", table.get("translation"), None)
    if rotation.shape != (3, 3):
        raise FileFormatError(path, f"{key}.rotation", "a rotation vector (radians) or a 3 x 3 matrix", rotation.tolist())
    if translation.size != 3:
        raise FileFormatError(path, f"{key}.translation", "3 numbers (meters)", translation.tolist())
    T_cam_world = se3.from_rotation_translation(rotation, translation.ravel())
    if not se3.is_rigid(T_cam_world, tolerance=1e-5):
        raise FileFormatError(path, f"{key}.rotation", "a proper rotation", rotation.tolist())
    try:
        model = plausible(CameraModel(int(size[0]), int(size[1]), K, kind, coefficients))
    except ValueError as error:
        raise FileFormatError(path, key, "a camera that can be built", str(error)) from error
    return Camera(name, model, se3.inverse(se3.nearest_rigid(T_cam_world)))


def _numbers(path: Path, field: str, value: object, shape: tuple[int, ...] | None) -> np.ndarray:
    expected = "numbers" if shape is None else f"{' x '.join(map(str, shape))} numbers"
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise FileFormatError(path, field, expected, value) from error
    # Not above a million: nothing here is, and squares must stay finite (this also refuses infinities and not-a-number).
    if (shape is not None and array.shape != shape) or not np.all(np.abs(array) <= 1e6):
        raise FileFormatError(path, field, expected, value)
    return array


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
