"""Images from one node to another in the same process: neither copied, nor serialized, nor sent."""

from __future__ import annotations

from collections.abc import Callable, Collection

from ..loaders.decoding import SourceImage
from ..observation.image_set import ENCODINGS, CameraImage


class DirectImages:
    """Hands the images of cameras that one node publishes to another that listens; both may use any thread.

    Parameters
    ----------
    cameras : names of those that are handed over.
    """

    def __init__(self, cameras: Collection[str]):
        self.cameras = frozenset(cameras)
        self._receivers: dict[str, Callable[[CameraImage], None]] = {}

    def listen(self, camera: str, receive: Callable[[CameraImage], None]) -> None:
        """Call ``receive`` with each image of a camera, in the thread that publishes it.

        Parameters
        ----------
        camera : its name.
        receive : must not write to the pixels.
        """
        self._receivers[camera] = receive

    def leave(self, camera: str) -> None:
        """Listen to a camera no more."""
        self._receivers.pop(camera, None)

    def has_listener(self, camera: str) -> bool:
        """Whether somebody listens to a camera."""
        return camera in self._receivers

    def hand_over(self, camera: str, image: SourceImage, stamp_ns: int) -> None:
        """Give an image to who listens.

        Parameters
        ----------
        camera : whose image it is.
        image : with pixels.
        stamp_ns : time of exposure.
        """
        receive = self._receivers.get(camera)
        if receive is None:
            return
        pixels, encoding = image.pixels, image.encoding
        if pixels is None or encoding not in ENCODINGS:  # a mosaic has no place in the core
            pixels, encoding = image.bgr, "bgr8"
        shared = pixels.view()
        shared.flags.writeable = False
        receive(CameraImage(camera, stamp_ns, shared, encoding))
