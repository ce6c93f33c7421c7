"""How far the clocks of two cameras are apart, by motion in their common planes: roughly, and then below the image period."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import fftconvolve

from .motion import MotionProfiles

LEAST_CORRELATION = 0.15  # of a pair that is used
_LEAST_OVERLAP = 0.4  # of the shorter recording
_LEAST_OVERLAP_S = 0.5
_BLOCK_S = 0.4  # motion is taken to be independent from one block to the next
_ITERATIONS = 30


@dataclass(frozen=True, eq=False)
class Pair:
    """Lag of camera ``j`` behind ``i``: what i shows at t, j shows at t + lag[0] + lag[1] * (t - middle)."""

    i: int
    j: int
    lag: np.ndarray
    covariance: np.ndarray
    correlation: float


class Signals:
    """Profiles of a camera on an even grid of time, smoothed over the longest image period of all cameras."""

    def __init__(self, motion: MotionProfiles, period_s: float, smooth_s: float):
        self.step_s = 0.5 * period_s
        first, last = (int(np.round(t / self.step_s)) for t in motion.times_s[[0, -1]])
        self.first, self.times_s = first, self.step_s * np.arange(first, last + 1)
        self._values: dict[str, np.ndarray] = {}
        for other, profile in motion.profiles.items():
            even = np.array([np.interp(self.times_s, motion.times_s, column) for column in profile.T]).T
            smooth = gaussian_filter1d(even, smooth_s / self.step_s, axis=0, mode="nearest")
            self._values[other] = smooth - smooth.mean(axis=0)
        self.camera = motion.camera

    def towards(self, other: Signals) -> np.ndarray:
        """(n, n_planes) by the planes that are common with ``other``."""
        return self._values[other.camera]


Tables = Mapping[tuple[int, int], tuple[int, np.ndarray] | None]


def correlations(signals: Sequence[Signals], max_offset_s: float) -> Tables:
    """Pair -> (first lag in steps, correlation at each lag from there on), as far as ``max_offset_s``; None without motion."""
    result: dict[tuple[int, int], tuple[int, np.ndarray] | None] = {}
    for (i, a), (j, b) in itertools.combinations(enumerate(signals), 2):
        x, y = a.towards(b), b.towards(a)
        first = b.first - a.first - (len(x) - 1)  # of the lags that fftconvolve gives
        lags = first + np.arange(len(x) + len(y) - 1)
        products = _lagged(x, y).sum(axis=1)
        norms = _lagged(np.ones(len(x)), np.sum(y**2, axis=1)) * _lagged(np.sum(x**2, axis=1), np.ones(len(y)))
        overlap_s = a.step_s * _lagged(np.ones(len(x)), np.ones(len(y)))
        least_s = max(_LEAST_OVERLAP_S, _LEAST_OVERLAP * a.step_s * min(len(x), len(y)))
        ok = (np.abs(lags) * a.step_s <= max_offset_s) & (overlap_s >= least_s)
        norm = np.sqrt(np.maximum(norms, 0.0))
        usable = ok & (norm > 1e-9 * norm.max(initial=0.0))
        table = np.where(usable, products / np.where(usable, norm, 1.0), -1.0)
        result[i, j] = (int(lags[ok][0]), table[ok]) if usable.any() else None
    return result


def _lagged(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Sums of x[t] * y[t + lag] for all lags from -(len(x) - 1) on, along the first axis."""
    return fftconvolve(x[::-1], y, axes=0)


def refined(i: int, j: int, signals: Sequence[Signals], lag_s: float, middle_s: float, width: int) -> Pair | None:
    """The lag of a pair below the image period, with ``width`` 2 also its drift; None where they do not agree near ``lag_s``."""
    a, b = signals[i], signals[j]
    curve = make_interp_spline(b.times_s, b.towards(a), k=3)
    slope = curve.derivative()
    margin_s = 4.0 * a.step_s
    inside = (a.times_s + lag_s >= b.times_s[0] + margin_s) & (a.times_s + lag_s <= b.times_s[-1] - margin_s)
    if np.count_nonzero(inside) * a.step_s < _LEAST_OVERLAP_S:
        return None
    times, x = a.times_s[inside], a.towards(b)[inside]
    basis = np.stack([np.ones_like(times), times - middle_s][:width], axis=1)
    lag = np.array([lag_s, 0.0][:width])
    for _ in range(_ITERATIONS):
        at = np.clip(times + basis @ lag, b.times_s[0], b.times_s[-1])
        y, dy = curve(at), slope(at)
        gain = np.sum(x * y) / max(float(np.sum(y * y)), 1e-300)
        rest = x - gain * y
        pull = basis * np.sum(rest * gain * dy, axis=1)[:, None]
        normal = basis.T @ (basis * np.sum((gain * dy) ** 2, axis=1)[:, None])
        step = np.linalg.solve(normal + 1e-12 * np.trace(normal) * np.eye(len(lag)), pull.sum(axis=0))
        lag = lag + step
        if np.abs(step).max() < 1e-7:
            break
    correlation = float(np.sum(x * y) / np.sqrt(max(float(np.sum(x * x) * np.sum(y * y)), 1e-300)))
    if correlation < LEAST_CORRELATION or abs(lag[0] - lag_s) > margin_s:
        return None
    blocks = np.unique(np.floor((times - times[0]) / _BLOCK_S), return_inverse=True)[1]
    sums = np.array([np.bincount(blocks, weights=column) for column in pull.T])
    spread = sums @ sums.T * (sums.shape[1] / max(sums.shape[1] - len(lag), 1))
    inverse = np.linalg.inv(normal)
    return Pair(i, j, lag, inverse @ spread @ inverse, correlation)
