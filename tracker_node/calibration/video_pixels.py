"""How the pixels of a camera's video lie in those of its calibration, where the sizes of their images differ.

Sizes, the rotation that the video states, and black bars in its images are the evidence. What they leave open is not guessed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from ..camera.rig import Camera, CameraRig
from ..errors import CalibrationError, FileFormatError, UnknownNameError
from ..loaders.images.source import ImageSource, VideoSource, open_camera_source_of_any_size, size_contradiction
from ..loaders.source_address import FILE, parse_source

RESAMPLED, CLOCKWISE, COUNTERCLOCKWISE = "resampled", "clockwise", "counterclockwise"
BARS, CUT, STRETCHED = "bars", "cut", "stretched"
KINDS = {
    RESAMPLED: "resampled as a whole",
    CLOCKWISE: "turned clockwise by a quarter",
    COUNTERCLOCKWISE: "turned counterclockwise by a quarter",
    BARS: "resampled as a whole, with black bars beside it",
    CUT: "resampled, and cut alike on both sides",
    STRETCHED: "resampled by another factor across than down",
}
_SAME_SHAPE = 2e-3  # relative difference of two sides' scales, where an image is resampled as a whole
_TURNS = {CLOCKWISE: 1, COUNTERCLOCKWISE: 3}
_BLACK, _BRIGHTER = 24.0, 8.0  # levels of 255: a bar at most; by how much what is beside it is brighter
_LOOKED_AT = 3  # images of a video, for bars


@dataclass(frozen=True, eq=False)
class PixelFit:
    """A way in which images have got their size.

    Attributes
    ----------
    kind : one of `KINDS`.
    turns : quarter turns, clockwise.
    pixel_map : (2, 3), pixel of the new image = pixel_map @ (u, v, 1) of the turned old one.
    size : (width, height) of the new image.
    """

    kind: str
    turns: int
    pixel_map: np.ndarray
    size: tuple[int, int]

    def camera(self, camera: Camera) -> Camera:
        """The camera for the new images: a turned one has another lens and looks with another side up."""
        for _ in range(self.turns):
            T_world_cam = camera.T_world_cam.copy()
            T_world_cam[:3, :2] = np.column_stack([-T_world_cam[:3, 1], T_world_cam[:3, 0]])
            camera = replace(camera, model=camera.model.turned_clockwise(), T_world_cam=T_world_cam)
        return replace(camera, model=camera.model.mapped(self.pixel_map, *self.size))

    def image(self, image: np.ndarray) -> np.ndarray:
        """An old image (h, w, 3) in the new pixels; black where it shows nothing."""
        turned = np.ascontiguousarray(np.rot90(image, -self.turns))
        if self.kind in (CUT, BARS):
            return cv2.warpAffine(turned, self.pixel_map, self.size, flags=cv2.INTER_LINEAR)
        return cv2.resize(turned, self.size, interpolation=cv2.INTER_AREA)


def pixel_fits(
    old: tuple[int, int], new: tuple[int, int], rotation_deg: int = 0, images: np.ndarray | None = None
) -> tuple[PixelFit, ...]:
    """The ways in which images of one size can have got another one.

    Parameters
    ----------
    old, new : (width, height) before and after.
    rotation_deg : by how much the new images state to be turned, clockwise; 0: they state nothing.
    images : (n, h, w, 3) some of the new ones, in which bars are looked for.

    Returns
    -------
    One where the evidence settles it; several, or none, where it does not.
    """
    if _same_shape(old, new):
        return (PixelFit(RESAMPLED, 0, _resampling(old, new), new),)
    turned = old[::-1]
    if _same_shape(turned, new):
        kinds = {90: (CLOCKWISE,), 270: (COUNTERCLOCKWISE,)}.get(rotation_deg % 360, tuple(_TURNS))
        return tuple(PixelFit(kind, _TURNS[kind], _resampling(turned, new), new) for kind in kinds)
    if (old[0] > old[1]) != (new[0] > new[1]) and old[0] != old[1] and new[0] != new[1]:
        return ()
    across, down = new[0] / old[0], new[1] / old[1]
    bars = PixelFit(BARS, 0, _centered(old, new, min(across, down)), new)
    if images is not None and _has_bars(images, old, min(across, down)):
        return (bars,)
    return PixelFit(CUT, 0, _centered(old, new, max(across, down)), new), PixelFit(STRETCHED, 0, _resampling(old, new), new)


def rig_of_videos(rig: CameraRig, chosen: Mapping[str, str], tell: Callable[[str], None]) -> CameraRig:
    """The rig for the images of its cameras' videos, whatever their size; cameras without a recording stay as they are.

    Parameters
    ----------
    rig : cameras with sources.
    chosen : camera -> one of `KINDS`, where sizes do not tell.
    tell : called with a sentence on every camera that changes.

    Returns
    -------
    The rig, with lenses for these images.

    Raises
    ------
    CalibrationError : a camera whose images fit in several ways, or in none; naming them. A choice that no recording needs.
    """
    for name, kind in chosen.items():
        if name not in rig.names:
            raise UnknownNameError("camera", name, rig.names)
        if kind not in KINDS:
            raise UnknownNameError("pixel map", kind, KINDS)
        if not _is_there(rig[name].source):
            raise CalibrationError(name, f"expected a recording that is there beside the pixel map '{kind}'")
    cameras = [camera_of_video(c, chosen.get(c.name), tell) if _is_there(c.source) else c for c in rig]
    return replace(rig, cameras=tuple(cameras))


def camera_of_video(camera: Camera, chosen: str | None, tell: Callable[[str], None]) -> Camera:
    """A camera for the images of its video, see `rig_of_videos`.

    Parameters
    ----------
    camera : with a source.
    chosen : one of `KINDS`, where sizes do not tell; None: they have to.
    tell : called with a sentence where the camera changes.

    Returns
    -------
    The camera.
    """
    source = open_camera_source_of_any_size(camera)
    old, new = (camera.model.width, camera.model.height), (source.native_width, source.native_height)
    if old == new:
        if chosen:
            expected = "its images have the size of the calibration: expected no pixel map"
            raise CalibrationError(camera.name, f"{expected}, got '{chosen}'")
        return camera
    fits = _chosen(camera.name, chosen, old, new) if chosen else pixel_fits(old, new, rotation_of(source), first_images(source))
    if len(fits) != 1:
        raise CalibrationError(camera.name, f"{size_contradiction(old, new, str(camera.source))}: {_open(camera.name, fits)}")
    try:
        found = fits[0].camera(camera)
    except ValueError as error:
        raise CalibrationError(camera.name, str(error)) from None
    sizes = f"{old[0]}x{old[1]}, is for images of {new[0]}x{new[1]} now"
    tell(f"camera {camera.name}: its calibration, of {sizes}: {KINDS[fits[0].kind]}")
    return found


def parsed_choices(option: str, texts: list[str] | None) -> dict[str, str]:
    """``CAMERA=KIND`` of a command line, by camera.

    Parameters
    ----------
    option : its name.
    texts : its values.

    Returns
    -------
    Camera -> kind.

    Raises
    ------
    FileFormatError : a value without ``=``.
    """
    found = {}
    for text in texts or ():
        name, given, kind = text.partition("=")
        if not given or not name:
            raise FileFormatError("command line", option, f"CAMERA=KIND, of {', '.join(KINDS)}", text)
        found[name] = kind
    return found


def rotation_of(source: ImageSource) -> int:
    """By how many degrees, clockwise, a video states that its images are to be turned, which reading it does; 0 of others."""
    if not isinstance(source, VideoSource):
        return 0
    capture = cv2.VideoCapture(source.path)
    try:
        return round(capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 360
    finally:
        capture.release()


def first_images(source: ImageSource) -> np.ndarray:
    """(n, h, w, 3) of a recording."""
    found = []
    for _, image in source:
        found.append(image)
        if len(found) == _LOOKED_AT:
            break
    return np.array(found)


def _is_there(source: str | None) -> bool:
    if source is None or (address := parse_source(source)).is_live:
        return False
    return address.kind != FILE or Path(address.target).exists() or any(mark in address.target for mark in "*?[%")


def _open(camera: str, fits: tuple[PixelFit, ...]) -> str:
    """What is to be said where sizes do not settle it."""
    if not fits:
        return "neither resampling nor a turn explains it; are these the videos of this calibration?"
    ways = ", or ".join(f"{KINDS[fit.kind]} ({fit.kind})" for fit in fits)
    return f"it may be {ways}; say which with --pixel-map {camera}={fits[0].kind}"


def _chosen(camera: str, kind: str, old: tuple[int, int], new: tuple[int, int]) -> tuple[PixelFit, ...]:
    """The one fit of a kind that somebody has chosen, if sizes allow it."""
    if kind in _TURNS:
        if _same_shape(old[::-1], new):
            return (PixelFit(kind, _TURNS[kind], _resampling(old[::-1], new), new),)
        expected = f"images of the shape of {old[1]}x{old[0]} for a quarter turn"
        raise CalibrationError(camera, f"expected {expected}, got {new[0]}x{new[1]}")
    across, down = new[0] / old[0], new[1] / old[1]
    scale = {BARS: min(across, down), CUT: max(across, down)}.get(kind)
    return (PixelFit(kind, 0, _resampling(old, new) if scale is None else _centered(old, new, scale), new),)


def _same_shape(old: tuple[int, int], new: tuple[int, int]) -> bool:
    """Whether one is the other resampled; sizes are whole numbers, and half of an odd one is rounded."""
    across, down = new[0] / old[0], new[1] / old[1]
    rounded = abs(new[1] - across * old[1]) <= 1.0 or abs(new[0] - down * old[0]) <= 1.0
    return abs(across / down - 1.0) <= _SAME_SHAPE or (rounded and abs(across / down - 1.0) <= 2.0 * _SAME_SHAPE)


def _resampling(old: tuple[int, int], new: tuple[int, int]) -> np.ndarray:
    sx, sy = new[0] / old[0], new[1] / old[1]
    return np.array([[sx, 0.0, 0.5 * sx - 0.5], [0.0, sy, 0.5 * sy - 0.5]])


def _centered(old: tuple[int, int], new: tuple[int, int], scale: float) -> np.ndarray:
    """The middle stays the middle."""
    t = [0.5 * (n - 1) - 0.5 * scale * (o - 1) for o, n in zip(old, new, strict=True)]
    return np.array([[scale, 0.0, t[0]], [0.0, scale, t[1]]])


def _has_bars(images: np.ndarray, old: tuple[int, int], scale: float) -> bool:
    """Whether all that the resampled image does not cover is black, and what lies beside it is not."""
    levels = images.max(axis=(0, 3)).astype(np.float64)
    height, width = levels.shape
    bars = round(0.5 * (width - scale * old[0])), round(0.5 * (height - scale * old[1]))
    if bars[0] >= bars[1]:
        levels, n = levels.T, bars[0]
    else:
        n = bars[1]
    if n < 2:
        return False
    outside = np.concatenate([levels[: n - 1], levels[-(n - 1) :]])
    inside = np.concatenate([levels[n + 1 : 2 * n + 1], levels[-(2 * n + 1) : -(n + 1)]])
    return float(np.percentile(outside, 95)) <= _BLACK and float(inside.mean() - outside.mean()) >= _BRIGHTER
