"""Marker trajectories in C3D files, the binary format of motion capture (c3d.org).

A point that was not seen has the residual -1. Angles, where there are any, stand among the points with their labels listed in
``POINT:ANGLES``, as Vicon writes them. Events, such as a foot's coming down, stand in the group ``EVENT``.

ezc3d reads files in a process of its own, which a damaged file can crash, hold up or fill without harm to others:
``python -m tracker_node.loaders.motion.c3d_file FILE`` writes the points as an ``.npz`` archive to standard output.
"""

from __future__ import annotations

import errno
import io
import os
import resource
import struct
import subprocess
import sys
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileFormatError, repeated
from ..whole_file import whole_file
from .trc import METERS_PER_UNIT, MarkerTrajectories, load_trc, without_subject

MOST_FRAMES = 65535  # that the header can count; of longer recordings TRIAL:ACTUAL_END_FIELD tells, to programs that look for it
MOST_EVENTS = 255  # a parameter's dimensions are bytes
_BLOCK = 512  # bytes
_INTEGER = 2  # type of a parameter: 16 bits
_MAGIC = 0x50  # second byte of every C3D file
_LEAST_BYTES = 8  # of a point: four numbers of 16 bits
_POINT_BYTES = 16  # of a point as written here: four single-precision numbers
_DATA_BLOCK = 16  # byte of the header where the number of the data's first block stands, counted from 1
_PROCESSOR, _BIG_ENDIAN = 3, 86  # byte of the parameters that tells of the byte order, and its value on MIPS


@dataclass(frozen=True, eq=False)
class AnglesOverTime:
    """Triples of joint angles: ``radians`` (n, k, 3), zeros where not ``valid`` (n, k)."""

    names: tuple[str, ...] = ()
    radians: np.ndarray = field(default_factory=lambda: np.zeros((0, 0, 3)))
    valid: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))


@dataclass(frozen=True)
class TimedEvent:
    """What happened, ``time_s`` after the first frame, on which side (``context``: Left, Right)."""

    time_s: float
    context: str
    label: str


def dump_c3d(
    markers: MarkerTrajectories,
    path: str | Path,
    y_up: bool = False,
    unit: str = "mm",
    descriptions: Sequence[str] = (),
    angles: AnglesOverTime | None = None,
    degrees: bool = True,
    events: Sequence[TimedEvent] = (),
) -> None:
    """Write points, at a constant rate, angles and events.

    Parameters
    ----------
    markers, path : points in meters; C3D file.
    y_up : turn the axes to those of OpenSim, as `trc.dump_trc` does. ``POINT:Y_SCREEN`` says which axis is up.
    unit : m, cm or mm. Coordinates are single precision: 0.06 mm at 1 km.
    descriptions : of the markers.
    angles, degrees : at the same times; whether they are written in degrees, or in radians.
    events : listed in the group ``EVENT``, the first `MOST_EVENTS` of them.

    Raises
    ------
    OSError : the file cannot be written whole; what was there before is still there.
    """
    import ezc3d  # here, since it has no wheels for some machines, which read and write everything else

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
    if events:
        _state_events(file, events)
    if n > MOST_FRAMES:
        _state_frames(file, n)
    points = np.ones((4, values.shape[1], n))
    points[:3] = np.where(valid[..., None], values, 0.0).transpose(2, 1, 0)
    file["data"]["points"] = points
    file["data"]["meta_points"] = {
        "residuals": np.where(valid, 0.0, -1.0).T[None],
        "camera_masks": np.zeros((7, values.shape[1], n), dtype=bool),
    }
    with whole_file(path, ".c3d") as draft:  # ezc3d appends the suffix to any other name
        draft.touch()  # which says why, where nothing can be written: ezc3d does not notice
        file.write(str(draft))
        _check_size(draft, values.shape[1] * n * _POINT_BYTES)


def _check_size(path: Path, n_data: int) -> None:
    """Raise OSError unless ``n_data`` bytes follow where the header says that the data begin."""
    with path.open("rb") as stream:
        header = stream.read(_BLOCK)
        size = stream.seek(0, os.SEEK_END)
    blocks = struct.unpack_from("<H", header, _DATA_BLOCK)[0] - 1 if len(header) == _BLOCK else 1
    if size < blocks * _BLOCK + n_data:
        raise OSError(errno.EIO, f"the C3D file could not be written whole, only {size} bytes of it")


