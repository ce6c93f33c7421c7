"""Live cameras through OpenCV: devices of this computer and streams of the network, connected again when they are lost."""

from __future__ import annotations

import os
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from ...camera.rig import CaptureSettings
from ...errors import SourceError, TrackerError, without_password
from ..source_address import DEVICE, SourceAddress
from .v4l2_device import VideoDevice

OPEN_TIMEOUT_MS = READ_TIMEOUT_MS = 4000  # a stream that says nothing for so long is gone
_CLOCK_SLACK_NS = 10**10  # a device's stamp farther than this from now is of another clock
_WAITS_S, _MOST_STORED = 0.02, 300  # how long a stream without a rate lets wait; images that can have been stored
_MJPG = cv2.VideoWriter.fourcc(*"MJPG")
_UNCONVERTED = ("GREY", "BA81", "GBRG", "GRBG", "RGGB", "Y8  ")  # one byte a pixel


class LiveCapture(ABC):
    """An open connection; ``read`` blocks until there is an image, at most some seconds."""

    @abstractmethod
    def read(self) -> tuple[int, np.ndarray | bytes] | None:
        """Own stamp in ns of the day's clock, and pixels (h, w[, 3]) or a JPEG; None when there is no image any more."""

    @abstractmethod
    def close(self) -> None: ...


class _OpenCvCapture(LiveCapture):
    def __init__(self, name: str, backend: int, parameters: list[int]):
        self._capture = cv2.VideoCapture(name, backend, parameters)
        self._jpeg = False

    def read(self) -> tuple[int, np.ndarray | bytes] | None:
        if not self._grab():
            return None
        stamp_ns = self._stamp_ns()
        ok, image = self._capture.retrieve()
        if not ok or image is None:
            return None
        return stamp_ns, image.tobytes() if self._jpeg else image

    def _grab(self) -> bool:
        return self._capture.grab()

    def _stamp_ns(self) -> int:
        return time.time_ns()

    def close(self) -> None:
        self._capture.release()


class StreamCapture(_OpenCvCapture):
    """A stream of the network; one of JPEG images gives these as they come.

    To learn what a stream is, FFmpeg reads up to a second of it. These images would all come at once, with stamps of the same
    moment: they are left out.

    Raises
    ------
    SourceError : cannot be opened.
    """

    def __init__(self, url: str, threads: int):
        timeouts = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, OPEN_TIMEOUT_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, READ_TIMEOUT_MS]
        super().__init__(url, cv2.CAP_FFMPEG, [*timeouts, cv2.CAP_PROP_N_THREADS, threads])
        if not self._capture.isOpened():
            raise SourceError(without_password(url), "no answer, or no video that OpenCV can decode")
        if int(self._capture.get(cv2.CAP_PROP_FOURCC)) == _MJPG:
            self._jpeg = self._capture.set(cv2.CAP_PROP_FORMAT, -1)  # packets as they are
        self._has_image = self._skip_stored()

    def _skip_stored(self) -> bool:
        """Until an image has to be waited for, which is the current one then; False if there is none."""
        rate_hz = self._capture.get(cv2.CAP_PROP_FPS)
        waits_s = 0.5 / rate_hz if 1.0 < rate_hz < 200.0 else _WAITS_S
        for _ in range(_MOST_STORED):
            began_s = time.monotonic()
            if not self._capture.grab():
                return False
            if time.monotonic() - began_s > waits_s:
                break
        return True

    def _grab(self) -> bool:
        if self._has_image:
            self._has_image = False
            return True
        return super()._grab()


class DeviceCapture(_OpenCvCapture):
    """A V4L2 device, with its settings made.

    Parameters
    ----------
    path : of the device; a stable one is best, since /dev/video0 may be another camera tomorrow.
    size : (width, height) that is asked for, or None.
    settings : pixel format, rate, exposure, gain, controls.
    device_stamps : the driver's stamps, where they are of the monotonic clock; otherwise those of arrival.

    Raises
    ------
    SourceError : cannot be used, with the reason.
    UnknownNameError : a control that it does not have.
    """

    def __init__(self, path: str, size: tuple[int, int] | None, settings: CaptureSettings, device_stamps: bool = True):
        with VideoDevice(path) as device:
            device.apply(settings)
        self._device_stamps = device_stamps
        super().__init__(os.path.realpath(path), cv2.CAP_V4L2, self._parameters(size, settings))
        if not self._capture.isOpened():
            raise SourceError(path, "does not give images in a format that OpenCV knows")
        self._check(path, settings)

    @staticmethod
    def _parameters(size: tuple[int, int] | None, settings: CaptureSettings) -> list[int]:
        parameters: list[int] = []
        if settings.pixel_format is not None:
            parameters += [cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*settings.pixel_format)]
        if size is not None:
            parameters += [cv2.CAP_PROP_FRAME_WIDTH, size[0], cv2.CAP_PROP_FRAME_HEIGHT, size[1]]
        if settings.rate_hz is not None:
            parameters += [cv2.CAP_PROP_FPS, round(settings.rate_hz)]
        return parameters

    def _check(self, path: str, settings: CaptureSettings) -> None:
        got = int(self._capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little").decode("ascii", "replace")
        if settings.pixel_format not in (None, got):
            self.close()
            raise SourceError(path, f"expected pixel format {settings.pixel_format}, the device gives {got}")
        self._jpeg = got == "MJPG"
        if self._jpeg or got in _UNCONVERTED:
            self._capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)

    def _stamp_ns(self) -> int:
        now_ns, steady_ns = time.time_ns(), time.monotonic_ns()
        of_device_ns = round(1e6 * self._capture.get(cv2.CAP_PROP_POS_MSEC))
        if not self._device_stamps or not 0 <= steady_ns - of_device_ns < _CLOCK_SLACK_NS:
            return now_ns
        return now_ns - (steady_ns - of_device_ns)


