"""Lights, and how cameras answer to them, from images of a body in known poses.

A pixel of a surface of color c under the light f shows c (gain f)^(1/gamma) (`camera.light`). Pose, shape and colors of the body
are known, so every pixel of it says something about the lights: where they are, how strong they are in each channel, and how the
camera turns light into gray levels. All are sought at once, by least squares with a robust loss, around what the rig says; the
first camera keeps its gain, since lights twice as strong look like gains twice as high. A camera without an image of any pose
stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from scipy.optimize import least_squares

from ..camera.light import SPOT_EDGE, Light
from ..camera.rig import CameraRig
from ..errors import CalibrationError, SourceError, TrackerError
from ..loaders.rig.rig_yaml import RigFile, rig_file_of
from ..model.configuration import Configuration
from ..render.raycast.surface_samples import SurfaceSamples, surface_samples

_RIM = 2  # pixels at the border of a shape are mixtures
_WHITE, _DARK = 250.0, 4.0  # gray levels beyond which a sensor says no more
_LEAST = 50  # pixels of a camera
_FAINT = 1e-3  # of intensities
_MOST_PIXELS = 1500  # of each camera in each image
_ROBUST_LEVELS = 6.0  # gray levels at which a pixel's pull stops growing: shine, shadows, folds
# How well directions (radians) are known beforehand, and the logarithms of intensities, gains and gammas
_DIRECTION_SIGMA, _INTENSITY_SIGMA, _GAIN_SIGMA, _GAMMA_SIGMA = 0.5, 0.7, 0.5, 0.5


@dataclass(frozen=True, eq=False)
class LightFit:
    """Result of `fit_lights`.

    Attributes
    ----------
    rig : with the lights, gains and gammas that have been found.
    rms_before, rms_after : per camera with images, gray levels between image and body.
    n_pixels : per camera with images.
    position_sigma_m : per light, the largest standard deviation of its place; nan without one.
    """

    rig: CameraRig
    rms_before: dict[str, float]
    rms_after: dict[str, float]
    n_pixels: dict[str, int]
    position_sigma_m: tuple[float, ...]
    converged: bool


def fit_lights(
    rig: CameraRig,
    configurations: Sequence[Configuration],
    images: Sequence[Sequence[np.ndarray | None]],
    position_sigma_m: float = 1.0,
    free_cameras: bool = True,
) -> LightFit:
    """The lights, gains and gammas that explain the images best.

    Parameters
    ----------
    rig : with the lights roughly as they are; their kinds and cones stay.
    configurations : the body in each pose.
    images : for each pose the BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none.
    position_sigma_m : how well places are known beforehand.
    free_cameras : gains and gammas are found, too.

    Returns
    -------
    The rig with the lights, gains and gammas found, and how well they fit.

    Raises
    ------
    TrackerError : a rig without lights, or no image at all.
    CalibrationError : a camera that sees too little of the body between black and white.
    """
    if not rig.lights:
        raise TrackerError("the rig has no lights to start with: put them into its file, their kinds and about where they are")
    rows = [i for i in range(len(rig)) if any(each[i] is not None for each in images)]
    if not rows:
        raise TrackerError("there is no image of any camera")
    seen = rig.subset([rig.names[i] for i in rows])
    views = [_CameraPixels.of(rig, i, configurations, [each[i] for each in images]) for i in rows]
    problem = _Problem(seen, views, position_sigma_m, free_cameras)
    start = np.zeros(problem.size)
    solution = least_squares(problem.residuals, start, loss="soft_l1", f_scale=_ROBUST_LEVELS, x_scale="jac", max_nfev=100)
    found = problem.rig_of(solution.x)
    rms = [{v.name: _rms(r) for v, r in zip(views, problem.differences(x), strict=True)} for x in (start, solution.x)]
    lit = replace(rig, cameras=tuple(found[c.name] if c.name in found.names else c for c in rig), lights=found.lights)
    return LightFit(
        lit, rms[0], rms[1], {view.name: len(view.seen) for view in views}, problem.position_sigmas(solution),
        bool(solution.success),
    )  # fmt: skip


def load_pose_images(patterns: Sequence[str], names: Sequence[str]) -> list[list[np.ndarray | None]]:
    """Images of every pose.

    Parameters
    ----------
    patterns : of each pose, with ``{name}`` in the place of the camera's.
    names : of the cameras.

    Returns
    -------
    For each pose the BGR images (h, w, 3) uint8 in the order of ``names``; None where there is no such file.

    Raises
    ------
    SourceError : a pattern without ``{name}``, a file that is no image, or no image at all.
    """
    images = [[_pose_image(pattern, name) for name in names] for pattern in patterns]
    if not any(image is not None for each in images for image in each):
        raise SourceError(patterns[0], "there is no image of any camera there")
    return images


def with_lights(rig_file: RigFile, fit: LightFit) -> RigFile:
    """The rig file with lights, gains and gammas of a fit.

    Parameters
    ----------
    rig_file : of the same cameras.
    fit : whose cameras without images stay as they are.

    Returns
    -------
    A copy.
    """
    found = rig_file_of(fit.rig)
    answers = {name: {"gain": found.cameras[name].gain, "gamma": found.cameras[name].gamma} for name in fit.n_pixels}
    return rig_file.with_cameras(answers).model_copy(update={"lights": found.lights})


def _pose_image(pattern: str, name: str) -> np.ndarray | None:
    """The image of a camera, or None where there is no such file."""
    try:
        path = Path(pattern.format(name=name))
    except (KeyError, IndexError, ValueError) as error:
        raise SourceError(pattern, "expected a pattern with {name}, such as 'pose1/{name}.png'") from error
    if not path.exists():
        return None
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise SourceError(path, "cannot be read as an image")
    return image


def irradiance(lights: Sequence[Light], points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Light on surfaces, by the law of `camera.light`.

    Parameters
    ----------
    lights : of the rig.
    points, normals : (n, 3) surface points and unit normals, world frame.

    Returns
    -------
    (n, 3) RGB.
    """
    total = np.zeros((len(points), 3))
    for light in lights:
        if light.kind == "ambient":
            total += np.asarray(light.intensity)
            continue
        axis = None if light.direction is None else np.asarray(light.direction) / np.linalg.norm(light.direction)
        if light.position is None:
            towards = np.broadcast_to(-np.asarray(axis), points.shape)
        else:
            towards = np.asarray(light.position) - points
            towards = towards / np.linalg.norm(towards, axis=1, keepdims=True)
        fraction = np.maximum((normals * towards).sum(axis=1), 0.0)
        if light.kind == "spot":
            outer, inner = np.cos(float(light.half_angle or 0.0)), np.cos(SPOT_EDGE * float(light.half_angle or 0.0))
            fraction = fraction * np.clip((-towards @ axis - outer) / (inner - outer), 0.0, 1.0)
        total += fraction[:, None] * np.asarray(light.intensity)
    return total


