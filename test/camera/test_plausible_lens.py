"""A lens from outside: each value at its limits, and beyond them."""

import numpy as np
import pytest

from tracker_node.camera.model import FARTHEST, LARGEST_COEFFICIENT, LONGEST, SHORTEST, CameraModel, plausible

SIDE = 800  # of the image, the longer one
PLACES = {"fx": (0, 0), "fy": (1, 1), "skew": (0, 1), "cx": (0, 2), "cy": (1, 2)}


def lens(field="fx", value=700.0, size=(SIDE, 600), distortion=(0.0,) * 5):
    K = np.array([[700.0, 0.0, 400.0], [0.0, 700.0, 300.0], [0.0, 0.0, 1.0]])
    K[PLACES[field]] = value
    return CameraModel(*size, K, "plumb_bob", np.array(distortion))


LIMITS = [
    ("fx", SHORTEST, LONGEST),
    ("fy", SHORTEST, LONGEST),
    ("skew", -LONGEST, LONGEST),
    ("cx", -FARTHEST, FARTHEST),
    ("cy", -FARTHEST, FARTHEST),
]


@pytest.mark.parametrize("size", [(SIDE, 600), (600, SIDE)])
@pytest.mark.parametrize(("field", "low", "high"), LIMITS)
def test_limits_are_in_longer_sides_of_the_image(field, low, high, size):
    for inside in (low * SIDE, high * SIDE):
        model = lens(field, inside, size)
        assert plausible(model) is model
    width = (high - low) * SIDE
    for outside in (low * SIDE - 1e-6 * width, high * SIDE + 1e-6 * width):
        with pytest.raises(ValueError, match=f"^{field}: expected {low * SIDE:g} to {high * SIDE:g}, got "):
            plausible(lens(field, outside, size))


@pytest.mark.parametrize("i", range(5))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_coefficients_are_counted_from_one(i, sign):
    coefficients = np.zeros(5)
    coefficients[i] = sign * LARGEST_COEFFICIENT
    plausible(lens(distortion=coefficients))
    coefficients[i] *= 1.001
    with pytest.raises(ValueError, match=f"^distortion coefficient {i + 1}: expected -1e\\+06 to 1e\\+06, got"):
        plausible(lens(distortion=coefficients))


def test_what_is_no_number_is_refused():
    coefficients = np.array([0.0, np.nan, 0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="nan"):
        plausible(lens(distortion=coefficients))
