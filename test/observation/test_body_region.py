"""Masks of a body grown and shrunk, in pixels."""

import numpy as np
import pytest

from tracker_node.observation.appearance import cells_near, grown, shrunk


def dot(size=(80, 120), at=(40, 60)):
    mask = np.zeros(size, np.uint8)
    mask[at] = 1
    return mask


@pytest.mark.parametrize(("reach", "cells"), [(0, 1), (4, 1), (8, 2), (12, 3), (13, 3), (14, 4)])
def test_a_pixel_grows_by_whole_cells_of_four(reach, cells):
    """Rows 40 to 43 and columns 60 to 63 are the cell of the pixel."""
    rows, columns = np.nonzero(grown(dot(), reach))
    assert (rows.min(), rows.max()) == (40 - 4 * cells, 43 + 4 * cells)
    assert (columns.min(), columns.max()) == (60 - 4 * cells, 63 + 4 * cells)


def test_any_label_counts_and_the_result_is_a_mask():
    found = grown(dot() * np.uint8(200), 8)
    assert set(np.unique(found)) == {0, 1}
    np.testing.assert_array_equal(found, grown(dot(), 8))
    assert not grown(np.zeros((10, 12), np.uint8), 8).any()


@pytest.mark.parametrize(("every", "cell"), [(1, 4), (2, 4), (3, 6), (4, 4), (8, 8)])
def test_cells_are_about_four_pixels_however_coarse_the_mask_is(every, cell):
    mask = dot((80 // every, 121 // every), (40 // every, 64 // every)) * np.uint8(9)
    near, size = cells_near(mask, 2 * cell, every)
    assert size == cell
    assert near.shape == (-(-mask.shape[0] * every // cell), -(-mask.shape[1] * every // cell))
    rows, columns = np.nonzero(near)
    assert (rows.min(), rows.max()) == (40 // every * every // cell - 2, 40 // every * every // cell + 2)
    assert (columns.min(), columns.max()) == (64 // every * every // cell - 2, 64 // every * every // cell + 2)


def test_cells_are_those_of_the_grown_mask():
    near, cell = cells_near(dot(), 12)
    np.testing.assert_array_equal(np.kron(near, np.ones((cell, cell), np.uint8)), grown(dot(), 12))


@pytest.mark.parametrize("size", [(3, 80), (80, 2), (1, 1)])
def test_small_masks_keep_their_size(size):
    found = grown(np.ones(size, np.uint8), 4)
    assert found.shape == size
    assert found.all()


@pytest.mark.parametrize("depth", [1, 3])
def test_labels_lose_what_is_near_the_outside_but_not_between_parts(depth):
    labels = np.zeros((40, 50), np.uint8)
    labels[10:30, 10:25], labels[10:30, 25:40] = 3, 7
    found = shrunk(labels, depth)
    rows, columns = np.nonzero(found)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (10 + depth, 29 - depth, 10 + depth, 39 - depth)
    assert found[20, 24] == 3
    assert found[20, 25] == 7


def test_the_edge_of_the_image_is_outside():
    found = shrunk(np.full((20, 20), 5, np.uint8), 2)
    assert not found[:2].any()
    assert not found[:, -2:].any()
    assert (found[2:-2, 2:-2] == 5).all()
