"""Reference silhouettes to hold a tracked body against; none comes from a tracker.

Two kinds: masks from the difference to a still image of the scene, for static cameras whose still shows the scene behind
the person, and polygons drawn by hand, where it does not. ``masks.json`` says which camera has which (docs/formats.md).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from ..errors import FileFormatError, SourceError


@dataclass(frozen=True)
class StillDifference:
    """Thresholds of `still_difference_mask`, for all cameras and images the same; grey levels of 0..255.

    A pixel differs when the largest difference of its channels exceeds ``low + low_share * brightness``; parts without a
    pixel above ``high`` do not count. A shadow is darker by no more than ``shadow_deepest`` levels and by no more than the
    factor ``shadow_darkest``, with its colour unchanged within ``shadow_color`` (a ratio). ``closed_px``: gaps up to this
    width are closed; ``opened_px``: threads up to this width are cut; ``joined_px``: parts this near to each other belong
    together; ``hole_px2``: holes up to this area are filled. Black before black hardly differs: in holes, and in bays
    narrower than ``bay_px``, what is darker than ``black`` belongs to the body from ``black_share`` of the threshold on.
    ``trimmed_px`` come off the outline at the end: blur, chroma subsampling and a low threshold have put them on.
    """

    blur_px: float = 1.2
    low: float = 10.0
    low_share: float = 0.06
    high: float = 50.0
    shadow_deepest: float = 45.0
    shadow_darkest: float = 0.4
    shadow_color: float = 0.14
    closed_px: int = 7
    opened_px: int = 5
    joined_px: int = 41
    hole_px2: int = 800
    bay_px: int = 61
    black: float = 60.0
    black_share: float = 0.4
    trimmed_px: int = 2


def still_difference_mask(
    image_bgr: np.ndarray, still_bgr: np.ndarray, thresholds: StillDifference | None = None
) -> np.ndarray:
    """Silhouette (h, w) uint8 0/255 of the one body that the still does not show.

    The still is first given the image's exposure and white balance (one gain a channel, the median ratio). What touches the
    border of the image is not the body: people on the still that have left since are there.

    Parameters
    ----------
    image_bgr, still_bgr : (h, w, 3) uint8 of one camera that has not moved.
    """
    if image_bgr.shape != still_bgr.shape:
        raise ValueError(f"expected images of one shape, got {image_bgr.shape} and {still_bgr.shape}")
    t = thresholds or StillDifference()
    image = cv2.GaussianBlur(image_bgr.astype(np.float32), (0, 0), t.blur_px)
    still = cv2.GaussianBlur(still_bgr.astype(np.float32), (0, 0), t.blur_px)
    still *= channel_gains(image_bgr, still_bgr)
    difference = _largest(cv2.absdiff(image, still))
    relative = difference / (t.low + t.low_share * _largest(still))
    shadow = _is_shadow(image, still, t)
    changed = (relative > 1.0) & ~shadow
    mask = cv2.morphologyEx(changed.astype(np.uint8), cv2.MORPH_OPEN, _disc(3))
    mask = _connected_to(mask > 0, difference > t.high)
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _disc(t.closed_px))
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, _disc(t.opened_px))
    mask = _largest_inner_part(mask, t.joined_px)
    black = (_largest(image) < t.black) & (relative > t.black_share) & ~shadow
    return cv2.erode(_with_black_parts(mask, black, t), _disc(2 * t.trimmed_px + 1))


def channel_gains(image_bgr: np.ndarray, still_bgr: np.ndarray) -> np.ndarray:
    """(3,) float32: what the still's channels are multiplied by to look like the image (median where unsaturated)."""
    image, still = image_bgr[::4, ::4], still_bgr[::4, ::4]  # enough for a median
    usable = ((still > 20) & (still < 235)).all(axis=2) & (image < 235).all(axis=2)
    if not usable.any():
        return np.ones(3, dtype=np.float32)
    return np.median(image[usable].astype(np.float32) / still[usable], axis=0).astype(np.float32)


def _is_shadow(image: np.ndarray, still: np.ndarray, t: StillDifference) -> np.ndarray:
    ratio = (image + 10.0) / (still + 10.0)  # what is nearly black has no color to speak of
    darkest, brightest = -_largest(-ratio), _largest(ratio)
    shallow = _largest(still - image) < t.shadow_deepest
    return shallow & (darkest > t.shadow_darkest) & (brightest < 1.0) & (brightest - darkest < t.shadow_color)


