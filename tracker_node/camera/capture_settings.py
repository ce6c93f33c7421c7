"""How a camera's images are taken, and as what they are published."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

BAYER_PATTERNS = ("rggb", "bggr", "gbrg", "grbg")
"""Colors of the first two lines of a mosaic, from the left."""
_MOSAICS = {"RGGB": "rggb", "BA81": "bggr", "GBRG": "gbrg", "GRBG": "grbg"}
PUBLISHED = ("color", "mono", "native", "jpeg")


@dataclass(frozen=True)
class CaptureSettings:
    """What is asked of a source; a file or a stream has no exposure to set, and says so.

    Parameters
    ----------
    pixel_format : FOURCC that a device is asked for, such as ``MJPG``, ``YUYV``, ``GREY``; None leaves it to the device.
    rate_hz : images per second that a device is asked for.
    exposure_us : exposure time, microseconds; None leaves the device as it is.
    gain : in the units of the device.
    controls : further controls of the device by name (``white_balance_automatic``), as ``v4l2-ctl --list-ctrls`` has them.
    bayer : one of `BAYER_PATTERNS` where gray images are a color mosaic; pixel formats of devices that are one say it.
    publish : ``color`` (bgr8), ``mono`` (mono8), ``native`` (gray images as mono8, mosaics as ``bayer_*8``), or ``jpeg``: the
        bytes of a source of JPEG images as they are.
    camera_info_url : where the lens is kept, see `loaders.rig.camera_info`; None for that of the rig.
    """

    pixel_format: str | None = None
    rate_hz: float | None = None
    exposure_us: float | None = None
    gain: int | None = None
    controls: Mapping[str, int] = field(default_factory=dict)
    bayer: str | None = None
    publish: str = "color"
    camera_info_url: str | None = None

    def __post_init__(self):
        if self.pixel_format is not None and not re.fullmatch(r"[A-Z0-9 ]{4}", self.pixel_format):
            raise ValueError(f"expected a pixel format of four capitals or digits, got {self.pixel_format!r}")
        for name in ("rate_hz", "exposure_us"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < 1e7:
                raise ValueError(f"expected a positive {name}, got {value}")
        if self.bayer is None and self.pixel_format in _MOSAICS:
            object.__setattr__(self, "bayer", _MOSAICS[self.pixel_format])
        if self.bayer not in (None, *BAYER_PATTERNS):
            raise ValueError(f"expected a Bayer pattern of {BAYER_PATTERNS}, got {self.bayer!r}")
        if self.publish not in PUBLISHED:
            raise ValueError(f"expected one of {PUBLISHED} to publish, got {self.publish!r}")

    @property
    def of_device(self) -> tuple[str, ...]:
        """Names of the settings given that only a device can follow."""
        given = [name for name in ("pixel_format", "exposure_us", "gain") if getattr(self, name) is not None]
        return (*given, *self.controls)
