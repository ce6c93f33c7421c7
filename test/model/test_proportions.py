"""What is expected of lengths between a detector's joints."""

import numpy as np
import pytest

from helpers.cameras.small_clip import body as arm_and_trunk
from tracker_node.model.humans.human import human_model
from tracker_node.model.shape_parameters import ShapeSpace, expected_lengths

GROUPS = ("size", "length", "breadth")
SPACE = ShapeSpace(human_model(), True, GROUPS)


def conditional(name: str, size: float) -> tuple[float, float]:
    """Mean and standard deviation of a length for somebody of a size."""
    mean, information = expected_lengths(SPACE)
    covariance = np.linalg.inv(information)
    k, s = SPACE.names.index(name), SPACE.names.index("size")
    slope = covariance[k, s] / covariance[s, s]
    return mean[k] + slope * size, float(np.sqrt(covariance[k, k] - slope * covariance[k, s]))


def test_the_information_is_that_of_a_proper_prior() -> None:
    mean, information = expected_lengths(SPACE)
    assert mean.shape == (len(SPACE),) and np.allclose(information, information.T)
    assert np.linalg.eigvalsh(information)[0] > 1.0
    sigmas = dict(zip(SPACE.names, np.sqrt(np.diag(np.linalg.inv(information))), strict=True))
    assert sigmas["size"] == pytest.approx(0.15)
    for name in ("length head", "length foot", "length hand"):  # of which no drawn body says anything
        assert sigmas[name] == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("name", "expected"), [("length upper_arm", -0.162), ("length thigh", 0.016), ("breadth pelvis y", 0.309), ("size", 0.0)]
)
def test_expected_lengths_of_an_adult(name: str, expected: float) -> None:
    mean, _ = expected_lengths(SPACE)
    assert np.exp(mean[SPACE.names.index(name)]) == pytest.approx(np.exp(expected), rel=0.01)


def test_children_have_short_thighs_and_long_shanks() -> None:
    """By slopes; and who has longer thighs than others of the size has shorter shanks."""
    for name, slope in (("length thigh", 0.230), ("length shank", -0.154)):
        adult, sigma = conditional(name, 0.0)
        child, _ = conditional(name, -0.3)
        assert child - adult == pytest.approx(-0.3 * slope, abs=0.005) and 0.02 < sigma < 0.06
    _, information = expected_lengths(SPACE)
    covariance = np.linalg.inv(information)
    thigh, shank = SPACE.names.index("length thigh"), SPACE.names.index("length shank")
    assert covariance[thigh, shank] < 0.0


def test_parts_of_a_trunk_go_together() -> None:
    """Their mean is known better than each."""
    _, information = expected_lengths(SPACE)
    covariance = np.linalg.inv(information)
    rows = [SPACE.names.index(f"length {part}") for part in ("pelvis", "abdomen", "torso")]
    apart = covariance[np.ix_(rows, rows)]
    assert apart.mean() < 0.5 * np.diag(apart).mean()


@pytest.mark.parametrize(
    "space",
    [
        ShapeSpace(arm_and_trunk(), True, GROUPS),
        ShapeSpace(human_model(), False, GROUPS),
        ShapeSpace(human_model(), True, ("girth",)),
    ],
)
def test_other_bodies_are_expected_to_be_as_given(space: ShapeSpace) -> None:
    mean, information = expected_lengths(space)
    assert not mean.any()
    assert np.allclose(information, np.diag(space.sigmas**-2.0))
