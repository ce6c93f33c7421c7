"""What comes of clicks: points in space, how well they were digitized, cameras from control points, trajectories."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...calibration.points.dlt import MIN_POINTS, calibrate, check_control_points, object_errors_m
from ...calibration.points.triangulation import ReconstructedPoint, reconstruct_point, repeatability
from ...camera.rig import CameraRig
from ...errors import CalibrationError
from ...loaders.motion.trajectory_file import Trajectories, write_joints
from ...loaders.motion.trc import MarkerTrajectories, dump_trc
from ...loaders.rig.control_points import ControlPoints
from .click_store import Clicked, ClickStore

JOINTS_FILE, TRC_FILE = "joints.csv", "joints.trc"
_MOST_PX = 10.0  # rms of clicks on one place


def reconstruct(rig: CameraRig, clicked: Clicked, sigma_px: float = 1.0) -> dict[str, tuple[tuple[str, ...], ReconstructedPoint]]:
    """Places of all points that two cameras or more show.

    Parameters
    ----------
    rig : all cameras.
    clicked : clicks on the images of one set.
    sigma_px : standard deviation of a click along u and v.

    Returns
    -------
    Point -> the cameras that show it, and its place.
    """
    found = {}
    for point in dict.fromkeys(point for points in clicked.values() for point in points):
        names = tuple(camera.name for camera in rig if point in clicked.get(camera.name, {}))
        pixels = np.array([clicked[name][point] for name in names])
        result = reconstruct_point([rig[name] for name in names], pixels, sigma_px)
        if result is not None:
            found[point] = names, result
    return found


@dataclass(frozen=True)
class Repeatability:
    """Standard deviations of one digitization, from images that were digitized more than once; not a number where there are none.

    Attributes
    ----------
    pixels, freedom : along u and v, and degrees of freedom.
    meters, freedom_3d : of the reconstructed points along the world's axes.
    """

    pixels: float
    freedom: int
    meters: float
    freedom_3d: int


def repeatability_of(rig: CameraRig, store: ClickStore, passes: tuple[str, ...]) -> Repeatability:
    """How well whoever has clicked would do so again.

    Parameters
    ----------
    rig : all cameras.
    store : the clicks.
    passes : names of the passes that are compared.

    Returns
    -------
    In the images, and in space.
    """
    pixels: list[np.ndarray] = []
    places: list[np.ndarray] = []
    for stamp_ns in store.stamps_ns():
        pixels += [p for points in store.repeated(stamp_ns).values() for p in points.values()]
        by_point: dict[str, list[np.ndarray]] = {}
        for name in passes:
            for point, (_, found) in reconstruct(rig, store.clicked(name, stamp_ns)).items():
                by_point.setdefault(point, []).append(found.position_m)
        places += [np.array(positions) for positions in by_point.values()]
    return Repeatability(*repeatability(pixels), *repeatability(places))


@dataclass(frozen=True, eq=False)
class ControlAssessment:
    """What a camera's control points say: ``residuals_px`` (n, 2) of the camera that fits them best, or the ``problem``."""

    seen: ControlPoints
    residuals_px: np.ndarray | None
    problem: str = ""


def judge_control(
    rig: CameraRig, seen: Mapping[str, ControlPoints], constraint: str
) -> tuple[dict[str, ControlAssessment], np.ndarray]:
    """Assess the control points of each camera.

    Parameters
    ----------
    rig : all cameras.
    seen : camera -> its control points, with places and pixels.
    constraint : one of `calibration.points.dlt.CONSTRAINTS`.

    Returns
    -------
    assessments : by camera.
    errors : (k,) meters between known places and where these cameras reconstruct them.
    """
    assessments, cameras = {}, []
    for name, points in seen.items():
        model = rig[name].model
        try:
            if len(points.names) < MIN_POINTS:
                raise CalibrationError(name, f"expected {MIN_POINTS} points or more, got {len(points.names)}")
            check_control_points(name, points, (model.width, model.height))
            found = calibrate(name, points.points, points.pixels, (model.width, model.height), constraint)
            assessments[name] = ControlAssessment(points, found.residuals_px)
            cameras.append(found.camera)
        except CalibrationError as error:
            assessments[name] = ControlAssessment(points, None, error.problem)
    return assessments, object_errors_m(cameras, seen)


