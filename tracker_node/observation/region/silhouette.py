"""A network's silhouette as the prior of every pixel to show the body."""

from __future__ import annotations

import numpy as np

from ..keypoints.people import Silhouette

PackedSilhouette = tuple[np.ndarray, np.ndarray]
"""(h, w) uint8 of the image, and (256,) float32: probability of each of its values that a pixel does not show the body, over that
that it does. Of size zero where nothing is known."""
NO_SILHOUETTE: PackedSilhouette = np.zeros((0, 0), np.uint8), np.ones(256, np.float32)
UNKNOWN = 128  # value of pixels that nothing is known of


def odds_table(weight: float, most: float) -> np.ndarray:
    """What the values of a silhouette are worth.

    Parameters
    ----------
    weight : factor of the network's log odds.
    most : largest absolute log odds.

    Returns
    -------
    (256,) float32, see `PackedSilhouette`; 1 of `UNKNOWN`.
    """
    p = (np.arange(256) + 0.5) / 256.0
    log_odds = np.clip(weight * np.log(p / (1.0 - p)), -most, most)
    log_odds[UNKNOWN] = 0.0
    return np.exp(-log_odds).astype(np.float32)


def packed(silhouette: Silhouette | None, size: tuple[int, int], table: np.ndarray) -> PackedSilhouette:
    """A silhouette for the kernels.

    Parameters
    ----------
    silhouette : of the body; None: nothing is known.
    size : (height, width) of the image.
    table : of `odds_table`.

    Returns
    -------
    With `UNKNOWN` where the silhouette does not reach.
    """
    if silhouette is None:
        return NO_SILHOUETTE
    whole = np.full(size, UNKNOWN, np.uint8)
    (u, v), (height, width) = silhouette.origin, silhouette.probabilities.shape
    whole[v : v + height, u : u + width] = silhouette.probabilities
    return whole, table
