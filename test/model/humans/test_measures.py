"""Measures of a man, and of men of other statures."""

from dataclasses import fields

import pytest

from tracker_node.calibration.body import model_stature
from tracker_node.model.humans.human import gait_human
from tracker_node.model.humans.measures import HumanMeasures, unused_markers


def test_lengths_add_up_to_shares_of_stature():
    man = HumanMeasures()
    assert man.stature == 1.75 and man.scale == 1.0
    hips = man.thigh_length + man.shank_length + man.ankle_height
    assert hips == pytest.approx(0.530 * 1.75, abs=2e-4)
    top = hips + man.pelvis_length + man.abdomen_length + man.neck_z + man.head_top
    assert top == pytest.approx(1.75, abs=4e-4)
    assert man.upper_arm_length == pytest.approx(0.3255) and man.forearm_length == pytest.approx(0.2555)
    assert man.hip_half_width == pytest.approx(0.084) and man.crotch_depth == pytest.approx(0.09625, abs=6e-5)
    assert man.pelvis_length == pytest.approx(0.09625, abs=6e-5) and man.chest_top == pytest.approx(0.2625)
    assert man.neck_z == pytest.approx(0.34125, abs=6e-5) and man.clavicle_z == pytest.approx(0.28525, abs=6e-5)
    assert man.head_radii[2] == pytest.approx(0.11375, abs=6e-5)


def test_sections_are_those_of_the_survey_for_a_smaller_man():
    """Of 1.75 m instead of 1.756 m: 0.9966 of them; radii are girths by two pi."""
    man = HumanMeasures()
    assert man.chest_radii == pytest.approx((0.1211, 0.1604), abs=1e-4)
    assert man.waist_radii == pytest.approx((0.1106, 0.1505), abs=1e-4)
    assert man.buttock_radii == pytest.approx((0.1226, 0.1704), abs=1e-4)
    assert man.chest_base_radii == pytest.approx((0.1106, 0.1465), abs=1e-4)
    assert man.neck_radius == pytest.approx(0.0601) and man.thigh_radii == pytest.approx((0.0947, 0.0904), abs=1e-4)
    assert man.upper_arm_radii == pytest.approx((0.0547, 0.0508), abs=1e-4)
    assert man.shank_radii == pytest.approx((0.0611, 0.0595), abs=1e-4)
    assert man.clavicle_length == pytest.approx(0.1578) and man.foot_radii[0] == pytest.approx(0.1345, abs=1e-4)


def test_all_lengths_scale_and_ratios_stay():
    man, child = HumanMeasures(), HumanMeasures.of_stature(0.875)
    assert child.stature == 0.875 and child.scale == 0.5
    kept = {"deltoid_scale", "elbow_scale", "wrist_scale", "knee_scale", "ankle_scale", "neck_taper"}
    for field in fields(man):
        factor = 1.0 if field.name in kept else 0.5
        value, small = getattr(man, field.name), getattr(child, field.name)
        if isinstance(value, tuple):
            assert isinstance(small, tuple) and small == pytest.approx([factor * v for v in value]), field.name
        else:
            assert small == pytest.approx(factor * value), field.name
    assert HumanMeasures.of_stature(1.75) == man


@pytest.mark.parametrize("stature", [0.39, 3.01, float("nan")])
def test_statures_that_nobody_has(stature):
    with pytest.raises(ValueError, match=f"expected a stature of 0.4 to 3 meters, got {stature}"):
        HumanMeasures(stature=stature)


def test_the_smallest_and_the_greatest():
    assert HumanMeasures(stature=0.4).scale == pytest.approx(0.22857, abs=1e-5)
    assert HumanMeasures(stature=3.0).stature == 3.0


def test_a_child_has_a_childs_head_and_its_stature():
    """A fifth to a sixth of the stature at 1 m, chin to crown, an adult's eighth at 1.75 m; no part vanishes."""
    child, small, adult = HumanMeasures.of_child(1.0), HumanMeasures.of_stature(1.0), HumanMeasures()
    assert 1.0 / 6.5 < 2.0 * child.head_radii[2] < 1.0 / 5.5
    assert child.head_radii[1] == pytest.approx(small.head_radii[1] * 1.75**0.54) and child.head_top > small.head_top
    assert 0.93 < child.thigh_length / small.thigh_length < 1.0 and child.upper_arm_length == small.upper_arm_length
    assert HumanMeasures.of_child(1.75) == adult
    for stature in (0.9, 1.3):
        assert model_stature(gait_human(HumanMeasures.of_child(stature))) == pytest.approx(stature, abs=2e-3)
    with pytest.raises(ValueError, match="child's stature"):
        HumanMeasures.of_child(0.5)


def test_of_many_markers_that_are_no_landmarks_ten_are_named():
    assert unused_markers(("LKJC", "RShoulder", "head"), ("left_knee", "right_shoulder", "head")) == ""
    said = unused_markers([f"M{i}" for i in range(12)], ("head",))
    assert said.startswith("12 of 12 markers") and said.endswith("M8, M9 and 2 more")
