"""Calibrations written in the TOML of Pose2Sim, aniposelib and Caliscope, which `pose2sim_toml` reads.

They differ in the names of the tables, in how a rotation is written and in what else has to be there.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...errors import UnknownNameError
from ...geometry import so3
from ..whole_file import write_whole

DIALECTS = ("pose2sim", "anipose", "caliscope")


def dump_calibration_toml(rig: CameraRig, path: str | Path, dialect: str = "pose2sim") -> None:
    """Write lenses and places, from the world to the camera, meters.

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
