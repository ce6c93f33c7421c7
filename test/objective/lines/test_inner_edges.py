"""The step of brightness across a crease, in images whose step is known."""

import cv2
import numpy as np
import pytest

from tracker_node.objective.lines.refinement import N_SUM_COLUMNS, step_distribution


def step_image(place, angle, low=(60.0, 50.0, 90.0), high=(90.0, 70.0, 130.0), noise=4.0, seed=0):
    """(80, 80, 3): two colors with an edge through (40, 40) + ``place`` along its normal; a pixel mixes what it covers."""
    fine = 8
    v, u = (np.mgrid[: 80 * fine, : 80 * fine] + 0.5) / fine - 0.5
    beyond = (u - 40.0) * np.cos(angle) + (v - 40.0) * np.sin(angle) > place
    image = cv2.resize(np.where(beyond[..., None], high, low), (80, 80), interpolation=cv2.INTER_AREA)
    image += np.random.default_rng(seed).normal(0.0, noise, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def measured(image, angle, scale=1.0, inside=12, outside=12, offset=0.0):
    n = np.cos(angle), np.sin(angle)
    sums = np.empty((100, N_SUM_COLUMNS))
    return step_distribution(image, 40.0 + offset * n[0], 40.0 + offset * n[1], *n, scale, inside, outside, sums)


@pytest.mark.parametrize("place", [-5.3, 0.0, 3.8])
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_finds_the_step(place, scale):
    errors, spreads = [], []
    for i, angle in enumerate(np.linspace(0.1, 6.0, 12)):
        mean, precision, gain = measured(step_image(place, angle, seed=i), angle, scale)
        errors.append(scale * mean - place)
        spreads.append(scale / np.sqrt(precision))
        assert gain > 20.0
    assert np.abs(errors).max() < 1.1 * scale
    assert np.sqrt(np.mean(np.square(errors))) < 2.0 * np.mean(spreads)


def test_the_step_may_be_far_from_the_middle_of_a_lopsided_line():
    mean, precision, _ = measured(step_image(-9.0, 0.4), 0.4, inside=16, outside=4)
    assert mean == pytest.approx(-9.0, abs=0.7)
    assert precision > 1.0


def test_no_step_no_evidence():
    for seed in range(10):
        flat = step_image(0.0, 0.3, high=(60.0, 50.0, 90.0), seed=seed)
        assert measured(flat, 0.3) == (0.0, 0.0, 0.0)


def test_nothing_is_said_beyond_the_image_or_without_room():
    image = step_image(0.0, 0.0)
    assert measured(image, 0.0, offset=35.0) == (0.0, 0.0, 0.0)
    assert measured(image, 0.0, inside=3, outside=3) == (0.0, 0.0, 0.0)


def test_a_fainter_step_is_less_sure():
    precisions = [
        np.mean([measured(step_image(0.0, 0.5, high=(60.0 + c, 50.0 + c, 90.0 + c), seed=s), 0.5)[1] for s in range(8)])
        for c in (6.0, 40.0)
    ]
    assert 0.0 < precisions[0] < 0.7 * precisions[1]
