"""Background of a static camera, from a recording in which somebody always stands somewhere, and an image without anybody.

A pixel of a static scene comes back to the same color whenever nobody stands before it. Where nearly all images of the
recording agree, theirs is the color of the background, whatever that image shows; elsewhere, where somebody moves, it is
that image's, brought to the recording's exposure.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ..camera.rig import CameraRig
from ..errors import CalibrationError, FileFormatError, SourceError
from ..loaders.images.source import IMAGE_SUFFIXES, open_source
from ..loaders.projects import VIDEO_SUFFIXES
from ..loaders.rig.rig_yaml import RigFile
from ..loaders.source_address import FILE, parse_source
from ..loaders.whole_file import whole_file
from .video_pixels import first_images, pixel_fits

_TOLERANCE = 12.0  # color levels (of 255) within which two images agree about a pixel
# This fraction of the images must agree for the recording to count rather than the other image. Uniform clothes of somebody who
# hardly moves agree in many images too: keep it high.
_MIN_FRACTION = 0.8
_MIN_WIDTH_PX = 9  # what changes in a place narrower than this is noise, not somebody who moves
# Of what never settles in the Balancing recording (9 to 19 % of the image), a third to a half is off by more than 30 levels: it
# shows the man. Elsewhere nothing is. Who walks through the image leaves less than this behind.
MOST_UNKNOWN = 0.05
_LEAST_MOVING = 1e-3  # of the image, below which nobody has moved: whoever stands there would be part of the background
_FOLDERS, _ENDINGS = ("background", "empty", "stills"), ("_background", "_empty")  # where images of the background alone lie
_SUFFIXES, _OF_EMPTY_VIDEO = (*IMAGE_SUFFIXES, *VIDEO_SUFFIXES), 9


@dataclass(frozen=True)
class Background:
    """A background, and where the recording shows it.

    Parameters
    ----------
    image : (h, w, 3) uint8.
    known : (h, w) bool, True where the recording itself shows the background; elsewhere the image without anybody does.
    moving : fraction of the image in which something wide has moved in the recording.
    """

    image: np.ndarray
    known: np.ndarray
    moving: float = 1.0

    def doubt(self, most_unknown: float) -> str:
        """Why a background that was made from the recording alone is not to be relied on; empty where it is.

        Parameters
        ----------
        most_unknown : fraction of the image that may never have settled.

        Returns
        -------
        Text without an end.
        """
        if self.moving < _LEAST_MOVING:
            return "nothing moves in its images, so whoever stands there would be part of the background"
        if (unknown := 1.0 - float(self.known.mean())) > most_unknown:
            return f"{100.0 * unknown:.1f} % never settles, at most {100.0 * most_unknown:g} % may"
        return ""


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
    known, moving = ~_where_somebody_moves(fraction), float(_wide(fraction < 1.0).mean())
    if alone is None:
        return Background(median, known, moving)
    matched = _exposed_like(alone, median)
    return Background(np.where(known[..., None], median, np.round(matched).astype(np.uint8)), known, moving)


def build_backgrounds(
    rig: CameraRig, n_images: int = 25, alone: str | Path | Mapping[str, Path] | None = None
) -> Iterator[tuple[str, Background]]:
    """Background of each camera of a rig, from its source, one after the other.

    Parameters
    ----------
    rig : whose cameras have sources.
    n_images : of each recording.
    alone : folder with an image of the background alone for each camera, named as the camera; or camera -> its image, of those
        that have one, see `images_beside`; None: there are none.

    Yields
    ------
    name, background : of a camera, in the order of the rig.

    Raises
    ------
    TrackerError : a camera without a source or without an image in the folder, or one of another shape; naming it.
    """
    for camera in rig:
        if camera.source is None:
            raise CalibrationError(camera.name, "has no source in the rig")
        images = spread_images(camera.source, n_images)
        named = alone if isinstance(alone, Mapping) or alone is None else {camera.name: _image_in(Path(alone), camera.name)}
        path = None if named is None else named.get(camera.name)
        yield camera.name, build_background(images, None if path is None else _image_like(path, camera.name, images))


def images_beside(rig: CameraRig) -> dict[str, Path]:
    """Images or videos of the background alone that lie beside the cameras' recordings.

    For ``videos/cam01.mp4``: ``cam01`` in ``background/``, ``empty/`` or ``stills/``, in ``videos/`` or beside it, and
    ``videos/cam01_background.*`` or ``videos/cam01_empty.*``; by the name of the camera or of its recording.

    Returns
    -------
    Camera -> file, of those that have one.

    Raises
    ------
    FileFormatError : a camera with two; naming them.
    """
    found = {}
    for camera in rig:
        if camera.source is None or parse_source(camera.source).kind != FILE:
            continue
        recording = Path(parse_source(camera.source).target)
        names = dict.fromkeys((camera.name, recording.stem))
        folders = [place / folder for place in (recording.parent, recording.parent.parent) for folder in _FOLDERS]
        stems = [folder / name for folder in folders for name in names]
        stems += [recording.parent / f"{name}{ending}" for name in names for ending in _ENDINGS]
        paths = (Path(f"{stem}{suffix}") for stem in stems for suffix in _SUFFIXES)
        there = list({path.resolve(): path for path in paths if path.is_file()}.values())
        if len(there) > 1:
            several = ", ".join(map(str, there))
            raise FileFormatError(recording.parent, camera.name, "one image of its background", several)
        if there:
            found[camera.name] = there[0]
    return found


def with_backgrounds(rig_file: RigFile, paths: Mapping[str, Path], base: Path | None = None) -> RigFile:
    """The rig file with images of the background.

    Parameters
    ----------
    rig_file : of the same cameras.
    paths : camera -> its image.
    base : folder that the paths become relative to; None: they become absolute.

    Returns
    -------
    A copy.
    """
    places = {name: str(path.absolute()) if base is None else os.path.relpath(path, base) for name, path in paths.items()}
    return rig_file.with_cameras({name: {"background": place} for name, place in places.items()})



def _image_in(folder: Path, camera: str) -> Path:
    """A camera's image of the background alone."""
    found = [path for suffix in IMAGE_SUFFIXES if (path := folder / f"{camera}{suffix}").exists()]
    if not found:
        raise SourceError(folder, f"has no image named {camera} ({', '.join(IMAGE_SUFFIXES)})")
    return found[0]


