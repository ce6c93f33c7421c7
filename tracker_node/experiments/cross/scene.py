"""The wooden cross as the experimenters have it: video, what they know of cameras and lights, and what they digitize.

Manual digitizing is simulated: someone clicks on the landmarks in every image, each point is reconstructed by DLT from the
cameras that show it, and the rigid body is fitted to the points. When a camera exposed is not known.

Films a thrown cross as analog interlaced video.

Every field is drawn over a still background at several times of its exposure, of which the mean of light is what the sensor sees;
it goes through the faults of the tape, and is woven with the next one into an image. Lenses have a barrel distortion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...calibration.points import dlt
from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...observation.deinterlace import check_interlaced, first_line, interpolate_lines, separate_fields, weave_fields
from ...render.raycast import raycaster
from ...render.raycast.raycaster import render_mask
from ...synthesis.scenes.room import cluttered_background
from ..target_images import TargetStudio
from . import throw as cross
from .throw import LATE_CAMERA, LATE_S, CrossTrial, yellow_stick

CONTROL_POINT_SIGMA_PX = 1.0
CLICK_SIGMA_PX = 1.5
SHUTTER_S, _MOMENTS = 0.004, 5  # exposure of a field, and how many times of it are drawn
_INSIDE_PX = 3  # colors are picked at least so far from the outline


@dataclass(frozen=True, eq=False)
class CrossScene:
    """Everything that the tracking and the digitizing need.

    Attributes
    ----------
    rig : cameras and lights as they are; ``rigs`` as known for tracking, by name: "true" has the true lenses and places, "dlt"
        those of the eleven parameters, "dlt_<constraint>" those of others; only "dlt_radial" has a distortion. These have the
        lights as measured, and no gain or gamma, which nobody knows; "lit" is the rig as it is.
    calibrations : constraint -> DLT of each camera.
    late_s : how much later than the first each camera exposes.
    seed : of everything that is random.
    """

    model: ArticulatedModel
    rig: CameraRig
    rigs: dict[str, CameraRig]
    calibrations: dict[str, list[dlt.DltCalibration]]
    trials: tuple[cross.CrossTrial, ...]
    late_s: tuple[float, ...]
    seed: int

    def film(self, trial: cross.CrossTrial, backend: str, shutter_s: float = SHUTTER_S) -> Footage:
        """Film a trial, and check that the video is interlaced.

        Parameters
        ----------
        trial : the throw.
        backend : renderer, of `target_images.BACKENDS`.
        shutter_s : exposure of a field.

        Returns
        -------
        The video.
        """
        backgrounds = [cluttered_background(camera, self.seed) for camera in self.rig]
        with TargetStudio(self.rig, backend) as studio:
            footage = film(self.model, trial, studio, backgrounds, np.random.default_rng(self.seed), shutter_s=shutter_s)
        for name, images in zip(self.rig.names, footage.images, strict=True):
            check_interlaced(images, f"{trial.name} somersault, camera {name}")
        return footage

    def digitize(self, trial: cross.CrossTrial) -> list[State | None]:
        """The pose at every field as a person digitizes it."""
        rng = np.random.default_rng(self.seed)
        parameters = np.array([calibration.parameters for calibration in self.calibrations["none"]])
        poses = []
        for field in range(trial.n_fields):
            states = [trial.state(field, late) for late in self.late_s]
            clicks = click(self.model, states, self.rig.cameras, CLICK_SIGMA_PX, rng)
            poses.append(digitized_state(self.model, clicks, parameters))
        return poses

    def picked_colors(self, trial: cross.CrossTrial, images: Sequence[np.ndarray], lit: CameraRig | None = None) -> np.ndarray:
        """Colors of the cross in the first field, as picked with an eye-dropper.

        Parameters
        ----------
        trial : the throw.
        images : of the first field, one a camera, BGR.
        lit : given, the colors are those under light of factor one if its lights, gains and gammas were true.

        Returns
        -------
        (n_cameras, n_shapes, 3) RGB.
        """
        picked = []
        for camera, late, image in zip(self.rig, self.late_s, images, strict=True):
            mask = render_mask(Configuration(self.model, trial.state(0, late)), camera)
            inside = cv2.erode(mask, np.ones((2 * _INSIDE_PX + 1, 2 * _INSIDE_PX + 1), np.uint8)) > 0
            inside = inside if inside.any() else mask > 0
            factor = 1.0 if lit is None else np.median(self._factors(trial.state(0, late), camera, lit)[inside], axis=0)
            picked.append(np.median(image[inside][:, ::-1], axis=0) / factor)
        return np.repeat(np.array(picked)[:, None], len(self.model.shapes), axis=1)

    def _factors(self, state: State, camera: Camera, lit: CameraRig) -> np.ndarray:
        """(h, w, 3) by which the colors of the cross are multiplied, RGB."""
        gray = replace(self.model, shapes=tuple(replace(shape, color_rgb=(100, 100, 100)) for shape in self.model.shapes))
        camera = replace(camera, gain=lit[camera.name].gain, gamma=lit[camera.name].gamma)
        return raycaster.render_color(Configuration(gray, state), camera, lit.lights).rgb / 100.0


def cross_scene(seed: int = 20, scale: float = 1.0, n_fields: int | None = None) -> CrossScene:
    """The experiment; for a quick look, smaller images and fewer fields.

    Parameters
    ----------
    seed : of everything that is random.
    scale : of the images.
    n_fields : of each throw; None: all.

    Returns
    -------
    The scene.
    """
    model, rig = yellow_stick(), cross.cross_rig()
    size = round(scale * cross.IMAGE_SIZE[0]), round(scale * cross.IMAGE_SIZE[1])
    rig = replace(rig, cameras=tuple(replace(camera, model=_barreled(camera).resized(*size)) for camera in rig))
    rng = np.random.default_rng(seed)
    points = cross.control_points(rng)
    pixels = [cross.digitized(camera, points, CONTROL_POINT_SIGMA_PX, rng) for camera in rig]
    calibrations = {
        constraint: [dlt.calibrate(camera.name, points, seen, size, constraint) for camera, seen in zip(rig, pixels, strict=True)]
        for constraint in dlt.CONSTRAINTS
    }
    lights = cross.measured_lights(rig.lights, rng)
    known = {"true": rig.cameras}
    for constraint, found in calibrations.items():
        known["dlt" if constraint == "none" else f"dlt_{constraint}"] = tuple(calibration.camera for calibration in found)
    rigs = {name: CameraRig(tuple(_unknown_answer(c) for c in cameras), lights=lights) for name, cameras in known.items()}
    trials: tuple[cross.CrossTrial, ...] = cross.side_somersault(model), cross.twisting_somersault(model)
    if n_fields is not None:
        trials = tuple(replace(trial, n_fields=n_fields) for trial in trials)
    rigs["lit"] = rig
    late_s = tuple(cross.LATE_S if name == cross.LATE_CAMERA else 0.0 for name in rig.names)
    return CrossScene(model, rig, rigs, calibrations, trials, late_s, seed)


def _barreled(camera: Camera) -> CameraModel:
    k1 = cross.DISTORTION[camera.name]
    return replace(camera.model, distortion_model="plumb_bob", distortion=np.array([k1, 0.0, 0.0, 0.0]))


def _unknown_answer(camera: Camera) -> Camera:
    return replace(camera, gain=(1.0, 1.0, 1.0), gamma=1.0)


@dataclass(frozen=True, eq=False)
class Clicks:
    """Points of one image set: ``pixels`` (n_points, n_cameras, 2) and where they were ``visible`` (n_points, n_cameras)."""

    pixels: np.ndarray
    visible: np.ndarray


_HALF_THICK_M = 0.06  # and a little more: so far the body may lie in front of a landmark in it without hiding it


def click(
    model: ArticulatedModel, states: Sequence[State], cameras: Sequence[Camera], sigma_px: float, rng: np.random.Generator
) -> Clicks:
    """Simulate clicks on the model's landmarks, with errors.

    Parameters
    ----------
    model : with landmarks.
    states : the body when each camera exposes.
    cameras : in the same order.
    sigma_px : standard deviation of the person's error along u and v.
    rng : random errors.

    Returns
    -------
    Pixels and visibility.
    """
    n_points = len(model.landmark_names)
    pixels, visible = np.zeros((n_points, len(cameras), 2)), np.zeros((n_points, len(cameras)), dtype=bool)
    for i, (camera, state) in enumerate(zip(cameras, states, strict=True)):
        configuration = Configuration(model, state)
        points = configuration.landmarks_world
        seen, valid = camera.project(points)
        valid = valid & camera.model.in_image(seen)
        depth = raycaster.render_view(configuration, camera).depth
        column, row = np.rint(np.where(valid[:, None], seen, 0.0)).astype(int).T
        in_front = depth[row, column] < se3.apply(camera.T_cam_world, points)[:, 2] - _HALF_THICK_M
        visible[:, i] = valid & ~in_front
        pixels[:, i] = seen + sigma_px * rng.standard_normal((n_points, 2))
    return Clicks(pixels, visible)


def digitized_state(model: ArticulatedModel, clicks: Clicks, parameters: np.ndarray) -> State | None:
    """Pose of a rigid body from clicks on its landmarks.

    None where fewer than three points could be reconstructed, or all of them lie on a line.

    Parameters
    ----------
    model : with landmarks.
    clicks : of one time step.
    parameters : (n_cameras, 11) DLT parameters.

    Returns
    -------
    None where fewer than three points could be reconstructed, or all of them lie on a line.
    """
    points, valid = dlt.reconstruct(parameters, clicks.pixels, clicks.visible.astype(np.float64))
    neutral = State.neutral(model)
    own = Configuration(model, neutral).landmarks_world[valid]
    if len(own) < 3 or np.linalg.svd(own - own.mean(axis=0), compute_uv=False)[1] < 1e-6:
        return None
    return State(se3.rigid_fit(own, points[valid]) @ neutral.T_world_root, neutral.joint_positions)


@dataclass(frozen=True, eq=False)
class Footage:
    """``images[camera][j]`` is the j-th interlaced image (h, w, 3) BGR uint8 of a camera, of the fields 2 j and 2 j + 1."""

    images: tuple[tuple[np.ndarray, ...], ...]
    n_fields: int

    def interpolated(self, field: int) -> list[np.ndarray]:
        """Every camera's image of one time step at full height, missing lines interpolated."""
        return [interpolate_lines(own, first_line(field)) for own in self.own_lines(field)]

    def own_lines(self, field: int) -> list[np.ndarray]:
        """Every camera's field of one time step at half height: the lines that were exposed."""
        return [np.ascontiguousarray(separate_fields(camera[field // 2])[field % 2]) for camera in self.images]


def film(
    model: ArticulatedModel, trial: CrossTrial, studio: TargetStudio, backgrounds: Sequence[np.ndarray],
    rng: np.random.Generator, faults: TapeFaults | None = None, shutter_s: float = SHUTTER_S,
) -> Footage:  # fmt: skip
    """Interlaced video of a trial from every camera of the studio.

    Parameters
    ----------
    model : the cross.
    trial : its throw.
    studio : draws it, with the cameras of its rig.
    backgrounds : (h, w, 3) BGR uint8, one of each camera.
    rng : noise of the tape.
    faults : of the tape.
    shutter_s : exposure of a field, about its time; 0: what moves is sharp.

    Returns
    -------
    The video of all cameras.
    """
    faults, n_moments = faults or TapeFaults(), _MOMENTS if shutter_s > 0.0 else 1
    moments = shutter_s * ((np.arange(n_moments) + 0.5) / n_moments - 0.5)
    fields: list[list[np.ndarray]] = [[] for _ in studio.rig]
    for field in range(trial.n_fields + trial.n_fields % 2):  # an odd last one would have no partner
        for i, camera in enumerate(studio.rig):
            late, own = LATE_S if camera.name == LATE_CAMERA else 0.0, slice(first_line(field), None, 2)
            states = [trial.state(field, late + moment) for moment in moments]
            sharp = [studio.image(i, Configuration(model, state), backgrounds[i])[own] for state in states]
            fields[i].append(record(exposed(sharp, camera.gamma), faults, rng))
    images = tuple(tuple(weave_fields(a, b) for a, b in zip(own[::2], own[1::2], strict=True)) for own in fields)
    return Footage(images, trial.n_fields)


def exposed(images: Sequence[np.ndarray], gamma: float) -> np.ndarray:
    """What a sensor shows that has seen several images one after the other: the mean of their light.

    Parameters
    ----------
    images : (h, w, 3) uint8, equally long.
    gamma : of the camera: gray levels are light to the power of one by it.

    Returns
    -------
    (h, w, 3) uint8.
    """
    if len(images) == 1:
        return images[0]
    light = (np.arange(256, dtype=np.float32) / 255.0) ** gamma
    mean = np.mean([light[image] for image in images], axis=0)
    return np.rint(255.0 * mean ** (1.0 / gamma)).astype(np.uint8)


@dataclass(frozen=True)
class TapeFaults:
    """Lengths are standard deviations of Gaussian low-passes along the lines, in pixels; noise in gray levels.

    The defaults are those of good Hi-8: luma of about 400 lines, chroma of a quarter of that as with 4:1:1 sampling, a signal to
    noise ratio of about 40 dB.
    """

    luma_blur_px: float = 0.8
    chroma_blur_px: float = 3.5
    luma_noise: float = 3.0
    chroma_noise: float = 4.0


def record(image: np.ndarray, faults: TapeFaults, rng: np.random.Generator) -> np.ndarray:
    """An image as it comes back from tape; only lines are filtered, so fields may be woven before or after.

    Parameters
    ----------
    image : (h, w, 3) uint8 BGR.
    faults : bandwidth and noise.
    rng : random numbers of the noise.

    Returns
    -------
    (h, w, 3) uint8 BGR.
    """
    ycrcb = cv2.cvtColor(image.astype(np.float32) / 255.0, cv2.COLOR_BGR2YCrCb) * 255.0
    blurred = (along_lines(ycrcb[:, :, 0], faults.luma_blur_px), along_lines(ycrcb[:, :, 1:], faults.chroma_blur_px))
    ycrcb = np.dstack(blurred)
    sigmas = np.array([faults.luma_noise, faults.chroma_noise, faults.chroma_noise], dtype=np.float32)
    noise = rng.standard_normal(ycrcb.shape, dtype=np.float32)
    # Chroma noise has passed the same narrow filter as chroma itself; scaled back to its standard deviation
    noise[:, :, 1:] = along_lines(noise[:, :, 1:], faults.chroma_blur_px)
    noise /= np.maximum(noise.std(axis=(0, 1)), 1e-9)
    bgr = cv2.cvtColor((ycrcb + sigmas * noise) / np.float32(255.0), cv2.COLOR_YCrCb2BGR)
    return np.clip(np.rint(bgr * 255.0), 0, 255).astype(np.uint8)


def along_lines(values: np.ndarray, sigma_px: float) -> np.ndarray:
    """Gaussian low-pass along the rows.

    Parameters
    ----------
    values : (h, w) or (h, w, c) float32.
    sigma_px : of the filter; 0: none.

    Returns
    -------
    The same shape.
    """
    if sigma_px <= 0.0:
        return values
    size = 2 * int(np.ceil(3.0 * sigma_px)) + 1
    return cv2.GaussianBlur(values, (size, 1), sigma_px, borderType=cv2.BORDER_REPLICATE)
