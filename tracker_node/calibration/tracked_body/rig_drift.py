"""Drift of the cameras' clocks from the images of a tracked body: a line through their delays in stretches of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import CalibrationError
from ...loaders.rig.rig_yaml import RigFile
from ...runs.images import RunImages
from .body_fit import Progress
from .lines import LineEvidence
from .rig_fit import SURE_SIGMAS, RigFit, RigFitOptions, fit_rig

LEAST_SPAN_S = 10.0  # between the middles of the first and the last stretch
_STRETCHES = 3
_LEAST_SETS = 3


@dataclass(frozen=True)
class ClockDrift:
    """A camera's clock against those of most cameras.

    Parameters
    ----------
    later_s, later_sigma_s : by how much its images are later than their stamps say, in the middle of the recording.
    drift, drift_sigma : by how much common time advances more than its clock, seconds a second; 0 where it is not surely one.
    middle_s : the stamp that ``later_s`` is for.
    """

    later_s: float
    later_sigma_s: float
    drift: float
    drift_sigma: float
    middle_s: float


def stretches(stamps_s: Sequence[float]) -> list[np.ndarray]:
    """Indices of the image sets of equal stretches of time.

    Raises
    ------
    CalibrationError : stretches whose middles are less than `LEAST_SPAN_S` apart, or with fewer than three image sets.
    """
    times, n = np.asarray(stamps_s, dtype=np.float64), _STRETCHES
    edges = np.linspace(times.min(), times.max(), n + 1)
    numbers = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, n - 1)
    parts = [np.flatnonzero(numbers == k) for k in range(n)]
    span_s = (edges[-1] - edges[0]) * (n - 1) / n
    if span_s < LEAST_SPAN_S or min(len(part) for part in parts) < _LEAST_SETS:
        least_s = LEAST_SPAN_S * n / (n - 1)
        problem = f"drift needs a run of {least_s:.0f} s, with {_LEAST_SETS} image sets in each of {n} stretches"
        raise CalibrationError("all", f"{problem}; here {edges[-1] - edges[0]:.1f} s, {min(len(p) for p in parts)} in one")
    return parts


def fit_clocks(
    images: RunImages,
    fit: RigFit,
    options: RigFitOptions,
    evidence_of: Callable[[RunImages], LineEvidence],
    progress: Progress | None = None,
) -> dict[str, ClockDrift]:
    """Clocks from fits to stretches of a run, with the cameras where a fit to all of it has them.

    Parameters
    ----------
    images : of the run.
    fit : of the rig to all of them.
    options : of that fit.
    evidence_of : contour evidence of some image sets.
    progress : told of the rounds of every stretch.

    Returns
    -------
    Camera -> its clock.

    Raises
    ------
    CalibrationError : a run that is too short for `stretches`.
    """
    stamps_s = [1e-9 * image_set.stamp_ns for image_set in images.sets]
    only_times = replace(options, places=False, focal=False, sure_sigmas=0.0)
    images = replace(images, states=fit.states)

    def fit_stretch(rows: np.ndarray) -> RigFit:
        part = images.subset(rows)
        found = evidence_of(part)
        return fit_rig(part.model, fit.rig, part.sets, part.states, part.velocities, only_times, progress, evidence=found)

    return fit_drift(stamps_s, stretches(stamps_s), fit_stretch)


def fit_drift(
    stamps_s: Sequence[float], parts: Sequence[np.ndarray], fit: Callable[[np.ndarray], RigFit]
) -> dict[str, ClockDrift]:  # fmt: skip
    """Clocks of all cameras, by weighted lines through their delays in each stretch.

    Parameters
    ----------
    stamps_s : of all image sets.
    parts : indices of image sets, from `stretches`.
    fit : fits the rig to the image sets with the given indices, with `RigFitOptions.sure_sigmas` 0.

    Returns
    -------
    Camera -> its clock.
    """
    times = np.array([float(np.mean(np.asarray(stamps_s)[part])) for part in parts])
    fits = [fit(part) for part in parts]
    middle_s = float(times.mean())
    result = {}
    for name in fits[0].cameras:
        found = [f.cameras[name] for f in fits]
        delays, sigmas = np.array([c.later_s for c in found]), np.array([c.later_sigma_s for c in found])
        result[name] = _line(times - middle_s, delays, np.maximum(sigmas, 1e-6), middle_s)
    return result


def _line(times: np.ndarray, delays: np.ndarray, sigmas: np.ndarray, middle_s: float) -> ClockDrift:
    """The line; its slope, and then its height, are taken for 0 where they are not surely something else."""
    basis = np.stack([np.ones_like(times), times], axis=1) / sigmas[:, None]
    covariance = np.linalg.inv(basis.T @ basis)
    value = covariance @ basis.T @ (delays / sigmas)
    rest = delays / sigmas - basis @ value
    deviations = np.sqrt(np.diag(covariance) * max(1.0, float(rest @ rest) / max(len(times) - 2, 1)))
    if abs(value[1]) < SURE_SIGMAS * deviations[1]:
        value = np.array([np.sum(delays / sigmas**2) / np.sum(sigmas**-2.0), 0.0])
        if abs(value[0]) < SURE_SIGMAS * deviations[0]:
            value[0] = 0.0
    return ClockDrift(float(value[0]), float(deviations[0]), float(value[1]), float(deviations[1]), middle_s)


def with_drift(rig_file: RigFile, fit: RigFit, clocks: Mapping[str, ClockDrift], begins_s: float) -> RigFile:
    """The rig file with clocks that drift.

    Parameters
    ----------
    rig_file : with the places of the fit.
    fit : whose time offsets are replaced.
    clocks : by camera, over the stretches of the run.
    begins_s : time of the run's beginning, seconds.

    Returns
    -------
    A copy.
    """
    changes = {}
    for name, clock in clocks.items():
        entry = rig_file.cameras[name]
        offset_s = entry.time_offset_s - fit.cameras[name].later_s + clock.later_s + clock.drift * (begins_s - clock.middle_s)
        ppm = entry.time_drift_ppm + 1e6 * clock.drift * (1.0 + 1e-6 * entry.time_drift_ppm)
        changes[name] = {"time_offset_s": offset_s, "time_drift_ppm": ppm}
    return rig_file.with_cameras(changes)


def drift_metrics(clocks: Mapping[str, ClockDrift]) -> dict[str, float | int]:
    """``refine.<camera>.drift_ppm`` and its sigma."""
    metrics: dict[str, float | int] = {}
    for name, clock in clocks.items():
        metrics |= {f"refine.{name}.drift_ppm": 1e6 * clock.drift, f"refine.{name}.drift_sigma_ppm": 1e6 * clock.drift_sigma}
    return metrics
