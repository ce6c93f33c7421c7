"""Cameras with a name, a place in the world and settings of their images; the rig of all; epipolar curves between two.

Detection of camera positions in another unit than meters, from the distances between the cameras.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import TrackerError, UnknownNameError
from ..geometry import se3
from .light import Light
from .model import CameraModel

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


@dataclass(frozen=True)
class Camera:
    """One camera of a rig. ``model`` is for the pixels of the images as published (any pixel map is folded into its K).

    Parameters
    ----------
    name : used for topics; its frame id is ``<name>_optical_frame``.
    T_world_cam : (4, 4), p_world = T_world_cam @ p_cam, meters.
    source : where its images come from (`loaders.source_address`); None for a camera that something else publishes.
    topic : of its images in a ROS graph, ``camera_info`` beside it; None for ``<name>/image_raw``.
    capture : how they are taken, and as what they are published.
    time_offset_ns : added to the source's own stamps to get common time.
    time_drift_ppm : by how much common time advances more than the camera's own, in millionths, from its first image on.
    stamps : where its own stamps come from, see `loaders.images.stamps`; None for what the source has by default.
    stamp_file : file that has the stamp of every image of the source, or None.
    background : path of an image of the background, or None.
    interlaced : ``top_first`` or ``bottom_first`` where each image of the source is two fields, and which was exposed first.
    gain, gamma : how the camera answers to light, see `camera.light`; ``gain`` is (r, g, b).
    """

    name: str
    model: CameraModel
    T_world_cam: np.ndarray
    source: str | None = None
    time_offset_ns: int = 0
    time_drift_ppm: float = 0.0
    stamps: str | None = None
    stamp_file: str | None = None
    background: str | None = None
    interlaced: str | None = None
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gamma: float = 1.0
    capture: CaptureSettings = field(default_factory=CaptureSettings)
    topic: str | None = None

    def __post_init__(self):
        transform = np.array(self.T_world_cam, dtype=np.float64)
        if not se3.is_rigid(transform):
            raise ValueError(f"camera '{self.name}': expected a rigid 4x4 T_world_cam, got {transform.tolist()}")
        transform.setflags(write=False)
        object.__setattr__(self, "T_world_cam", transform)

    @property
    def frame_id(self) -> str:
        return f"{self.name}_optical_frame"

    @property
    def T_cam_world(self) -> np.ndarray:
        return se3.inverse(self.T_world_cam)

    @property
    def center(self) -> np.ndarray:
        """Optical center in the world, meters (3,)."""
        return self.T_world_cam[:3, 3]

    def project(self, points_world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (..., 2) of world points (..., 3), and a validity mask."""
        return self.model.project(se3.apply(self.T_cam_world, points_world))


@dataclass(frozen=True)
class CameraRig:
    """All cameras, in the order that fixes every per-camera array; the world frame is ``world_frame``; and the scene's lights."""

    cameras: tuple[Camera, ...]
    world_frame: str = "world"
    lights: tuple[Light, ...] = ()

    def __post_init__(self):
        names = [camera.name for camera in self.cameras]
        if len(set(names)) != len(names):
            raise ValueError(f"expected unique camera names, got {names}")

    def __repr__(self) -> str:
        """In a line, without lenses and places."""
        sized = [f"{camera.name} {camera.model.width}x{camera.model.height}" for camera in self.cameras]
        return f"<{type(self).__name__}: {', '.join(sized) or 'no cameras'}>"

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(camera.name for camera in self.cameras)

    def __len__(self) -> int:
        return len(self.cameras)

    def __iter__(self) -> Iterator[Camera]:
        return iter(self.cameras)

    def __getitem__(self, name: str) -> Camera:
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise UnknownNameError("camera", name, self.names)

    def subset(self, names: list[str] | tuple[str, ...]) -> CameraRig:
        """The rig of the named cameras only, in the given order."""
        return replace(self, cameras=tuple(self[name] for name in names))

    def with_sources(self, sources: Mapping[str, str | None]) -> CameraRig:
        """The rig with other sources for some cameras.

        Parameters
        ----------
        sources : camera -> see `loaders.source_address`; None: it has none.

        Returns
        -------
        The same cameras in the same order.

        Raises
        ------
        UnknownNameError : a camera that the rig does not have.
        """
        named = {name: replace(self[name], source=source) for name, source in sources.items()}
        return replace(self, cameras=tuple(named.get(camera.name, camera) for camera in self))


_NEAREST_M, _FARTHEST_M, _N_DEPTHS = 0.05, 200.0, 400


