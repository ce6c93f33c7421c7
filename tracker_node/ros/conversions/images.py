"""What a camera says, in messages of ROS: Image, CompressedImage, CameraInfo; and the images in them."""

from __future__ import annotations

import struct

import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from ...camera.model import CameraModel
from ...errors import SourceError, shown
from ...loaders.bag.message_types import NS_PER_S
from ...loaders.decoding import bayer_pattern, decoded_message, pixels_of
from ...observation.image_set import ENCODINGS, CameraImage
from ...runs import messages
from .messages import fill, message_of


def image_message(stamp_ns: int, frame_id: str, pixels: np.ndarray, encoding: str = "bgr8") -> Image:
    """Image of a uint8 array (height, width[, 3]).

    Parameters
    ----------
    stamp_ns : time of exposure.
    frame_id : name of the camera's optical frame.
    pixels : (height, width[, 3]) uint8.
    encoding : as ROS names it.

    Returns
    -------
    message : with a copy of the pixels.
    """
    return message_of(Image, messages.image(stamp_ns, frame_id, pixels, encoding))


class ImageBuffer:
    """One Image message whose memory is used again for every image of a camera."""

    def __init__(self, frame_id: str, width: int, height: int, encoding: str = "bgr8"):
        channels = 1 if bayer_pattern(encoding) else ENCODINGS[encoding]
        self._shape = (height, width, 3) if channels == 3 else (height, width)
        self._frame_id, self._encoding, self.message = frame_id, encoding, Image()

    def fill(self, stamp_ns: int, pixels: np.ndarray) -> Image:
        """The message with these pixels; valid until the next call.

        Parameters
        ----------
        stamp_ns : time of exposure.
        pixels : (height, width[, 3]) uint8.

        Returns
        -------
        message : the one of this buffer.
        """
        if pixels.shape != self._shape or pixels.dtype != np.uint8:
            raise ValueError(f"expected uint8 pixels {self._shape}, got {pixels.dtype} {pixels.shape}")
        return fill(self.message, messages.image(stamp_ns, self._frame_id, pixels, self._encoding))


def camera_info_message(stamp_ns: int, frame_id: str, model: CameraModel) -> CameraInfo:
    """CameraInfo of a lens.

    Parameters
    ----------
    stamp_ns : time of exposure.
    frame_id : name of the camera's optical frame.
    model : the lens.

    Returns
    -------
    message : see `runs.messages.camera_info`.
    """
    return message_of(CameraInfo, messages.camera_info(stamp_ns, frame_id, model))


def camera_image_of(camera: str, message: Image) -> CameraImage:
    """The message's pixels as a view; a copy where rows have padding at their ends.

    Parameters
    ----------
    camera : its name.
    message : sensor_msgs/Image.

    Returns
    -------
    image : with the stamp of the message.

    Raises
    ------
    SourceError : naming the camera, for an encoding or a size that cannot be used.
    """
    content = np.frombuffer(message.data, np.uint8)
    size, swapped = (message.width, message.height), bool(message.is_bigendian)
    pixels, encoding = pixels_of(camera, size, message.encoding, message.step, content, big_endian=swapped)
    return CameraImage(camera, _stamp_ns(camera, message.header.stamp.sec, message.header.stamp.nanosec), pixels, encoding)


def _stamp_ns(camera: str, seconds: int, nanoseconds: int) -> int:
    if nanoseconds >= NS_PER_S:
        raise SourceError(camera, f"header.stamp.nanosec: expected less than {NS_PER_S}, got {nanoseconds}")
    return seconds * NS_PER_S + nanoseconds


def decode_raw_image(camera: str, data: bytes) -> CameraImage:
    """Image from its serialized form (CDR), without building a message: the pixels are a read-only view of ``data``.

    Parameters
    ----------
    camera : its name.
    data : a serialized sensor_msgs/Image.

    Returns
    -------
    image : with the stamp of the message.

    Raises
    ------
    SourceError : naming the camera, when the bytes are no Image of a usable encoding.
    """
    try:
        reader = _CdrReader(data)
        seconds, nanoseconds = reader.int32(), reader.uint32()
        reader.string()  # frame_id
        height, width, encoding = reader.uint32(), reader.uint32(), reader.string()
        swapped = bool(reader.uint8())  # the order of the bytes of wider numbers
        step, size = reader.uint32(), reader.uint32()
        content = np.frombuffer(data, np.uint8, count=size, offset=4 + reader.offset)
    except (struct.error, IndexError, ValueError, UnicodeDecodeError) as error:
        raise SourceError(camera, f"damaged image message ({error})") from error
    pixels, encoding = pixels_of(camera, (width, height), encoding, step, content, big_endian=swapped)
    return CameraImage(camera, _stamp_ns(camera, seconds, nanoseconds), pixels, encoding)


def raw_stamp_ns(data: bytes) -> int | None:
    """Stamp of a serialized sensor_msgs/Image, without a look at the rest; None where the bytes have none."""
    try:
        reader = _CdrReader(data)
        return reader.int32() * NS_PER_S + reader.uint32()
    except (struct.error, IndexError, ValueError):
        return None


class _CdrReader:
    """Plain CDR behind its four bytes of encapsulation; values are aligned to their size."""

    def __init__(self, data: bytes):
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise ValueError("not CDR")
        self._data, self._order, self.offset = data, "<" if data[1] == 1 else ">", 0

    def _word(self, kind: str) -> int:
        self.offset = (self.offset + 3) & ~3
        (value,) = struct.unpack_from(self._order + kind, self._data, 4 + self.offset)
        self.offset += 4
        return value

    def uint8(self) -> int:
        self.offset += 1
        return self._data[3 + self.offset]

    def int32(self) -> int:
        return self._word("i")

    def uint32(self) -> int:
        return self._word("I")

    def string(self) -> str:
        n = self.uint32()
        start = 4 + self.offset
        if n < 1 or start + n > len(self._data):
            raise ValueError("a string reaches beyond the end")
        self.offset += n
        return bytes(self._data[start : start + n - 1]).decode()


def jpeg_message(stamp_ns: int, frame_id: str, data: np.ndarray | bytes) -> CompressedImage:
    """A JPEG as it is; `runs.messages.jpeg_of` makes one of a BGR image.

    Parameters
    ----------
    stamp_ns : time of exposure.
    frame_id : name of the camera's optical frame.
    data : the bytes of the JPEG.

    Returns
    -------
    message : with these bytes.
    """
    return message_of(CompressedImage, messages.compressed_image(stamp_ns, frame_id, data))


def bgr_of_compressed(camera: str, message: CompressedImage) -> CameraImage:
    """Decoded JPEG or PNG.

    Parameters
    ----------
    camera : its name.
    message : sensor_msgs/CompressedImage.

    Returns
    -------
    image : BGR, with the stamp of the message.

    Raises
    ------
    SourceError : naming the camera, when it cannot be decoded.
    """
    bgr = decoded_message(message.data, message.format)
    if bgr is None:
        raise SourceError(camera, f"cannot decode a compressed image of format {shown(message.format)}")
    return CameraImage(camera, _stamp_ns(camera, message.header.stamp.sec, message.header.stamp.nanosec), bgr)
