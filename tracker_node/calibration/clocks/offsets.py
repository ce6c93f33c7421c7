"""Clocks of free-running cameras from motion in their images: offset and drift, with their covariance.

Profiles of motion (`motion`) of every pair of cameras are correlated over time, roughly first; the lags that agree
best over all pairs are refined below the image period, each pair together with its drift, as image registration in one dimension
(Lucas and Kanade); and the clocks of the cameras are the weighted least-squares solution of all pairs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import CalibrationError
from ...loaders.rig.rig_yaml import RigFile
from .motion import MotionProfiles, Pair, Signals, Tables, correlations, refined

DRIFT_SIGMA = 200e-6  # of what the clocks of cameras differ by; quartz has 50 to 100 millionths
SURE_SIGMAS = (3.0, 2.0)  # an offset, a drift, of fewer is taken for none; drift also has a prior
LEAST_DRIFT_S = 20.0  # a shorter recording does not tell drift
_NEAR_S, _NEAR_PERIODS = 0.2, 4.0  # a second offset that fits as well is farther from the first
_BEST_CORRELATION = 0.5  # of some pair of each camera; unrelated motion of a few seconds comes to 0.2 to 0.47 at its best lag
_REPEATED = 0.93  # how well a second offset agrees: in a clip of a walk as well as .99, 0.8 s off; in fifteen others .88 at most
# Cameras see one motion differently: what lags are off by, in image periods of cameras that see nothing alike, and the seconds of
# motion that this was learned from (60 cameras of people in clothes, 2 to 3 s; root mean square of error over sigma 1.6 without)
_UNLIKE_PERIODS, _LEARNED_S = 1.0, 2.5
_COMMON_S = 10.0  # sigma of a weak prior: an offset common to all cameras is unobservable


@dataclass(frozen=True)
class ClockOptions:
    """What to estimate.

    Parameters
    ----------
    max_offset_s : how far two clocks may be apart beyond what stamps say.
    drift : whether clocks may run at different rates; in recordings of less than `LEAST_DRIFT_S` it is not estimated.
    """

    max_offset_s: float = 2.0
    drift: bool = True


@dataclass(frozen=True)
class ClockFit:
    """What has been found about a camera's clock.

    Parameters
    ----------
    offset_s, offset_sigma_s : to be added to its stamps, in the middle of the recording, and its standard deviation. The sigma
        says how far pairs of cameras contradict each other and themselves, not what all of them have wrong alike.
    drift, drift_sigma : by how much common time advances more than its clock, seconds a second.
    correlation : of its motion with that of the camera that it agrees with best.
    runner_up : how well the best offset elsewhere agrees with all cameras, as a fraction of how well this one does. Near 1, as in
        motion that repeats itself, either may be the right one.
    """

    offset_s: float
    offset_sigma_s: float
    drift: float
    drift_sigma: float
    correlation: float
    runner_up: float


@dataclass(frozen=True, eq=False)
class Clocks:
    """Clocks of all cameras.

    Parameters
    ----------
    cameras : name -> clock. middle_s : the time that offsets are for.
    covariance_s2 : (n, n) of the offsets, each against the mean of the others', in the order of ``cameras``.
    misfit : how many times more the pairs disagree than their own uncertainties allow for, at least 1; it is in all sigmas.
    """

    cameras: Mapping[str, ClockFit]
    middle_s: float
    covariance_s2: np.ndarray
    misfit: float

    def corrected(self, name: str, first_s: float, offset_s: float, drift_ppm: float) -> tuple[float, float]:
        """Offset and drift for the rig, of a camera whose file has others already.

        Parameters
        ----------
        name : of the camera.
        first_s : stamp of its first image as it was used here, with the old offset.
        offset_s : the old offset.
        drift_ppm : the old drift.

        Returns
        -------
        offset_s : seconds.
        drift_ppm : millionths.
        """
        clock = self.cameras[name]
        offset = offset_s + clock.offset_s + clock.drift * (first_s - self.middle_s)
        return offset, drift_ppm + 1e6 * clock.drift * (1.0 + 1e-6 * drift_ppm)

    def metrics(self) -> dict[str, float | int]:
        """``time.<camera>.<key>``, and the covariance of each two offsets in ms^2."""
        names = list(self.cameras)
        metrics: dict[str, float | int] = {"time.misfit": self.misfit}
        for i, (name, clock) in enumerate(self.cameras.items()):
            metrics[f"time.{name}.offset_ms"] = 1e3 * clock.offset_s
            metrics[f"time.{name}.offset_sigma_ms"] = 1e3 * clock.offset_sigma_s
            metrics[f"time.{name}.drift_ppm"] = 1e6 * clock.drift
            metrics[f"time.{name}.drift_sigma_ppm"] = 1e6 * clock.drift_sigma
            metrics[f"time.{name}.correlation"] = clock.correlation
            metrics[f"time.{name}.runner_up"] = clock.runner_up
            for j in range(i):
                metrics[f"time.{name}.covariance_{names[j]}_ms2"] = 1e6 * float(self.covariance_s2[i, j])
        return metrics


def with_clocks(rig_file: RigFile, clocks: Clocks, first_s: Mapping[str, float]) -> RigFile:
    """A rig's file with the clocks of its cameras.

    Parameters
    ----------
    rig_file : with the offsets by which the images were read.
    clocks : what has been found.
    first_s : camera -> stamp of its first image, as it was read.

    Returns
    -------
    A copy.
    """
    changes = {}
    for name, first in first_s.items():
        entry = rig_file.cameras[name]
        offset_s, ppm = clocks.corrected(name, first, entry.time_offset_s, entry.time_drift_ppm)
        changes[name] = {"time_offset_s": offset_s, "time_drift_ppm": ppm}
    return rig_file.with_cameras(changes)


def estimate_clocks(motions: Sequence[MotionProfiles], options: ClockOptions | None = None) -> Clocks:
    """Clocks of all cameras; of the solutions that agree as well, the one in which most of them are right as they are.

    Parameters
    ----------
    motions : one a camera, at least two.
    options : largest offset, and whether drift is estimated.

    Returns
    -------
    Offsets and drifts with their uncertainty.

    Raises
    ------
    CalibrationError : a camera whose motion agrees with no other's, or whose images are of another time.
    """
    options = options or ClockOptions()
    if len(motions) < 2:
        raise ValueError(f"expected the motion of two cameras at least, got {len(motions)}")
    period_s = min(float(np.median(np.diff(m.times_s))) for m in motions)
    longest_s = max(float(np.median(np.diff(m.times_s))) for m in motions)
    signals = [Signals(m, period_s, longest_s) for m in motions]
    middle_s = float(np.median([0.5 * (m.first_s + m.last_s) for m in motions]))
    shared_s = min(m.last_s for m in motions) - max(m.first_s for m in motions)
    width = 2 if options.drift and shared_s >= LEAST_DRIFT_S else 1
    tables = correlations(signals, options.max_offset_s)
    near = max(_NEAR_S, _NEAR_PERIODS * longest_s) / signals[0].step_s
    start, runners_up = _consistent_lags(tables, motions, near)
    pairs, unlike_s2 = [], (_UNLIKE_PERIODS * longest_s) ** 2 * min(_LEARNED_S / max(shared_s, 1e-9), 1.0)
    for (i, j), table in tables.items():
        lag_s = signals[i].step_s * (start[j] - start[i])
        if table is not None and (pair := refined(i, j, signals, lag_s, middle_s, width)) is not None:
            covariance = pair.covariance.copy()
            covariance[0, 0] += unlike_s2 * pair.unlike
            pairs.append(replace(pair, covariance=covariance))
    return clocks_of_pairs(pairs, [m.camera for m in motions], runners_up, middle_s, width)


def _consistent_lags(tables: Tables, motions: Sequence[MotionProfiles], near: float) -> tuple[list[int], list[float]]:
    """Lag of each camera in steps, the first 0, with the greatest sum of correlations, and how near the next best comes.

    The strongest pairs come first, then the lag of each camera is searched again among all others. ``near``: lags of so many
    steps are the same one.
    """
    n = len(motions)
    lags = {0: 0}
    peaks = {pair: float(t[1].max()) for pair, t in tables.items() if t is not None}
    while len(lags) < n:
        open_pairs = {pair: peak for pair, peak in peaks.items() if (pair[0] in lags) != (pair[1] in lags)}
        if not open_pairs or max(open_pairs.values()) < _BEST_CORRELATION:
            lost = next(k for k in range(n) if k not in lags)
            best = max((peak for pair, peak in peaks.items() if lost in pair), default=0.0)
            problem = f"its motion agrees with no other camera's (best correlation {best:.2f}); is it of the same time,"
            remedy = "if so, more seconds of motion may tell, or another way: a clap (--by sound), flashes, timecode"
            raise CalibrationError(motions[lost].camera, f"{problem} within the largest offset that is searched? {remedy}")
        i, j = max(open_pairs, key=lambda pair: open_pairs[pair])
        first, table = tables[i, j]  # type: ignore[misc]
        lag = first + int(table.argmax())
        lags.update({j: lags[i] + lag} if i in lags else {i: lags[j] - lag})
    for _ in range(3):
        for k in range(1, n):
            sums = _sums(k, lags, tables)
            lags[k] = max(sums, key=lambda lag: sums[lag])
    runners_up = []
    for k in range(n):
        sums = _sums(k, lags, tables)
        others = (value for lag, value in sums.items() if abs(lag - lags[k]) > near)
        runners_up.append(max(0.0, max(others, default=0.0)) / max(sums.get(lags[k], 0.0), 1e-9))
    return [lags[k] for k in range(n)], runners_up


def _sums(k: int, lags: Mapping[int, int], tables: Tables) -> dict[int, float]:
    """Lag of camera ``k`` -> sum of its correlations with all others as they are."""
    sums: dict[int, float] = {}
    for (i, j), entry in tables.items():
        if entry is None or k not in (i, j):
            continue
        first, table = entry
        of_k = lags[i] + first + np.arange(len(table)) if k == j else lags[j] - first - np.arange(len(table))
        for lag, value in zip(of_k.tolist(), table.tolist(), strict=True):
            sums[lag] = sums.get(lag, 0.0) + value
    return sums


def clocks_of_pairs(
    pairs: Sequence[Pair], names: Sequence[str], runners_up: Sequence[float], middle_s: float, width: int = 1,
    what: str = "motion",
) -> Clocks:  # fmt: skip
    """Clocks that agree best with the lags of all pairs, set so that most offsets and drifts are 0.

    Parameters
    ----------
    pairs : of cameras, by their numbers.
    names, runners_up : of the cameras; how well another lag agrees, in shares of this one.
    middle_s : time that offsets are for.
    width : 2 where pairs have drifts, else 1.
    what : the lags come from, for messages.

    Returns
    -------
    Offsets and drifts with their uncertainty.

    Raises
    ------
    CalibrationError : a camera that agrees with no other.
    """
    n = len(names)
    for k, name in enumerate(names):
        if max((pair.correlation for pair in pairs if k in (pair.i, pair.j)), default=0.0) < _BEST_CORRELATION:
            where = "below the image period" if what == "motion" else "within the largest offset that is searched"
            raise CalibrationError(name, f"its {what} agrees with no other camera's {where}")
    _check_connected(pairs, names, what)
    if (again := max(runners_up)) > _REPEATED:
        problem = f"its {what} repeats itself: another offset agrees {again:.2f} times as well"
        remedy = "go by what does not (claps, flashes at uneven times), or search less far (synchronize --max-offset)"
        raise CalibrationError(names[runners_up.index(again)], f"{problem}; {remedy}")
    held = np.zeros((n, width), dtype=bool)
    for _ in range(2):
        values, covariance, misfit = _network(pairs, n, width, held)
        values = values - np.median(values, axis=0)
        gauge = np.kron((n * np.eye(n) - 1.0) / (n - 1), np.eye(width))  # of each camera against the mean of the others
        sigmas = np.sqrt(np.maximum(np.diag(gauge @ covariance @ gauge.T), 0.0)).reshape(n, width)
        doubtful = np.abs(values) < np.array(SURE_SIGMAS[:width]) * sigmas
        if not held.any():
            free_sigmas, free_covariance = sigmas, gauge @ covariance @ gauge.T
        held = doubtful
    values = np.where(held, 0.0, values)
    best = [max(pair.correlation for pair in pairs if k in (pair.i, pair.j)) for k in range(n)]
    drift = np.zeros((n, 2)) if width == 1 else np.stack([values[:, 1], free_sigmas[:, 1]], axis=1)
    cameras = {
        name: ClockFit(*(float(v) for v in (values[k, 0], free_sigmas[k, 0], *drift[k], best[k], runners_up[k])))
        for k, name in enumerate(names)
    }
    return Clocks(cameras, middle_s, free_covariance[::width, ::width], misfit)


def _check_connected(pairs: Sequence[Pair], names: Sequence[str], what: str) -> None:
    """Raises CalibrationError where cameras agree in groups that have nothing to do with each other."""
    reached = {0}
    while more := {k for pair in pairs for k in (pair.i, pair.j) if reached & {pair.i, pair.j}} - reached:
        reached |= more
    if len(reached) < len(names):
        apart = next(k for k in range(len(names)) if k not in reached)
        others = ", ".join(names[k] for k in sorted(reached))
        raise CalibrationError(names[apart], f"its {what} agrees with that of no camera of {others}")


def _network(pairs: Sequence[Pair], n: int, width: int, held: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Values (n, width) of all cameras, their covariance and how much worse pairs agree than they should; ``held`` ones stay 0.

    A pair that contradicts the others counts less (Cauchy weights).
    """
    prior = np.where(held, 1e9, np.tile([_COMMON_S**-2.0, DRIFT_SIGMA**-2.0][:width], (n, 1))).ravel()
    weights = np.ones(len(pairs))
    for _ in range(10):
        H, g = np.diag(prior), np.zeros(n * width)
        rows = []
        for pair, weight in zip(pairs, weights, strict=True):
            J = np.zeros((width, n * width))
            J[:, pair.i * width : (pair.i + 1) * width] = np.eye(width)
            J[:, pair.j * width : (pair.j + 1) * width] = -np.eye(width)
            precision = np.linalg.inv(pair.covariance)
            H += weight * J.T @ precision @ J
            g += weight * J.T @ precision @ pair.lag
            rows.append((J, precision))
        values = np.linalg.solve(H, g)
        squares = np.array([(p.lag - J @ values) @ W @ (p.lag - J @ values) for p, (J, W) in zip(pairs, rows, strict=True)])
        freedom = width * (len(pairs) - n + 1)
        misfit = max(1.0, float(np.sum(weights * squares)) / freedom) if freedom > 0 else 1.0
        weights = 1.0 / (1.0 + squares / (9.0 * width * misfit))
    return values.reshape(n, width), misfit * np.linalg.inv(H), misfit
