"""Eleven parameters to seven, stage by stage, on the cameras of the cross: lenses whose principal points are off the middle."""

import numpy as np
import pytest

from tracker_node.calibration.points.dlt import calibrate, check_control_points
from tracker_node.calibration.points.dlt_stages import STAGES, calibrate_in_stages, object_errors_m
from tracker_node.errors import CalibrationError
from tracker_node.experiments.cross.throw import IMAGE_SIZE, MIDDLE, control_points, cross_rig, digitized
from tracker_node.loaders.rig.control_points import ControlPoints

RIG = cross_rig()
RNG = np.random.default_rng(3)
POINTS = control_points(RNG)
CLICKS = [digitized(camera, POINTS, 1.0, RNG) for camera in RIG]


@pytest.fixture(scope="module")
def stages():
    return [calibrate_in_stages(c.name, POINTS, clicks, IMAGE_SIZE) for c, clicks in zip(RIG, CLICKS, strict=True)]


def test_every_stage_is_what_it_says(stages):
    for camera, clicks, found in zip(RIG, CLICKS, stages, strict=True):
        assert tuple(stage.name for stage in found) == STAGES
        linear, refined, restricted, annealed, polished = found
        assert refined.rms_px <= linear.rms_px < 2.0
        assert restricted.rms_px > 5.0 * refined.rms_px  # the principal point is not in the middle
        assert polished.rms_px < annealed.rms_px < restricted.rms_px
        assert polished.rms_px < 1.6
        for stage in (restricted, annealed, polished):
            K = stage.camera.model.K
            assert K[0, 0] == K[1, 1] and K[0, 1] == 0.0 and (K[0, 2], K[1, 2]) == (383.5, 287.5)
        np.testing.assert_allclose(polished.residuals_px, clicks - polished.camera.project(POINTS)[0], atol=1e-9)
        assert polished.camera.name == camera.name


def test_the_last_stage_is_the_best_camera_of_its_kind(stages):
    for camera, clicks, found in zip(RIG, CLICKS, stages, strict=True):
        assert found[-1].rms_px == pytest.approx(calibrate(camera.name, POINTS, clicks, IMAGE_SIZE, "centered").rms_px, abs=1e-4)


def test_points_elsewhere_are_found_to_a_few_millimetres(stages):
    others = MIDDLE + np.random.default_rng(8).uniform(-0.9, 0.9, (100, 3))
    pixels = np.stack([camera.project(others)[0] for camera in RIG], axis=1)
    errors = [object_errors_m([found[k].camera for found in stages], others, pixels, np.ones((100, 3))) for k in range(5)]
    rms = [1e3 * np.sqrt(np.mean(e**2)) for e in errors]
    assert rms[0] < 5.0 and rms[1] < 5.0 and rms[4] < 3.0
    assert rms[2] > 5.0 * rms[4]


def test_annealing_can_be_repeated():
    first, second = (calibrate_in_stages("left", POINTS, CLICKS[0], IMAGE_SIZE, seed=4, iterations=30) for _ in range(2))
    np.testing.assert_array_equal(first[3].camera.T_world_cam, second[3].camera.T_world_cam)


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
        calibrate_in_stages("left", line, CLICKS[0], IMAGE_SIZE)
