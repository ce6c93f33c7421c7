"""What is said of cameras that do not agree with a fit, and the covariance of equations as they are."""

import numpy as np
import pytest

from tracker_node.tracking.assessment import assess_cameras, inverse_covariance
from tracker_node.tracking.estimate import Status

ALL = ("left", "right", "top")


def said(agreement: dict[str, float], present=ALL, n_cameras: int = 3, least: float = 0.4) -> tuple[Status, str]:
    return assess_cameras(agreement, least, present, n_cameras, "colors do not agree", "the body")


@pytest.mark.parametrize(
    ("agreement", "present", "n_cameras", "reason"),
    [
        ({"left": 0.9, "right": 0.8, "top": 0.4}, ALL, 3, ""),
        ({"left": 0.9, "right": 0.8}, ALL, 3, ""),  # the body is not expected in the third one's image
        ({"left": 0.9}, ("left",), 1, ""),
        ({"left": 0.9, "right": 0.39, "top": -0.3}, ALL, 3, "colors do not agree in right (39 %), top (0 %)"),
        ({"left": 0.9, "right": 0.1}, ("left", "right"), 3, "colors do not agree in right (10 %)"),  # before those that are gone
        ({"left": 0.9, "right": 0.8}, ("left", "right"), 3, "2 of 3 cameras"),
        ({"left": 0.9}, ("left", "right"), 3, "2 of 3 cameras"),  # before those that see nothing
        ({"left": 0.9}, ALL, 3, "only left sees the body"),
        ({}, ALL, 3, "only no camera sees the body"),
        ({}, ("left",), 1, "only no camera sees the body"),
    ],
)
def test_cameras_are_named_that_do_not_see_the_body_as_they_should(agreement, present, n_cameras, reason):
    status, words = said(agreement, present, n_cameras)
    assert words == reason
    assert status is (Status.DEGRADED if reason else Status.TRACKING)


def test_the_least_is_enough():
    assert said({"left": 0.4, "right": 0.4})[0] is Status.TRACKING
    assert said({"left": 0.4, "right": 0.4}, least=0.4001)[0] is Status.DEGRADED


def test_a_covariance_is_the_inverse_times_the_variance():
    root = np.random.default_rng(3).normal(size=(5, 5))
    H = root @ root.T + 3.0 * np.eye(5)
    before, found = H.copy(), inverse_covariance(H, 4.0)
    np.testing.assert_allclose(found, 4.0 * np.linalg.inv(H), rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(found, found.T)
    np.testing.assert_array_equal(H, before)


def test_what_nothing_tells_has_a_large_variance():
    np.testing.assert_allclose(np.diag(inverse_covariance(np.diag([1e4, 0.0]), 1.0)), [1e-4, 100.0], rtol=1e-5)
    np.testing.assert_allclose(np.diag(inverse_covariance(np.zeros((2, 2)), 1.0)), 1e6)
