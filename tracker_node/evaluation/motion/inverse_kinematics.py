"""Inverse kinematics of an OpenSim model: our landmarks are its markers, weighted by what their covariances say.

OpenSim's own solver finds the coordinates in each image set for which the weighted sum of squared distances between the model's
markers and ours is least. Source: S. L. Delp et al., "OpenSim: open-source software to create and analyze dynamic simulations of
movement", IEEE Trans. Biomed. Eng. 54 (2007) 1940-1950. What is left says how well the model's size and joints suit the body.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileFormatError, extra_module
from ...loaders.motion.bvh import AXES_Y_UP
from ...loaders.motion.trc import NumberTable, dump_table
from ...model.humans.measures import landmark_of_marker

FEWEST_MARKERS = 3
LEAST_SD_M = 0.002  # landmarks that are said to be known better than this are not
_WEIGHTS = (1e-3, 1e3)  # between which the weights stay
_ACCURACY = 1e-6
_ENVIRONMENT = ("PATH", "LD_LIBRARY_PATH", "SIMBODY_HOME")  # which OpenSim sets anew where it is imported


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """What OpenSim has found in n image sets; not-a-number in sets without a state.

    Attributes
    ----------
    model : name of the OpenSim model.
    stamps_ns : (n,).
    coordinates, units : (k,) its names and "rad" or "m".
    values : (n, k).
    markers : (m,) those that it has in common with the body, by their landmarks.
    errors_m : (n, m) distance between its marker and ours.
    weighted : by covariances; else all alike.
    """

    model: str
    stamps_ns: np.ndarray
    coordinates: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    markers: tuple[str, ...]
    errors_m: np.ndarray
    weighted: bool

    @property
    def rms_m(self) -> np.ndarray:
        """(n,) over the markers of a set."""
        return np.sqrt(np.mean(self.errors_m**2, axis=1))

    def metrics(self) -> dict[str, float | int]:
        """Means over the sets, by key."""
        known = np.isfinite(self.errors_m).all(axis=1)
        if not known.any():
            return {"opensim_sets": 0}
        return {
            "opensim_sets": int(known.sum()),
            "opensim_marker_rms_mm": 1e3 * float(self.rms_m[known].mean()),
            "opensim_marker_max_mm": 1e3 * float(self.errors_m[known].max()),
        }


def inverse_kinematics(
    model_path: str | Path,
    stamps_ns: np.ndarray,
    names: Sequence[str],
    points_m: np.ndarray,
    sds_m: np.ndarray | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> InverseKinematics:
    """Coordinates of an OpenSim model that suit landmarks best.

    Parameters
    ----------
    model_path : .osim, scaled to the person; its markers have the names of our landmarks, or those of OpenPose.
    stamps_ns : (n,) increasing.
    names : of m landmarks.
    points_m : (n, m, 3) in the world, z up; not-a-number where there is no state.
    sds_m : (n, m) their standard deviations, of which the weights are the inverse squares; None: all weigh alike.
    progress : is given a sentence now and then.

    Returns
    -------
    What was found in each set.

    Raises
    ------
    MissingExtraError : the package ``opensim`` is not installed.
    FileFormatError : no model of OpenSim, or one that has fewer than `FEWEST_MARKERS` markers in common with the body.
    """
    with _own_environment():
        osim = extra_module("opensim", "opensim")
    osim.Logger.setLevel(osim.Logger.Level_Error)
    osim.Logger.removeFileSink()
    model, state = _loaded(osim, Path(model_path))
    own = [str(model.getMarkerSet().get(i).getName()) for i in range(model.getMarkerSet().getSize())]
    pairs = [(marker, list(names).index(landmark_of_marker(marker))) for marker in own if landmark_of_marker(marker) in names]
    if len(pairs) < FEWEST_MARKERS:
        expected = f"at least {FEWEST_MARKERS} named like landmarks ({', '.join(list(names)[:3])} ...) or OpenPose's (RHip ...)"
        raise FileFormatError(model_path, "markers", expected, ", ".join(own[:8]) or "none")
    columns = [column for _, column in pairs]
    places = points_m[:, columns] @ AXES_Y_UP.T
    good = np.asarray(np.isfinite(places).all(axis=(1, 2)))
    weights = np.ones(places.shape[:2]) if sds_m is None else _weights(sds_m[:, columns], good)
    count = model.getCoordinateSet().getSize()
    coordinates = [model.getCoordinateSet().get(i) for i in range(count)]
    values, errors = np.full((len(places), count), np.nan), np.full(places.shape[:2], np.nan)
    if good.any():
        markers, times = [marker for marker, _ in pairs], (stamps_ns - stamps_ns[0]) * 1e-9
        references = _references(osim, markers, times[good], places[good])  # the solver does not keep it alive
        unused = osim.SimTKArrayCoordinateReference()
        solver = osim.InverseKinematicsSolver(model, references, unused, np.inf)
        solver.setAccuracy(_ACCURACY)
        for step, i in enumerate(np.flatnonzero(good)):
            state.setTime(float(times[i]))
            if step == 0 or not good[i - 1]:
                solver.assemble(state)  # before which it has no weights that could be changed
            for marker, weight in zip(markers, weights[i], strict=True):
                solver.updateMarkerWeight(marker, float(weight))
            solver.track(state)
            values[i] = [coordinate.getValue(state) for coordinate in coordinates]
            errors[i] = [solver.computeCurrentMarkerError(marker) for marker in markers]
            if step % 200 == 199:
                progress(f"OpenSim: {step + 1} of {int(good.sum())} image sets")
    turns = {osim.Coordinate.Rotational: "rad", osim.Coordinate.Translational: "m"}
    units = tuple(turns.get(coordinate.getMotionType(), "") for coordinate in coordinates)
    found = tuple(str(coordinate.getName()) for coordinate in coordinates)
    used = tuple(landmark_of_marker(marker) for marker, _ in pairs)
    return InverseKinematics(str(model.getName()), stamps_ns, found, units, values, used, errors, sds_m is not None)


def write_coordinates(found: InverseKinematics, path: Path) -> None:
    """Write coordinates as a table that OpenSim reads (.mot): times since the first set, angles in degrees, gaps left out.

    Parameters
    ----------
    found : of `inverse_kinematics`.
    path : of the file.
    """
    good = np.isfinite(found.values).all(axis=1)
    scale = np.array([np.degrees(1.0) if unit == "rad" else 1.0 for unit in found.units])
    values = found.values[good] * scale
    times = (found.stamps_ns[good] - found.stamps_ns[0]) * 1e-9
    dump_table(NumberTable(found.coordinates, times, values, np.ones(values.shape, dtype=bool), True), path)


@contextmanager
def _own_environment() -> Iterator[None]:
    """Keep what the import of OpenSim would set anew, so that child processes find what they found before."""
    before = {name: os.environ.get(name) for name in _ENVIRONMENT}
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _loaded(osim: Any, path: Path) -> tuple[Any, Any]:
    """The model, and its state; one that cannot be read is named."""
    if not path.is_file():
        raise FileFormatError(path, "(path)", "a model of OpenSim (.osim)", "nothing there")
    try:
        model = osim.Model(str(path))
        return model, model.initSystem()
    except RuntimeError as error:
        said = next((line.strip() for line in str(error).splitlines() if line.strip()), "what OpenSim cannot read")
        raise FileFormatError(path, "(content)", "a model of OpenSim (.osim)", said) from None


def _weights(sds_m: np.ndarray, good: np.ndarray) -> np.ndarray:
    """(n, m) inverse variances, 1 in the middle; landmarks of which nothing is said weigh least."""
    told = good[:, None] & np.isfinite(sds_m) & (sds_m > 0.0)
    inverse = 1.0 / np.maximum(np.where(told, sds_m, 1.0), LEAST_SD_M) ** 2
    middle = float(np.median(inverse[told])) if told.any() else 1.0
    return np.where(told, np.clip(inverse / middle, *_WEIGHTS), _WEIGHTS[0] if told.any() else 1.0)


def _references(osim: Any, markers: Sequence[str], times_s: np.ndarray, places: np.ndarray) -> Any:
    """Markers at (n, m, 3), meters, y up."""
    table = osim.TimeSeriesTableVec3()
    table.setColumnLabels(list(markers))
    for time, row in zip(times_s, places, strict=True):
        table.appendRow(float(time), osim.RowVectorVec3([osim.Vec3(*map(float, place)) for place in row]))
    table.addTableMetaDataString("Units", "m")
    table.addTableMetaDataString("DataRate", f"{(len(times_s) - 1) / max(times_s[-1] - times_s[0], 1e-9):.6g}")
    weights = osim.SetMarkerWeights()
    for marker in markers:
        weights.cloneAndAppend(osim.MarkerWeight(marker, 1.0))
    return osim.MarkersReference(table, weights)
