"""A turned square of an image: where its pixels are, and what they show."""

import numpy as np
import pytest

from tracker_node.observation.keypoints.crop import Crop, mapped


def picture(width: int = 60, height: int = 40) -> np.ndarray:
    v, u = np.mgrid[:height, :width]
    return np.stack([4 * u, 6 * v, np.full_like(u, 100)], axis=2).astype(np.uint8)


def test_an_upright_square_of_the_same_size_is_a_part_of_the_image():
    image = picture()
    cut = Crop((20.5, 15.5), 16.0).cut(image, 16)
    np.testing.assert_array_equal(cut, image[8:24, 13:29])


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2, -2.0])
def test_the_middle_stays_and_the_head_is_up_in_the_square(angle):
    """The person is turned clockwise by the angle: up in the square is (sin, -cos) in the image."""
    crop = Crop((30.0, 20.0), 64.0, angle)
    to_image = crop.to_image(32)
    middle, above, right = mapped(to_image, np.array([[15.5, 15.5], [15.5, 5.5], [20.5, 15.5]]))
    np.testing.assert_allclose(middle, [30.0, 20.0])
    np.testing.assert_allclose(above - middle, 20.0 * np.array([np.sin(angle), -np.cos(angle)]), atol=1e-12)
    np.testing.assert_allclose(right - middle, 10.0 * np.array([np.cos(angle), np.sin(angle)]), atol=1e-12)


def test_integer_coordinates_are_centers_of_pixels_on_both_sides():
    """A square of twice the size: a pixel of it covers two by two of the image."""
    to_image = Crop((7.5, 7.5), 16.0).to_image(8)
    np.testing.assert_allclose(mapped(to_image, np.array([[0.0, 0.0], [7.0, 7.0]])), [[0.5, 0.5], [14.5, 14.5]])


def test_points_are_mapped_by_rows():
    matrix = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    np.testing.assert_array_equal(mapped(matrix, np.array([[1.0, 0.0], [0.0, 1.0]])), [[4.0, 10.0], [5.0, 11.0]])


def test_a_quarter_turn_shows_the_image_turned():
    image = picture(16, 16)
    turned = Crop((7.5, 7.5), 16.0, np.pi / 2).cut(image, 16)
    np.testing.assert_allclose(turned.astype(int), np.rot90(image).astype(int), atol=1)


def test_beyond_the_image_it_is_black():
    cut = Crop((0.0, 0.0), 20.0).cut(np.full((40, 60, 3), 200, np.uint8), 20)
    assert (cut[11:, 11:] == 200).all() and not cut[:9].any() and not cut[:, :9].any()


@pytest.mark.parametrize("size", [200.0, 330.0, 800.0])
def test_every_pixel_of_the_image_has_a_say_where_the_square_is_large(size):
    """A chess board of single pixels is gray, wherever it is seen from afar; and what is bright stays where it is."""
    image = np.zeros((400, 400, 3), np.uint8)
    image[::2, ::2] = image[1::2, 1::2] = 200
    cut = Crop((199.5, 199.5), size).cut(image, 50)
    assert np.abs(cut[20:30, 20:30].astype(int) - 100).max() < 30
    v, u = np.mgrid[:400, :400]
    spot = np.rint(250.0 * np.exp(-0.5 * ((u - 223.0) ** 2 + (v - 187.0) ** 2) / 15.0**2))
    crop = Crop((201.3, 204.8), size, 0.4)
    shown = crop.cut(np.repeat(spot[:, :, None], 3, axis=2).astype(np.uint8), 50)[:, :, 0].astype(float)
    v, u = np.mgrid[:50, :50]
    found = mapped(crop.to_image(50), np.array([[(u * shown).sum(), (v * shown).sum()]]) / shown.sum())
    np.testing.assert_allclose(found, [[223.0, 187.0]], atol=0.15)
