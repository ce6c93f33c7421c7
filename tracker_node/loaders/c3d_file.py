"""Marker trajectories in C3D files, the binary format of motion capture (c3d.org), through ezc3d.

A point that was not seen has the residual -1. Angles, where there are any, stand among the points with their labels listed in
``POINT:ANGLES``, as Vicon writes them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

from ..errors import FileFormatError
from .trc import METERS_PER_UNIT, MarkerTrajectories

_BLOCK = 512  # bytes
_MAGIC = 0x50  # second byte of every C3D file


@dataclass(frozen=True, eq=False)
class AnglesOverTime:
    """Triples of joint angles: ``radians`` (n, k, 3), zeros where not ``valid`` (n, k)."""

    names: tuple[str, ...] = ()
    radians: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 3)))
    valid: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))


def dump_c3d(
    markers: MarkerTrajectories,
    path: str | Path,
    y_up: bool = False,
    unit: str = "mm",
    descriptions: Sequence[str] = (),
    angles: AnglesOverTime | None = None,
    degrees: bool = True,
) -> None:
    """Write points, at a constant rate, and angles.

    Parameters
    ----------
    y_up : turn the axes to those of OpenSim, as `trc.dump_trc` does. ``POINT:Y_SCREEN`` says which axis is up.
    unit : m, cm or mm. Coordinates are single precision: 0.06 mm at 1 km.
    descriptions : of the markers.
    """
    n = len(markers)
    positions = (markers.positions_m[..., [1, 2, 0]] if y_up else markers.positions_m) / METERS_PER_UNIT[unit]
    turned = angles or AnglesOverTime((), np.zeros((n, 0, 3)), np.zeros((n, 0), dtype=bool))
    values = np.concatenate([positions, np.rad2deg(turned.radians) if degrees else turned.radians], axis=1)
    valid = np.concatenate([markers.valid, turned.valid], axis=1)
    file = ezc3d.c3d()
    set_ = file.add_parameter
    set_("POINT", "RATE", [float(markers.rate_hz)])
    set_("POINT", "LABELS", [*markers.names, *turned.names])
    set_("POINT", "DESCRIPTIONS", [*(descriptions or ("",) * len(markers.names)), *("joint angles",) * len(turned.names)])
    set_("POINT", "UNITS", [unit])
    set_("POINT", "X_SCREEN", ["+X"])
    set_("POINT", "Y_SCREEN", ["+Y" if y_up else "+Z"])
    if turned.names:
        set_("POINT", "ANGLES", list(turned.names))
        set_("POINT", "ANGLE_UNITS", ["deg" if degrees else "rad"])
    points = np.ones((4, values.shape[1], n))
    points[:3] = np.where(valid[..., None], values, 0.0).transpose(2, 1, 0)
    file["data"]["points"] = points
    file["data"]["meta_points"] = {
        "residuals": np.where(valid, 0.0, -1.0).T[None],
        "camera_masks": np.zeros((7, values.shape[1], n), dtype=bool),
    }
    file.write(str(path))


def load_c3d(path: str | Path, y_up: bool | None = None) -> MarkerTrajectories:
    """Markers of a C3D file; angles, forces and the like among its points are left out.

    Parameters
    ----------
    y_up : turn the file's axes, y up as in OpenSim, to z up. None: as ``POINT:Y_SCREEN`` says; without it z is up.

    Raises
    ------
    FileFormatError : no C3D file, one that cannot be read, no markers, a unit that is none, no rate.
    """
    file = _read(path)
    point = file["parameters"]["POINT"]
    labels = [label.strip() for label in _values(point, "LABELS")]
    other = {label.strip() for kind in ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS") for label in _values(point, kind)}
    values = np.asarray(file["data"]["points"], dtype=np.float64)[:3].transpose(2, 1, 0)
    columns = [i for i, label in enumerate(labels[: values.shape[1]]) if label and label not in other]
    names = tuple(labels[i] for i in columns)
    if not names or not len(values):
        raise FileFormatError(path, "POINT:LABELS", "at least one marker and one frame", f"{len(names)} and {len(values)}")
    if len(set(names)) != len(names):
        raise FileFormatError(path, "POINT:LABELS", "each once", sorted({n for n in names if names.count(n) > 1}))
    unit = (_values(point, "UNITS") or ["mm"])[0].strip() or "mm"
    if unit not in METERS_PER_UNIT:
        raise FileFormatError(path, "POINT:UNITS", f"one of {sorted(METERS_PER_UNIT)}", unit)
    rate = float(file["header"]["points"]["frame_rate"])
    if not (np.isfinite(rate) and rate > 0.0):
        raise FileFormatError(path, "POINT:RATE", "a positive number", rate)
    positions = values[:, columns] * METERS_PER_UNIT[unit]
    residuals = np.asarray(file["data"]["meta_points"]["residuals"])[0].T[:, columns]
    valid = (residuals >= 0.0) & np.isfinite(positions).all(axis=2)
    positions[~valid] = 0.0
    if y_up if y_up is not None else "Y" in "".join(_values(point, "Y_SCREEN")).upper():
        positions = positions[..., [2, 0, 1]]
    return MarkerTrajectories(names, np.arange(len(positions)) / rate, positions, rate, valid)


def _read(path: str | Path) -> Any:
    try:
        with Path(path).open("rb") as stream:
            start = stream.read(_BLOCK)
    except OSError as error:
        raise FileFormatError(path, "(file)", "a readable C3D file", error.strerror or error) from None
    if len(start) < _BLOCK or start[1] != _MAGIC:
        raise FileFormatError(path, "(file)", "a C3D file", f"{len(start)} bytes that begin with {start[:4]!r}")
    try:
        return ezc3d.c3d(str(path))
    except (RuntimeError, ValueError, OSError, IndexError, KeyError, MemoryError) as error:
        raise FileFormatError(path, "(content)", "what a C3D file holds", str(error)) from None


def _values(group: Mapping[str, Any], name: str) -> list[str]:
    return [str(value) for value in group[name]["value"]] if name in group else []
