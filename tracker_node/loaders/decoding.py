"""One image of a source, and what is done to it on the way: mosaics to colors, area averaging, JPEG left as it is."""

from __future__ import annotations

import array
from dataclasses import dataclass

import cv2
import numpy as np

from ..camera.rig import CaptureSettings
from ..errors import SourceError, shown
from ..observation.image_set import ENCODINGS

JPEG = "jpeg"
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm")
_REDUCED = {1: cv2.IMREAD_COLOR, 2: cv2.IMREAD_REDUCED_COLOR_2, 4: cv2.IMREAD_REDUCED_COLOR_4, 8: cv2.IMREAD_REDUCED_COLOR_8}
# OpenCV counts the pattern from the second line and column; these aliases go by the first.
_FROM_BAYER = {name: getattr(cv2, f"COLOR_Bayer{name.upper()}2BGR") for name in ("rggb", "bggr", "gbrg", "grbg")}
_SAME_ENCODING = {"8UC1": "mono8", "8UC3": "bgr8", "8UC4": "bgra8", "uyvy": "yuv422", "yuyv": "yuv422_yuy2"}  # other names
_BAYER_ENCODING = {f"bayer_{name}8": name for name in _FROM_BAYER}
_MOSAICS = {f"bayer_{name}{bits}": code for name, code in _FROM_BAYER.items() for bits in (8, 16)}
# What else cameras of ROS send, of which images of the core are made: numbers a pixel, and how they become bgr8. Not 16UC1: such
# images are depths.
_CONVERTED: dict[str, tuple[int, int | None]] = {
    "bgra8": (4, cv2.COLOR_BGRA2BGR), "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY), "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2),
    "mono16": (1, None), "bgr16": (3, None), "rgb16": (3, cv2.COLOR_RGB2BGR),
    **{name: (1, code) for name, code in _MOSAICS.items()},
}  # fmt: skip
_TWELVE_BITS = range(4, 16)  # of 256, the brightest where drivers leave 12 bits where they are; black is darker