def _trajectories(rig: CameraRig, store: ClickStore) -> Trajectories:
    """Every point in every image set, from the mean of the passes; not valid where fewer than two cameras show it."""
    stamps = store.stamps_ns()
    found = [reconstruct(rig, store.mean_clicks(stamp_ns)) for stamp_ns in stamps]
    names = tuple(dict.fromkeys(name for of_set in found for name in of_set))
    positions, valid = np.zeros((len(stamps), len(names), 3)), np.zeros((len(stamps), len(names)), dtype=bool)
    for i, of_set in enumerate(found):
        for name, (_, point) in of_set.items():
            positions[i, names.index(name)], valid[i, names.index(name)] = point.position_m, True
    return Trajectories(names, np.array(stamps, dtype=np.int64), positions, valid)


def contradictions(rig: CameraRig, store: ClickStore) -> list[str]:
    """Points whose clicks cannot be of one place, the worst first, for people.

    Parameters
    ----------
    rig : all cameras.
    store : the clicks.

    Returns
    -------
    Point, image set and how far the clicks are off.
    """
    stamps = store.stamps_ns()
    found = [(stamp_ns, name, point.rms_px) for stamp_ns in stamps
             for name, (_, point) in reconstruct(rig, store.mean_clicks(stamp_ns)).items()]  # fmt: skip
    apart = sorted((each for each in found if each[2] > _MOST_PX), key=lambda each: -each[2])
    return [f"{name} at {1e-9 * (stamp_ns - stamps[0]):.3f} s by {rms_px:.0f} px" for stamp_ns, name, rms_px in apart]


def save_trajectories(rig: CameraRig, store: ClickStore) -> list[Path]:
    """Write ``joints.csv`` and ``joints.trc`` (y up) into the folder of the clicks.

    A TRC file has one rate, that of the digitized image sets; those that were left out among them are rows without places.

    Parameters
    ----------
    rig : all cameras.
    store : the clicks, whose folder is written to.

    Returns
    -------
    The files written, none without points.

    Raises
    ------
    FileFormatError : a file of that name that is not ours to replace.
    """
    found = _trajectories(rig, store)
    if not found.names:
        return []
    seen = found.valid.any(axis=1)
    found = Trajectories(found.names, found.stamps_ns[seen], found.positions_m[seen], found.valid[seen])
    even, step_ns = _evenly(found)
    markers = MarkerTrajectories(even.names, 1e-9 * even.stamps_ns, even.positions_m, 1e9 / step_ns, even.valid)
    for name in (JOINTS_FILE, TRC_FILE):  # neither, if one of them is refused
        store.folder.check(name)
    return [
        store.folder.write(JOINTS_FILE, lambda path: write_joints(path, found)),
        store.folder.write(TRC_FILE, lambda path: dump_trc(markers, path)),
    ]


def _evenly(found: Trajectories) -> tuple[Trajectories, float]:
    """With rows that are not valid where image sets were left out, and the median step in nanoseconds; 1 s of a single one."""
    steps = np.diff(found.stamps_ns)
    if not len(steps):
        return found, 1e9
    step_ns = float(np.median(steps))
    apart = np.maximum(1, np.round(steps / step_ns)).astype(int)  # in steps
    at = np.concatenate([[0], np.cumsum(apart)])
    n = int(at[-1]) + 1
    stamps = np.round(np.interp(np.arange(n), at, found.stamps_ns - found.stamps_ns[0])).astype(np.int64) + found.stamps_ns[0]
    positions, valid = np.zeros((n, *found.positions_m.shape[1:])), np.zeros((n, len(found.names)), dtype=bool)
    positions[at], valid[at] = found.positions_m, found.valid
    return Trajectories(found.names, stamps, positions, valid), step_ns
