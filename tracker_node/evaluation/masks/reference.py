"""Reference silhouettes to compare a tracked body with; none comes from a tracker.

Two kinds: masks from the difference to a still image of the scene, for static cameras whose still shows the scene behind
the person, and polygons drawn by hand, where it does not. ``masks.json`` says which camera has which (docs/results.md).
Differences are made for judging, not for tracking: thresholds are fixed for all images, nothing is learned from one image for
another.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np

from ...errors import FileFormatError, SourceError
from ...loaders.json_values import read_json

_SAMPLED = 4  # every so many rows and columns tell a video's image from another's: all would take as long as half a mask
COARSE = 4  # the body is searched at this fraction of the size


@dataclass(frozen=True)
class StillDifference:
    """Thresholds of `still_difference_mask`, for all cameras and images the same; gray levels of 0..255.

    A pixel differs when the largest difference of its channels exceeds ``low + low_share * brightness``; parts without a
    pixel above ``high`` do not count. A shadow is darker by no more than ``shadow_deepest`` levels and by no more than the
    factor ``shadow_darkest``, with its color unchanged within ``shadow_color`` (a ratio). ``closed_px``: gaps up to this
    width are closed; ``opened_px``: threads up to this width are cut; ``joined_px``: parts this near to each other belong
    together; ``border_px``: what lies along the border for more than this is not the body (a hand may reach it);
    ``hole_px2``: holes up to this area are filled. Black before black hardly differs: in holes, and in bays
    narrower than ``bay_px``, what is darker than ``black`` belongs to the body from ``black_share`` of the threshold on,
    in holes from half of it, even if it could be a shadow.
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
    border_px: int = 120
    hole_px2: int = 800
    bay_px: int = 61
    black: float = 60.0
    black_share: float = 0.6
    trimmed_px: int = 2


def still_difference_mask(image_bgr: np.ndarray, still_bgr: np.ndarray, thresholds: StillDifference | None = None) -> np.ndarray:
    """Silhouette of the one body that the still does not show.

    The still is first given the image's exposure and white balance (one gain a channel, the median ratio). What lies along
    the border of the image is not the body: people on the still that have left since are there.

    Parameters
    ----------
    image_bgr, still_bgr : (h, w, 3) uint8 of one camera that has not moved.
    thresholds : the defaults if None.

    Returns
    -------
    (h, w) uint8, 0 or 255.
    """
    if image_bgr.shape != still_bgr.shape:
        raise ValueError(f"expected images of one shape, got {image_bgr.shape} and {still_bgr.shape}")
    t = thresholds or StillDifference()
    gains = channel_gains(image_bgr, still_bgr)
    coarse = _coarse_mask(image_bgr, still_bgr, gains, t)
    result = np.zeros(image_bgr.shape[:2], dtype=np.uint8)
    if not coarse.any():
        return result
    box = _box(coarse, t.bay_px)
    fine = _Difference(image_bgr[box], still_bgr[box], gains, t)
    mask = _parts_with(fine.changed(t), cv2.dilate(coarse[box], _disc(t.joined_px)) > 0)
    whole = _with_black_parts(mask, fine, t)
    result[box] = cv2.erode(whole, _disc(2 * t.trimmed_px + 1))
    return result


class _Difference:
    """What differs between an image and the still under the image's light, all (h, w).

    ``absolute`` gray levels, ``relative`` to the threshold of the pixel, ``shadow`` bool, ``brightness`` of the image.
    """

    def __init__(self, image_bgr: np.ndarray, still_bgr: np.ndarray, gains: np.ndarray, t: StillDifference):
        image = cv2.GaussianBlur(image_bgr.astype(np.float32), (0, 0), t.blur_px)
        still = cv2.GaussianBlur(still_bgr.astype(np.float32), (0, 0), t.blur_px) * gains
        self.absolute = _largest(cv2.absdiff(image, still))
        self.relative = self.absolute / (t.low + t.low_share * _largest(still))
        self.shadow = _is_shadow(image, still, t)
        self.brightness = _largest(image)

    def changed(self, t: StillDifference) -> np.ndarray:
        """Pixels that differ and are no shadow, without what is thin or faint: uint8 0/255."""
        changed = ((self.relative > 1.0) & ~self.shadow).astype(np.uint8)
        changed = cv2.morphologyEx(changed, cv2.MORPH_OPEN, _disc(3))
        mask = _parts_with(changed, self.absolute > t.high)
        mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _disc(t.closed_px))
        return cv2.morphologyEx(mask, cv2.MORPH_OPEN, _disc(t.opened_px))