def _state_events(file: Any, events: Sequence[TimedEvent]) -> None:
    """In order of time, each as minutes and seconds."""
    listed = sorted(events, key=lambda event: event.time_s)[:MOST_EVENTS]
    minutes, seconds = np.divmod([event.time_s for event in listed], 60.0)
    set_ = file.add_parameter
    _set_integers(file, "EVENT", "USED", [len(listed)])
    set_("EVENT", "CONTEXTS", [event.context for event in listed])
    set_("EVENT", "LABELS", [event.label for event in listed])
    set_("EVENT", "TIMES", np.array([minutes, seconds]))


def _state_frames(file: Any, n: int) -> None:
    """First and last frame as two words of 16 bits each, the lower one first."""
    for name, frame in (("ACTUAL_START_FIELD", 1), ("ACTUAL_END_FIELD", n)):
        _set_integers(file, "TRIAL", name, [frame & 0xFFFF, frame >> 16])


def _set_integers(file: Any, group: str, name: str, values: Sequence[int]) -> None:
    """A parameter of words of 16 bits; ezc3d would make numbers with a fraction of them."""
    file.add_parameter(group, name, list(values))
    parameter = file["parameters"][group][name]
    parameter["type"], parameter["value"] = _INTEGER, np.array(values)


def load_c3d(path: str | Path, y_up: bool | None = None) -> MarkerTrajectories:
    """Markers of a C3D file; angles, forces and the like among its points are left out.

    Parameters
    ----------
    path : C3D file.
    y_up : turn the file's axes, y up as in OpenSim, to z up. None: as ``POINT:Y_SCREEN`` says; without it z is up.

    Returns
    -------
    Markers in meters; times count from the recording's first frame, which a trimmed file begins after.

    Raises
    ------
    FileFormatError : no C3D file, one that cannot be read, no markers, a unit that is none, no rate.
    """
    n_stated = _stated_frames(path)
    content = _read_c3d(path)
    values = content["points"]
    n_stated = n_stated or int(content["actual_frames"])
    if len(values) < n_stated:
        problem = f"{len(values)}; ezc3d reads {MOST_FRAMES} at most"
        raise FileFormatError(path, "(end)", f"the {n_stated} frames that it states", problem)
    names, columns = _markers(path, content, values.shape[1])
    if not len(values):
        raise FileFormatError(path, "(end)", "at least one frame", "none")
    unit = next(iter(content["units"].tolist()), "") or "mm"
    if unit not in METERS_PER_UNIT:
        raise FileFormatError(path, "POINT:UNITS", f"one of {sorted(METERS_PER_UNIT)}", unit)
    rate = float(content["rate"])
    if not (np.isfinite(rate) and rate > 0.0):
        raise FileFormatError(path, "POINT:RATE", "a positive number", rate)
    positions = values[:, columns] * METERS_PER_UNIT[unit]
    valid = (content["residuals"][:, columns] >= 0.0) & np.isfinite(positions).all(axis=2)
    positions[~valid] = 0.0
    if y_up if y_up is not None else "Y" in "".join(content["y_screen"].tolist()).upper():
        positions = positions[..., [2, 0, 1]]
    first = int(content["first_frame"])
    return MarkerTrajectories(without_subject(names), (first + np.arange(len(positions))) / rate, positions, rate, valid)


def load_markers(path: str | Path, y_up: bool | None = None) -> MarkerTrajectories:
    """Markers of a TRC or C3D file, whichever its content is.

    Parameters
    ----------
    path : of the file.
    y_up : whether its axes are y up; None: a TRC file has y up, a C3D file what it says itself.

    Returns
    -------
    Markers in meters.

    Raises
    ------
    FileFormatError : as of `trc.load_trc` and `load_c3d`.
    """
    try:
        with Path(path).open("rb") as stream:
            is_c3d = stream.read(2)[1:] == bytes([_MAGIC]) or Path(path).suffix.lower() == ".c3d"
    except OSError as error:
        raise FileFormatError(path, "(file)", "a readable TRC or C3D file", error.strerror or error) from None
    return load_c3d(path, y_up) if is_c3d else load_trc(path, y_up is not False)


def _markers(path: str | Path, content: Mapping[str, np.ndarray], n: int) -> tuple[tuple[str, ...], list[int]]:
    """Names and columns of the points that are markers, of ``n``."""
    labels, other = content["labels"].tolist(), set(content["not_markers"].tolist())
    columns = [i for i, label in enumerate(labels[:n]) if label and label not in other]
    names = tuple(labels[i] for i in columns)
    twice = repeated(names)
    if twice or not names:
        raise FileFormatError(path, "POINT:LABELS", "at least one marker, each with a name of its own", twice or "none")
    return names, columns


