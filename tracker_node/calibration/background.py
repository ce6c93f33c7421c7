"""Background of a static camera, from a recording in which somebody always stands somewhere, and an image without anybody.

A pixel of a static scene comes back to the same color whenever nobody stands before it. Where nearly all images of the
recording agree, theirs is the color of the background, whatever that image shows; elsewhere, where somebody moves, it is
that image's, brought to the recording's exposure.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ..camera.rig import CameraRig
from ..errors import CalibrationError, SourceError
from ..loaders.images.source import IMAGE_SUFFIXES, open_source
from ..loaders.rig.rig_yaml import RigFile
from ..loaders.whole_file import whole_file

_TOLERANCE = 12.0  # color levels (of 255) within which two images agree about a pixel
# This fraction of the images must agree for the recording to count rather than the other image. Uniform clothes of somebody who
# hardly moves agree in many images too: keep it high.
_MIN_FRACTION = 0.8
_MIN_WIDTH_PX = 9  # what changes in a place narrower than this is noise, not somebody who moves


@dataclass(frozen=True)
class Background:
    """A background, and where the recording shows it.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    known : (h, w) bool, True where the recording itself shows the background; elsewhere the image without anybody does.
    """

    image: np.ndarray
    known: np.ndarray


def build_background(images: np.ndarray, alone: np.ndarray | None = None) -> Background:
    """Background of a static camera.

    Parameters
    ----------
    images : (n, h, w, 3) uint8, spread over the recording; 20 to 40 do.
    alone : the background without anybody, (h, w, 3) uint8 of the same camera in the same place and the same pixels, or None.

    Returns
    -------
    The background, and where the recording itself shows it.

    Raises
    ------
    ValueError : when the sizes differ or there are no images.
    """
    if images.ndim != 4 or len(images) == 0:
        raise ValueError(f"expected images of shape (n, h, w, 3), got {images.shape}")
    if alone is not None and alone.shape != images.shape[1:]:
        raise ValueError(f"expected a background alone of shape {images.shape[1:]}, got {alone.shape}")
    median, fraction = _median_and_agreement(images)
    known = ~_where_somebody_moves(fraction)
    if alone is None:
        return Background(median, known)
    matched = _exposed_like(alone, median)
    return Background(np.where(known[..., None], median, np.round(matched).astype(np.uint8)), known)


def build_backgrounds(
    rig: CameraRig, n_images: int = 25, folder: str | Path | None = None
) -> Iterator[tuple[str, Background]]:
    """Background of each camera of a rig, from its source, one after the other.

    Parameters
    ----------
    rig : whose cameras have sources.
    n_images : of each recording.
    folder : with an image of the background alone for each camera, named as the camera; None: there are none.

    Yields
    ------
    name, background : of a camera, in the order of the rig.

    Raises
    ------
    TrackerError : a camera without a source or without an image in ``folder``, or one of another size; naming it.
    """
    for camera in rig:
        if camera.source is None:
            raise CalibrationError(camera.name, "has no source in the rig")
        images = spread_images(camera.source, n_images)
        alone = None if folder is None else _image_of(Path(folder), camera.name, images.shape[1:])
        yield camera.name, build_background(images, alone)


def with_backgrounds(rig_file: RigFile, paths: Mapping[str, Path]) -> RigFile:
    """The rig file with images of the background.

    Parameters
    ----------
    rig_file : of the same cameras.
    paths : camera -> its image.

    Returns
    -------
    A copy, with absolute paths.
    """
    cameras = {
        name: entry.model_copy(update={"background": str(paths[name].absolute())}) if name in paths else entry
        for name, entry in rig_file.cameras.items()
    }
    return rig_file.model_copy(update={"cameras": cameras})


def _image_of(folder: Path, camera: str, shape: tuple[int, ...]) -> np.ndarray:
    """A camera's image of the background alone, in the pixels of its recording."""
    found = [path for suffix in IMAGE_SUFFIXES if (path := folder / f"{camera}{suffix}").exists()]
    image = cv2.imread(str(found[0])) if found else None
    if image is None:
        raise SourceError(folder, f"has no image named {camera} ({', '.join(IMAGE_SUFFIXES)})")
    if image.shape != shape:
        sizes = f"is {image.shape[1]}x{image.shape[0]}, its recording {shape[1]}x{shape[0]}"
        raise CalibrationError(camera, f"its image of the background {sizes}; bring the image to that size first")
    return image


