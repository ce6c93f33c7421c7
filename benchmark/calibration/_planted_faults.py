"""A recording with one thing wrong: the faults that a doctor has to name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np

from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import so3
from tracker_node.observation.deinterlace import separate_fields, weave_fields

CAMERA = 1  # index of the camera that faults of one camera concern
OTHER = 0  # the one that it is exchanged with


@dataclass(frozen=True, eq=False)
class Clip:
    """A rig and what its cameras have recorded: BGR images and rates in Hz, by the camera's name."""

    rig: CameraRig
    images: Mapping[str, list[np.ndarray]]
    rates_hz: Mapping[str, float]

    def with_camera(self, index: int, **changes) -> Clip:
        cameras = list(self.rig.cameras)
        cameras[index] = replace(cameras[index], **changes)
        return replace(self, rig=replace(self.rig, cameras=tuple(cameras)))

    def with_images(self, name: str, images: list[np.ndarray], rate_hz: float | None = None) -> Clip:
        rates = {**self.rates_hz, name: rate_hz or self.rates_hz[name]}
        return replace(self, images={**self.images, name: images}, rates_hz=rates)


def _name(clip: Clip) -> str:
    return clip.rig.names[CAMERA]


def wrong_resolution(clip: Clip) -> Clip:
    """The images of one camera at two thirds of their size."""
    small = [cv2.resize(image, None, fx=2 / 3, fy=2 / 3, interpolation=cv2.INTER_AREA) for image in clip.images[_name(clip)]]
    return clip.with_images(_name(clip), small)


def swapped_cameras(clip: Clip) -> Clip:
    a, b = clip.rig.names[OTHER], _name(clip)
    return clip.with_images(a, clip.images[b]).with_images(b, clip.images[a])


def mirrored_axis(clip: Clip) -> Clip:
    """The sign of the world's x axis is wrong (and of the cameras' own, or they would be no rotations)."""
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    cameras = tuple(replace(camera, T_world_cam=mirror @ camera.T_world_cam @ mirror) for camera in clip.rig)
    return replace(clip, rig=replace(clip.rig, cameras=cameras))


def millimeters(clip: Clip) -> Clip:
    scale = np.ones((4, 4))
    scale[:3, 3] = 1000.0
    cameras = tuple(replace(camera, T_world_cam=camera.T_world_cam * scale) for camera in clip.rig)
    return replace(clip, rig=replace(clip.rig, cameras=cameras))


def bad_extrinsics(clip: Clip, degrees: float = 2.5) -> Clip:
    """One camera turned about an oblique axis."""
    turn = np.eye(4)
    turn[:3, :3] = so3.exp(np.radians(degrees) * np.array([0.6, -0.7, 0.39]) / np.linalg.norm([0.6, -0.7, 0.39]))
    return clip.with_camera(CAMERA, T_world_cam=clip.rig.cameras[CAMERA].T_world_cam @ turn)


def clock_offset(clip: Clip, seconds: float = 0.1) -> Clip:
    """One camera was started later than the others."""
    name = _name(clip)
    return clip.with_images(name, clip.images[name][round(seconds * clip.rates_hz[name]) :])


def exposure_change(clip: Clip, factor: float = 1.2) -> Clip:
    """One camera becomes brighter in mid-recording."""
    name = _name(clip)
    images = clip.images[name]
    half = len(images) // 2
    return clip.with_images(name, images[:half] + [cv2.convertScaleAbs(image, alpha=factor) for image in images[half:]])


def interlaced_video(clip: Clip) -> Clip:
    """One camera puts two successive images into the lines of one, at half the rate."""
    name = _name(clip)
    images = [image[: image.shape[0] // 2 * 2] for image in clip.images[name]]
    woven = [weave_fields(separate_fields(a)[0], separate_fields(b)[1]) for a, b in zip(images[::2], images[1::2], strict=False)]
    return clip.with_images(name, woven, 0.5 * clip.rates_hz[name])


def duplicate_images(clip: Clip, every: int = 5) -> Clip:
    """One camera gives every fifth image twice, and the next not at all."""
    name = _name(clip)
    images = clip.images[name]
    return clip.with_images(name, [images[i - 1] if i % every == every - 1 else images[i] for i in range(len(images))])


def low_image_rate(clip: Clip, rate_hz: float = 6.0) -> Clip:
    """All cameras at a rate at which limbs are elsewhere in every image."""
    for name in clip.rig.names:
        step = round(clip.rates_hz[name] / rate_hz)
        clip = clip.with_images(name, clip.images[name][::step], clip.rates_hz[name] / step)
    return clip


def moved_camera(clip: Clip, degrees: float = 1.0) -> Clip:
    """One camera is turned in mid-recording: a homography, exact for a turn about its center but for the lens's distortion."""
    camera = clip.rig.cameras[CAMERA]
    turn = so3.exp(np.radians(degrees) * np.array([0.5, 0.8, 0.33]) / np.linalg.norm([0.5, 0.8, 0.33]))
    homography = camera.model.K @ turn @ np.linalg.inv(camera.model.K)
    images = clip.images[camera.name]
    half, size = len(images) // 2, (camera.model.width, camera.model.height)
    turned = [cv2.warpPerspective(image, homography, size, borderMode=cv2.BORDER_REFLECT) for image in images[half:]]
    return clip.with_images(camera.name, images[:half] + turned)


def wrong_focal_length(clip: Clip, factor: float = 1.1) -> Clip:
    camera: Camera = clip.rig.cameras[CAMERA]
    K = camera.model.K.copy()
    K[0, 0], K[1, 1] = factor * K[0, 0], factor * K[1, 1]
    return clip.with_camera(CAMERA, model=replace(camera.model, K=K))


@dataclass(frozen=True)
class Planted:
    """A fault: how it gets into a clip, and what the doctor has to say: the key of its fault, and the cameras (indices)."""

    plant: Callable[[Clip], Clip]
    fault: str
    cameras: tuple[int, ...]


PLANTED = {
    "wrong_resolution": Planted(wrong_resolution, "resolution", (CAMERA,)),
    "swapped_cameras": Planted(swapped_cameras, "swapped", (OTHER, CAMERA)),
    "mirrored_axis": Planted(mirrored_axis, "mirrored", ()),
    "millimeters": Planted(millimeters, "unit", ()),
    "bad_extrinsics": Planted(bad_extrinsics, "place", (CAMERA,)),
    "moved_camera": Planted(moved_camera, "moved", (CAMERA,)),
    "wrong_focal_length": Planted(wrong_focal_length, "focal", (CAMERA,)),
    "clock_offset": Planted(clock_offset, "clock", (CAMERA,)),
    "exposure_change": Planted(exposure_change, "exposure", (CAMERA,)),
    "interlaced_video": Planted(interlaced_video, "interlaced", (CAMERA,)),
    "duplicate_images": Planted(duplicate_images, "repeated", (CAMERA,)),
    "low_image_rate": Planted(low_image_rate, "rate", ()),
}
