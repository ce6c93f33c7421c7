"""The recorded images of a rig by camera and number, in any order: decoded when asked for, and kept while there is room.

A posed body as lines over an image: the outlines of its parts, and the points that it can be taken by.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import cv2
import numpy as np

from ..camera.rig import Camera, CameraRig
from ..errors import FileFormatError, SourceError, TrackerError, UnknownNameError
from ..loaders.decoding import SourceImage
from ..loaders.images.file_sources import READ_ON
from ..loaders.images.source import ImageSource, SourceOptions
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..observation.image_set import CameraImage, ImageSet
from ..render.overlay import part_colors, part_outlines
from ..runs.image_sets import opened_sources
from ..runs.loop import make_synchronizer
from ..tracking.config import SynchronizerConfig

_JPEG_BYTES = 256 * 2**20
_DECODED_BYTES = 128 * 2**20
_QUALITY = 88
_STAMP_ONLY = np.zeros((1, 1), np.uint8)

Item = TypeVar("Item")


@dataclass(frozen=True)
class SetNumbers:
    """One image set: the number of its image in the source of every camera that has one."""

    stamp_ns: int
    numbers: Mapping[str, int]


class RecordedImages:
    """Images of the sources that a rig names.

    Parameters
    ----------
    rig : cameras; one without a source that can be used has no images.
    options : which images of the sources, and their stamps.
    synchronizer : how images become sets; the image period is that of the sources.

    Attributes
    ----------
    sets : in order of time; made from the stamps alone.
    problems : one sentence for each camera that is left out.
    """

    def __init__(self, rig: CameraRig, options: SourceOptions | None = None, synchronizer: SynchronizerConfig | None = None):
        self.problems: list[str] = []
        options = options or SourceOptions()
        try:
            self._sources = opened_sources(rig, options, self.problems)
        except SourceError:
            self._sources = {}
        self._number_of = {name: self._stamped(name) for name in [*self._sources]}
        self._readers = {name: _Reader(source) for name, source in self._sources.items()}
        self.sets = _sets_of(self._sources, self._number_of, synchronizer or SynchronizerConfig()) if self._sources else ()
        self._jpegs: _Recent[bytes] = _Recent(_JPEG_BYTES, len)
        self._decoded: _Recent[np.ndarray] = _Recent(_DECODED_BYTES, lambda image: image.nbytes)

    def _stamped(self, camera: str) -> dict[int, int]:
        """Number of the image of each stamp; a camera that gives fewer than it announces is left out."""
        source = self._sources[camera]
        numbers = source.numbers
        try:
            source.stamp_ns(numbers[-1])  # of a bag this reads all of them, from the first on each would anew
            return {source.stamp_ns(i): i for i in numbers}
        except TrackerError as error:
            self.problems.append(f"camera '{camera}': {error}; this camera is left out")
            del self._sources[camera]
            return {}

    @property
    def cameras(self) -> tuple[str, ...]:
        """Those that have images, in the order of the rig."""
        return tuple(self._sources)

    def number_at(self, camera: str, stamp_ns: int) -> int | None:
        """Number of the image that has exactly this stamp.

        Parameters
        ----------
        camera : its name.
        stamp_ns : integer nanoseconds.

        Returns
        -------
        None where there is none.
        """
        return self._number_of.get(camera, {}).get(stamp_ns)

    def bgr(self, camera: str, number: int) -> np.ndarray:
        """One image.

        Parameters
        ----------
        camera : its name.
        number : of the image in its source.

        Returns
        -------
        (h, w, 3) uint8, read-only.

        Raises
        ------
        TrackerError : no such camera or image, or one that cannot be read.
        """
        if camera not in self._readers:
            raise UnknownNameError("camera with images", camera, self.cameras)
        key = camera, number
        image = self._decoded.get(key)
        if image is None:
            image = self._readers[camera].read(number)
            image.flags.writeable = False
            self._decoded.put(key, image)
        return image

    def jpeg(self, camera: str, number: int, shrink: int = 1) -> bytes:
        """One image as a JPEG.

        Parameters
        ----------
        camera : its name.
        number : of the image in its source.
        shrink : whole factor by which it is made smaller.

        Returns
        -------
        The file's bytes.
        """
        key = camera, number, shrink
        data = self._jpegs.get(key)
        if data is None:
            image = self.bgr(camera, number)
            if shrink > 1:
                size = max(1, image.shape[1] // shrink), max(1, image.shape[0] // shrink)
                image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
            data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
            self._jpegs.put(key, data)
        return data

    def image_set(self, index: int) -> ImageSet:
        """The images of set number ``index``.

        Raises
        ------
        TrackerError : there is no such set, or one of its images cannot be read.
        """
        if not 0 <= index < len(self.sets):
            raise FileFormatError("request", "set", f"a number of an image set below {len(self.sets)}", index)
        return self.images_of(self.sets[index])

    def images_of(self, numbers: SetNumbers) -> ImageSet:
        """The images of a set, in the order of the rig."""
        images = [
            CameraImage(camera, self._sources[camera].stamp_ns(number), self.bgr(camera, number))
            for camera, number in numbers.numbers.items()
        ]
        return ImageSet(numbers.stamp_ns, tuple(images))


class _Reader:
    """One source, read on from where it is, or anew from where it is asked for."""

    def __init__(self, source: ImageSource):
        self._source = source
        self._lock = threading.Lock()
        self._images: Iterator[SourceImage] | None = None
        self._next = 0

    def read(self, number: int) -> np.ndarray:
        numbers = self._source.numbers
        if number not in numbers:
            raise FileFormatError("request", "image", f"a number in [{numbers.start}, {numbers.stop - 1}]", number)
        with self._lock:
            if self._images is None or not self._next <= number <= self._next + READ_ON:
                self._images = self._source.images(number)
            self._next, wanted_ns = number + 1, self._source.stamp_ns(number)
            image = next((image for image in self._images if image.stamp_ns >= wanted_ns), None)
            if image is None or image.stamp_ns != wanted_ns:
                self._images = None
                raise SourceError(self._source.path, f"image {number} cannot be read")
            return np.array(image.bgr)


def _sets_of(
    sources: Mapping[str, ImageSource], number_of: Mapping[str, Mapping[int, int]], config: SynchronizerConfig
) -> tuple[SetNumbers, ...]:
    """Sets as an offline run makes them, from the stamps alone."""
    names = tuple(sources)
    period_s = min(1.0 / source.rate_hz for source in sources.values())
    synchronizer = make_synchronizer(names, replace(config, image_period_s=period_s))
    sets: list[ImageSet] = []
    for stamp_ns, order in sorted((stamp_ns, i) for i, name in enumerate(names) for stamp_ns in number_of[name]):
        sets += synchronizer.add(CameraImage(names[order], stamp_ns, _STAMP_ONLY, "mono8"))
    sets += synchronizer.flush()
    return tuple(SetNumbers(s.stamp_ns, {x.camera: number_of[x.camera][x.stamp_ns] for x in s.images}) for s in sets)


class _Recent(Generic[Item]):
    """The items that were asked for last, as many as ``most_bytes`` hold; from any thread."""

    def __init__(self, most_bytes: int, size: Callable[[Item], int]):
        self._most, self._size, self._bytes = most_bytes, size, 0
        self._items: OrderedDict[Hashable, Item] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: Hashable) -> Item | None:
        with self._lock:
            if key in self._items:
                self._items.move_to_end(key)
            return self._items.get(key)

    def put(self, key: Hashable, item: Item) -> None:
        with self._lock:
            if key in self._items:
                return
            self._items[key] = item
            self._bytes += self._size(item)
            while self._bytes > self._most and len(self._items) > 1:
                self._bytes -= self._size(self._items.popitem(last=False)[1])


WORKING_HEIGHT_PX = 1000  # outlines and scores are made in images of about this height, at most


def working_rig(rig: CameraRig) -> tuple[CameraRig, int]:
    """The rig on images smaller by a whole factor, and that factor: 1 for images that are small already."""
    tallest = max(max(camera.model.height, camera.model.width) for camera in rig)
    factor = max(1, round(tallest / WORKING_HEIGHT_PX))
    small = (replace(c, model=c.model.resized(c.model.width // factor, c.model.height // factor)) for c in rig)
    return replace(rig, cameras=tuple(small)), factor


@dataclass(frozen=True, eq=False)
class Handles:
    """Points by which a body is taken with the mouse: its landmarks, and the origins of links that have none there.

    Attributes
    ----------
    names : of the landmarks and links.
    links : (n,) index of the link that each is fixed to.
    points : (n, 3) meters, in the link.
    bones : pairs of handles between which a line is drawn.
    """

    names: tuple[str, ...]
    links: np.ndarray
    points: np.ndarray
    bones: tuple[tuple[int, int], ...]

    def world(self, body: Configuration) -> np.ndarray:
        """(n, 3) meters."""
        T = body.Ts_world_link[self.links]
        return np.einsum("nij,nj->ni", T[:, :3, :3], self.points) + T[:, :3, 3]


_SAME_PLACE_M = 0.01


def handles_of(model: ArticulatedModel) -> Handles:
    """The handles of a body."""
    body = Configuration(model, State.neutral(model))
    names, links, points = list(model.landmark_names), list(model.landmark_links), list(model.landmark_positions)
    at = [*body.landmarks_world]
    origin_of: dict[int, int] = {}
    for link, name in enumerate(model.chain.links):
        origin = body.Ts_world_link[link, :3, 3]
        near = [i for i, point in enumerate(at) if np.linalg.norm(point - origin) < _SAME_PLACE_M]
        if not near:
            near = [len(names)]
            names.append(name)
            links.append(link)
            points.append(np.zeros(3))
            at.append(origin)
        origin_of[link] = near[0]
    bones = [(origin_of[int(p)], origin_of[i]) for i, p in enumerate(model.chain.parents) if p >= 0]
    bones += [(origin_of[int(link)], i) for i, link in enumerate(model.landmark_links)]
    used = tuple(dict.fromkeys((a, b) for a, b in bones if a != b))
    return Handles(tuple(names), np.array(links, dtype=np.int64), np.array(points).reshape(-1, 3), used)


class OutlineDrawer:
    """Outlines of one body in the cameras of one rig, in pixels of its full images."""

    def __init__(self, rig: CameraRig, model: ArticulatedModel):
        self.handles = handles_of(model)
        self._rig, self._model = rig, model
        self._small, self._factor = working_rig(rig)

    def colors(self) -> list[str]:
        """Of the parts, as CSS writes them."""
        return [f"rgb({r} {g} {b})" for b, g, r in part_colors(self._model)[1:].tolist()]

    def drawn(self, state: State) -> dict[str, Any]:
        """By camera: ``parts``, pairs of a part's index and a closed line [u, v, u, v, ...]; ``handles``, [u, v] or None."""
        body = Configuration(self._model, state)
        places = self.handles.world(body)
        return {
            camera.name: {"parts": self._parts(body, small), "handles": _pixels(camera, places)}
            for camera, small in zip(self._rig, self._small, strict=True)
        }

    def _parts(self, body: Configuration, camera: Camera) -> list[tuple[int, list[float]]]:
        lines = ((part, (line + 0.5) * self._factor - 0.5) for part, line in part_outlines(body, camera))
        return [(part, np.round(pixels, 1).ravel().tolist()) for part, pixels in lines]


def _pixels(camera: Camera, points: np.ndarray) -> list[list[float] | None]:
    pixels, valid = camera.project(points)
    return [np.round(pixel, 2).tolist() if ok else None for pixel, ok in zip(pixels, valid, strict=True)]
