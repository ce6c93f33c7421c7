"""Images with their stamps: of one camera, and of all cameras at one time step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..model.configuration import Neighbor
from .keypoints.people import People

ENCODINGS = {"bgr8": 3, "rgb8": 3, "mono8": 1}


@dataclass(frozen=True, eq=False)
class CameraImage:
    """One image of one camera.

    ``pixels`` is uint8, (height, width, 3) for ``bgr8``/``rgb8``, (height, width) for ``mono8``; it may be a read-only view.
    ``stamp_ns`` is the time of exposure in integer nanoseconds. ``people`` is what a detector has found in it; None: none has
    looked. ``people_stamp_ns`` is the stamp of the image that they were found in, where that is an earlier one of this camera;
    None: this one.
    """

    camera: str
    stamp_ns: int
    pixels: np.ndarray
    encoding: str = "bgr8"
    people: People | None = None
    people_stamp_ns: int | None = None

    def __post_init__(self):
        if self.encoding not in ENCODINGS:
            raise ValueError(f"expected an encoding of {sorted(ENCODINGS)}, got {self.encoding!r}")
        channels = ENCODINGS[self.encoding]
        if self.pixels.dtype != np.uint8 or self.pixels.ndim != (3 if channels == 3 else 2):
            raise ValueError(f"expected uint8 pixels for {self.encoding}, got {self.pixels.dtype} {self.pixels.shape}")

    @property
    def bgr(self) -> np.ndarray:
        """(height, width, 3) uint8 in BGR; a copy only for other encodings."""
        if self.encoding == "bgr8":
            return self.pixels
        if self.encoding == "rgb8":
            return self.pixels[:, :, ::-1]
        return np.repeat(self.pixels[:, :, None], 3, axis=2)


@dataclass(frozen=True, eq=False)
class ImageSet:
    """Images of one time step; cameras that gave none are absent.

    ``stamp_ns`` is the set's reference stamp (that of its earliest image); ``images`` is in the order of the rig.
    ``joint_positions``: what a robot says of its joints at that stamp, radians or meters by the axis's name. ``own``,
    ``neighbors``: where the body and others that are followed in these images are expected; None, empty: nobody has said.
    """

    stamp_ns: int
    images: tuple[CameraImage, ...]
    joint_positions: Mapping[str, float] = field(default_factory=dict)
    own: Neighbor | None = None
    neighbors: tuple[Neighbor, ...] = ()

    def get(self, camera: str) -> CameraImage | None:
        for image in self.images:
            if image.camera == camera:
                return image
        return None

    @property
    def cameras(self) -> tuple[str, ...]:
        return tuple(image.camera for image in self.images)
