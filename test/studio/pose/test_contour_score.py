"""Scores of contours: shares of the outline."""

from types import SimpleNamespace

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.studio.pose.bench import ContourScore, _fraction


def test_a_share_needs_ten_samples():
    assert _fraction(5, 10) == 0.5 and _fraction(3.0, 12.0) == 0.25 and _fraction(0, 10) == 0.0
    assert _fraction(9, 9) is None and _fraction(0, 0) is None


def test_shares_are_of_all_of_each_camera_and_of_each_part():
    expected, close = np.array([[20, 4], [30, 5], [3, 2]]), np.array([[10, 1], [27, 1], [3, 2]])
    scored = ContourScore._scored(SimpleNamespace(_rig=circle_rig(3)), SimpleNamespace(expected=expected, close=close))
    assert [(camera.camera, camera.samples) for camera in scored.cameras] == [("cam01", 24), ("cam02", 35), ("cam03", 5)]
    values = [camera.value for camera in scored.cameras]
    assert values == [pytest.approx(11 / 24), pytest.approx(28 / 35), None]
    assert scored.parts == (pytest.approx(40 / 53), pytest.approx(4 / 11)) and scored.total == pytest.approx(44 / 64)