@dataclass(frozen=True, eq=False)
class _CameraPixels:
    """All pixels of one camera: points, normals, colors of the body there, and what was ``seen`` (n, 3) RGB."""

    name: str
    points: np.ndarray
    normals: np.ndarray
    colors: np.ndarray
    seen: np.ndarray

    @classmethod
    def of(cls, rig: CameraRig, i: int, configurations, images) -> _CameraPixels:
        camera, parts = rig.cameras[i], []
        for configuration, image in zip(configurations, images, strict=True):
            if image is None:
                continue
            if problem := camera.model.size_problem(image):
                raise CalibrationError(camera.name, problem)
            parts.append(_thinned(surface_samples(configuration, camera, rim=_RIM), image))
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)] if parts else [np.zeros((0, 3))] * 4
        if len(columns[0]) < _LEAST:
            raise CalibrationError(
                camera.name, f"only {len(columns[0])} pixels of the body are neither black nor white; expected {_LEAST} at least"
            )
        return cls(camera.name, *columns)


def _thinned(samples: SurfaceSamples, image: np.ndarray) -> tuple[np.ndarray, ...]:
    """Points, normals, colors and what was seen, at no more than `_MOST_PIXELS` pixels that are neither black nor white."""
    seen = image[samples.pixels[:, 1], samples.pixels[:, 0], ::-1].astype(np.float64)
    good = np.flatnonzero((seen.max(axis=1) < _WHITE) & (seen.max(axis=1) > _DARK))
    good = good[np.unique(np.linspace(0, max(len(good) - 1, 0), _MOST_PIXELS).astype(int))] if len(good) else good
    return samples.points[good], samples.normals[good], samples.colors_rgb[good], seen[good]