@dataclass(frozen=True, eq=False)
class SourceImage:
    """Pixels as published, or a JPEG that nobody has decoded.

    ``pixels`` is (h, w, 3) for ``bgr8``, (h, w) for ``mono8`` and ``bayer_*8``, None for ``jpeg``. ``original`` is what the
    source has given: a JPEG, or, where they are to be kept, pixels.
    """

    stamp_ns: int
    pixels: np.ndarray | None
    encoding: str
    original: np.ndarray | bytes | None = None

    @property
    def jpeg(self) -> bytes:
        """The JPEG that the source has given; empty if it was none."""
        return self.original if isinstance(self.original, bytes) else b""

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) as published."""
        return content_size(self.jpeg if self.pixels is None else self.pixels)

    @property
    def bgr(self) -> np.ndarray:
        """(h, w, 3) uint8.

        Raises
        ------
        SourceError : a JPEG that cannot be decoded.
        """
        if self.pixels is None:
            return decode_jpeg(self.jpeg)
        if self.encoding in _BAYER_ENCODING:
            return cv2.cvtColor(self.pixels, _FROM_BAYER[_BAYER_ENCODING[self.encoding]])
        return self.pixels if self.pixels.ndim == 3 else cv2.cvtColor(self.pixels, cv2.COLOR_GRAY2BGR)


@dataclass(frozen=True)
class Preparation:
    """What becomes of each image between its source and its publication.

    Parameters
    ----------
    settings : pattern of a mosaic, and as what images are published.
    size : (width, height) to resample to, or None.
    source : for errors.
    keep : hand on the source's own pixels too.

    Raises
    ------
    SourceError : a mosaic, or a JPEG as it is, cannot be resampled.
    """

    settings: CaptureSettings
    size: tuple[int, int] | None
    source: str
    keep: bool = False

    def __post_init__(self):
        raw_mosaic = self.settings.publish == "native" and self.settings.bayer
        if self.size is not None and (raw_mosaic or self.settings.publish == JPEG):
            what = "a Bayer mosaic" if raw_mosaic else "a JPEG that is passed on as it is"
            raise SourceError(self.source, f"{what} cannot be resampled; publish color, or leave its size")

    def image(self, stamp_ns: int, content: np.ndarray | bytes) -> SourceImage:
        """The image to publish of what a source has given.

        Parameters
        ----------
        stamp_ns, content : nanoseconds; pixels (h, w[, 3]), or the bytes of a JPEG.

        Returns
        -------
        Image in the encoding and size that are published.

        Raises
        ------
        SourceError : what is to be passed on as JPEG is none, or a JPEG cannot be decoded.
        """
        if self.settings.publish == JPEG:
            if not isinstance(content, bytes):
                raise SourceError(self.source, "does not give JPEG images that could be passed on as they are")
            return SourceImage(stamp_ns, None, JPEG, content)
        pixels = decode_jpeg(content, self.size) if isinstance(content, bytes) else content
        original = content if self.keep or isinstance(content, bytes) else None
        return SourceImage(stamp_ns, *self._converted(pixels), original)

    def _converted(self, pixels: np.ndarray) -> tuple[np.ndarray, str]:
        pattern, publish = self.settings.bayer, self.settings.publish
        if pattern is not None:
            mosaic = pixels if pixels.ndim == 2 else pixels[:, :, 0]
            if publish == "native":
                return mosaic, f"bayer_{pattern}8"
            pixels = cv2.cvtColor(mosaic, _FROM_BAYER[pattern])
        pixels = _resampled(pixels, self.size)
        if pixels.ndim == 3 and publish == "mono":
            return cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), "mono8"
        if pixels.ndim == 2 and publish == "color":
            return cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR), "bgr8"
        return pixels, "bgr8" if pixels.ndim == 3 else "mono8"


def check_fields(settings: CaptureSettings, source: str) -> None:
    """Refuse to take mosaics, or JPEG images that are to be passed on, apart into fields.

    Parameters
    ----------
    settings, source : of the camera; name of its source, for messages.

    Raises
    ------
    SourceError : naming the source.
    """
    if settings.publish == JPEG or settings.bayer:
        raise SourceError(source, "interlaced images cannot be mosaics, nor passed on as JPEG")


def _resampled(pixels: np.ndarray, size: tuple[int, int] | None) -> np.ndarray:
    """An image at another size (width, height): area averages when it shrinks, linear interpolation when it grows."""
    if size is None or (pixels.shape[1], pixels.shape[0]) == tuple(size):
        return pixels
    shrinks = size[0] < pixels.shape[1]
    return cv2.resize(pixels, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)


def decoded(data: bytes | array.array | np.ndarray, flags: int = cv2.IMREAD_COLOR) -> np.ndarray | None:
    """Pixels of an encoded image (JPEG, PNG, ...).

    Parameters
    ----------
    data, flags : file's content; of ``cv2.imdecode``.

    Returns
    -------
    Pixels; None where the image is damaged, or larger than OpenCV may read.
    """
    content = np.frombuffer(data, np.uint8)
    try:
        return cv2.imdecode(content, flags) if content.size else None
    except cv2.error:
        return None


def decoded_message(data: bytes | array.array | np.ndarray, form: str) -> np.ndarray | None:
    """Pixels of a sensor_msgs/CompressedImage.

    Parameters
    ----------
    data, form : of the message; its ``format`` begins with the encoding of the camera's own images, which may be a mosaic. It is
        still one where what was compressed has no colors.

    Returns
    -------
    (h, w, 3) BGR, as it lies in the file: calibrations know nothing of how somebody held a camera; None for a damaged image.
    """
    pixels = decoded(data, cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if pixels is None or pixels.ndim == 3:
        return pixels
    return cv2.cvtColor(pixels, _MOSAICS.get(_own_encoding(form), cv2.COLOR_GRAY2BGR))


def is_plain_jpeg(data: bytes, form: str) -> bool:
    """Whether an image can be handed on as it is.

    Parameters
    ----------
    data, form : of the message, as of `decoded_message`.

    Returns
    -------
    True for a JPEG, but for a mosaic, whose colors are still to be made.
    """
    return data[:2] == b"\xff\xd8" and _own_encoding(form) not in _MOSAICS


def _own_encoding(form: str) -> str:
    return form.partition(";")[0].strip()


def decode_jpeg(data: bytes, size: tuple[int, int] | None = None) -> np.ndarray:
    """Pixels of a JPEG.

    Parameters
    ----------
    data : file's content.
    size : (width, height) to deliver; a half, a quarter or an eighth is never computed at full size. None for the file's.

    Returns
    -------
    (h, w, 3) BGR.

    Raises
    ------
    SourceError : damaged.
    """
    width, height = jpeg_size(data)
    factor = width // size[0] if size else 1
    exact = size is not None and (factor * size[0], factor * size[1]) == (width, height)
    flags = _REDUCED.get(factor, cv2.IMREAD_COLOR) if exact else cv2.IMREAD_COLOR
    pixels = decoded(data, flags | cv2.IMREAD_IGNORE_ORIENTATION)
    if pixels is None:
        raise SourceError("JPEG image", "cannot be decoded")
    return _resampled(pixels, size)


def jpeg_size(data: bytes) -> tuple[int, int]:
    """(width, height) from the frame header of a JPEG (ITU-T T.81, B.2.2).

    Raises
    ------
    SourceError : no JPEG, or one that ends before its frame header.
    """
    at = 2
    while data[:2] == b"\xff\xd8" and at + 9 <= len(data) and data[at] == 0xFF:
        kind = data[at + 1]
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            return int.from_bytes(data[at + 7 : at + 9], "big"), int.from_bytes(data[at + 5 : at + 7], "big")
        at += 1 if kind == 0xFF else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    raise SourceError("JPEG image", "has no frame header")


def is_whole(data: bytes) -> bool:
    """Whether a JPEG or a PNG has an end, perhaps with something behind it; a thumbnail's end within it is none."""
    if data[:2] != b"\xff\xd8":
        return b"IEND" in data
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:  # up to the first scan
        at += 1 if data[at + 1] == 0xFF else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return data.find(b"\xff\xd9", at) >= 0


