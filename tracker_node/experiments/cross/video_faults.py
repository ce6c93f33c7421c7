"""What an analog video camera and its tape do to an image, as on Hi-8.

How a camera answers to light (gain, gamma) is the renderer's business, and two instants in one image that of
`observation.deinterlace`. Between them: the limited bandwidth of luma, the much more limited one of chroma, noise of both.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np


@dataclass(frozen=True)
class TapeFaults:
    """Lengths are standard deviations of Gaussian low-passes along the lines, in pixels; noise in grey levels.

    The defaults are those of good Hi-8: luma of about 400 lines, chroma of a quarter of that as with 4:1:1 sampling, a signal to
    noise ratio of about 40 dB.
    """

    luma_blur_px: float = 0.8
    chroma_blur_px: float = 3.5
    luma_noise: float = 3.0
    chroma_noise: float = 4.0


def record(image: np.ndarray, faults: TapeFaults, rng: np.random.Generator) -> np.ndarray:
    """A BGR image (h, w, 3) uint8 as it comes back from tape. Only lines: nothing is mixed between them, so fields may be woven
    before or after."""
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
    """Gaussian low-pass along the rows of (h, w) or (h, w, c) float32; none for a sigma of zero."""
    if sigma_px <= 0.0:
        return values
    size = 2 * int(np.ceil(3.0 * sigma_px)) + 1
    return cv2.GaussianBlur(values, (size, 1), sigma_px, borderType=cv2.BORDER_REPLICATE)