def _coarse_mask(image_bgr: np.ndarray, still_bgr: np.ndarray, gains: np.ndarray, t: StillDifference) -> np.ndarray:
    """Where the body is, roughly: the same at a quarter of the size, where one body is separated from other things."""
    size = (image_bgr.shape[1], image_bgr.shape[0])
    small = (-(-size[0] // COARSE), -(-size[1] // COARSE))
    image, still = (cv2.resize(full, small, interpolation=cv2.INTER_AREA) for full in (image_bgr, still_bgr))
    reduced = replace(t, blur_px=t.blur_px / 2, closed_px=3, opened_px=1)
    mask = _Difference(image, still, gains, reduced).changed(reduced)
    mask = _largest_inner_part(mask, t.border_px // COARSE, -(-t.joined_px // COARSE))
    return cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST)


def _box(mask: np.ndarray, margin_px: int) -> tuple[slice, slice]:
    u, v, width, height = cv2.boundingRect(mask)
    return (slice(max(v - margin_px, 0), v + height + margin_px), slice(max(u - margin_px, 0), u + width + margin_px))


def channel_gains(image_bgr: np.ndarray, still_bgr: np.ndarray) -> np.ndarray:
    """What the still's channels are multiplied by to look like the image: the median ratio of unsaturated pixels.

    Parameters
    ----------
    image_bgr, still_bgr : (h, w, 3) uint8.

    Returns
    -------
    (3,) float32.
    """
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


def _parts_with(mask: np.ndarray, seeds: np.ndarray) -> np.ndarray:
    """Parts of ``mask`` that hold a pixel of ``seeds``, uint8 0/255."""
    n, labels = cv2.connectedComponents(mask)
    keep = np.zeros(n, dtype=np.uint8)
    keep[np.unique(labels[(mask > 0) & seeds])] = 255
    return keep[labels]


def _largest_inner_part(mask: np.ndarray, border_px: int, joined_px: int) -> np.ndarray:
    """The largest part that does not lie along the border, 0/255; nothing where there is none.

    Pieces nearer to each other than ``joined_px`` are one part; the space between them stays out.
    """
    n, labels = cv2.connectedComponents(mask)
    border = np.concatenate([labels[0], labels[-1], labels[1:-1, 0], labels[1:-1, -1]])
    outside = np.bincount(border, minlength=n) > border_px
    inner = np.where(outside[labels], 0, mask).astype(np.uint8)
    n, labels = cv2.connectedComponents(cv2.dilate(inner, _disc(joined_px)))
    areas = np.bincount(labels[inner > 0], minlength=n)
    best = int(np.argmax(areas))
    return np.where((labels == best) & (inner > 0), 255, 0).astype(np.uint8)


def _with_black_parts(mask: np.ndarray, difference: _Difference, t: StillDifference) -> np.ndarray:
    """Bays, then holes, filled where what is black differs sufficiently; small holes in any case."""
    black = np.where(difference.brightness < t.black, difference.relative, 0.0)
    bays = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _disc(t.bay_px))
    with_bays = _joined(mask, bays > 0, (black > t.black_share) & ~difference.shadow, t)
    filled = _joined(with_bays, _enclosed(with_bays), black > t.black_share / 2, t)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(255 - filled, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] <= t.hole_px2
    return np.where(small[labels] | (filled > 0), 255, 0).astype(np.uint8)


def _joined(mask: np.ndarray, where: np.ndarray, belongs: np.ndarray, t: StillDifference) -> np.ndarray:
    """The mask with the solid parts of ``belongs`` within ``where``."""
    parts: np.ndarray = np.where(belongs & where, 255, 0).astype(np.uint8)
    parts = cv2.morphologyEx(parts, cv2.MORPH_CLOSE, _disc(t.closed_px))
    parts = cv2.morphologyEx(parts, cv2.MORPH_OPEN, _disc(2 * t.opened_px + 1))
    joined = np.where((mask > 0) | (where & (parts > 0)), 255, 0).astype(np.uint8)
    return cv2.morphologyEx(joined, cv2.MORPH_CLOSE, _disc(t.closed_px))


def _enclosed(mask: np.ndarray) -> np.ndarray:
    """(h, w) bool: what cannot be reached from beyond the image without crossing the mask."""
    flooded = cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    cv2.floodFill(flooded, None, (0, 0), 255)
    return flooded[1:-1, 1:-1] == 0


_FARTHEST_PX, _LARGEST_PX = 1e6, 65_536  # of a corner, of an image


def polygon_mask(polygons: list[np.ndarray], width: int, height: int) -> np.ndarray:
    """Mask of closed outlines; where two overlap is outside (holes).

    Parameters
    ----------
    polygons : outlines (n, 2), pixels (u, v).
    width, height : of the mask, pixels.

    Returns
    -------
    (h, w) uint8, 0 or 255.
    """
    mask = np.zeros((height, width), dtype=np.uint8)
    cv2.fillPoly(mask, [np.round(polygon).astype(np.int32).reshape(-1, 1, 2) for polygon in polygons], 255)
    return mask


@dataclass(frozen=True, eq=False)
class CameraMasks:
    """Reference masks of one camera: by hand for some images, or from a still for all.

    ``width`` and ``height`` are those of the images that the masks were made for. ``polygons``: image number -> outlines.
    ``still``: path of the still image, empty where the rig's background image is meant; None for polygons.
    """

    camera: str
    width: int
    height: int
    polygons: Mapping[int, list[np.ndarray]] = field(default_factory=dict)
    still: str | None = None
    _made: dict[tuple[int, bytes], np.ndarray] = field(default_factory=dict, repr=False)  # number, digest -> bits

    def image_numbers(self, n_images: int) -> list[int]:
        """Numbers of the images below ``n_images`` that have a mask."""
        if self.still is not None:
            return list(range(n_images))
        return sorted(number for number in self.polygons if number < n_images)

    def mask(self, number: int, image_bgr: np.ndarray | None = None, still_bgr: np.ndarray | None = None) -> np.ndarray:
        """Mask of an image.

        Parameters
        ----------
        number : of the image in its source.
        image_bgr, still_bgr : (h, w, 3) uint8, which masks by difference need.

        Returns
        -------
        (h, w) uint8, 0 or 255.
        """
        if self.still is None:
            return polygon_mask(self.polygons[number], self.width, self.height)
        if image_bgr is None or still_bgr is None:
            raise ValueError("expected the image and the still for a mask by difference")
        seen = hashlib.sha1(usedforsecurity=False)
        for each in (image_bgr, still_bgr):
            seen.update(each[::_SAMPLED, ::_SAMPLED].tobytes())
        key = number, seen.digest()
        if key not in self._made:
            self._made[key] = np.packbits(still_difference_mask(image_bgr, still_bgr) > 0, axis=1)
        return 255 * np.unpackbits(self._made[key], axis=1, count=image_bgr.shape[1])


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
            raise FileFormatError(path, f"{where}.still", "a path, or '' for the rig's background image", entry["still"])
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
    """Read the still of a camera.

    Parameters
    ----------
    path : of an image.
    width, height : of the camera's images, pixels.

    Returns
    -------
    (height, width, 3) uint8 BGR.

    Raises
    ------
    SourceError : it is missing or of another size.
    """
    still = cv2.imread(path, cv2.IMREAD_COLOR)
    if still is None:
        raise SourceError(path, "cannot be read as an image")
    if still.shape[:2] != (height, width):
        raise SourceError(path, f"expected a still of {width}x{height}, got {still.shape[1]}x{still.shape[0]}")
    return still
