"""The pixel loops of the ray-caster: float32, sixteen pixels at a time, depth and label packed in one integer.

A positive float32 orders like its bits read as an integer. The upper 24 bits of a pixel's inverse depth with the label in the
lower 8 make the nearest shape the largest integer, so that drawing a shape is one maximum per pixel. What is left of the
inverse depth is good to 3e-5 of itself.

Loops whose number of rounds is visibly sixteen, without branches, are what the compiler turns into vector instructions. They run
over boxes of pixels: in groups of sixteen, the span of a curved surface in each row costs more than the pixels that it saves.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ...compiled.kernels import compiled
from ..shape_arrays import PADDING
from .coefficients import ABOVE, BELOW, BETWEEN, BOX, LINE, LOWER, ORIGIN, QUADRATIC, UPPER

LANES = PADDING
LABEL_BITS = 255
_BIG = np.float32(1e30)
_ZERO = np.float32(0.0)

# numba counts the references to arrays whenever they are passed on, by atomic operations that cost five times as much as the
# arithmetic of shading a pixel. Without (``_nrt``) a function takes arrays and numbers, and neither makes nor returns arrays or
# slices.
pixel_function: Any = partial(compiled, forceinline=True, _nrt=False)
"""Decorator of a function at one pixel: compiled into its callers, without counting references."""

pixel_loop: Any = partial(compiled, _nrt=False)
"""Decorator of a kernel that calls such functions pixel by pixel."""


def _make_curved(bounds: int) -> Callable:
    """The loop over a curved surface that bounds the inverse depth as ``bounds`` says, a constant when it is compiled."""
    between, above = bounds == BETWEEN, bounds == ABOVE

    @compiled
    def draw(c, label, xs, ys, rows, columns, row_offset, column_offset, buffer):
        x0, y0 = c[ORIGIN], c[ORIGIN + 1]
        q00, q10, q01, q20, q11, q02 = (c[QUADRATIC], c[QUADRATIC + 1], c[QUADRATIC + 2], c[QUADRATIC + 3],
                                        c[QUADRATIC + 4], c[QUADRATIC + 5])  # fmt: skip
        l0, l1, l2 = c[LINE], c[LINE + 1], c[LINE + 2]
        h0, h1, h2 = c[UPPER], c[UPPER + 1], c[UPPER + 2]
        a0, a1, a2 = c[LOWER], c[LOWER + 1], c[LOWER + 2]
        b0, b1, b2 = c[LOWER + 3], c[LOWER + 4], c[LOWER + 5]
        tag, upper_bits = np.int32(label), np.int32(~LABEL_BITS)
        for v in range(rows[0], rows[1]):
            for u in range(columns[0], columns[1], LANES):
                x_row, y_row = xs[v, u : u + LANES], ys[v, u : u + LANES]
                at = u - column_offset
                out = buffer[v - row_offset, at : at + LANES]
                for i in range(LANES):
                    x, y = x_row[i] - x0, y_row[i] - y0
                    q = q00 + x * (q10 + q20 * x + q11 * y) + y * (q01 + q02 * y)
                    root = np.sqrt(q if q > _ZERO else _ZERO)
                    line = l0 + l1 * x + l2 * y
                    high = h0 + h1 * x + h2 * y
                    low_a, low_b = a0 + a1 * x + a2 * y, b0 + b1 * x + b2 * y
                    if between:
                        enter, leave = line + root, line - root
                    elif above:
                        enter, leave = _BIG, (line + root if q > _ZERO else -_BIG)
                    else:
                        enter, leave = (line - root if q > _ZERO else _BIG), -_BIG
                    enter = enter if enter < high else high
                    leave = leave if leave > low_a else low_a
                    leave = leave if leave > low_b else low_b
                    packed = (np.float32(enter).view(np.int32) & upper_bits) | tag
                    hit = (enter > leave) & (enter > _ZERO)
                    hit &= q > _ZERO if between else enter < _BIG
                    packed = packed if hit else np.int32(0)
                    out[i] = packed if packed > out[i] else out[i]

    return draw


_draw_between, _draw_above, _draw_below = _make_curved(BETWEEN), _make_curved(ABOVE), _make_curved(BELOW)


@compiled
def _box(c, label, xs, ys, rows, columns, row_offset, column_offset, buffer):
    x0, y0 = c[ORIGIN], c[ORIGIN + 1]
    tag, upper_bits = np.int32(label), np.int32(~LABEL_BITS)
    for v in range(rows[0], rows[1]):
        for u in range(columns[0], columns[1], LANES):
            x_row, y_row = xs[v, u : u + LANES], ys[v, u : u + LANES]
            at = u - column_offset
            out = buffer[v - row_offset, at : at + LANES]
            for i in range(LANES):
                x, y = x_row[i] - x0, y_row[i] - y0
                enter, leave = _BIG, _ZERO
                for j in range(3):
                    bound = c[UPPER + 3 * j] + c[UPPER + 3 * j + 1] * x + c[UPPER + 3 * j + 2] * y
                    enter = bound if bound < enter else enter
                for j in range(6):
                    bound = c[LOWER + 3 * j] + c[LOWER + 3 * j + 1] * x + c[LOWER + 3 * j + 2] * y
                    leave = bound if bound > leave else leave
                packed = (np.float32(enter).view(np.int32) & upper_bits) | tag
                hit = (enter > leave) & (x == x)  # no ray: not a number
                packed = packed if hit else np.int32(0)
                out[i] = packed if packed > out[i] else out[i]


@compiled
def draw_shape(kind, bounds, c, label, xs, ys, box, row_offset, column_offset, buffer):
    """Draw one shape into a buffer.

    Columns are widened to whole groups of sixteen, which is harmless since every pixel is tested.

    Parameters
    ----------
    kind, bounds, c : kind of the shape, and result and coefficients of `coefficients.shape_coefficients`.
    label : 1 + index of the shape.
    xs, ys : of `RayTable`.
    box : (u0, v0, u1, v1) the pixels to test.
    row_offset, column_offset : the pixel of the image at the corner of the buffer.
    buffer : (h, w) int32, changed in place.
    """
    rows = (box[1], box[3])
    columns = (box[0] // LANES * LANES, box[2])
    if kind == BOX:
        _box(c, label, xs, ys, rows, columns, row_offset, column_offset, buffer)
    elif bounds == BETWEEN:
        _draw_between(c, label, xs, ys, rows, columns, row_offset, column_offset, buffer)
    elif bounds == ABOVE:
        _draw_above(c, label, xs, ys, rows, columns, row_offset, column_offset, buffer)
    elif bounds == BELOW:
        _draw_below(c, label, xs, ys, rows, columns, row_offset, column_offset, buffer)


@compiled
def unpack_labels(buffer, columns, labels):
    """Labels out of a buffer.

    Parameters
    ----------
    buffer : (h, .) int32 of `draw_shape`.
    columns : where in it the result's first column is.
    labels : (h, w) uint8, filled.
    """
    for v in range(labels.shape[0]):
        for u in range(labels.shape[1]):
            labels[v, u] = buffer[v, u + columns] & LABEL_BITS


@compiled
def unpack_depth(buffer, columns, depth):
    """Depth out of a buffer.

    Parameters
    ----------
    buffer : (h, .) int32 of `draw_shape`.
    columns : where in it the result's first column is.
    depth : (h, w) float32, filled: meters, infinite where nothing is.
    """
    keep, half = np.int32(~LABEL_BITS), np.int32(128)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            packed = buffer[v, u + columns]
            inverse = np.int32((packed & keep) | half).view(np.float32)
            depth[v, u] = np.float32(1.0) / inverse if packed > 0 else np.float32(np.inf)


@compiled
def unpack_mask(buffer, columns, mask):
    """Mask out of a buffer.

    Parameters
    ----------
    buffer : (h, .) int32 of `draw_shape`.
    columns : where in it the result's first column is.
    mask : (h, w) uint8, filled: 255 where anything is, else 0.
    """
    for v in range(mask.shape[0]):
        for u in range(mask.shape[1]):
            mask[v, u] = 255 if buffer[v, u + columns] > 0 else 0
