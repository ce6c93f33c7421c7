"""The tracked body laid over the images: agreement with reference masks, and pictures for the report."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from ...camera.rig import Camera, CameraRig
from ...errors import SourceError, TrackerError
from ...loaders.bag.images import image_of, image_topics
from ...loaders.bag.reader import BagReader
from ...loaders.images.source import SourceOptions, open_camera_source
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration
from ...parallel import Workers
from ...render.overlay import draw_overlay, masked_image
from ...render.raycast.raycaster import render_mask
from ...render.shape_arrays import PLACES, bounding_spheres, shape_places
from ...runs.data import RunData
from ...runs.images import image_bags_of
from ..evaluate import SilhouetteScores, image_numbers
from ..metrics import intersection_over_union
from .reference import CameraMasks, read_still

_THREADS = 2  # that share the cameras
SAME_TIME_STEP = 0.45  # images: how far an image's stamp may be from that of its set


@dataclass(frozen=True, eq=False)
class Picture:
    """The part of an image that the body is in, (h, w, 3) BGR; ``kind``: ``overlay``, with the body drawn over it, or ``mask``,
    black where the body is not."""

    camera: str
    number: int
    bgr: np.ndarray
    kind: str = "overlay"


@dataclass(eq=False)
class ImageReview:
    """Result of `review_images`; ``problems`` names cameras that could not be read, and why."""

    scores: SilhouetteScores = field(default_factory=SilhouetteScores)
    pictures: list[Picture] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class ReviewOptions:
    """``pictures``: how many image sets are shown; ``height_px`` of a picture; ``first_image``: number of the image in the
    sources that the first image set shows."""

    pictures: int = 6
    height_px: int = 420
    first_image: int = 0


@dataclass(frozen=True, eq=False)
class _Task:
    """What is read of every camera: ``row_of`` an image number, the numbers that are shown, and bags of images by camera."""

    run: RunData
    model: ArticulatedModel
    period_ns: float
    row_of: Mapping[int, int]
    shown: set[int]
    options: ReviewOptions
    bags: Mapping[str, Path]

    def configuration(self, number: int) -> Configuration:
        return self.run.configuration(self.model, self.row_of[number])


def review_images(
    run: RunData,
    model: ArticulatedModel,
    rig: CameraRig,
    masks: Mapping[str, CameraMasks],
    period_ns: float,
    options: ReviewOptions | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> ImageReview:
    """Compare the body with the images of every camera, each of which is read once.

    Images come from the rig's sources, or from the run's bag for a camera without one. A camera that cannot be read is named and
    left out.

    Parameters
    ----------
    run : states over time.
    model : body of the run.
    rig : cameras with their sources.
    masks : camera -> reference masks; others get pictures only.
    period_ns : of the images.
    options : what is shown.
    progress : is given a sentence for each camera, from several threads.

    Returns
    -------
    Scores, pictures, and what could not be read.
    """
    options = options or ReviewOptions()
    rows = np.flatnonzero(run.has_state)
    if not len(rows):
        return ImageReview(problems=["There is no image set with a state, and so no silhouette and no picture."])
    numbers = image_numbers(run, period_ns) + options.first_image
    row_of = {int(numbers[row]): int(row) for row in rows}
    shown = {int(numbers[rows[i]]) for i in spread(len(rows), options.pictures)}
    try:
        bags = image_bags_of(run.bag, run.info, rig.names)
    except TrackerError as error:
        return ImageReview(problems=[str(error)])
    task = _Task(run, model, period_ns, row_of, shown, options, bags)

    def of_camera(camera: Camera) -> ImageReview:
        progress(f"images of {camera.name}")
        try:
            return _review_camera(task, camera, masks.get(camera.name))
        except TrackerError as error:
            return ImageReview(problems=[str(error)])

    return _together(Workers(_THREADS).map(of_camera, list(rig)))


def _together(cameras: Sequence[ImageReview]) -> ImageReview:
    review = ImageReview()
    for each in cameras:
        review.pictures += each.pictures
        review.problems += each.problems
        for part in ("kind", "numbers", "ious"):
            getattr(review.scores, part).update(getattr(each.scores, part))
    return review


def spread(n: int, k: int) -> list[int]:
    """At most ``k`` of 0..n-1, evenly spread, the ends included.

    Parameters
    ----------
    n : how many there are.
    k : how many are wanted.

    Returns
    -------
    In order.
    """
    return sorted({round(i) for i in np.linspace(0, n - 1, min(n, k))}) if n and k > 0 else []


def _review_camera(task: _Task, camera: Camera, masks: CameraMasks | None) -> ImageReview:
    review = ImageReview()
    wanted = set(masks.image_numbers(max(task.row_of) + 1)) & set(task.row_of) if masks else set()
    still = _still(camera, masks) if masks else None
    box = _box([task.configuration(number) for number in sorted(task.shown)], camera)
    numbers, ious = [], []
    for number, image in _images(task, camera, wanted | task.shown):
        configuration = task.configuration(number)
        if number in wanted and masks is not None:
            reference = _fitted(masks.mask(number, image, still), camera)
            numbers.append(number)
            ious.append(intersection_over_union(render_mask(configuration, camera), reference))
        if number in task.shown:
            overlay, seen = draw_overlay(image, configuration, camera), masked_image(image, configuration, camera)
            for kind, picture in (("overlay", overlay), ("mask", seen)):
                small = _of_height(picture[box], task.options.height_px)
                review.pictures.append(Picture(camera.name, number, small, kind))
    if masks is not None and numbers:
        review.scores.kind[camera.name] = "drawn by hand" if masks.still is None else "difference to a still image"
        review.scores.numbers[camera.name] = numbers
        review.scores.ious[camera.name] = ious
    return review


def _of_height(picture: np.ndarray, height: int) -> np.ndarray:
    width = max(round(picture.shape[1] * height / picture.shape[0]), 1)
    return cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)


def _box(configurations: Sequence[Configuration], camera: Camera) -> tuple[slice, slice]:
    """The part of a camera's images that the body is in, in all ``configurations``, with a margin."""
    if not configurations:
        return slice(None), slice(None)
    bounds = bounding_spheres(configurations[0].model)
    places = np.concatenate([shape_places(body, bounds).reshape(-1, PLACES, 3) for body in configurations])
    mirrored = 2.0 * places[:, :1] - places  # shapes reach as far the other way
    landmarks = [body.landmarks_world for body in configurations]
    points = np.concatenate([*landmarks, places.reshape(-1, 3), mirrored.reshape(-1, 3)])
    pixels, valid = camera.project(points)
    pixels = pixels[valid & camera.model.in_image(pixels)]
    if len(pixels) < 2:
        return slice(None), slice(None)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = 0.05 * float((high - low).max()) + 1.0
    (u0, v0), (u1, v1) = np.maximum(low - margin, 0).astype(int), np.ceil(high + margin).astype(int)
    return slice(v0, v1 + 1), slice(u0, u1 + 1)


