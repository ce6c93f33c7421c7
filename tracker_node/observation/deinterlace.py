"""Interlaced video: two times of exposure in one image, on the even and on the odd lines.

Interlaced video of 25 images a second holds 50 *fields*. Each becomes an image of its own, either at full height, its
missing lines interpolated (Trewartha et al.), or at half height, seen by a lens whose pixels are twice as high
(`field_camera`): then nothing is invented.

*Comb.* Where something moves, the lines of the two fields disagree, and neighboring lines differ more than lines two apart,
which are of one time. In an image of one exposure it is the other way round. `comb_ratio` is that comparison.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np

from ..camera.rig import Camera
from ..errors import SourceError

FIELD_ORDERS = ("top_first", "bottom_first")  # the field that was exposed first: lines 0, 2, 4... or lines 1, 3, 5...
# White noise, and a line one pixel high, give a ratio of one; all else in a progressive image gives less. Measured with
# clutter full of lines one pixel high, the worst case: 0.7 to 0.95 in progressive and 1.9 to 3.3 in interlaced images.
COMB_THRESHOLD = 1.0
_MOVED = 24  # gray levels of change from image to image that count as motion, well above noise
_MIN_MOVED_PIXELS = 400
_ORDERS_DIFFER = 1.5  # least ratio of the combs of both orders that tells them apart; steady motion gives some 9


def first_line(field: int, order: str = "top_first") -> int:
    """First line of a field in an interlaced image.

    Parameters
    ----------
    field : even for the earlier field of an image, odd for the later one.
    order : one of `FIELD_ORDERS`.

    Returns
    -------
    0 or 1.
    """
    if order not in FIELD_ORDERS:
        raise ValueError(f"expected a field order of {FIELD_ORDERS}, got {order!r}")
    return (field + FIELD_ORDERS.index(order)) % 2


def separate_fields(image: np.ndarray, order: str = "top_first") -> tuple[np.ndarray, np.ndarray]:
    """Both fields of an interlaced image, each with its own lines only.

    Parameters
    ----------
    image : (h, w, ...), h even.
    order : one of `FIELD_ORDERS`.

    Returns
    -------
    earlier, later : (h / 2, w, ...) views.
    """
    if image.shape[0] % 2:
        raise ValueError(f"expected an even number of lines, got {image.shape[0]}")
    return image[first_line(0, order) :: 2], image[first_line(1, order) :: 2]


def weave_fields(earlier: np.ndarray, later: np.ndarray, order: str = "top_first") -> np.ndarray:
    """The interlaced image of two fields; inverse of `separate_fields`.

    Parameters
    ----------
    earlier, later : (h, w, ...) of one type.
    order : one of `FIELD_ORDERS`.

    Returns
    -------
    (2 h, w, ...).
    """
    image = np.empty((2 * earlier.shape[0], *earlier.shape[1:]), dtype=earlier.dtype)
    image[first_line(0, order) :: 2], image[first_line(1, order) :: 2] = earlier, later
    return image


def interpolate_lines(field: np.ndarray, line: int) -> np.ndarray:
    """A field at full height.

    Its lines stay where the camera had them; each missing one is the mean of those above and below, and repeats its neighbor at
    the image's edge.

    Parameters
    ----------
    field : (h, w, ...) uint8.
    line : first of its lines in the image, 0 or 1.

    Returns
    -------
    (2 h, w, ...) uint8.
    """
    image = np.empty((2 * field.shape[0], *field.shape[1:]), dtype=np.uint8)
    image[line::2] = field
    wide = field.astype(np.uint16)
    image[1:-1][line::2] = (wide[:-1] + wide[1:] + 1) >> 1
    edge = -1 if line == 0 else 0
    image[edge] = field[edge]
    return image


def deinterlace(image: np.ndarray, order: str = "top_first") -> tuple[np.ndarray, np.ndarray]:
    """Both fields of an interlaced image at full height.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    order : one of `FIELD_ORDERS`.

    Returns
    -------
    earlier, later : (h, w, 3) uint8.
    """
    earlier, later = separate_fields(image, order)
    return interpolate_lines(earlier, first_line(0, order)), interpolate_lines(later, first_line(1, order))


def field_camera(camera: Camera, line: int) -> Camera:
    """The camera for a field's own lines: half as high.

    Parameters
    ----------
    camera : of the whole image.
    line : line of the image that is the field's first, 0 or 1.

    Returns
    -------
    Another lens at the same place.
    """
    width, height = camera.model.width, camera.model.height
    return replace(camera, model=camera.model.mapped(np.array([[1.0, 0.0, 0.0], [0.0, 0.5, -0.5 * line]]), width, height // 2))


def comb_ratio(images: Sequence[np.ndarray]) -> float | None:
    """Mean square second difference between neighboring lines over that between lines two apart, where something moves.

    Parameters
    ----------
    images : two or more successive images (h, w, 3) uint8 as recorded.

    Returns
    -------
    Above `COMB_THRESHOLD` in interlaced video, below in progressive video; None where too little moves to tell.
    """
    near = far = 0.0
    n_moved = 0
    before = _luma(images[0])
    for image in images[1:]:
        luma = _luma(image)
        middle = luma[2:-2]
        moved = np.abs(middle - before[2:-2]) > _MOVED
        near += float((((middle - 0.5 * (luma[1:-3] + luma[3:-1]))[moved]) ** 2).sum())
        far += float((((middle - 0.5 * (luma[:-4] + luma[4:]))[moved]) ** 2).sum())
        n_moved += int(moved.sum())
        before = luma
    return near / far if n_moved >= _MIN_MOVED_PIXELS and far > 0.0 else None


def check_interlaced(images: Sequence[np.ndarray], source: str) -> None:
    """Refuse a source that is marked as interlaced and is not.

    A scene in which nothing moves passes: its fields are alike, and taking them apart does no harm but to its resolution.

    Parameters
    ----------
    images : as of `comb_ratio`.
    source : its name, for the message.

    Raises
    ------
    SourceError : naming the source and the ratio.
    """
    ratio = comb_ratio(images)
    if ratio is not None and ratio < COMB_THRESHOLD:
        raise SourceError(
            source,
            f"marked as interlaced, but what moves shows no comb (ratio {ratio:.2f}, interlaced video has more than"
            f" {COMB_THRESHOLD:g}): it is progressive, take the mark away",
        )


def _field_order(images: Sequence[np.ndarray]) -> str | None:
    """Which field was exposed first, one of `FIELD_ORDERS`, from what moves; None where too little does.

    The later field of an image and the earlier one of the next are one field period apart, the other two are three: woven
    together, they show the smaller comb.
    """
    combs = {}
    for order in FIELD_ORDERS:
        later = first_line(1, order)
        woven = [weave_fields(a[later::2], b[1 - later :: 2], FIELD_ORDERS[later]) for a, b in pairwise(images)]
        combs[order] = _line_energy(woven, images)
    smaller = min(combs, key=combs.__getitem__)
    larger = max(combs.values())
    return smaller if larger > 0.0 and combs[smaller] * _ORDERS_DIFFER < larger else None


def _line_energy(woven: Sequence[np.ndarray], images: Sequence[np.ndarray]) -> float:
    """Sum of squared second differences between neighboring lines, where something has moved; 0 if that is too little."""
    total, n_moved = 0.0, 0
    for image, before, after in zip(woven, images[:-1], images[1:], strict=True):
        moved = (np.abs(_luma(after) - _luma(before)) > _MOVED)[1:-1]
        luma = _luma(image)
        total += float((((luma[1:-1] - 0.5 * (luma[:-2] + luma[2:]))[moved]) ** 2).sum())
        n_moved += int(moved.sum())
    return total if n_moved >= _MIN_MOVED_PIXELS else 0.0


def check_field_order(images: Sequence[np.ndarray], order: str, source: str) -> None:
    """Refuse a field order that makes everything move back and forth; a scene in which nothing moves passes.

    Parameters
    ----------
    images : two or more successive ones (h, w, 3) uint8 as recorded.
    order : that the source is marked with.
    source : its name, for the message.

    Raises
    ------
    SourceError : naming the source and the order that its images have.
    """
    found = _field_order(images)
    if found is not None and found != order:
        raise SourceError(source, f"marked as {order}, but then what moves would go back and forth: it is {found}")


def _luma(image: np.ndarray) -> np.ndarray:
    """(h, w) float32 of BGR, weights of ITU-R BT.601; averaged along the line, where a comb goes on and noise does not."""
    luma = image @ np.array([0.114, 0.587, 0.299], dtype=np.float32)
    return cv2.blur(luma, (5, 1))
