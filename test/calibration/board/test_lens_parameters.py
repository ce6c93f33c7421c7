"""Lenses as vectors: order, prior, and derivatives against differences."""

from dataclasses import replace

import numpy as np
import pytest

from tracker_node.calibration.board.adjustment import COEFFICIENTS, lens_jacobian, lens_of_vector, lens_prior, lens_vector
from tracker_node.camera.model import CameraModel

K = np.array([[500.0, 0.0, 310.0], [0.0, 510.0, 230.0], [0.0, 0.0, 1.0]])
DISTORTION = {
    "none": (), "plumb_bob": (-0.2, 0.05, 0.001, -0.002, 0.01), "equidistant": (0.05, -0.01, 0.003, -0.001),
    "rational_polynomial": (0.1, -0.05, 0.001, -0.002, 0.01, 0.2, -0.04, 0.02),
}  # fmt: skip


def lens(kind, coefficients=None):
    return CameraModel(640, 480, K, kind, np.array(DISTORTION[kind] if coefficients is None else coefficients))


@pytest.mark.parametrize("kind", DISTORTION)
def test_a_vector_is_there_and_back(kind):
    model = lens(kind)
    vector = lens_vector(model)
    assert vector.tolist() == [500.0, 510.0, 310.0, 230.0, *DISTORTION[kind]]
    again = lens_of_vector(vector, model)
    np.testing.assert_array_equal(again.K, K)
    assert (again.width, again.height, again.distortion_model) == (640, 480, kind)
    assert again.distortion.tolist() == list(DISTORTION[kind])


def test_coefficients_that_are_not_given_are_zero():
    assert lens_vector(lens("plumb_bob", DISTORTION["plumb_bob"][:4]))[-2:].tolist() == [-0.002, 0.0]


def test_focal_lengths_are_positive():
    with pytest.raises(ValueError, match=r"."):
        lens_of_vector(np.array([-1.0, 1.0, 0.0, 0.0]), lens("none"))


@pytest.mark.parametrize("kind", DISTORTION)
def test_a_lens_may_be_off_its_middle_by_a_tenth(kind):
    mean, sigma = lens_prior(lens(kind))
    assert mean.tolist() == [0.0, 0.0, 319.5, 239.5] + [0.0] * len(COEFFICIENTS[kind])
    assert sigma[:4].tolist() == [np.inf, np.inf, 64.0, 64.0]
    assert len(sigma) == len(mean)
    assert lens_prior(replace(lens(kind), width=480, height=700))[1][2] == 70.0
    if kind == "plumb_bob":
        assert sigma[4:].tolist() == [1.0, 1.0, 0.02, 0.02, 1.0]


@pytest.mark.parametrize("kind", DISTORTION)
def test_derivatives_are_those_of_pixels(kind):
    model, step = lens(kind), 1e-6
    points = np.array([[0.3, -0.2, 1.5], [-0.5, 0.4, 2.0], [0.05, 0.01, 1.0], [0.0, 0.0, 2.0]])
    found = lens_jacobian(model, points)
    vector = lens_vector(model)
    assert found.shape == (4, 2, len(vector))
    for i in range(len(vector)):
        ends = []
        for sign in (1.0, -1.0):
            moved = vector.copy()
            moved[i] += sign * step
            ends.append(lens_of_vector(moved, model).project(points)[0])
        np.testing.assert_allclose(found[..., i], (ends[0] - ends[1]) / (2.0 * step), rtol=1e-5, atol=1e-6)
