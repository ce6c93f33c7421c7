"""People that a detector has found in an image: points with covariances, and the pixels that they cover."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Silhouette:
    """Which pixels of a part of an image show a person.

    Attributes
    ----------
    probabilities : (height, width) uint8, 0 to 255 for a probability of 0 to 1.
    origin : (u, v) of the first pixel in the image.
    """

    probabilities: np.ndarray
    origin: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Person:
    """One person in one image.

    Attributes
    ----------
    names : of the detector's points, the same for everybody.
    pixels : (n, 2) u and v of the points.
    covariances : (n, 2, 2) of their errors, pixels^2, as the detector states them.
    scores : (n,) probability that a point is where ``pixels`` says; 0 for one that was not found.
    score : probability that there is a person at all.
    box : (4,) least u, least v, largest u, largest v of what shows the person.
    silhouette : the pixels of the person; None where the detector tells none.
    """

    names: tuple[str, ...]
    pixels: np.ndarray
    covariances: np.ndarray
    scores: np.ndarray
    score: float
    box: tuple[float, float, float, float]
    silhouette: Silhouette | None = None

    def __post_init__(self):
        n = len(self.names)
        shapes = (self.pixels.shape, self.covariances.shape, self.scores.shape)
        if shapes != ((n, 2), (n, 2, 2), (n,)):
            raise ValueError(f"expected pixels, covariances, scores of shapes (n, 2), (n, 2, 2), (n,), got {shapes}")


People = tuple[Person, ...]
"""The people in one image, in no particular order."""
