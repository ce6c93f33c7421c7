"""From linear light to the file of an image: exposure, blur, tone curve, noise, JPEG."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

_TONES = 4096
_TONE_CURVE = (255.0 * np.linspace(0.0, 1.0, _TONES) ** (2.0 / 2.2)).astype(np.float32)  # of the square root of light


@dataclass(frozen=True, eq=False)
class Sensor:
    """Of one camera.

    Parameters
    ----------
    gains : (3,) of linear RGB, exposure and white balance.
    blur_px : standard deviation of the lens's blur.
    noise : standard deviation, gray levels.
    jpeg_quality : of the files.
    """

    gains: np.ndarray
    blur_px: float
    noise: float
    jpeg_quality: int

    def develop(self, light: np.ndarray, rng: np.random.Generator, exposure: float = 1.0) -> np.ndarray:
        """The image of a scene.

        Parameters
        ----------
        light : (h, w, 3) float32 linear RGB.
        rng : of the noise.
        exposure : factor of the gains.

        Returns
        -------
        (h, w, 3) uint8 BGR.
        """
        light = cv2.GaussianBlur(light, (0, 0), self.blur_px)
        root = np.sqrt(np.clip(light * (self.gains * exposure).astype(np.float32), 0.0, 1.0))
        image = _TONE_CURVE[(root * (_TONES - 1)).astype(np.int32)]
        image += np.float32(self.noise) * rng.standard_normal(image.shape, dtype=np.float32)
        return np.ascontiguousarray(np.clip(image + 0.5, 0.0, 255.0).astype(np.uint8)[:, :, ::-1])

    def write(self, image: np.ndarray, path: Path) -> None:
        """Write a JPEG file.

        Parameters
        ----------
        image : (h, w, 3) uint8 BGR.
        path : of the file.
        """
        _, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self.jpeg_quality])
        path.write_bytes(encoded.tobytes())


def draw_sensor(scene: np.ndarray, rng: np.random.Generator) -> Sensor:
    """A camera exposed for a scene.

    Parameters
    ----------
    scene : (h, w, 3) linear RGB.
    rng : decides brightness, white balance, noise and quality.

    Returns
    -------
    The sensor.
    """
    target = rng.uniform(0.34, 0.5) ** 2.2
    balance = rng.uniform(0.95, 1.05, 3)
    return Sensor(
        target / float(np.median(scene.mean(axis=2))) * balance, float(rng.uniform(0.45, 0.8)), float(rng.uniform(2.0, 5.0)),
        int(rng.integers(80, 94)),
    )  # fmt: skip
