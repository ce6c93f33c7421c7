"""Stadium sections, and measures that fit together."""

import math

import pytest

from tracker_node.model.humans import segments18 as man


def test_sections():
    """Two half circles of radius 1 and 1 meter of straight between: girth 2 pi + 2, breadth 3, depth 2."""
    assert man.radius_of(2.0 * math.pi) == pytest.approx(1.0)
    assert man.stadium_halves(2.0 * math.pi + 2.0, 3.0) == pytest.approx((1.5, 1.0))
    assert man.stadium_of_ratio(2.0 * math.pi + 2.0, 1.5) == pytest.approx((1.5, 1.0))
    assert man.stadium_of_ratio(2.0 * math.pi, 1.0) == pytest.approx((1.0, 1.0))


def test_levels_are_in_order():
    assert 0 < man.UMBILICUS < man.LOWEST_RIB < man.NIPPLE < man.SHOULDER < man.ACROMION < 0.6
    assert 0 < man.NOSE < man.ABOVE_EAR < man.HEAD_TOP < 0.4
    assert 0 < man.ELBOW < man.FOREARM_MAXIMUM < man.WRIST < 0.6 and 0 < man.THUMB_BASE < man.KNUCKLES < man.FINGERNAILS < 0.2
    assert 0 < man.CROTCH < man.KNEE < man.CALF_MAXIMUM < man.ANKLE < 0.9 and 0 < man.HEEL < man.BALL < man.TOENAILS < 0.25
    assert pytest.approx(0.2555) == man.MID_THIGH and pytest.approx(0.10175) == man.ARCH
    assert pytest.approx(1.81, abs=0.015) == man.ANKLE_HEIGHT + man.ANKLE + man.ACROMION + man.HEAD_TOP
    assert pytest.approx(1.296, abs=0.001) == man.HEAD_LENGTH_TO_BREADTH


@pytest.mark.parametrize("part", ["HIP", "UMBILICUS", "RIB", "NIPPLE", "WRIST", "THUMB", "KNUCKLE", "NAIL", "BALL", "TOE"])
def test_every_section_is_a_stadium(part):
    girth, breadth = getattr(man, f"{part}_SECTION")
    broad, thin = man.stadium_halves(girth, breadth)
    assert 0.0 < thin < broad == breadth / 2
    assert 2.0 * math.pi * thin + 4.0 * (broad - thin) == pytest.approx(girth)
