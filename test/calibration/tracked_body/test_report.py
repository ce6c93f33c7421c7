"""The page of a fit says what was found, in the units that it names."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.two_links import two_links
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.tracked_body.body_fit import BodyFit, BodyFitReport, FittedParameter, LineMetrics
from tracker_node.calibration.tracked_body.report import (
    before_and_after,
    body_metrics,
    camera_table,
    line_table,
    measure_table,
    parameter_table,
    rig_metrics,
)
from tracker_node.calibration.tracked_body.rig_fit import CameraFit, RigFit
from tracker_node.geometry import se3
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid
from tracker_node.observation.image_set import CameraImage, ImageSet

BEFORE, AFTER = LineMetrics(90, 3.0, 2.0), LineMetrics(100, 1.5, 1.0)
PAIR, RIG, ARM = (BEFORE, AFTER), circle_rig(2), two_links()
PARAMETERS = (FittedParameter("length arm", 0.05, 0.01, 0.1), FittedParameter("girth arm", -0.02, 0.005, 0.0))
REPORT = BodyFitReport(PARAMETERS, {"cam01": PAIR}, {"hand": PAIR}, PAIR, 7, 12)
CAMERA = CameraFit(BEFORE, AFTER, 0.012, np.radians(0.5), 0.02, 1.03, 0.001, np.radians(0.05), 0.004, 0.002)
RIG_FIT = RigFit(RIG, ARM, (), (), {"cam01": CAMERA}, PAIR, 7, 12, 0.97)


def longer():
    """The arm with its elbow twice as far out, and a smaller hand."""
    joint = replace(ARM.chain.joints[0], T_parent_joint=se3.from_rotation_translation(np.eye(3), [0, 0, 0.6]))
    hand = replace(ARM.shapes[2], primitive=Ellipsoid((0.02, 0.05, 0.08)))
    return replace(ARM, chain=KinematicChain(ARM.chain.links, (joint,)), shapes=(*ARM.shapes[:2], hand))


def test_lines_before_and_after():
    (row,) = line_table("Cameras", "camera", {"cam01": PAIR}).table[1:]
    assert row == ("cam01", "100", "3.00", "1.50", "2.00", "1.00")


def test_parameters_in_percent_and_in_sigmas_of_the_prior():
    first, held = parameter_table(REPORT).table[1:]
    assert first == ("length arm", "+5.0", "1.0", "10", "+0.5")
    assert held == ("girth arm", "-2.0", "0.5", "0", "held")


def test_sizes_are_whole_ones_in_millimetres():
    rows = {name: sizes for name, *sizes in measure_table(ARM, BodyFit(longer(), (), REPORT)).table[1:]}
    assert rows["hand"] == ["60 x 100 x 160", "40 x 100 x 160"]
    assert rows["upper to joint elbow"] == ["300", "600"]


def test_cameras_in_readable_units():
    (row,) = camera_table(RIG_FIT).table[1:]
    assert row == ("cam01", "12.0 ± 1.0", "0.500 ± 0.050", "+20.0 ± 4.0", "+3.00 ± 0.20")


def test_flat_figures_of_a_body():
    figures = body_metrics(BodyFit(ARM, (), REPORT))
    assert (figures["body.sets"], figures["body.iterations"], figures["body.lines"]) == (7, 12, 100)
    for key in ("body", "body.cam01", "body.hand"):
        assert (figures[f"{key}.rms_before_px"], figures[f"{key}.rms_after_px"]) == (3.0, 1.5)
    assert (figures["body.length_arm"], figures["body.length_arm_sigma"]) == (0.05, 0.01)


def test_flat_figures_of_a_rig():
    figures = rig_metrics(RIG_FIT)
    assert (figures["refine.sets"], figures["refine.rms_before_px"], figures["refine.rms_after_px"]) == (7, 3.0, 1.5)
    own = {key.removeprefix("refine.cam01."): value for key, value in figures.items() if "cam01" in key}
    assert own == pytest.approx({
        "rms_before_px": 3.0, "rms_after_px": 1.5, "moved_mm": 12.0, "turned_deg": 0.5, "later_ms": 20.0, "later_sigma_ms": 4.0,
        "moved_sigma_mm": 1.0, "turned_sigma_deg": 0.05, "focal_scale": 1.03,
    })  # fmt: skip


@pytest.mark.parametrize(("n", "time_steps", "taken"), [(9, 2, (4, 6)), (9, 1, (5,)), (1, 2, (1,))])
def test_pictures_are_of_time_steps_in_between(n, time_steps, taken):
    state = State.neutral(ARM, se3.from_rotation_translation(np.eye(3), [0.0, 0.0, 0.8]))
    bgr = np.full((480, 640, 3), 50, np.uint8)
    sets = [ImageSet(i, (CameraImage("cam01", i, bgr),)) for i in range(n)]
    images = before_and_after(sets, (ARM, RIG, [state] * n), (longer(), RIG, [state] * n), time_steps)
    assert [one.text.split(" of ")[0] for one in images] == [f"cam01, image set {k}" for k in taken]
    for one in images:
        assert one.image.shape[0] == 420
        assert one.image.shape[1] % 2 == 0  # two alike beside each other
        left, right = np.hsplit(one.image, 2)
        assert np.any(left != 50)
        assert np.any(left != right)
