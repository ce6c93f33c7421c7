"""Densities of color against the same written out in numpy."""

import numpy as np
import pytest

from tracker_node.observation.appearance import BINS
from tracker_node.observation.region.colors import N_COLORS, UNIFORM, fill_classes, fill_density, mix_classes, mix_counts, shade


def histogram(seed, n=300):
    """(`N_COLORS`,) float32 counts of ``n`` pixels in a few colors."""
    rng = np.random.default_rng(seed)
    return np.bincount(rng.integers(0, N_COLORS, 12)[rng.integers(0, 12, n)], minlength=N_COLORS).astype(np.float32)


def shared(counts):
    """With neighboring colors: weights 1/4, 1/2, 1/4 along each channel, what falls beyond the last bin being lost."""
    cube = counts.reshape((BINS,) * 3).astype(np.float64)
    for axis in range(3):
        before, after = (np.roll(cube, step, axis) for step in (1, -1))
        before[(slice(None),) * axis + (0,)] = 0.0
        after[(slice(None),) * axis + (-1,)] = 0.0
        cube = 0.5 * cube + 0.25 * before + 0.25 * after
    return cube.ravel()


def test_counts_replace_nothing_known_and_are_mixed_into_what_is():
    shares, first, second = np.zeros(N_COLORS, np.float32), histogram(0), histogram(1)
    assert mix_counts(shares, first, np.float32(0.25)) == 300
    np.testing.assert_allclose(shares, first / 300.0, rtol=1e-6)
    mix_counts(shares, second, np.float32(0.25))
    np.testing.assert_allclose(shares, 0.75 * first / 300.0 + 0.25 * second / 300.0, rtol=1e-5)
    before = shares.copy()
    assert mix_counts(shares, histogram(2, n=19), np.float32(0.25)) == 0
    np.testing.assert_array_equal(shares, before)


def test_support_is_the_share_of_pixels_in_stated_colors_of_classes_that_state_any_and_are_seen():
    counts = np.array([histogram(0), histogram(1), histogram(2, n=10)])
    kinds = np.zeros(counts.shape, dtype=np.bool_)
    kinds[0, np.flatnonzero(counts[0])[:4]] = True
    kinds[2, :] = True
    support = np.full(3, np.nan)
    mix_classes(np.zeros_like(counts), counts, np.float32(0.5), kinds, support)
    assert support[0] == pytest.approx(counts[0, kinds[0]].sum() / 300.0)
    assert 0.0 < support[0] < 1.0
    assert np.isnan(support[1:]).all()


@pytest.mark.parametrize(("of_shades", "of_stated"), [(0.0, 0.0), (0.5, 0.3), (1.0, 0.3), (0.0, 1.0)])
def test_a_density_is_shared_with_its_neighbors_and_sums_the_parts(of_shades, of_stated):
    learnt, shades, stated = (histogram(seed) / np.float32(300.0) for seed in (3, 4, 5))
    density = np.empty(N_COLORS, np.float32)
    fill_density(learnt, shades, of_shades, stated, of_stated, density)
    seen = of_shades * shared(shades) + (1.0 - of_shades) * shared(learnt)
    wanted = 0.98 * ((1.0 - of_stated) * seen + of_stated * stated) + 0.02 * UNIFORM
    np.testing.assert_allclose(density, wanted, rtol=1e-5)


def test_which_sources_a_class_has():
    learnt, shades, stated = (histogram(seed) / np.float32(300.0) for seed in (3, 4, 5))
    nothing = np.zeros(N_COLORS, np.float32)
    parts = np.array([nothing, learnt, learnt, learnt, learnt, nothing])
    n, body = len(parts), np.empty_like(parts)
    trusted, doubted = np.arange(n) >= 2, np.arange(n) == 3
    trusted[4:] = False
    borne_out = np.arange(n) >= 4
    fill_classes(parts, np.tile(shades, (n, 1)), np.tile(stated, (n, 1)), trusted, doubted, borne_out, 0.3, body)
    assert (body[0] == np.float32(UNIFORM)).all()
    for i, shares in enumerate([(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 0.3), (0.0, 1.0)], start=1):
        wanted = np.empty(N_COLORS, np.float32)
        fill_density(parts[i], shades, shares[0], stated, shares[1], wanted)
        np.testing.assert_array_equal(body[i], wanted)
    assert len(np.unique(body, axis=0)) == n


def test_shadows_darken_a_part_of_the_surroundings_and_leave_their_hue():
    lit, out = np.zeros(N_COLORS, np.float32), np.full(N_COLORS, 7.0, np.float32)
    lit[(12 * BINS + 8) * BINS + 4] = 1.0
    shade(lit, out)
    b, g, r = np.unravel_index(np.flatnonzero(out), (BINS,) * 3)
    assert out.sum() == pytest.approx(1.0)
    assert 0.6 < out.max() < 0.9
    assert (b.min(), b.max()) == (5, 12)
    np.testing.assert_allclose(g + 0.5, 8.5 / 12.5 * (b + 0.5), atol=1.0)
    np.testing.assert_allclose(r + 0.5, 4.5 / 12.5 * (b + 0.5), atol=1.0)