def _image_like(path: Path, camera: str, images: np.ndarray) -> np.ndarray:
    """An image of the background alone, or the median of a video of it, in the pixels of the recording's images."""
    if path.suffix.lower() in VIDEO_SUFFIXES:
        image = _median_and_agreement(spread_images(path, _OF_EMPTY_VIDEO))[0]
    else:
        image = first_images(open_source(path))[0]
    (height, width), (wanted_height, wanted_width) = image.shape[:2], images.shape[1:3]
    if (width, height) == (wanted_width, wanted_height):
        return image
    fits = pixel_fits((width, height), (wanted_width, wanted_height), images=images[:3])
    if len(fits) != 1:
        sizes = f"is {width}x{height}, its recording {wanted_width}x{wanted_height}"
        raise CalibrationError(camera, f"its image of the background {sizes}; bring the image to that size first")
    return fits[0].image(image)


def _wide(places: np.ndarray) -> np.ndarray:
    """(h, w) uint8: places (bool) without those that are narrow."""
    disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_MIN_WIDTH_PX,) * 2)
    return cv2.morphologyEx(places.astype(np.uint8), cv2.MORPH_OPEN, disk)


def _where_somebody_moves(fraction: np.ndarray) -> np.ndarray:
    """(h, w) bool: places where the recording does not agree with itself, and what they enclose."""
    # Edges of things flicker by themselves; whoever moves leaves a wide trace.
    disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_MIN_WIDTH_PX,) * 2)
    moving = _wide(fraction < _MIN_FRACTION)
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
