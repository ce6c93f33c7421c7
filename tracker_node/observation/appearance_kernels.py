"""Pixel loops of the appearance model, so written that the compiler makes vector instructions of them.

What that takes: whole rows of interleaved colors, indices that are unsigned (a signed one might be negative, which is checked),
no branches, float32 throughout, and a logarithm of our own.
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled.kernels import compiled

_LOG_GAUSS = np.float32(-1.5 * math.log(2.0 * math.pi))
_LOG_2 = np.float32(math.log(2.0))
_ONE, _HALF = np.float32(1.0), np.float32(0.5)
_G, _R = np.uint64(1), np.uint64(2)  # places of green and red after blue
_SEEN = np.uint8(1)


@compiled(inline="always")
def log_positive(x):
    """Natural logarithm of a positive, normal float32, to 3e-6: exponent, and the artanh series of the mantissa."""
    bits = np.float32(x).view(np.int32)
    exponent = np.float32((bits >> np.int32(23)) - np.int32(127))
    mantissa = np.int32((bits & np.int32(0x7FFFFF)) | np.int32(0x3F800000)).view(np.float32)
    t = (mantissa - _ONE) / (mantissa + _ONE)
    s = t * t
    series = _ONE + s * (np.float32(1 / 3) + s * (np.float32(1 / 5) + s * (np.float32(1 / 7) + s * np.float32(1 / 9))))
    return exponent * _LOG_2 + np.float32(2.0) * t * series


@compiled
def _scene_row(bgr, mean, variance, darkest, log_shadow, out):
    """Log density of a row of colors if it shows the background, lit or in shadow."""
    for j in range(np.uint64(out.size)):
        b = np.uint64(3) * j
        x, y, z = np.float32(bgr[b]), np.float32(bgr[b + _G]), np.float32(bgr[b + _R])
        mx, my, mz = mean[b], mean[b + _G], mean[b + _R]
        half_precision, log_variance = _HALF / variance[j], log_positive(variance[j])
        dx, dy, dz = x - mx, y - my, z - mz
        lit = _LOG_GAUSS - np.float32(1.5) * log_variance - half_precision * (dx * dx + dy * dy + dz * dz)
        # A shadow: free to be anywhere along the line to black, so its density is that of the two axes across it
        gain = (x * mx + y * my + z * mz) / (mx * mx + my * my + mz * mz + _ONE)
        dx, dy, dz = x - gain * mx, y - gain * my, z - gain * mz
        shaded = log_shadow - log_variance - half_precision * (dx * dx + dy * dy + dz * dz)
        shaded = shaded if (gain > darkest) & (gain < _ONE) else lit
        out[j] = lit if lit > shaded else shaded


@compiled
def _odds_row(bgr, known, has_scene, shift, log_pairs, log_outlier, reach, out):
    """From the background's log densities in ``out`` to the log-odds of body against surroundings."""
    down, width = np.uint32(shift), np.uint32(8 - shift)
    for j in range(np.uint64(out.size)):
        at = np.uint64(3) * j
        b, g, r = np.uint32(bgr[at]) >> down, np.uint32(bgr[at + _G]) >> down, np.uint32(bgr[at + _R]) >> down
        pair = np.uint64(2) * np.uint64((((b << width) | g) << width) | r)
        body, scene = log_pairs[pair], log_pairs[pair + np.uint64(1)]
        background = log_outlier + scene
        background = background if background > out[j] else out[j]
        background = background if (known[j] != 0) & has_scene else scene
        value = body - background
        value = value if value < reach else reach
        out[j] = value if value > -reach else -reach


@compiled
def log_odds(bgr, corner, mean, variance, known, has_scene, shift, log_pairs, options, out):
    """Log-odds of body against surroundings in a part of an image.

    Parameters
    ----------
    bgr : (height, 3 width) uint8, interleaved.
    corner : (u0, v0) where the part begins.
    mean : (height, 3 width) float32 of the background, interleaved.
    variance : (height, width) float32 of it.
    known : (height, width) uint8, 0 where it is not known.
    has_scene : False: there is no background; only ``known`` must then have as many columns, all 0.
    shift : color bins are so many bits coarser than a gray level.
    log_pairs : per color bin the log densities of body and surroundings.
    options : (darkest shadow, outlier log weight, reach, log density of shadows) float32.
    out : (h, w) float32, filled.
    """
    u0, v0 = corner
    u1 = u0 + out.shape[1]
    for i in range(out.shape[0]):
        v = v0 + i
        row = bgr[v, 3 * u0 : 3 * u1]
        if has_scene:
            _scene_row(row, mean[v, 3 * u0 : 3 * u1], variance[v, u0:u1], options[0], options[3], out[i])
            _odds_row(row, known[v, u0:u1], True, shift, log_pairs, options[1], options[2], out[i])
        else:
            _odds_row(row, known[0, : u1 - u0], False, shift, log_pairs, options[1], options[2], out[i])


@compiled
def _update_row(bgr, body, mean, variance, known, rate, floor):
    for j in range(np.uint64(body.size)):
        at = np.uint64(3) * j
        x, y, z = np.float32(bgr[at]), np.float32(bgr[at + _G]), np.float32(bgr[at + _R])
        mx, my, mz, old = mean[at], mean[at + _G], mean[at + _R], variance[j]
        dx, dy, dz = x - mx, y - my, z - mz
        total = dx * dx + dy * dy + dz * dz
        free, seen = body[j] == 0, known[j] == _SEEN
        # A known pixel far off its mean shows something that passes by. An unknown one starts from its first value.
        stable = total <= np.float32(36.0) * old
        weight = (rate if stable else np.float32(0.0)) if seen else _ONE
        weight = weight if free else np.float32(0.0)
        mean[at], mean[at + _G], mean[at + _R] = mx + weight * dx, my + weight * dy, mz + weight * dz
        followed = old + weight * (total * np.float32(1.0 / 3.0) - old)
        followed = followed if followed > floor else floor
        followed = followed if seen else np.float32(4.0) * floor
        variance[j] = followed if weight > np.float32(0.0) else old
        known[j] = _SEEN if free | seen else known[j]


@compiled
def update_scene(bgr, corner, body, mean, variance, known, rate, floor):
    """Update the running mean and variance of the background in a part of an image.

    Parameters
    ----------
    bgr, corner : as of `log_odds`.
    body : (h, w) uint8 on the part, not zero where the body may be.
    mean, variance, known : as of `log_odds`; pixels whose ``known`` is not 1 start from this image.
    rate : weight of this image, float32.
    floor : least variance, float32.
    """
    u0, v0 = corner
    u1 = u0 + body.shape[1]
    for i in range(body.shape[0]):
        v = v0 + i
        _update_row(
            bgr[v, 3 * u0 : 3 * u1], body[i], mean[v, 3 * u0 : 3 * u1], variance[v, u0:u1], known[v, u0:u1], rate, floor
        )  # fmt: skip
