"""A run's motion in files of other programs: TRC, MOT, STO, C3D, BVH, TUM; CSV is in `run_export`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileFormatError, repeated
from ...geometry import so3
from ...loaders.motion.bvh import AXES_Y_UP, dump_bvh
from ...loaders.motion.c3d_file import MOST_EVENTS, MOST_FRAMES, AnglesOverTime, TimedEvent, dump_c3d
from ...loaders.motion.trajectory_file import dump_tum
from ...loaders.motion.trc import MarkerTrajectories, NumberTable, dump_table, dump_trc
from ...model.articulated import ArticulatedModel
from ...model.humans.measures import MARKER_OF_LANDMARK
from ...runs.motion import RunMotion, without_gaps
from .coordinates import model_coordinates, opensim_coordinates
from .gait import find_gait, foot_contacts
from .isb_angles import isb_angles


@dataclass(frozen=True)
class ExportOptions:
    """How a motion is written.

    Parameters
    ----------
    y_up : the file's axes are (x, y, z) = (y, z, x) of the world, as OpenSim and Pose2Sim have them; otherwise the world's.
    unit : of lengths: m, cm, mm. degrees : of angles; otherwise radians. Where the format leaves a choice.
    landmarks : names, in the order of the file; empty: all of the model (BVH: none).
    openpose_names : landmarks under the names of OpenPose and Pose2Sim (``RKnee``), where they have one.
    link : whose pose is written to TUM files; empty: the root.
    opensim : coordinates of OpenSim's models of a person instead of the model's own, in MOT, STO and CSV.
    isb_angles : also joint angles after the ISB, in C3D and CSV.

    Raises
    ------
    FileFormatError : a landmark given twice, which readers would refuse.
    """

    y_up: bool
    unit: str = "m"
    degrees: bool = True
    landmarks: tuple[str, ...] = ()
    openpose_names: bool = False
    link: str = ""
    opensim: bool = False
    isb_angles: bool = False

    def __post_init__(self) -> None:
        if twice := repeated(self.landmarks):
            raise FileFormatError("export", "landmarks", "each name once", ", ".join(twice))

    @property
    def axes(self) -> np.ndarray:
        """(3, 3): file = axes @ world."""
        return AXES_Y_UP if self.y_up else np.eye(3)

    @property
    def angle_unit(self) -> str:
        return "deg" if self.degrees else "rad"

    def columns(self, model: ArticulatedModel) -> list[int]:
        """Indices of the landmarks. Raises UnknownNameError."""
        return [model.landmark_index(name) for name in self.landmarks or model.landmark_names]

    def labels(self, model: ArticulatedModel) -> tuple[str, ...]:
        """Names of the landmarks in the file."""
        names = self.landmarks or model.landmark_names
        return tuple(MARKER_OF_LANDMARK.get(name, name) for name in names) if self.openpose_names else tuple(names)


_DOWN, _OFF = "Foot Strike", "Foot Off"
AT_CONSTANT_RATE = ("trc", "c3d", "bvh")  # formats that state a rate, or whose readers expect one


def markers_of(motion: RunMotion, options: ExportOptions) -> MarkerTrajectories:
    """The chosen landmarks in world axes, times since the first row.

    Parameters
    ----------
    motion : states over time.
    options : which landmarks, under which names.

    Returns
    -------
    Positions in meters, not valid in gaps.

    Raises
    ------
    FileFormatError : a body without landmarks.
    UnknownNameError : a landmark that it does not have.
    """
    columns = options.columns(motion.model)
    if not columns:
        raise FileFormatError(motion.model.name, "landmarks", "a body model with at least one", "none")
    valid = motion.landmarks_valid()[:, columns]
    positions = np.where(valid[..., None], motion.landmarks_m()[:, columns], 0.0)
    return MarkerTrajectories(options.labels(motion.model), motion.times_s, positions, motion.rate_hz, valid)


def _trc(motion: RunMotion, path: Path, options: ExportOptions) -> list[str]:
    dump_trc(markers_of(motion, options), path, options.y_up, options.unit)
    return []


def _c3d(motion: RunMotion, path: Path, options: ExportOptions) -> list[str]:
    chosen = [motion.model.landmarks[i] for i in options.columns(motion.model)]
    described = [f"{landmark.name}, fixed to {landmark.link}" for landmark in chosen]
    angles = None
    if options.isb_angles:
        found = isb_angles(motion)
        angles = AnglesOverTime(tuple(f"{joint}Angles" for joint in found.joints), found.radians, found.valid)
    events = foot_events(motion)
    dump_c3d(markers_of(motion, options), path, options.y_up, options.unit, described, angles, options.degrees, events)
    notes = [f"{len(events)} events, of which C3D holds {MOST_EVENTS}"] if len(events) > MOST_EVENTS else []
    long = f"{len(motion)} frames: programs that do not know TRIAL:ACTUAL_END_FIELD see the first {MOST_FRAMES}"
    return notes + ([long] if len(motion) > MOST_FRAMES else [])


def foot_events(motion: RunMotion) -> list[TimedEvent]:
    """When feet come down on the floor and leave it, under the names that gait programs know.

    Parameters
    ----------
    motion : at a constant rate.

    Returns
    -------
    In order of time, since its first row; none of a body without feet.
    """
    points = dict(zip(motion.model.landmark_names, np.swapaxes(motion.landmarks_or_nan_m(), 0, 1), strict=True))
    gait = find_gait(motion.times_s, points, {}, motion.rate_hz)
    found: set[tuple[float, str, str]] = set()
    for side, foot in foot_contacts(motion.times_s, points, gait).items():
        found |= {(each.start_s, side.capitalize(), _DOWN) for each in foot.contacts if each.comes}
        found |= {(each.end_s, side.capitalize(), _OFF) for each in foot.contacts if each.leaves}
    return [TimedEvent(*each) for each in sorted(found)]


def _opensim_table(motion: RunMotion, path: Path, options: ExportOptions) -> list[str]:
    found = opensim_coordinates(motion) if options.opensim else model_coordinates(motion, options.y_up)
    # Rows of gaps are left out: OpenSim's older class Storage, which its window uses, stops reading at the first nan
    values = found.scaled(options.degrees)[motion.valid]
    valid = np.ones(values.shape, dtype=bool)
    dump_table(NumberTable(found.names, motion.times_s[motion.valid], values, valid, options.degrees), path)
    return []


def _bvh(motion: RunMotion, path: Path, options: ExportOptions) -> list[str]:
    whole = without_gaps(motion)
    dump_bvh(motion.model, whole.Ts_world_link(), motion.period_ns * 1e-9, path, options.y_up, options.unit, options.landmarks)
    missing = int(np.count_nonzero(~motion.valid))
    return [f"BVH cannot mark gaps: {missing} frames are interpolated"] if missing else []


def _tum(motion: RunMotion, path: Path, options: ExportOptions) -> list[str]:
    link = motion.model.chain.link_index(options.link) if options.link else 0
    good = motion.valid
    Ts = motion.Ts_world_link()[good, link]
    turns = np.array([so3.xyzw_from_matrix(rotation) for rotation in options.axes @ Ts[:, :3, :3]])
    dump_tum(motion.stamps_ns[good], Ts[:, :3, 3] @ options.axes.T, turns, path)
    return []


# Each writes a file, and returns what the format could not hold
FORMATS: dict[str, Callable[[RunMotion, Path, ExportOptions], list[str]]] = {
    "trc": _trc,
    "mot": _opensim_table,
    "sto": _opensim_table,
    "c3d": _c3d,
    "bvh": _bvh,
    "tum": _tum,
}