def _images(task: _Task, camera: Camera, wanted: set[int]) -> Iterator[tuple[int, np.ndarray]]:
    """(number, BGR) of the wanted images of a camera."""
    if not wanted:
        return
    bag = task.bags.get(camera.name)
    if task.run.bag is not None and (camera.source is None or bag not in (None, task.run.bag)):
        yield from _bag_images(task, camera, wanted, bag or task.run.bag)
        return
    source = open_camera_source(camera, SourceOptions(start=min(wanted), end=max(wanted) + 1))
    numbers = {source.stamp_ns(i): i for i in sorted(wanted)}
    stamps = list(numbers)
    for stamp_ns, image in source:
        later = stamps[bisect_right(stamps, stamp_ns) :]
        if later:
            source.skip_before(later[0], math.inf)  # nothing is decoded for the images between
        if stamp_ns in numbers:
            yield numbers[stamp_ns], image


def _bag_images(task: _Task, camera: Camera, wanted: set[int], bag: Path) -> Iterator[tuple[int, np.ndarray]]:
    """The same from a bag, by stamp; images that were made smaller for tracking get the camera's size."""
    size = (camera.model.width, camera.model.height)
    with BagReader(bag) as reader:
        topics = image_topics(reader, [camera.name])
        if not topics:
            raise SourceError(camera.name, f"the rig names no source, and {bag} holds no images")
        for message in reader.messages(topics):
            image = image_of(reader, message, camera.name)
            offset = (image.stamp_ns - int(task.run.stamps_ns[0])) / task.period_ns
            number = round(offset) + task.options.first_image
            if number in wanted and abs(offset - round(offset)) < SAME_TIME_STEP:
                yield number, cv2.resize(image.bgr, size, interpolation=cv2.INTER_AREA)


def _still(camera: Camera, masks: CameraMasks) -> np.ndarray | None:
    if masks.still is None:
        return None
    path = masks.still or camera.background
    if not path:
        problem = "its reference masks need a still image, and the rig names no background image"
        raise TrackerError(f"camera '{camera.name}': {problem}")
    return read_still(path, camera.model.width, camera.model.height)


def _fitted(mask: np.ndarray, camera: Camera) -> np.ndarray:
    """The mask in the pixels of the camera."""
    return cv2.resize(mask, (camera.model.width, camera.model.height), interpolation=cv2.INTER_NEAREST)


def contact_sheet(pictures: Sequence[Picture]) -> list[list[Picture]]:
    """Pictures as rows of one image set each, cameras in the order of their first picture."""
    cameras = list(dict.fromkeys(picture.camera for picture in pictures))
    numbers = sorted({picture.number for picture in pictures})
    at = {(picture.camera, picture.number): picture for picture in pictures}
    return [[at[camera, number] for camera in cameras if (camera, number) in at] for number in numbers]