class _Problem:
    """Parameters: per light logarithms of intensities (3), then place (3) and direction (3) as it has them, all as departures in
    units of their sigmas; then per camera logarithms of gain (3; not the first's) and gamma."""

    def __init__(self, rig: CameraRig, views: Sequence[_CameraPixels], position_sigma_m: float, free_cameras: bool):
        self.rig, self.views, self.position_sigma_m, self.free_cameras = rig, views, position_sigma_m, free_cameras
        self.parts = [3 + 3 * (light.position is not None) + 3 * (light.direction is not None) for light in rig.lights]
        self.size = sum(self.parts) + ((4 * len(rig) - 3) if free_cameras else 0)

    def lights_of(self, x: np.ndarray) -> tuple[Light, ...]:
        lights, at = [], 0
        for light, size in zip(self.rig.lights, self.parts, strict=True):
            values, k = x[at : at + size], 3
            intensity = np.maximum(light.intensity, _FAINT) * np.exp(_INTENSITY_SIGMA * values[:3])
            changes: dict = {"intensity": tuple(map(float, intensity))}
            if light.position is not None:
                changes["position"] = tuple(map(float, light.position + self.position_sigma_m * values[k : k + 3]))
                k += 3
            if light.direction is not None:
                axis = np.asarray(light.direction) / np.linalg.norm(light.direction)
                changes["direction"] = tuple(map(float, axis + _DIRECTION_SIGMA * values[k : k + 3]))
            lights.append(replace(light, **changes))
            at += size
        return tuple(lights)

    def rig_of(self, x: np.ndarray) -> CameraRig:
        cameras, at = [], sum(self.parts)
        for i, camera in enumerate(self.rig):
            if self.free_cameras:
                n = 3 if i else 0
                gain = np.array(camera.gain) * (np.exp(_GAIN_SIGMA * x[at : at + n]) if n else 1.0)
                gamma = camera.gamma * float(np.exp(_GAMMA_SIGMA * x[at + n]))
                camera = replace(camera, gain=(float(gain[0]), float(gain[1]), float(gain[2])), gamma=gamma)
                at += n + 1
            cameras.append(camera)
        return replace(self.rig, cameras=tuple(cameras), lights=self.lights_of(x))

    def differences(self, x: np.ndarray) -> list[np.ndarray]:
        """Per camera (n, 3) gray levels, shown minus seen."""
        rig = self.rig_of(x)
        result = []
        for camera, view in zip(rig, self.views, strict=True):
            light = np.maximum(np.array(camera.gain) * irradiance(rig.lights, view.points, view.normals), 1e-6)
            result.append(np.minimum(view.colors * light ** (1.0 / camera.gamma), 255.0) - view.seen)
        return result

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Differences, and the departures that the prior holds small (in gray levels: a sigma as much as one pixel's level)."""
        return np.concatenate([*(d.ravel() for d in self.differences(x)), x])

    def position_sigmas(self, solution) -> tuple[float, ...]:
        noise = max(float(np.median(np.abs(solution.fun))) * 1.4826, 0.3)
        covariance = noise**2 * np.linalg.pinv(solution.jac.T @ solution.jac)
        sigmas, at = [], 0
        for light, size in zip(self.rig.lights, self.parts, strict=True):
            place = np.sqrt(np.diag(covariance)[at + 3 : at + 6]).max() * self.position_sigma_m
            sigmas.append(float(place) if light.position is not None else float("nan"))
            at += size
        return tuple(sigmas)


def _rms(differences: np.ndarray) -> float:
    return float(np.sqrt(np.mean(differences**2)))
