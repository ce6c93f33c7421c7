"""A turned square of an image, as a network takes it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np


@dataclass(frozen=True)
class Crop:
    """A square of an image around a person.

    Attributes
    ----------
    center : (u, v) pixels.
    size : length of its sides, pixels.
    angle : by which the person is turned clockwise in the image, radians; 0: the head is up.
    """

    center: tuple[float, float]
    size: float
    angle: float = 0.0

    def to_image(self, side: int) -> np.ndarray:
        """Matrix from pixels of the crop to those of the image.

        Parameters
        ----------
        side : pixels of the crop along each side.

        Returns
        -------
        (2, 3); integer coordinates are centers of pixels on both sides.
        """
        scale, c, s = self.size / side, math.cos(self.angle), math.sin(self.angle)
        A = scale * np.array([[c, -s], [s, c]])
        middle = 0.5 * (side - 1)
        return np.column_stack([A, np.asarray(self.center) - A @ [middle, middle]])

    def cut(self, image: np.ndarray, side: int) -> np.ndarray:
        """The pixels of the crop; black beyond the image.

        Parameters
        ----------
        image : (height, width, 3) uint8.
        side : pixels of the result along each side.

        Returns
        -------
        (side, side, 3) uint8.
        """
        reduction = self.size / side
        if reduction > 2.0:  # else every second pixel would have no say
            factor = 2.0 ** math.floor(math.log2(reduction))
            image = cv2.resize(image, None, fx=1.0 / factor, fy=1.0 / factor, interpolation=cv2.INTER_AREA)
            u, v = ((x + 0.5) / factor - 0.5 for x in self.center)
            return Crop((u, v), self.size / factor, self.angle).cut(image, side)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return cv2.warpAffine(image, self.to_image(side), (side, side), flags=flags, borderMode=cv2.BORDER_CONSTANT)


def mapped(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points through an affine map.

    Parameters
    ----------
    matrix : (2, 3).
    points : (n, 2).

    Returns
    -------
    (n, 2).
    """
    return points @ matrix[:, :2].T + matrix[:, 2]
