"""Gains of images in closed form: each camera's exposure, and a little of its white balance, are unknowns of every comparison.

The image I is brought into the light of the model M: the sum of (M - h I)^2 is least at h = sum(M I) / sum(I I). The other way
round, a dark model would explain a black wall; here a body that leaves its image costs all of its colors, as without gains.
"""

from __future__ import annotations

import numpy as np

LEAST, MOST = 1.0 / 3.0, 3.0
TINT = 1.2  # of a channel, against the gain of all


def gains_of(products: np.ndarray, image_squares: np.ndarray) -> np.ndarray:
    """Factors of the channels of images.

    Parameters
    ----------
    products, image_squares : (..., 3) sums of M I and of I I over the pixels of the body.

    Returns
    -------
    (..., 3); 1 where the image is black.
    """
    squares = image_squares.sum(axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        common = np.clip(np.where(squares > 0.0, products.sum(axis=-1, keepdims=True) / squares, 1.0), LEAST, MOST)
        own = np.where(image_squares > 0.0, products / image_squares, common)
    return np.clip(own, np.maximum(common / TINT, LEAST), np.minimum(common * TINT, MOST))


def squares_left(model_squares: np.ndarray, products: np.ndarray, image_squares: np.ndarray) -> np.ndarray:
    """Squared differences that the best gains leave.

    Parameters
    ----------
    model_squares : (...) sums of M M over pixels and channels.
    products, image_squares : see `gains_of`.

    Returns
    -------
    (...) sums of (M - h I)^2.
    """
    gains = gains_of(products, image_squares)
    return np.maximum(model_squares + np.sum(gains * (gains * image_squares - 2.0 * products), axis=-1), 0.0)
