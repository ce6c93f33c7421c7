"""The recorded images of a rig by camera and number, in any order: decoded when asked for, and kept while there is room."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import cv2
import numpy as np

from ..camera.rig import CameraRig
from ..errors import FileFormatError, SourceError, TrackerError, UnknownNameError
from ..loaders.decoding import SourceImage
from ..loaders.images.file_sources import READ_ON
from ..loaders.images.source import ImageSource, SourceOptions
from ..observation.image_set import CameraImage, ImageSet
from ..runs.image_sets import opened_sources
from ..runs.set_formation import make_synchronizer
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
        source, numbers = self._sources[camera], _numbers(self._sources[camera])
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
        numbers = _numbers(self._source)
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


def _numbers(source: ImageSource) -> range:
    return range(source.options.start, source.options.start + source.n_images)


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
