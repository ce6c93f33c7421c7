"""Lags between cameras by what their microphones hear: claps, steps, voices.

Onsets of energy are correlated, roughly first. Around the strongest ones the tracks are compared sample by sample, with
frequencies weighted nearly alike, which a room's echoes disturb least (PHAT: Knapp and Carter, "The generalized correlation
method for estimation of time delay", 1976). Sound takes 3 ms a meter: its way to each camera is taken off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, fftconvolve, sosfiltfilt
from scipy.signal.windows import tukey

from ...errors import CalibrationError
from .motion import Lag, Pair, pairs_that_agree

SPEED_OF_SOUND = 343.0  # m/s, at 20 degrees
_STEP_S = 1e-3  # of onsets
_BAND_HZ = (500.0, 8000.0)
_MOST_ONSETS, _APART_S, _LEAST_ONSET = 24, 0.25, 0.2  # that are compared; apart; of the strongest
_BEFORE_S, _AFTER_S, _SEARCH_S = 0.004, 0.008, 0.012  # of an onset, most of it before echoes; how far from the rough lag
_WHITE = 0.7  # power of a frequency's strength that is taken out: all of it would hear noise where there is no sound
_SIGMA_OF_ONE_S, _LEAST_SIGMA_S = 1e-3, 2e-5
_NEAR_S = 0.05  # a second lag that agrees as well is farther away
_LEAST_CORRELATION = 0.2


@dataclass(frozen=True, eq=False)
class Heard:
    """What the microphone of a camera has heard.

    Attributes
    ----------
    camera : its name.
    rate_hz, first_s, samples : of its track; ``first_s`` in the time of the camera's stamps.
    way_s, way_sigma_s : that sound takes from where it was made to the camera, and how well that is known.
    """

    camera: str
    rate_hz: float
    first_s: float
    samples: np.ndarray
    way_s: float = 0.0
    way_sigma_s: float = 0.0

    @property
    def last_s(self) -> float:
        return self.first_s + len(self.samples) / self.rate_hz


@dataclass(frozen=True, eq=False)
class _Track:
    """A track in its band, and its onsets every `_STEP_S` from ``first`` on, in such steps."""

    heard: Heard
    band: np.ndarray
    onsets: np.ndarray
    first: int


def sound_lags(heard: Sequence[Heard], max_offset_s: float) -> tuple[list[Pair], list[float]]:
    """Lags of every pair of cameras.

    Parameters
    ----------
    heard : one a camera.
    max_offset_s : the largest lag that is searched.

    Returns
    -------
    pairs : of those that agree.
    runners_up : of each camera, how well the second best lag agrees, in shares of the best.

    Raises
    ------
    CalibrationError : a track without any sound.
    """
    return pairs_that_agree([_track(one) for one in heard], lambda a, b: _lag(a, b, max_offset_s))


def _lag(a: _Track, b: _Track, max_offset_s: float) -> Lag | None:
    """Lag of ``b`` behind ``a``, without sound's way to either camera."""
    rough = _rough_lag(a, b, max_offset_s)
    if rough is None:
        return None
    lag_s, correlation, runner_up = rough
    return Lag(*_refined(a, b, lag_s), correlation, runner_up)


def _track(heard: Heard) -> _Track:
    nyquist = 0.5 * heard.rate_hz
    band = butter(2, (_BAND_HZ[0] / nyquist, min(_BAND_HZ[1] / nyquist, 0.9)), "bandpass", output="sos")
    filtered = sosfiltfilt(band, heard.samples.astype(np.float64)) if len(heard.samples) > 64 else np.zeros(0)
    first, last = (int(np.ceil(t / _STEP_S)) for t in (heard.first_s, heard.last_s))
    edges = np.clip(np.round((np.arange(first, last) * _STEP_S - heard.first_s) * heard.rate_hz).astype(int), 0, len(filtered))
    sums = np.concatenate([[0.0], np.cumsum(filtered**2)])
    energy = np.diff(sums[edges]) / np.maximum(np.diff(edges), 1)
    if len(energy) < 10 or not energy.max(initial=0.0) > 0.0:
        raise CalibrationError(heard.camera, "its sound track is silent")
    level = np.log1p(energy / max(float(np.median(energy)), 1e-6 * float(energy.max())))
    onsets = np.maximum(np.diff(level, prepend=level[0]), 0.0) * level  # steep, and loud
    return _Track(heard, filtered, onsets, first)


