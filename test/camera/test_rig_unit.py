"""Rigs in millimeters and centimeters are told from meters by how far their cameras stand apart."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import check_metres, check_place, wrong_unit
from tracker_node.errors import TrackerError

EYES = ((3.0, 0.3, 1.2), (-2.0, 2.5, 1.1), (-1.5, -2.6, 1.3))


def cameras(factors, focal_px: float = 1500.0):
    lens = CameraModel(1280, 720, np.array([[focal_px, 0.0, 639.5], [0.0, focal_px, 359.5], [0.0, 0.0, 1.0]]))
    places = [tuple(factor * x for x in eye) for factor, eye in zip(factors, EYES, strict=True)]
    return [look_at(place, (0.0, 0.0, 1.0), lens, f"cam{i}") for i, place in enumerate(places, 1)]


def test_metres_are_metres():
    assert wrong_unit(cameras([1, 1, 1])) is None
    assert wrong_unit(cameras([1000, 1, 1])[:1]) is None  # one camera alone stands nowhere
    check_metres(cameras([1, 1, 1]), 1.8)


@pytest.mark.parametrize(("factor", "unit", "by"), [(1000, "millimeters", "1000"), (100, "centimeters", "100")])
def test_all_cameras_in_another_unit_are_refused_with_the_factor(factor, unit, by):
    with pytest.raises(TrackerError, match=rf"^rig: The cameras are \d+ m apart: .* in {unit}.*Divide it by {by}\.") as told:
        check_metres(cameras([factor] * 3), 1.8)
    assert "rig check" in str(told.value)


def test_a_small_body_tells_millimeters_from_centimeters():
    """Half a meter between cameras that look at a mouse, or five between such that look at a person."""
    for factor, size_m, by in ((100, 0.13, "1000"), (100, 1.8, "100"), (2000, 1.8, "1000"), (500, 1.8, "100")):
        with pytest.raises(TrackerError, match=rf"Divide it by {by}\."):
            check_metres(cameras([factor] * 3), size_m)


def test_one_camera_in_another_unit_is_named():
    found = wrong_unit(cameras([1, 1000, 1]))
    assert found is not None and (found.cameras, found.all_of_them, found.factor) == (("cam2",), False, 1e-3)
    with pytest.raises(TrackerError, match="cam2: stands 3"):
        check_metres(cameras([1, 1000, 1]), 1.8)


def test_long_lenses_far_away_are_not_refused():
    far = cameras([100] * 3, focal_px=12_000.0)
    assert wrong_unit(far) is not None  # rig check asks
    check_metres(far, 1.8)


@pytest.mark.parametrize("size_m", [240.0, 2.4e-7])
def test_a_body_in_another_unit_is_told(size_m):
    with pytest.raises(TrackerError, match=rf"a body in meters, got one of {size_m:.3g} m; meshes in mil.* take scale"):
        check_metres(cameras([1, 1, 1]), size_m)


def test_a_state_in_millimeters_is_refused_with_its_place():
    for place in ((0.2, 0.1, 1.0), (2.0, 0.3, 1.0), (0.0, 40.0, 1.0)):
        check_place(cameras([1, 1, 1]), 1.8, np.array(place))
    with pytest.raises(TrackerError, match=r"^initial state: expected a place in meters .* got \(200, 100, 1000\), 1023 m from"):
        check_place(cameras([1, 1, 1]), 1.8, np.array([200.0, 100.0, 1000.0]))