def axes_equations(cameras: Iterable[Camera]) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations of the point nearest to all optical axes: each asks for (I - d d^T)(X - c) = 0.

    Parameters
    ----------
    cameras : with centers c and unit axes d.

    Returns
    -------
    A : (3, 3); singular where all axes are parallel.
    b : (3,) meters, world; the point solves A X = b.
    """
    cameras = tuple(cameras)
    axes, centers = np.array([c.T_world_cam[:3, 2] for c in cameras]), np.array([c.center for c in cameras])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    return across.sum(axis=0), np.einsum("nij,nj->i", across, centers)


def epipolar_curve(camera: Camera, pixel: np.ndarray, other: Camera) -> np.ndarray:
    """Where one camera's pixel can be in another camera's image.

    Depths along the ray go from 5 cm to 200 m in steps of two percent.

    Parameters
    ----------
    camera, pixel : one camera of a rig, and (2,) on its image.
    other : the other camera.

    Returns
    -------
    (k, 2) pixels of ``other`` from near to far, bent as its lens is: the longest stretch of the ray that is on the image, and
    one place beyond each of its ends. Empty where the ray is not in view.
    """
    rays, ok = camera.model.rays(np.asarray(pixel, dtype=np.float64)[None])
    if not ok[0]:
        return np.zeros((0, 2))
    depths = np.geomspace(_NEAREST_M, _FARTHEST_M, _N_DEPTHS)
    pixels, valid = other.project(se3.apply(camera.T_world_cam, depths[:, None] * rays))
    inside = valid & other.model.in_image(pixels)
    stretches = np.ma.flatnotmasked_contiguous(np.ma.array(inside, mask=~inside))
    if not stretches:
        return np.zeros((0, 2))
    longest = max(stretches, key=lambda stretch: stretch.stop - stretch.start)
    first, last = longest.start, longest.stop
    first -= first > 0 and bool(valid[first - 1])
    last += last < len(valid) and bool(valid[last])
    return pixels[first:last]


SMALLEST_BODY_M = 1e-4  # and hardly anything smaller is tracked
LARGEST_ROOM_M = 100.0  # a camera farther than this from the others is hardly meant in meters
LEAST_PX = 20.0  # a body that is smaller in the images is not tracked
_LEAST_OF_IMAGE = 0.005  # of its height, that a body has where it may be


@dataclass(frozen=True)
class WrongUnit:
    """What speaks for another unit.

    Parameters
    ----------
    cameras : the ones that stand too far away, by name.
    all_of_them : these are all cameras of the rig.
    apart_m : how far they stand from the others, as it is written.
    factor : by which their places become meters.
    """

    cameras: tuple[str, ...]
    all_of_them: bool
    apart_m: float
    factor: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        names = ", ".join(self.cameras)
        who = f"The cameras are {self.apart_m:.0f} m apart"
        if not self.all_of_them:
            who = f"{names}: stands {self.apart_m:.0f} m from the others"
        unit = "millimeters" if self.factor < 5e-3 else "centimeters"
        return (
            f"{who}: the translation of T_world_cam seems to be in {unit}, a rig is in meters ({self.apart_m * self.factor:.2f} m"
            f" then). Divide it by {1 / self.factor:.0f}."
        )


def wrong_unit(cameras: Sequence[Camera]) -> WrongUnit | None:
    """Evidence that cameras stand farther apart than any room is large; None without it, and for a single camera."""
    if len(cameras) < 2:
        return None
    centers = np.array([camera.center for camera in cameras])
    distances = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    half = len(cameras) // 2  # of two in the middle the nearer, so that one camera in three does not make all look far
    apart = np.sort(distances, axis=1)[:, half]
    far = apart > LARGEST_ROOM_M
    if not far.any():
        return None
    typical = float(np.median(apart[far]))
    names = tuple(camera.name for camera, is_far in zip(cameras, far, strict=True) if is_far)
    return WrongUnit(names, bool(far.all()), typical, 1e-3 if typical > 1000.0 else 1e-2)


def check_place(cameras: Sequence[Camera], size_m: float, place: np.ndarray) -> None:
    """Refuse a state in another unit, which puts the body so far away that no camera could see it.

    Parameters
    ----------
    cameras : of the rig.
    size_m : size of the body.
    place : (3,) of its root, meters, world.

    Raises
    ------
    TrackerError : with the place.
    """
    away = [(c.model, max(float(np.linalg.norm(c.center - place)), size_m)) for c in cameras]
    if max(size_m * float(lens.K[1, 1]) / (far * lens.height) for lens, far in away) < _LEAST_OF_IMAGE:
        at, nearest = ", ".join(f"{x:.4g}" for x in place), min(far for _, far in away)
        told = f"expected a place in meters where cameras may see the body, got ({at}), {nearest:.0f} m from the nearest camera"
        raise TrackerError(f"initial state: {told}")


def check_metres(cameras: Sequence[Camera], size_m: float) -> None:
    """Refuse cameras, or a body, in another unit; a rig that is really large sees a body of this size too small to track.

    Parameters
    ----------
    cameras : of the rig.
    size_m : size of the body that is to be tracked between them.

    Raises
    ------
    TrackerError : with the sentence that ``rig check`` writes.
    """
    if not SMALLEST_BODY_M < size_m < LARGEST_ROOM_M:
        told = "meshes in millimeters take scale: 0.001"
        raise TrackerError(f"model: expected a body in meters, got one of {size_m:.3g} m; {told}")
    wrong = wrong_unit(cameras)
    if wrong is None:
        return
    middle_m = 0.5 * wrong.apart_m
    far = (camera.model for camera in cameras if camera.name in wrong.cameras)
    largest_px, height_px = max((size_m * float(lens.K[1, 1]) / middle_m, lens.height) for lens in far)
    if largest_px < LEAST_PX:
        # The unit in which the body is nearest to half as large as an image
        factor = min((1e-2, 1e-3), key=lambda factor: abs(math.log(2.0 * largest_px / (factor * height_px))))
        wrong = replace(wrong, factor=factor)
        raise TrackerError(f"rig: {wrong.sentence} (tracker_node rig check looks for other faults, too)")
