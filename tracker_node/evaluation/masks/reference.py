"""Reference silhouettes to hold a tracked body against; none comes from a tracker.

Two kinds: masks from the difference to a still image of the scene, for static cameras whose still shows the scene behind
the person, and polygons drawn by hand, where it does not. ``masks.json`` says which camera has which (docs/results.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from ...errors import FileFormatError, SourceError
from ...loaders.json_values import read_json
from .still_difference import still_difference_mask

_FARTHEST_PX, _LARGEST_PX = 1e6, 65_536  # of a corner, of an image


def polygon_mask(polygons: list[np.ndarray], width: int, height: int) -> np.ndarray:
    """Mask (h, w) uint8 0/255 of closed outlines, each (n, 2) pixels (u, v); where two overlap is outside (holes)."""
    mask = np.zeros((height, width), dtype=np.uint8)
    cv2.fillPoly(mask, [np.round(polygon).astype(np.int32).reshape(-1, 1, 2) for polygon in polygons], 255)
    return mask


@dataclass(frozen=True, eq=False)
class CameraMasks:
    """Reference masks of one camera: by hand for some images, or from a still for all.

    ``width`` and ``height`` are those of the images that the masks were made for. ``polygons``: image number -> outlines.
    ``still``: path of the still image, empty where the rig's plate is meant; None for polygons.
    """

    camera: str
    width: int
    height: int
    polygons: Mapping[int, list[np.ndarray]] = field(default_factory=dict)
    still: str | None = None

    def image_numbers(self, n_images: int) -> list[int]:
        """Numbers of the images below ``n_images`` that have a mask."""
        if self.still is not None:
            return list(range(n_images))
        return sorted(number for number in self.polygons if number < n_images)

    def mask(self, number: int, image_bgr: np.ndarray | None = None, still_bgr: np.ndarray | None = None) -> np.ndarray:
        """Mask of image ``number``; masks from a still need the image and the still."""
        if self.still is None:
            return polygon_mask(self.polygons[number], self.width, self.height)
        if image_bgr is None or still_bgr is None:
            raise ValueError("expected the image and the still for a mask by difference")
        return still_difference_mask(image_bgr, still_bgr)


def load_reference_masks(path: str | Path) -> dict[str, CameraMasks]:
    """Camera -> masks of a ``masks.json``.

    Raises
    ------
    FileFormatError : naming the field.
    """
    content = read_json(path)
    cameras = content.get("cameras") if isinstance(content, dict) else None
    if not isinstance(cameras, dict) or not cameras:
        raise FileFormatError(path, "cameras", "a mapping of camera names", cameras)
    return {name: _camera_masks(path, name, entry) for name, entry in cameras.items()}


def _camera_masks(path: str | Path, name: str, entry: object) -> CameraMasks:
    where = f"cameras.{name}"
    if not isinstance(entry, dict):
        raise FileFormatError(path, where, "a mapping", entry)
    size = entry.get("image_size")
    if not (isinstance(size, list) and len(size) == 2 and all(isinstance(v, int) and 0 < v <= _LARGEST_PX for v in size)):
        raise FileFormatError(path, f"{where}.image_size", "[width, height] in pixels", size)
    if ("still" in entry) == ("polygons" in entry):
        raise FileFormatError(path, where, "either 'still' or 'polygons'", sorted(entry))
    if "still" in entry:
        if not isinstance(entry["still"], str):
            raise FileFormatError(path, f"{where}.still", "a path, or '' for the rig's plate", entry["still"])
        still = str(Path(path).parent / entry["still"]) if entry["still"] else ""
        return CameraMasks(name, size[0], size[1], still=still)
    if not isinstance(entry["polygons"], dict):
        raise FileFormatError(path, f"{where}.polygons", "image number -> outlines", entry["polygons"])
    polygons = {}
    for number, outlines in entry["polygons"].items():
        if not (number.isdecimal() and len(number) < 10):
            raise FileFormatError(path, f"{where}.polygons", "image numbers", number)
        polygons[int(number)] = _outlines(path, f"{where}.polygons.{number}", outlines)
    return CameraMasks(name, size[0], size[1], polygons=polygons)


def _outlines(path: str | Path, where: str, outlines: object) -> list[np.ndarray]:
    """Outlines are flat lists u0 v0 u1 v1 ..., so that a file stays short enough to read."""
    result = []
    for outline in outlines if isinstance(outlines, list) else [outlines]:
        try:
            points = np.array(outline, dtype=np.float64).reshape(-1, 2)
        except (TypeError, ValueError, OverflowError):
            points = np.zeros((0, 2))
        if len(points) < 3 or not (np.abs(points) <= _FARTHEST_PX).all():
            raise FileFormatError(path, where, "outlines [u, v, u, v, ...] of at least three points", outline)
        result.append(points)
    return result


def read_still(path: str, width: int, height: int) -> np.ndarray:
    """The still (height, width, 3) BGR. Raises SourceError when it is missing or of another size."""
    still = cv2.imread(path, cv2.IMREAD_COLOR)
    if still is None:
        raise SourceError(path, "cannot be read as an image")
    if still.shape[:2] != (height, width):
        raise SourceError(path, f"expected a still of {width}x{height}, got {still.shape[1]}x{still.shape[0]}")
    return still
