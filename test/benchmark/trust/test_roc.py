"""ROC against counting pairs."""

import cv2
import numpy as np
import pytest

from benchmark.trust._roc import roc, roc_picture


def pairs(scores, positives):
    """Share of (positive, negative) pairs in which the positive scores higher, a tie counting half."""
    difference = scores[positives][:, None] - scores[~positives][None]
    return ((difference > 0) + 0.5 * (difference == 0)).mean()


@pytest.mark.parametrize("levels", [3, 10_000])  # with many ties, and with hardly any
def test_area_is_the_share_of_ordered_pairs(levels):
    rng = np.random.default_rng(levels)
    positives = rng.random(400) < 0.2
    scores = np.round(rng.normal(size=400) + 1.5 * positives, 0 if levels == 3 else 6)
    assert roc(scores, positives).area == pytest.approx(pairs(scores, positives), abs=1e-12)


def test_rates_at_a_threshold():
    scores, positives = np.array([0.9, 0.8, 0.8, 0.3, 0.1]), np.array([True, True, False, False, True])
    curve = roc(scores, positives)
    assert curve.at(0.8) == (0.5, 2 / 3)
    assert curve.at(0.85) == (0.0, 1 / 3)
    assert curve.at(2.0) == (0.0, 0.0) and curve.at(0.0) == (1.0, 1.0)


def test_one_kind_only_has_no_area():
    assert np.isnan(roc(np.arange(3.0), np.ones(3, dtype=bool)).area)


def test_picture_shows_the_curves():
    scores = np.linspace(0.0, 1.0, 50)
    curves = {"all": roc(scores, scores > 0.5), "noise": roc(scores, np.arange(50) % 2 == 0)}
    picture = cv2.imdecode(np.frombuffer(roc_picture(curves, 0.5), np.uint8), cv2.IMREAD_COLOR)
    for rgb in ((0x00, 0x72, 0xB2), (0xE6, 0x9F, 0x00)):
        assert (np.abs(picture[..., ::-1].astype(int) - rgb).max(axis=-1) < 20).sum() > 200
