"""Images of a rig's cameras by the name of their source: files, folders and bags; decoded beforehand, or taken apart into fields.

Images of the background are read here, too.
"""

from __future__ import annotations

import glob
import itertools
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...camera.rig import Camera, CameraRig, CaptureSettings
from ...errors import CalibrationError, SourceError, without_password
from ...observation.deinterlace import check_field_order, check_interlaced, deinterlace
from ..decoding import SourceImage, check_fields
from ..source_address import BAG, parse_source
from .file_sources import (
    DEFAULT_FOLDER_RATE_HZ,
    IMAGE_SUFFIXES,
    BagSource,
    FolderSource,
    VideoSource,
    list_images,
    topic_of_camera,
)
from .recorded_source import ImageSource, ReadCounts, SourceOptions
from .stamps import field_times, file_times, load_stamp_file

__all__ = [
    "DEFAULT_FOLDER_RATE_HZ",
    "IMAGE_SUFFIXES",
    "FolderSource",
    "ImageSource",
    "InterlacedSource",
    "PreloadedSource",
    "ReadCounts",
    "SourceOptions",
    "VideoSource",
    "assumed_rate",
    "list_images",
    "open_camera_source",
    "open_recordings",
    "open_source",
]

_CHECKED = 12  # images at the beginning that must not contradict a source being interlaced


class PreloadedSource(ImageSource):
    """Another source's images, all decoded before the first is delivered."""

    def __init__(self, source: ImageSource):
        self._source = source
        read = source._usable(source.numbers.start, source.numbers.stop)
        self._images = [(i, source._prepared(0, content)) for i, content in read]
        self._unreadable = source.counts
        super().__init__(source.path, replace(source.options, size=None, shrink=1, rate_hz=source.rate_hz))
        self.note = source.note

    def _open(self) -> tuple[int, int, float, int]:
        return self._source.width, self._source.height, self._source.rate_hz, self._source._n_in_file

    def stamp_ns(self, i: int) -> int:
        return self._source.stamp_ns(i)

    def _read(self, start: int, end: int) -> Iterator[tuple[int, Any]]:
        self.counts.missing += self._unreadable.missing
        self.counts.unusable += self._unreadable.unusable
        self.counts.problems += self._unreadable.problems
        yield from ((i, image) for i, image in self._images if start <= i < end)

    _usable = _read  # the other source has looked at sizes

    def _settings(self) -> CaptureSettings:
        return self._source._settings()

    def _prepared(self, stamp_ns: int, content: Any) -> SourceImage:
        return replace(content, stamp_ns=stamp_ns)


