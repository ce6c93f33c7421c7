"""Cameras of the cross from control points: lenses whose principal points are off the middle; and what cannot be meant."""

import numpy as np
import pytest

from tracker_node.calibration.points.dlt import calibrate, check_control_points, object_errors_m
from tracker_node.errors import CalibrationError
from tracker_node.experiments.cross.throw import IMAGE_SIZE, MIDDLE, control_points, cross_rig, digitized
from tracker_node.loaders.rig.control_points import ControlPoints

RIG = cross_rig()
RNG = np.random.default_rng(3)
POINTS = control_points(RNG)
CLICKS = [digitized(camera, POINTS, 1.0, RNG) for camera in RIG]


@pytest.mark.parametrize("constraint", ["none", "centered"])
def test_points_elsewhere_are_found_to_a_few_millimeters(constraint):
    found = [calibrate(c.name, POINTS, clicks, IMAGE_SIZE, constraint).camera for c, clicks in zip(RIG, CLICKS, strict=True)]
    others = MIDDLE + np.random.default_rng(8).uniform(-0.9, 0.9, (100, 3))
    names = tuple(map(str, range(100)))
    errors = object_errors_m(found, {c.name: ControlPoints(names, others, c.project(others)[0]) for c in RIG})
    assert len(errors) == 100 and 1e3 * np.sqrt(np.mean(errors**2)) < (5.0 if constraint == "none" else 3.0)


def test_points_that_one_camera_sees_are_not_reconstructed():
    def seen(camera, *rows):
        return ControlPoints(tuple(f"p{row}" for row in rows), POINTS[list(rows)], camera.project(POINTS[list(rows)])[0])

    left, right, top = RIG
    errors = object_errors_m([left, right, top], {"left": seen(left, 2, 1), "right": seen(right, 3, 2), "top": seen(top, 3)})
    assert len(errors) == 2 and errors.max() < 1e-9


def check(points, pixels=None, size=IMAGE_SIZE):
    names = tuple(f"p{i}" for i in range(len(points)))
    check_control_points("left", ControlPoints(names, points, CLICKS[0] if pixels is None else pixels), size)


def test_points_that_cannot_be_meant_are_refused():
    check(POINTS)
    with pytest.raises(CalibrationError, match=r"'left'.*span 2214.*are they millimeters\? give meters"):
        check(1e3 * POINTS)
    mixed = POINTS.copy()
    mixed[7] *= 1e3
    with pytest.raises(CalibrationError, match=r"'p7' is .* times as far .* in another unit"):
        check(mixed)
    with pytest.raises(CalibrationError, match="mm only: are they in meters"):
        check(1e-3 * POINTS)
    clicks = CLICKS[0].copy()
    clicks[5] = [900.0, 100.0]
    with pytest.raises(CalibrationError, match=r"'p5' was seen at pixel \(900, 100\), outside of the image of 768x576"):
        check(POINTS, clicks)


def test_points_on_a_line_are_called_so():
    line = np.linspace(0.0, 1.0, 20)[:, None] * np.array([1.0, 0.5, 0.2])
    with pytest.raises(CalibrationError, match=r"'left'.*20 control points lie on one line"):
        calibrate("left", line, CLICKS[0], IMAGE_SIZE)