def _largest(channels: np.ndarray) -> np.ndarray:
    """(h, w) largest of three channels; faster than a reduction over the short axis."""
    b, g, r = cv2.split(channels)
    return cv2.max(cv2.max(b, g), r)


def _disc(diameter_px: int) -> np.ndarray:
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (diameter_px, diameter_px))


def _connected_to(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Parts of ``low`` that hold a pixel of ``high``, uint8 0/255."""
    n, labels = cv2.connectedComponents(low.astype(np.uint8))
    keep = np.zeros(n, dtype=np.uint8)
    keep[np.unique(labels[low & high])] = 255
    keep[0] = 0
    return keep[labels]


def _largest_inner_part(mask: np.ndarray, joined_px: int) -> np.ndarray:
    """The largest part that does not touch the border, 0/255; nothing where there is none.

    Pieces nearer to each other than ``joined_px`` are one part; the space between them stays out.
    """
    n, labels = cv2.connectedComponents(mask)
    border = np.zeros(n, dtype=bool)
    border[np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])] = True
    inner = np.where(border[labels], 0, mask).astype(np.uint8)
    n, labels = cv2.connectedComponents(cv2.dilate(inner, _disc(joined_px)))
    areas = np.bincount(labels[inner > 0], minlength=n)
    best = int(np.argmax(areas))
    return np.where((labels == best) & (inner > 0), 255, 0).astype(np.uint8)


def _with_black_parts(mask: np.ndarray, black: np.ndarray, t: StillDifference) -> np.ndarray:
    """Bays and holes of the mask filled where ``black`` says so; small holes in any case."""
    hull = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _disc(t.bay_px))
    hull[_enclosed(mask)] = 255
    parts = cv2.morphologyEx(np.where(black, hull, 0), cv2.MORPH_CLOSE, _disc(t.closed_px))
    parts = cv2.morphologyEx(parts, cv2.MORPH_OPEN, _disc(2 * t.opened_px + 1))
    mask = cv2.morphologyEx(cv2.bitwise_or(mask, cv2.bitwise_and(parts, hull)), cv2.MORPH_CLOSE, _disc(t.closed_px))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(255 - mask, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] <= t.hole_px2
    return np.where(small[labels] | (mask > 0), 255, 0).astype(np.uint8)


def _enclosed(mask: np.ndarray) -> np.ndarray:
    """(h, w) bool: what cannot be reached from the border without crossing the mask. The border must be free."""
    flooded = mask.copy()
    cv2.floodFill(flooded, None, (0, 0), 255)
    return flooded == 0


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
    try:
        content = json.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        raise FileFormatError(path, "(file)", "a readable JSON file", str(error)) from None
    cameras = content.get("cameras") if isinstance(content, dict) else None
    if not isinstance(cameras, dict) or not cameras:
        raise FileFormatError(path, "cameras", "a mapping of camera names", cameras)
    return {name: _camera_masks(path, name, entry) for name, entry in cameras.items()}


def _camera_masks(path: str | Path, name: str, entry: object) -> CameraMasks:
    where = f"cameras.{name}"
    if not isinstance(entry, dict):
        raise FileFormatError(path, where, "a mapping", entry)
    size = entry.get("image_size")
    if not (isinstance(size, list) and len(size) == 2 and all(isinstance(v, int) and v > 0 for v in size)):
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
        if not number.isdigit():
            raise FileFormatError(path, f"{where}.polygons", "image numbers", number)
        polygons[int(number)] = _outlines(path, f"{where}.polygons.{number}", outlines)
    return CameraMasks(name, size[0], size[1], polygons=polygons)


def _outlines(path: str | Path, where: str, outlines: object) -> list[np.ndarray]:
    """Outlines are flat lists u0 v0 u1 v1 ..., so that a file stays short enough to read."""
    result = []
    for outline in outlines if isinstance(outlines, list) else [outlines]:
        try:
            points = np.array(outline, dtype=np.float64).reshape(-1, 2)
        except (TypeError, ValueError):
            points = np.zeros((0, 2))
        if len(points) < 3 or not np.isfinite(points).all():
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
