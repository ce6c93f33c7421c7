"""Control points that show by themselves that something is wrong: sizes, units, pixels off the image."""

import numpy as np
import pytest

from tracker_node.calibration.points.dlt import LARGEST_M, SMALLEST_M, check_control_points
from tracker_node.errors import CalibrationError
from tracker_node.loaders.rig.control_points import ControlPoints

CUBE = np.array(list(np.ndindex(2, 2, 2)), dtype=float)
NAMES = tuple("abcdefgh")
PIXELS = np.linspace(5.0, 60.0, 16).reshape(8, 2)


def check(points=CUBE, pixels=PIXELS):
    check_control_points("cam", ControlPoints(NAMES, points, pixels), (64, 64))


def test_good_points_pass():
    check()
    check(CUBE * LARGEST_M)
    check(CUBE * SMALLEST_M)


@pytest.mark.parametrize(("size", "message"), [(1.01 * LARGEST_M, "are they millimeters"), (0.99 * SMALLEST_M, "mm only")])
def test_volumes_of_another_unit_are_refused(size, message):
    with pytest.raises(CalibrationError, match=message):
        check(CUBE * size)


def test_a_point_in_millimetres_is_named():
    points = CUBE.copy()
    points[3] *= 1000.0
    with pytest.raises(CalibrationError, match=r"'d' is \d+ times as far"):
        check(points)


@pytest.mark.parametrize(("pixel", "inside"), [((-0.5, 3.0), True), ((63.5, 63.5), True), ((-0.6, 3.0), False),
                                               ((3.0, -0.6), False), ((63.6, 3.0), False), ((3.0, 63.6), False)])  # fmt: skip
def test_pixels_are_on_the_image_to_its_edges(pixel, inside):
    pixels = PIXELS.copy()
    pixels[5] = pixel
    if inside:
        check(pixels=pixels)
        return
    with pytest.raises(CalibrationError, match=r"'f' was seen at pixel .* outside of the image of 64x64"):
        check(pixels=pixels)
