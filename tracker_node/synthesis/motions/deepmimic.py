"""Captured motions in the DeepMimic text format.

A clip states, per image, the root's position and orientation and the rotations of 12 joints, with Y up, X forward and Z to the
right (44 columns: dt; root xyz; root quaternion wxyz; then chest, neck, right hip, knee, ankle, shoulder, elbow, and the same
on the left; spherical joints as quaternions wxyz, knees and elbows as one angle about the lateral axis).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from ...errors import FileFormatError, SourceError, UnknownNameError
from ...loaders.json_values import read_json
from .motion import (
    LONG_RUN,
    LONG_RUN_CLIPS,
    LONG_RUN_IMAGES,
    LONG_RUN_RADIUS_M,
    PROCEDURAL,
    Motion,
    chained,
    heading,
    joined,
    swing,
    within,
)

# Column of each segment's joint in a clip, and the number of its columns (4: quaternion, 1: angle about the lateral axis).
_COLUMNS = {
    "pelvis": (4, 4), "torso": (8, 4), "head": (12, 4),
    "right_thigh": (16, 4), "right_shank": (20, 1), "right_foot": (21, 4),
    "right_upper_arm": (25, 4), "right_forearm": (29, 1),
    "left_thigh": (30, 4), "left_shank": (34, 1), "left_foot": (35, 4),
    "left_upper_arm": (39, 4), "left_forearm": (43, 1),
}  # fmt: skip
N_COLUMNS = 44

# Clip axes (x forward, y up, z right) to body and world axes (x forward, y left, z up).
_WORLD_FROM_CLIP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class MotionClip:
    """A clip as its file states it: ``columns`` (n, 44), and whether its end joins its beginning."""

    name: str
    columns: np.ndarray
    wraps: bool

    @property
    def times_s(self) -> np.ndarray:
        """(n,) seconds; every row says how long it lasts."""
        return np.concatenate([[0.0], np.cumsum(self.columns[:-1, 0])])

    @property
    def duration_s(self) -> float:
        return float(self.times_s[-1])

    def resampled(self, rate_hz: float, n_images: int | None = None) -> Motion:
        """The clip at another rate; rotations are interpolated on the sphere, positions linearly.

        ``n_images`` beyond the clip's end repeat a clip that wraps, with the root's travel and turn continued, and with its
        end bent to meet its beginning.

        Parameters
        ----------
        rate_hz : images per second.
        n_images : of the motion; None: the whole clip.

        Returns
        -------
        The motion.

        Raises
        ------
        SourceError : when more images are asked for than a clip that does not wrap has.
        """
        available = int(np.floor(self.duration_s * rate_hz + 1e-9)) + 1
        n = available if n_images is None else n_images
        if n > available and not self.wraps:
            raise SourceError(self.name, f"the clip gives {available} images at {rate_hz:g} Hz and does not wrap, got {n}")
        times = np.arange(n) / rate_hz
        if n <= available:
            return Motion(self.name, float(rate_hz), *self._at(times))
        cycles = np.floor(times / self.duration_s + 1e-12).astype(int)
        clip = self.closed()
        positions, rotations = clip._at(times - cycles * self.duration_s)
        positions, rotations = _continued(positions, rotations, cycles, *clip._at(np.array([0.0, self.duration_s])))
        return Motion(self.name, float(rate_hz), positions, rotations)

    def closed(self) -> MotionClip:
        """The clip with its last 0.3 s bent so that its last pose is its first, but for travel and turn."""
        columns, times = self.columns.copy(), self.times_s
        weight = np.clip(1.0 - (times[-1] - times) / 0.3, 0.0, 1.0)
        weight = weight * weight * (3.0 - 2.0 * weight)
        for segment, (start, width) in _COLUMNS.items():
            values = columns[:, start : start + width]
            if width == 1:
                values += weight[:, None] * (values[0] - values[-1])
                continue
            turns = Rotation.from_quat(values[:, [1, 2, 3, 0]])
            first, last = turns[0], turns[-1]
            if segment == "pelvis":
                ends = _WORLD_FROM_CLIP @ Rotation.concatenate([first, last]).as_matrix() @ _WORLD_FROM_CLIP.T
                turn = _WORLD_FROM_CLIP.T @ heading(ends[1]) @ heading(ends[0]).T @ _WORLD_FROM_CLIP
                first = Rotation.from_matrix(turn) * first
            gap = (first * last.inv()).as_rotvec()
            bent = Rotation.from_rotvec(weight[:, None] * gap) * turns
            values[:] = bent.as_quat()[:, [3, 0, 1, 2]]
        columns[:, 2] += weight * (columns[0, 2] - columns[-1, 2])
        return MotionClip(self.name, columns, self.wraps)

    def _at(self, times_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        own = self.times_s
        times_s = np.clip(times_s, 0.0, own[-1])
        local = {}
        for segment, (start, width) in _COLUMNS.items():
            values = self.columns[:, start : start + width]
            if width == 4:
                turns = Slerp(own, Rotation.from_quat(values[:, [1, 2, 3, 0]]))(times_s)
            else:
                angles = np.interp(times_s, own, values[:, 0])
                turns = Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0])
            local[segment] = _WORLD_FROM_CLIP @ turns.as_matrix() @ _WORLD_FROM_CLIP.T
        roots = np.stack([np.interp(times_s, own, self.columns[:, 1 + axis]) for axis in range(3)], axis=1)
        return roots @ _WORLD_FROM_CLIP.T, chained(local)


def _continued(positions, rotations, cycles, end_positions, end_rotations) -> tuple[np.ndarray, np.ndarray]:
    """Move what lies in repetition c by the travel and turn of c whole clips (horizontal, about the vertical)."""
    turn = heading(end_rotations[1, 0]) @ heading(end_rotations[0, 0]).T
    positions, rotations = positions.copy(), rotations.copy()
    total_turn, total_shift = np.eye(3), np.zeros(3)
    step = end_positions[1] - turn @ end_positions[0]
    step[2] = 0.0
    for cycle in range(1, cycles.max() + 1):
        total_shift = total_turn @ step + total_shift
        total_turn = total_turn @ turn
        inside = cycles == cycle
        positions[inside] = positions[inside] @ total_turn.T + total_shift
        rotations[inside] = total_turn @ rotations[inside]
    return positions, rotations


def read_clip(path: str | Path) -> MotionClip:
    """A clip from a DeepMimic motion file (JSON with ``Frames`` of 44 numbers).

    Raises
    ------
    SourceError : no such file. FileFormatError : naming the field that is wrong.
    """
    path = Path(path)
    if not path.is_file():
        raise SourceError(path, "no such motion file")
    content = read_json(path)
    frames = content.get("Frames") if isinstance(content, dict) else None
    if not isinstance(frames, list) or len(frames) < 2:
        raise FileFormatError(path, "Frames", "a list of at least two rows", frames)
    for i, row in enumerate(frames):
        if not isinstance(row, list) or len(row) != N_COLUMNS or not all(isinstance(v, (int, float)) for v in row):
            raise FileFormatError(path, f"Frames[{i}]", f"{N_COLUMNS} numbers", row)
    columns = np.array(frames, dtype=np.float64)
    if not np.isfinite(columns).all() or (columns[:-1, 0] <= 0.0).any():
        raise FileFormatError(path, "Frames", "finite numbers, a positive duration in column 0", "others")
    for segment, (start, width) in _COLUMNS.items():
        lengths = np.linalg.norm(columns[:, start : start + 4], axis=1) if width == 4 else np.ones(1)
        if (np.abs(lengths - 1.0) > 0.5).any():
            got = f"a length of {lengths[np.argmax(np.abs(lengths - 1.0))]:.3g}"
            raise FileFormatError(path, f"Frames, quaternion of {segment}", "about unit length", got)
    return MotionClip(path.stem.removeprefix("humanoid3d_"), columns, content.get("Loop") == "wrap")


def find_clip(name: str, folder: str | Path) -> Path:
    """File of a clip, ``humanoid3d_<name>.txt``.

    Parameters
    ----------
    name : of the clip.
    folder : of the clips.

    Returns
    -------
    The file.

    Raises
    ------
    SourceError : no such folder, or no clips in it. UnknownNameError : listing the clips there.
    """
    known = {p.stem.removeprefix("humanoid3d_"): p for p in sorted(Path(folder).glob("humanoid3d_*.txt"))}
    if not known:
        raise SourceError(folder, "no motion clips there (expected files humanoid3d_<name>.txt)")
    if name not in known:
        raise UnknownNameError("motion", name, [*known, PROCEDURAL])
    return known[name]


def load_motion(name: str, rate_hz: float, n_images: int | None = None, folder: str | Path | None = None) -> Motion:
    """A motion by name.

    Parameters
    ----------
    name : ``swing`` (procedural), a path of a clip, the name of a clip in ``folder``, or ``long_run`` (several).
    rate_hz : images per second.
    n_images : of the motion; None: as many as it has.
    folder : of the clips.

    Returns
    -------
    The motion, its middle above the world's origin.

    Raises
    ------
    SourceError : when the clip's file, or the folder, is missing. FileFormatError : as `read_clip`.
    """
    if name == PROCEDURAL:
        return swing(rate_hz, 60 if n_images is None else n_images).centered()
    if Path(name).suffix or "/" in name:
        return read_clip(name).resampled(rate_hz, n_images).centered()
    if folder is None:
        raise SourceError(name, f"name the folder of the motion clips, or take the procedural motion '{PROCEDURAL}'")
    if name == LONG_RUN:
        parts = [read_clip(find_clip(clip, folder)).resampled(rate_hz) for clip in LONG_RUN_CLIPS]
        return within(joined(parts, n_images or round(LONG_RUN_IMAGES * rate_hz / 30.0), LONG_RUN), LONG_RUN_RADIUS_M)
    return read_clip(find_clip(name, folder)).resampled(rate_hz, n_images).centered()