def _rough_lag(a: _Track, b: _Track, max_offset_s: float) -> tuple[float, float, float] | None:
    """Lag of ``b`` behind ``a`` to a millisecond, correlation, and the next best one as a share of it."""
    smooth = np.hanning(7)
    # About their means: tracks of mere noise, whose onsets are everywhere, would agree by .75 at any lag
    x, y = (np.convolve(track.onsets - track.onsets.mean(), smooth / smooth.sum(), "same") for track in (a, b))
    products = fftconvolve(x[::-1], y)
    lags = (b.first - a.first + np.arange(-(len(x) - 1), len(y))) * _STEP_S
    allowed = np.abs(lags) <= max_offset_s
    if not allowed.any():
        return None
    table = np.where(allowed, products / np.sqrt(np.sum(x**2) * np.sum(y**2)), 0.0)
    best = int(table.argmax())
    if table[best] < _LEAST_CORRELATION:
        return None
    elsewhere = table[np.abs(lags - lags[best]) > _NEAR_S].max(initial=0.0)
    return float(lags[best]), float(table[best]), float(elsewhere / table[best])


def _refined(a: _Track, b: _Track, lag_s: float) -> tuple[float, float]:
    """The lag to less than a sample, from onsets one by one, without sound's way to either camera; and its variance."""
    found = [lag for at_s in _strongest(a) if (lag := _lag_at(a, b, at_s, lag_s)) is not None]
    if found:
        lags = np.array(found)
        middle = float(np.median(lags))
        spread = 1.4826 * float(np.median(np.abs(lags - middle)))
        sigma = max(1.25 * spread / np.sqrt(len(lags)), _LEAST_SIGMA_S) if len(lags) > 2 else _SIGMA_OF_ONE_S
    else:
        middle, sigma = lag_s, 5.0 * _SIGMA_OF_ONE_S
    variance = sigma**2 + a.heard.way_sigma_s**2 + b.heard.way_sigma_s**2
    return middle - (b.heard.way_s - a.heard.way_s), variance


def _strongest(track: _Track) -> list[float]:
    """Times of its strongest onsets, in the time of its camera."""
    strength = track.onsets.copy()
    chosen: list[float] = []
    least = _LEAST_ONSET * strength.max()
    while len(chosen) < _MOST_ONSETS and strength.max(initial=0.0) >= least > 0.0:
        k = int(strength.argmax())
        chosen.append((track.first + k) * _STEP_S)
        reach = round(_APART_S / _STEP_S)
        strength[max(k - reach, 0) : k + reach + 1] = 0.0
    return chosen


def _lag_at(a: _Track, b: _Track, at_s: float, lag_s: float) -> float | None:
    """Lag of one onset; None where either track does not reach around it, or the two have nothing in common there."""
    x, x_s = _window(a, at_s - _BEFORE_S, at_s + _AFTER_S)
    y, y_s = _window(b, at_s + lag_s - _BEFORE_S - _SEARCH_S, at_s + lag_s + _AFTER_S + _SEARCH_S)
    if x is None or y is None:
        return None
    rate = a.heard.rate_hz
    if b.heard.rate_hz != rate:
        grid = np.arange(int(len(y) * rate / b.heard.rate_hz)) / rate
        y = np.interp(grid, np.arange(len(y)) / b.heard.rate_hz, y)
    n = 1 << int(np.ceil(np.log2(len(x) + len(y))))
    cross = np.conj(np.fft.rfft(x * tukey(len(x), 0.3), n)) * np.fft.rfft(y, n)
    frequencies = np.fft.rfftfreq(n, 1.0 / rate)
    inside = (frequencies >= _BAND_HZ[0]) & (frequencies <= min(_BAND_HZ[1], 0.45 * rate))
    white = np.where(inside, cross / np.maximum(np.abs(cross), 1e-300) ** _WHITE, 0.0)
    table = np.fft.irfft(white, n)[: len(y) - len(x) + 1]
    k = int(table.argmax())
    if not 0 < k < len(table) - 1 or table[k] < 4.0 * float(np.std(table)):
        return None
    before, here, after = table[k - 1 : k + 2]
    part = 0.5 * (before - after) / (before - 2.0 * here + after)
    return float((k + part) / rate + y_s - x_s)


def _window(track: _Track, start_s: float, end_s: float) -> tuple[np.ndarray | None, float]:
    """The samples between two times, and the time of the first of them."""
    heard = track.heard
    first, last = (round((t - heard.first_s) * heard.rate_hz) for t in (start_s, end_s))
    if first < 0 or last > len(track.band):
        return None, 0.0
    return track.band[first:last], heard.first_s + first / heard.rate_hz
