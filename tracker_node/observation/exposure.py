"""Light that changes in a whole image: lamps, automatic exposure and white balance, taken out as a gain per camera and channel.

What colors were learned, of body and background, is compared with images in the light in which it was learned. Most of what a
fixed camera sees stands still, so the gain of a channel is the median of the ratios between its pixels now and before: closed
form, and the body that moves does not matter. Where the ratios differ from pixel to pixel, the image shows something else, and no
gain makes up for that.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ..compiled.kernels import compiled

_EVERY = 16  # pixel of a row, and row, is compared...
_LARGE = 1e6  # ...and fewer of an image of more pixels
_DARK, _BRIGHT = 16.0, 245.0  # gray levels between which a pixel tells its light
_LEAST_PIXELS = 40
_MIDDLE = (0.35, 0.5, 0.65)  # quantiles of the ratios: who walks before a wall covers it in one image and bares it in the other
_SCATTER = 0.1  # by which the last of them is above the first, beyond which the image shows something else
_LEAST_GAIN = 0.02  # difference to 1, below which an image is left as it is
_SAME = 0.01  # difference of the means, below which no gain is looked for: medians take longer
_RATE = 0.05  # weight of the newest image in what is compared with
_OTHER_SETS = 30  # images in a row that show something else, after which that is what is compared with


class Exposure:
    """The light of one camera, against that of its first image; deterministic in what it is given.

    Attributes
    ----------
    gains : (3,) of the last image, by channel.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """The next image is the first."""
        self._before: np.ndarray | None = None
        self._others = 0
        self.gains = np.ones(3)

    def normalized(self, image: np.ndarray) -> np.ndarray:
        """The next image as it would be in the light of the first one.

        Parameters
        ----------
        image : (h, w, 3) uint8.

        Returns
        -------
        The image itself where its light is that of the first.
        """
        every = _EVERY * max(round(np.sqrt(image.shape[0] * image.shape[1] / _LARGE)), 1)
        some = image[::every, ::every]
        if self._before is None or self._before.shape != some.shape:
            self._before = some.astype(np.float32)
            return image
        if _follow_alike(image, every, self._before):
            self.gains, self._others = np.ones(3), 0
            return image
        now = some.astype(np.float32)
        gains = _gains(now, self._before)
        self._learn(now, gains)
        if gains is None or np.abs(gains - 1.0).max() < _LEAST_GAIN:
            return image
        levels = np.arange(256.0)[:, None] / gains
        return cv2.LUT(image, np.clip(np.rint(levels), 0, 255).astype(np.uint8)[None])

    def _learn(self, now: np.ndarray, gains: np.ndarray | None) -> None:
        assert self._before is not None
        self.gains = np.ones(3) if gains is None else gains
        self._others = self._others + 1 if gains is None else 0
        if gains is not None:
            told = None if gains.max() <= 1.0 else (now.max(axis=2) < _BRIGHT).astype(np.uint8)  # what is cut off says less
            cv2.accumulateWeighted(now / gains.astype(np.float32), self._before, _RATE, told)
        elif self._others >= _OTHER_SETS:
            self._before, self._others = now, 0


@compiled
def _follow_alike(image, every, before):
    """Have ``before`` follow every so many pixels of an image, where the means of their channels are alike; whether they are."""
    now, then = np.zeros(3), np.zeros(3)
    for i in range(before.shape[0]):
        for j in range(before.shape[1]):
            for k in range(3):
                now[k] += image[i * every, j * every, k]
                then[k] += before[i, j, k]
    for k in range(3):
        if not abs(now[k] - then[k]) < _SAME * then[k]:
            return False
    for i in range(before.shape[0]):
        for j in range(before.shape[1]):
            for k in range(3):
                before[i, j, k] += np.float32(_RATE) * (np.float32(image[i * every, j * every, k]) - before[i, j, k])
    return True


def _gains(now: np.ndarray, before: np.ndarray) -> np.ndarray | None:
    """(3,) by which the light of an image differs from that of another; None where it is another picture."""
    gains = np.empty(3)
    for channel in range(3):
        a, b = now[:, :, channel], before[:, :, channel]
        told = (a > _DARK) & (a < _BRIGHT) & (b > _DARK) & (b < _BRIGHT)
        n = int(told.sum())
        if n < _LEAST_PIXELS:
            return None
        places = [int(quantile * n) for quantile in _MIDDLE]
        low, middle, high = np.partition(a[told] / b[told], places)[places]
        if high > (1.0 + _SCATTER) * low:
            return None
        gains[channel] = middle
    return gains


class Exposures:
    """The `Exposure` of every camera of a rig.

    Parameters
    ----------
    n_cameras : of the rig.
    """

    def __init__(self, n_cameras: int):
        self._cameras = [Exposure() for _ in range(n_cameras)]

    def reset(self) -> None:
        """The next images are the first."""
        for camera in self._cameras:
            camera.reset()

    def normalized(self, images: Sequence[np.ndarray | None]) -> list[np.ndarray | None]:
        """All images of the next set in the light of the first ones.

        Parameters
        ----------
        images : BGR pixels per camera, None where the set has none.

        Returns
        -------
        In the same order.
        """
        paired = zip(self._cameras, images, strict=True)
        return [None if image is None else camera.normalized(image) for camera, image in paired]