def content_size(content: np.ndarray | bytes) -> tuple[int, int]:
    """(width, height) of pixels or of a JPEG; raises SourceError for bytes that are none."""
    return jpeg_size(content) if isinstance(content, bytes) else (content.shape[1], content.shape[0])


def bayer_pattern(encoding: str) -> str | None:
    """``rggb`` of ``bayer_rggb8``; None for other encodings."""
    return _BAYER_ENCODING.get(encoding)


def pixels_of(
    camera: str, size: tuple[int, int], encoding: str, step: int, content: np.ndarray, what: str = "image message",
    big_endian: bool = False,
) -> tuple[np.ndarray, str]:  # fmt: skip
    """Pixels of a sensor_msgs/Image.

    Parameters
    ----------
    camera, size : name, for messages; (width, height).
    encoding, step, content : as in the message; bytes from row to row; (n,) uint8.
    what : the image, for messages.
    big_endian : order of the bytes of 16 bits, whose upper eight are taken.

    Returns
    -------
    (height, width[, 3]) uint8, a view of ``content`` or, where rows have padding or pixels are converted, a read-only copy; and
    the name that the core has for their encoding.

    Raises
    ------
    SourceError : naming the camera, for an encoding or a size that cannot be used.
    """
    (width, height), encoding = size, _SAME_ENCODING.get(encoding, encoding)
    if encoding not in ENCODINGS and encoding not in _CONVERTED:
        raise SourceError(camera, f"image encoding: expected one of {sorted(ENCODINGS | _CONVERTED)}, got {shown(encoding)}")
    channels, code = (ENCODINGS[encoding], None) if encoding in ENCODINGS else _CONVERTED[encoding]
    wide = encoding.endswith("16")
    used = width * channels * (2 if wide else 1)
    if step < used or content.size < height * step or not height * width:
        raise SourceError(camera, f"{what} contradicts itself: {width}x{height}, step {step}, {content.size} bytes")
    rows = content[: height * step].reshape(height, step)[:, :used]
    if wide:
        rows = rows[:, 0 if big_endian else 1 :: 2]
    if step != used or encoding not in ENCODINGS:  # compiled code is made for rows without padding, and images that do not change
        rows = np.ascontiguousarray(rows)
        if wide and rows.max() in _TWELVE_BITS:
            problem = "expected 16 bits a number, of which the upper eight are taken, got none above 4095"
            raise SourceError(camera, f"{what}: {encoding}: {problem}: 12 bits, to be shifted by four, or a dark image")
        if code is not None:
            try:
                rows = cv2.cvtColor(rows if channels == 1 else rows.reshape(height, width, channels), code)
            except cv2.error as error:  # of half a pixel of a mosaic, or of a pair
                raise SourceError(camera, f"{what}: {encoding} of {width}x{height} pixels cannot be converted") from error
        rows.flags.writeable = False
    if encoding not in ENCODINGS:
        encoding, channels = ("mono8", 1) if encoding == "mono16" else ("bgr8", 3)
    return rows if channels == 1 else rows.reshape(height, width, channels), encoding
