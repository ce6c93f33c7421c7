"""Cameras of this computer through Video4Linux2: what a device is, and its controls, by the kernel's ioctl interface.

Images themselves are read by OpenCV (`loaders.images.live_capture`), which has no words for most of what can be wrong before.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import stat
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from ...camera.rig import CaptureSettings
from ...errors import SourceError, UnknownNameError

# linux/videodev2.h; struct v4l2_capability, v4l2_queryctrl, v4l2_control
CAPABILITY = struct.Struct("=16s32s32sIII12x")
QUERYCTRL = struct.Struct("=II32siiiiI8x")
CONTROL = struct.Struct("=Ii")
_READ, _WRITE = 2, 1


def _ioctl_number(direction: int, number: int, size: int) -> int:
    return direction << 30 | size << 16 | ord("V") << 8 | number


VIDIOC_QUERYCAP = _ioctl_number(_READ, 0, CAPABILITY.size)
VIDIOC_G_CTRL = _ioctl_number(_READ | _WRITE, 27, CONTROL.size)
VIDIOC_S_CTRL = _ioctl_number(_READ | _WRITE, 28, CONTROL.size)
VIDIOC_QUERYCTRL = _ioctl_number(_READ | _WRITE, 36, QUERYCTRL.size)
CAP_VIDEO_CAPTURE, CAP_DEVICE_CAPS = 0x1, 0x80000000
FLAG_DISABLED, FLAG_NEXT_CTRL = 0x1, 0x80000000
TYPE_CLASS = 6
CID_GAIN, CID_EXPOSURE_AUTO, CID_EXPOSURE_ABSOLUTE = 0x00980913, 0x009A0901, 0x009A0902
EXPOSURE_MANUAL = 1
_EXPOSURE_UNIT_US = 100.0  # of CID_EXPOSURE_ABSOLUTE


@dataclass(frozen=True)
class DeviceControl:
    """One control of a device; ``name`` is written as v4l2-ctl writes it (``white_balance_automatic``)."""

    id: int
    name: str
    minimum: int
    maximum: int
    step: int


class VideoDevice:
    """An open video device; a context manager.

    Raises
    ------
    SourceError : no such device, no permission, or no camera; in words that say what to do.
    """

    def __init__(self, path: str):
        self.path = path
        self._file = _opened(path)
        try:
            self.name = self._capture_name()
        except SourceError:
            os.close(self._file)
            raise

    def __enter__(self) -> VideoDevice:
        return self

    def __exit__(self, *_) -> None:
        os.close(self._file)

    def _capture_name(self) -> str:
        buffer = bytearray(CAPABILITY.size)
        try:
            fcntl.ioctl(self._file, VIDIOC_QUERYCAP, buffer)
        except OSError as error:
            raise SourceError(self.path, f"is not a video device ({error.strerror})") from None
        _, card, _, _, of_all, of_this = CAPABILITY.unpack(buffer)
        if not (of_this if of_all & CAP_DEVICE_CAPS else of_all) & CAP_VIDEO_CAPTURE:
            raise SourceError(self.path, f"gives no images (of '{_text(card)}' another of its devices does, mostly ...-index0)")
        return _text(card)

    def controls(self) -> Iterator[DeviceControl]:
        """All controls that are not disabled."""
        number = 0
        while True:
            buffer = bytearray(QUERYCTRL.pack(number | FLAG_NEXT_CTRL, 0, b"", 0, 0, 0, 0, 0))
            try:
                fcntl.ioctl(self._file, VIDIOC_QUERYCTRL, buffer)
            except OSError:
                return
            number, kind, name, minimum, maximum, step, _, flags = QUERYCTRL.unpack(buffer)
            if kind != TYPE_CLASS and not flags & FLAG_DISABLED:
                yield DeviceControl(number, _control_name(_text(name)), minimum, maximum, step)

    def value(self, control: DeviceControl) -> int:
        """Current value of a control."""
        buffer = bytearray(CONTROL.pack(control.id, 0))
        fcntl.ioctl(self._file, VIDIOC_G_CTRL, buffer)
        return CONTROL.unpack(buffer)[1]

    def apply(self, settings: CaptureSettings) -> None:
        """Set exposure, gain and the other controls that ``settings`` give; a device may refuse, then nothing is hidden.

        Raises
        ------
        UnknownNameError : a control that the device does not have.
        SourceError : a value beyond its range, or one that the device refuses.
        """
        known = {control.name: control for control in self.controls()}
        for name, value in _wanted(settings, {control.id: control.name for control in known.values()}, self.path):
            if name not in known:
                raise UnknownNameError(f"control of {self.path}", name, known)
            self._set(known[name], value)

    def _set(self, control: DeviceControl, value: int) -> None:
        if not control.minimum <= value <= control.maximum:
            allowed = f"from {control.minimum} to {control.maximum}"
            raise SourceError(self.path, f"control {control.name}: expected a value {allowed}, got {value}")
        try:
            fcntl.ioctl(self._file, VIDIOC_S_CTRL, bytearray(CONTROL.pack(control.id, value)))
        except OSError as error:
            raise SourceError(self.path, f"control {control.name} cannot be set to {value} ({error.strerror})") from None


def _wanted(settings: CaptureSettings, names: Mapping[int, str], path: str) -> Iterator[tuple[str, int]]:
    """(name, value) in the order in which they must be set: automatic exposure is off before a fixed one."""
    if settings.exposure_us is not None:
        if CID_EXPOSURE_ABSOLUTE not in names:
            raise SourceError(path, "its exposure time cannot be set (exposure_us)")
        if CID_EXPOSURE_AUTO in names:
            yield names[CID_EXPOSURE_AUTO], EXPOSURE_MANUAL
    yield from settings.controls.items()
    if settings.exposure_us is not None:
        yield names[CID_EXPOSURE_ABSOLUTE], max(1, round(settings.exposure_us / _EXPOSURE_UNIT_US))
    if settings.gain is not None:
        if CID_GAIN not in names:
            raise SourceError(path, "its gain cannot be set")
        yield names[CID_GAIN], settings.gain


def _opened(path: str) -> int:
    try:
        if not stat.S_ISCHR(os.stat(path).st_mode):
            raise SourceError(path, "is not a video device (a file: write it without v4l2:)")
        return os.open(path, os.O_RDWR | os.O_NONBLOCK)
    except FileNotFoundError:
        here = sorted(str(link) for link in Path("/dev/v4l/by-id").glob("*-index0"))
        raise SourceError(path, f"no such device, is it plugged in? There are: {', '.join(here) or 'none'}") from None
    except PermissionError:
        raise SourceError(path, "no permission to use this device (sudo usermod -aG video $USER, then log in again)") from None
    except OSError as error:
        said = "somebody else is using this device" if error.errno == errno.EBUSY else str(error.strerror)
        raise SourceError(path, said) from None


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode(errors="replace")


def _control_name(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
