"""Control points that cannot be meant: another unit, another image; said before a camera is sought with them."""

from __future__ import annotations

import numpy as np

from ...errors import CalibrationError
from ...loaders.rig.control_points import ControlPoints

LARGEST_M = 200.0  # a volume for people and vehicles; in millimetres it would be 200 000
SMALLEST_M = 0.02
_FAR = 20.0  # times the usual distance from the middle


def check_control_points(name: str, seen: ControlPoints, image_size: tuple[int, int]) -> None:
    """Refuse what a camera's points show to be wrong by itself.

    Raises
    ------
    CalibrationError : a volume of a size that points to millimetres, one point in another unit than the others, or a pixel that
        is not on the image.
    """
    from_middle = np.linalg.norm(seen.points - np.median(seen.points, axis=0), axis=1)
    usual, far = float(np.median(from_middle)), int(from_middle.argmax())
    if usual > 0.0 and from_middle[far] > _FAR * usual:
        raise CalibrationError(
            name,
            f"control point '{seen.names[far]}' is {from_middle[far] / usual:.0f} times as far from the middle as the others are:"
            " is it in another unit? all places are in metres",
        )
    extent = float(np.ptp(seen.points, axis=0).max())
    if extent > LARGEST_M:
        raise CalibrationError(name, f"its control points span {extent:g} m: are they millimetres? give metres")
    if extent < SMALLEST_M:
        raise CalibrationError(name, f"its control points span {1e3 * extent:g} mm only: are they in metres?")
    outside = np.any((seen.pixels < -0.5) | (seen.pixels > np.array(image_size) - 0.5), axis=1)
    if outside.any():
        i = int(outside.argmax())
        u, v = seen.pixels[i]
        width, height = image_size
        raise CalibrationError(
            name, f"control point '{seen.names[i]}' was seen at pixel ({u:g}, {v:g}), outside of the image of {width}x{height}"
        )