class InterlacedSource(ImageSource):
    """A source of interlaced images as twice as many images, one a field, missing lines interpolated.

    Numbers, rate and ``start`` and ``end`` of the options are those of the delivered images. Where originals are kept, that of
    the first field is the image that both come from, and the second has none.

    Raises
    ------
    SourceError : an odd number of lines; a mosaic, or JPEG images to be passed on, which cannot be taken apart; what moves in the
        first images shows that they are progressive, or have the other field order.
    """

    def __init__(self, path: str | Path, options: SourceOptions, order: str):
        check_fields(options.capture, str(path))
        self._order = order
        times = None if options.times_ns is None else options.times_ns[::2]
        self._woven = open_source(path, SourceOptions(threads=options.threads, own_times=options.own_times, times_ns=times))
        super().__init__(str(path), options)
        first = [image for _, image in itertools.islice(self._woven, min(_CHECKED, self._woven.n_images))]
        check_interlaced(first, str(path))
        check_field_order(first, order, str(path))

    def _open(self) -> tuple[int, int, float, int]:
        source = self._woven
        self.first_number = source.first_number
        self.rate_is_assumed = source.rate_is_assumed and self.options.rate_hz is None
        if source.native_height % 2:
            raise SourceError(source.path, f"marked as interlaced, but its {source.native_height} lines are not an even number")
        return source.native_width, source.native_height, 2.0 * source.rate_hz, 2 * source.n_images

    def _own_times(self) -> tuple[int, ...] | None:
        times = self._woven.options.times_ns
        return None if times is None else field_times(times)

    def _read(self, start: int, end: int) -> Iterator[tuple[int, Any]]:
        self._woven.counts = self.counts
        for i, content in self._woven._usable(start // 2, (end + 1) // 2):
            image = self._woven._prepared(0, content).bgr
            for number, field in enumerate(deinterlace(image, self._order), start=2 * i):
                if start <= number < end:
                    yield number, (field, image if self.options.keep and number == 2 * i else None)

    _usable = _read  # the woven source has looked at sizes

    def _prepared(self, stamp_ns: int, content: Any) -> SourceImage:
        field, woven = content
        return replace(super()._prepared(stamp_ns, field), original=woven)


def open_source(path: str | Path, options: SourceOptions | None = None, **changes) -> ImageSource:
    """Open a video file, an image folder, a pattern of image files, or the images in a bag (`loaders.source_address`).

    Parameters
    ----------
    path, options : source; how it is read, None for all of it.
    **changes : fields of `SourceOptions`, for short calls: ``open_source("cam01.mp4", start=10, end=20)``.

    Returns
    -------
    Source, opened.

    Raises
    ------
    SourceError : naming the path, when it is missing or unreadable, or live.
    """
    if options is not None and changes:
        raise ValueError("expected options or single fields, got both")
    options = options or SourceOptions(**changes)
    address = parse_source(str(path))
    if address.is_live:
        problem = "is live: tracker_node camera_ingest publishes it, and only a recording can be read here"
        raise SourceError(address.shown, problem)
    if address.kind == BAG:
        return BagSource(address, options)
    text = address.target
    if os.path.isdir(text) or (re.search(r"[*?\[]|%0?\d*d", text) and not os.path.exists(text)):
        return FolderSource(text, options)
    if not os.path.exists(text):
        raise SourceError(text, "no such file or folder")
    if Path(text).suffix.lower() in IMAGE_SUFFIXES:
        return FolderSource(glob.escape(text), options)
    return VideoSource(text, options)


def open_recordings(
    paths: Mapping[str, str], stamp_file: str | Path | None = None, late_s: Mapping[str, float] | None = None
) -> dict[str, ImageSource]:
    """Open a recording of each camera.

    Parameters
    ----------
    paths : camera -> its recording.
    stamp_file : with the times of all cameras, see `stamps.load_stamp_file`; None: the recordings' own.
    late_s : camera -> by how much its images are later than they say; of others 0.

    Returns
    -------
    sources : by camera.

    Raises
    ------
    TrackerError : a recording that cannot be read, or has another number of images than the file has times; naming it.
    """
    sources = {}
    for name, path in paths.items():
        times = load_stamp_file(stamp_file, name) if stamp_file else None
        source = sources[name] = open_source(path, times_ns=times, base_stamp_ns=round(1e9 * (late_s or {}).get(name, 0.0)))
        if times is not None and len(times) != source.n_images:
            problem = f"has {len(times)} times for camera '{name}', but {path} has {source.n_images} images"
            raise SourceError(str(stamp_file), problem)
    return sources


def assumed_rate(sources: Iterable[ImageSource], where: str) -> list[str]:
    """A sentence where nothing says the rate of some of these sources.

    Parameters
    ----------
    sources, where : opened; what the user gives a rate by.

    Returns
    -------
    At most one.
    """
    if not any(source.rate_is_assumed for source in sources):
        return []
    return [f"no rate in image folders: {DEFAULT_FOLDER_RATE_HZ:g} Hz assumed; {where} says another"]


def open_camera_source(camera: Camera, options: SourceOptions | None = None) -> ImageSource:
    """Source of a rig's camera: its size is compared with the calibration, its stamps get the camera's time offset.

    Parameters
    ----------
    camera : of the rig.
    options : how it is read; with a ``size`` images are resampled, for the lens ``camera.model.resized(*options.size)``.

    Returns
    -------
    Source, opened.

    Raises
    ------
    SourceError : no source given, missing, unreadable or live, progressive though the camera is said to be interlaced, or
        stamps that are not those of its images.
    FileFormatError : a stamp file or a bag that cannot be used.
    CalibrationError : the file's image size is not that of the calibration.
    """
    source = open_camera_source_of_any_size(camera, options)
    expected, got = (camera.model.width, camera.model.height), (source.native_width, source.native_height)
    if expected != got:
        raise CalibrationError(camera.name, size_contradiction(expected, got, str(camera.source)))
    return source


def open_camera_source_of_any_size(camera: Camera, options: SourceOptions | None = None) -> ImageSource:
    """Source of a rig's camera whatever the size of its images; otherwise as `open_camera_source`.

    Parameters
    ----------
    camera, options : of the rig; how its source is read.

    Returns
    -------
    Source, opened.
    """
    if not camera.source:
        raise SourceError(camera.name, "the rig names no source for this camera")
    options = options or SourceOptions()
    check_recorded(camera.source, camera.capture)
    shifted = replace(
        options,
        base_stamp_ns=options.base_stamp_ns + camera.time_offset_ns,
        drift_ppm=camera.time_drift_ppm,
        capture=camera.capture,
        own_times=options.own_times and camera.stamps != "rate",
    )
    address = parse_source(camera.source)
    if address.kind == BAG:
        address = topic_of_camera(address, camera.name)
    if camera.stamp_file is not None or camera.stamps is not None:
        times = file_times(camera, open_source(str(address)).n_stored)
        shifted = replace(shifted, times_ns=field_times(times) if camera.interlaced and times else times)
    if camera.interlaced:
        return InterlacedSource(str(address), shifted, camera.interlaced)
    return open_source(str(address), shifted)


def size_contradiction(expected: tuple[int, int], got: tuple[int, int], source: str) -> str:
    """The sentence for images that are not of the size that the calibration is for.

    Parameters
    ----------
    expected, got : (width, height), px.
    source : where the images come from; a password in it is left out.

    Returns
    -------
    Text without an end.
    """
    sizes = f"expected {expected[0]}x{expected[1]}, got {got[0]}x{got[1]}"
    return f"image size contradicts the calibration: {sizes} in {without_password(source)}"


def check_recorded(source: str, capture: CaptureSettings) -> None:
    """Refuse settings of a device for a recording.

    Parameters
    ----------
    source, capture : of a camera, as in the rig.

    Raises
    ------
    SourceError : naming them.
    """
    if capture.of_device and not parse_source(source).is_live:
        raise SourceError(source, f"{', '.join(capture.of_device)} can be set for v4l2: sources only")


def load_backgrounds(rig: CameraRig) -> dict[str, np.ndarray]:
    """Camera name -> BGR image of the background (height, width, 3), for the cameras that name one.

    Raises
    ------
    SourceError : an image that is missing or cannot be read.
    CalibrationError : an image that does not have the size of the camera's images.
    """
    backgrounds = {}
    for camera in rig:
        if not camera.background:
            continue
        image = cv2.imread(camera.background, cv2.IMREAD_COLOR)
        if image is None:
            raise SourceError(camera.background, f"cannot be read as the background of camera '{camera.name}'")
        if problem := camera.model.size_problem(image):
            raise CalibrationError(camera.name, f"{problem} in {camera.background}")
        backgrounds[camera.name] = image
    return backgrounds


def resized_backgrounds(backgrounds: dict[str, np.ndarray], rig: CameraRig) -> dict[str, np.ndarray]:
    """Images of the background in another size, for cameras whose images are published resampled.

    Parameters
    ----------
    backgrounds, rig : camera -> BGR image (h, w, 3); rig with the lenses of the published images.

    Returns
    -------
    Camera -> BGR image in the size of its lens.
    """
    sizes = {name: (rig[name].model.width, rig[name].model.height) for name in backgrounds}
    return {name: cv2.resize(image, sizes[name], interpolation=cv2.INTER_AREA) for name, image in backgrounds.items()}
