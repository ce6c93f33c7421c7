"""Textures for the faces of a body, drawn as OpenCV draws them, and flat bodies with a texture on them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ..model.articulated import ArticulatedModel, Shape
from ..model.kinematic_chain import KinematicChain
from ..model.shapes.primitives import Box

BLACK, GRAY, WHITE = 20, 120, 200  # gray levels of printed paper as a camera shows it


def charuco_texture(
    columns: int, rows: int, square_m: float, marker_ratio: float, dictionary: str, inverted: bool, texels_per_m: float = 1000.0
) -> np.ndarray:
    """Texture of a ChArUco board as OpenCV draws it.

    Parameters
    ----------
    columns, rows : squares.
    square_m : edge of a square.
    marker_ratio : marker to square.
    dictionary : name in `cv2.aruco`, such as ``DICT_4X4_1000``.
    inverted : white and black are exchanged.
    texels_per_m : resolution.

    Returns
    -------
    (h, w, 3) uint8 RGB.
    """
    markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    board = cv2.aruco.CharucoBoard((columns, rows), square_m, square_m * marker_ratio, markers)
    size = round(columns * square_m * texels_per_m), round(rows * square_m * texels_per_m)
    drawn = board.generateImage(size) > 127
    return _rgb(np.where(drawn != inverted, WHITE, BLACK))


def framed(texture: np.ndarray, borders: Sequence[tuple[int, int, int, int, int]]) -> np.ndarray:
    """The texture with borders around it.

    Parameters
    ----------
    texture : (h, w, 3) uint8 RGB.
    borders : from the innermost outward (left, right, top, bottom, gray level), widths in texels.

    Returns
    -------
    (h', w', 3) uint8 RGB.
    """
    for left, right, top, bottom, gray in borders:
        texture = cv2.copyMakeBorder(texture, top, bottom, left, right, cv2.BORDER_CONSTANT, value=(gray, gray, gray))
    return texture


def plate_model(
    name: str, texture: np.ndarray, texels_per_m: float, origin: tuple[float, float], thickness_m: float, rim: int = BLACK
) -> ArticulatedModel:
    """A flat box with a texture on its face ``+z``; back and edges have one gray level.

    Parameters
    ----------
    name : of the body and its link.
    texture : (h, w, 3) uint8 RGB texture.
    texels_per_m : its resolution.
    origin : (column, row) of the texture where the root of the body is; its x runs along the columns, its y up the rows.
    thickness_m : of the box.
    rim : gray level of back and edges.

    Returns
    -------
    A body of one link.
    """
    height, width = texture.shape[:2]
    T = np.eye(4)
    T[0, 3] = (width / 2.0 - origin[0]) / texels_per_m
    T[1, 3] = (origin[1] - height / 2.0) / texels_per_m
    T[2, 3] = -thickness_m / 2.0
    box = Box((width / texels_per_m, height / texels_per_m, thickness_m), None, (None, None, None, None, texture, None))
    return ArticulatedModel(name, KinematicChain((name,), ()), (Shape("face", name, box, T, (rim, rim, rim)),))


def _rgb(gray: np.ndarray) -> np.ndarray:
    return np.repeat(gray.astype(np.uint8)[:, :, None], 3, axis=2)