def _where_somebody_moves(fraction: np.ndarray) -> np.ndarray:
    """(h, w) bool: places where the recording does not agree with itself, and what they enclose."""
    # Edges of things flicker by themselves; whoever moves leaves a wide trace.
    disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_MIN_WIDTH_PX,) * 2)
    moving = cv2.morphologyEx((fraction < _MIN_FRACTION).astype(np.uint8), cv2.MORPH_OPEN, disk)
    # Uniform clothes of somebody who hardly moves look like background: what motion encloses is not known either.
    moving = cv2.morphologyEx(cv2.dilate(moving, disk), cv2.MORPH_CLOSE, np.ones((3 * _MIN_WIDTH_PX,) * 2, dtype=np.uint8))
    outlines, _ = cv2.findContours(moving, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(moving, outlines, -1, 1, cv2.FILLED)
    return moving.astype(bool)


def spread_images(source: str | Path, n_images: int = 25) -> np.ndarray:
    """Images spread evenly over a recording.

    Parameters
    ----------
    source : video, folder or another source.
    n_images : how many; fewer where the recording has fewer.

    Returns
    -------
    (n, h, w, 3) uint8 BGR.

    Raises
    ------
    SourceError : when the recording cannot be read.
    """
    opened = open_source(source)
    n_images = min(n_images, opened.n_images)
    wanted = {int((i + 0.5) * opened.n_images / n_images) for i in range(n_images)}
    found = [image for i, (_, image) in enumerate(opened) if i in wanted]
    if not found:
        raise SourceError(source, "no image could be read")
    return np.array(found)


def write_image(path: Path, image: np.ndarray) -> None:
    """Write a PNG, whole or not at all, making its folder.

    Parameters
    ----------
    path : of the PNG.
    image : (h, w, 3) uint8 BGR.

    Raises
    ------
    SourceError : when it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as draft:
            draft.write_bytes(cv2.imencode(".png", image)[1].tobytes())
    except OSError as error:
        raise SourceError(path, f"cannot be written: {error.strerror}") from error


def _median_and_agreement(images: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Per pixel the median color (h, w, 3) uint8, and the fraction (h, w) of the images that agree with it."""
    median = np.empty(images.shape[1:], dtype=np.uint8)
    fraction = np.empty(images.shape[1:3], dtype=np.float32)
    middle = len(images) // 2
    for top in range(0, images.shape[1], 64):  # in strips, to keep copies small
        strip = images[:, top : top + 64]
        median[top : top + 64] = np.partition(strip, middle, axis=0)[middle]
        near = np.zeros(strip.shape[1:3], dtype=np.float32)
        for image in strip:
            near += np.max(cv2.absdiff(image, median[top : top + 64]), axis=-1) <= _TOLERANCE
        fraction[top : top + 64] = near / len(images)
    return median, fraction


def _exposed_like(alone: np.ndarray, median: np.ndarray) -> np.ndarray:
    """The image (float32) with a gain and an offset per channel, fitted where it shows the same as the recording."""
    result = np.empty(alone.shape, dtype=np.float32)
    for channel in range(alone.shape[2]):
        x = alone[::4, ::4, channel].ravel().astype(np.float64)
        y = median[::4, ::4, channel].ravel().astype(np.float64)
        inside = (x > 5) & (x < 250) & (y > 5) & (y < 250)
        gain, offset = 1.0, 0.0
        for _ in range(8):
            error = np.abs(gain * x + offset - y)
            keep = inside & (error <= max(6.0, 2.0 * float(np.median(error[inside])) if inside.any() else 6.0))
            if np.count_nonzero(keep) < 100 or np.ptp(x[keep]) < 10.0:
                break
            gain, offset = np.polyfit(x[keep], y[keep], 1)
        result[..., channel] = np.clip(gain * alone[..., channel].astype(np.float32) + offset, 0.0, 255.0)
    return result
