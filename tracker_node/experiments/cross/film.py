"""Films a thrown cross as analog interlaced video.

Every field is drawn at its own time over a still background, goes through the faults of camera and tape, and is woven with the
next one into an image.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration
from ...observation.deinterlace import first_line, interpolate_lines, separate_fields, weave_fields
from ..target_images import TargetStudio
from .throw import LATE_CAMERA, LATE_S, CrossTrial


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
    rng: np.random.Generator, faults: TapeFaults | None = None, done: Callable[[int], None] = lambda field: None,
) -> Footage:  # fmt: skip
    """Interlaced video of a trial from every camera of the studio.

    Parameters
    ----------
    model : the cross.
    trial : its throw.
    studio : draws it, with the cameras of its rig.
    backgrounds : (h, w, 3) BGR uint8, one of each camera.
    rng : noise of the tape.
    faults : of camera and tape.
    done : called with every field that has been filmed.

    Returns
    -------
    The video of all cameras.
    """
    faults = faults or TapeFaults()
    fields: list[list[np.ndarray]] = [[] for _ in studio.rig]
    for field in range(trial.n_fields + trial.n_fields % 2):  # an odd last one would have no partner
        for i, camera in enumerate(studio.rig):
            state = trial.state(field, LATE_S if camera.name == LATE_CAMERA else 0.0)
            picture = studio.image(i, Configuration(model, state), backgrounds[i])
            fields[i].append(record(picture[first_line(field) :: 2], faults, rng))
        done(field)
    images = tuple(tuple(weave_fields(a, b) for a, b in zip(own[::2], own[1::2], strict=True)) for own in fields)
    return Footage(images, trial.n_fields)


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