def _stated_frames(path: str | Path) -> int:
    """Number of frames by the header; 0 where it is at its end."""
    try:
        with Path(path).open("rb") as stream:
            header = stream.read(_BLOCK)
            stream.seek((header[0] - 1) * _BLOCK + _PROCESSOR if header[:1] > b"\0" else 0)
            processor, size = stream.read(1), stream.seek(0, os.SEEK_END)
    except OSError as error:
        raise FileFormatError(path, "(file)", "a readable C3D file", error.strerror or error) from None
    if len(header) < _BLOCK or header[1] != _MAGIC or not processor:
        raise FileFormatError(path, "(file)", "a C3D file", f"{len(header)} bytes that begin with {header[:4]!r}")
    order = ">" if processor[0] == _BIG_ENDIAN else "<"
    n_points, _, first, last = struct.unpack_from(f"{order}4H", header, 2)
    n = last - first + 1 if last < MOST_FRAMES else 0
    if n * n_points * _LEAST_BYTES > size:
        raise FileFormatError(path, "(end)", f"{n} frames of {n_points} points, as the header says", f"{size} bytes in all")
    return n


_TIMEOUT_S = 120.0
_MEMORY_BYTES = 8 << 30
_NOT_MARKERS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")  # lists of the points that are something else


def _read_c3d(path: str | Path) -> Mapping[str, np.ndarray]:
    """Content of a C3D file.

    ``points`` (n, m, 3) in the file's unit, ``residuals`` (n, m), ``rate`` (), and texts: ``labels`` (m), ``not_markers``,
    ``units``, ``y_screen``; ``actual_frames`` (), how many ``TRIAL`` states, 0 where it does not; ``first_frame`` (), from 0.
    """
    command = [sys.executable, "-m", "tracker_node.loaders.motion.c3d_file", str(path)]
    try:
        child = subprocess.run(command, capture_output=True, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        raise FileFormatError(path, "(content)", f"a C3D file that is read within {_TIMEOUT_S:.0f} s", "none") from None
    if child.returncode != 0:
        said = child.stderr.decode(errors="replace").strip().splitlines()
        problem = said[-1] if said else f"one that ends the reader with status {child.returncode}"
        raise FileFormatError(path, "(content)", "an undamaged C3D file", problem)
    try:
        with np.load(io.BytesIO(child.stdout), allow_pickle=False) as archive:
            return dict(archive)
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise FileFormatError(path, "(content)", "an undamaged C3D file", str(error)) from None


def main(path: str) -> None:
    """Read ``path`` and write what `_read_c3d` returns."""
    import ezc3d

    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    file = ezc3d.c3d(path)
    point = file["parameters"]["POINT"]
    first, last = _actual_fields(file["parameters"].get("TRIAL", {}))

    def texts(name: str) -> list[str]:
        return [str(value).strip() for value in point[name]["value"]] if name in point else []

    np.savez(
        sys.stdout.buffer,
        points=np.asarray(file["data"]["points"], dtype=np.float64)[:3].transpose(2, 1, 0),
        residuals=np.asarray(file["data"]["meta_points"]["residuals"], dtype=np.float64)[0].T,
        rate=np.float64(file["header"]["points"]["frame_rate"]),
        labels=np.array([label for i in ("", *range(2, 99)) for label in texts(f"LABELS{i}")], dtype=np.str_),
        not_markers=np.array([label for kind in _NOT_MARKERS for label in texts(kind)], dtype=np.str_),
        units=np.array(texts("UNITS"), dtype=np.str_),
        y_screen=np.array(texts("Y_SCREEN"), dtype=np.str_),
        actual_frames=last - first + 1 if last else 0,
        first_frame=first - 1 if last else int(file["header"]["points"]["first_frame"]),
    )


def _actual_fields(trial: Mapping[str, Any]) -> tuple[int, int]:
    """Numbers of the first and last frame, each two words of 16 bits, the lower one first; zeros where they make no sense."""
    numbers = []
    for name in ("ACTUAL_START_FIELD", "ACTUAL_END_FIELD"):
        words = [int(word) & 0xFFFF for word in np.ravel(trial[name]["value"])] if name in trial else []
        numbers.append(words[0] + (words[1] << 16) if len(words) == 2 else 0)
    return (numbers[0], numbers[1]) if 0 < numbers[0] <= numbers[1] else (0, 0)


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except Exception as error:  # whatever the library throws becomes the last line that the other process reads
        sys.exit(f"{type(error).__name__}: {error}".replace("\n", " "))