def open_capture(
    address: SourceAddress, size: tuple[int, int] | None, settings: CaptureSettings, stamps: str | None, threads: int = 1
) -> LiveCapture:
    """Connect to a device or a stream.

    Parameters
    ----------
    address, size : of the camera; (width, height) that is asked for, or None.
    settings, stamps : of a device; as in the rig, ``capture`` for the time of arrival.
    threads : of the decoder.

    Returns
    -------
    Open connection.

    Raises
    ------
    TrackerError : with the reason.
    """
    if address.kind == DEVICE:
        return DeviceCapture(address.target, size, settings, stamps != "capture")
    return StreamCapture(address.target, threads)


def check_live_settings(address: SourceAddress, settings: CaptureSettings, stamps: str | None) -> None:
    """Refuse settings that a live source cannot follow, before anything is started.

    Parameters
    ----------
    address, settings, stamps : of the camera, as in the rig.

    Raises
    ------
    SourceError : settings of a device for a stream; stamps of a file.
    """
    if address.kind != DEVICE and settings.of_device:
        raise SourceError(address.shown, f"{', '.join(settings.of_device)} can be set for v4l2: sources only")
    possible = ("capture",) if address.kind not in (DEVICE, "topic") else ("capture", "device")
    if stamps not in (None, *possible):
        raise SourceError(address.shown, f"the rig asks for {stamps} stamps; this source has {' or '.join(possible)}")


FIRST_RETRY_S, LAST_RETRY_S = 0.5, 8.0


@dataclass
class Connection:
    """State of a live source.

    ``problem`` says why there is no connection; empty while there is one, and before the first. ``bayer`` is the pattern of
    mosaics that say it of themselves.
    """

    connected: bool = False
    problem: str = ""
    times: int = 0  # that it has been made
    received: int = 0
    bayer: str | None = None


class LiveSource:
    """Images of one live camera until it is closed.

    Whatever goes wrong, the connection is tried again: after half a second at first, then at intervals that double to eight
    seconds, so that a camera that has been unplugged is back soon and one that is away costs nothing.

    Parameters
    ----------
    open_capture : makes a connection, or raises `TrackerError`.

    Iterating yields (own stamp in ns, pixels or JPEG) and ends after `close`.
    """

    def __init__(self, open_capture: Callable[[], LiveCapture], retry_s: tuple[float, float] = (FIRST_RETRY_S, LAST_RETRY_S)):
        self._open, self._retry_s = open_capture, retry_s
        self._closed = threading.Event()
        self.connection = Connection()

    def close(self) -> None:
        """End the iteration, from any thread; it notices after the image that it waits for, or the time-out of that."""
        self._closed.set()

    def __iter__(self) -> Iterator[tuple[int, np.ndarray | bytes]]:
        wait_s = self._retry_s[0]
        while not self._closed.is_set():
            before = self.connection.received
            try:
                yield from self._one_connection()
            except TrackerError as error:
                self._lost(str(error))
            except Exception as error:  # a decoder's own failure
                self._lost(f"{type(error).__name__}: {error}")
            wait_s = self._retry_s[0] if self.connection.received > before else min(2.0 * wait_s, self._retry_s[1])
            self._closed.wait(wait_s)

    def _one_connection(self) -> Iterator[tuple[int, np.ndarray | bytes]]:
        capture = self._open()
        try:
            while not self._closed.is_set():
                image = capture.read()
                if image is None:
                    self._lost("gives no more images; trying to connect again")
                    return
                if not self.connection.connected:
                    self.connection.connected, self.connection.problem = True, ""
                    self.connection.times += 1
                self.connection.received += 1
                yield image
        finally:
            capture.close()

    def _lost(self, problem: str) -> None:
        self.connection.connected, self.connection.problem = False, problem
