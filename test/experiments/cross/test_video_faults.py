"""The recording chain: what it blurs, what it keeps, and how much noise it adds."""

import cv2
import numpy as np
import pytest

from tracker_node.experiments.cross.scene import TapeFaults, along_lines, record

QUIET = TapeFaults(luma_noise=0.0, chroma_noise=0.0)


def edge() -> np.ndarray:
    """Gray to a yellow of the same luma: an edge in chroma only; BGR."""
    image = np.full((40, 120, 3), 150, np.uint8)
    image[:, 60:] = 30, 160, 168
    return image


def to_ycrcb(image):
    return cv2.cvtColor(image.astype(np.float32) / 255.0, cv2.COLOR_BGR2YCrCb) * 255.0


def width_of_edge(profile: np.ndarray) -> float:
    share = (profile - profile[0]) / (profile[-1] - profile[0])
    return float(np.interp(0.9, share, np.arange(len(share))) - np.interp(0.1, share, np.arange(len(share))))


def test_chroma_is_smeared_along_the_lines_as_wide_as_stated():
    chroma = to_ycrcb(record(edge(), QUIET, np.random.default_rng(0)))[20, :, 2]
    # From 10 to 90 % a Gaussian takes 2.563 sigma
    assert width_of_edge(chroma) == pytest.approx(2.563 * QUIET.chroma_blur_px, rel=0.1)
    assert np.abs(to_ycrcb(record(edge(), QUIET, np.random.default_rng(0)))[20, :, 0] - 150.0).max() < 3.0


def test_luma_is_smeared_less():
    step = np.zeros((10, 60, 3), np.uint8)
    step[:, 30:] = 200
    luma = to_ycrcb(record(step, QUIET, np.random.default_rng(0)))[5, :, 0]
    assert width_of_edge(luma) == pytest.approx(2.563 * QUIET.luma_blur_px, rel=0.35)


def test_lines_are_not_mixed_so_fields_keep_their_instant():
    image = np.zeros((8, 50, 3), np.uint8)
    image[::2] = 40, 120, 220
    got = record(image, QUIET, np.random.default_rng(0)).astype(int)
    assert np.abs(got[::2] - [40, 120, 220]).max() <= 1 and got[1::2].max() <= 1


def test_noise_has_the_stated_strength_and_chroma_noise_is_coarse():
    faults = TapeFaults(luma_noise=3.0, chroma_noise=4.0)
    got = to_ycrcb(record(np.full((120, 160, 3), 128, np.uint8), faults, np.random.default_rng(1))) - [128.0, 127.5, 127.5]
    assert got[:, :, 0].std() == pytest.approx(3.0, rel=0.1)
    assert got[:, :, 1].std() == pytest.approx(4.0, rel=0.1)
    chroma = got[:, :, 1]
    assert np.corrcoef(chroma[:, :-1].ravel(), chroma[:, 1:].ravel())[0, 1] > 0.8
    assert abs(np.corrcoef(chroma[:-1].ravel(), chroma[1:].ravel())[0, 1]) < 0.1


def test_the_same_seed_records_the_same_tape():
    first, again = (record(edge(), TapeFaults(), np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert (first != record(edge(), TapeFaults(), np.random.default_rng(4))).any()


def test_no_blur_leaves_the_values():
    values = np.random.default_rng(0).normal(size=(5, 9)).astype(np.float32)
    np.testing.assert_array_equal(along_lines(values, 0.0), values)
