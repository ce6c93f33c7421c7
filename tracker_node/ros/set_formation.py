"""Image sets from images, with accounts that outlast a change of cameras or of the synchronizer's parameters."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, replace

from ..observation.image_set import CameraImage, ImageSet
from ..observation.image_synchronizer import ImageSynchronizer
from ..tracking.config import SynchronizerConfig


class SetFormation:
    """An `ImageSynchronizer` that can be exchanged. With fewer cameras than ``min_cameras`` all of them are asked for."""

    def __init__(self, cameras: tuple[str, ...], config: SynchronizerConfig):
        self._config = config
        self._synchronizer = _synchronizer(cameras, config)
        self._images_before: dict[str, Counter[str]] = {}
        self._sets_before: Counter[str] = Counter()
        self._jumps_before = 0

    def change(self, cameras: tuple[str, ...], config: SynchronizerConfig) -> None:
        """Other cameras or parameters; images that wait are counted as ``reset``."""
        if cameras == self._synchronizer.cameras and config == self._config:
            return
        self.reset()
        self._images_before, self._sets_before, self._jumps_before = self._images(), self._sets(), self.clock_jumps
        self._config, self._synchronizer = config, _synchronizer(cameras, config)

    def add(self, image: CameraImage) -> list[ImageSet]:
        """As `ImageSynchronizer.add`."""
        return self._synchronizer.add(image)

    def flush(self) -> list[ImageSet]:
        """As `ImageSynchronizer.flush`."""
        return self._synchronizer.flush()

    def reset(self) -> None:
        """As `ImageSynchronizer.reset`."""
        self._synchronizer.reset()

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        """Per camera that is or was in use, what became of its images: see `ImageSynchronizer.counters`."""
        return {camera: dict(counts) for camera, counts in self._images().items()}

    @property
    def clock_jumps(self) -> int:
        """How often stamps went back by more than images overtake each other."""
        return self._jumps_before + self._synchronizer.clock_jumps

    @property
    def sets(self) -> dict[str, int]:
        """``complete`` and ``of fewer cameras``, and ``not formed, <reason>`` for each reason."""
        return dict(self._sets())

    def _images(self) -> dict[str, Counter[str]]:
        result = {camera: Counter(counts) for camera, counts in self._images_before.items()}
        for camera, counts in self._synchronizer.counters.items():
            result.setdefault(camera, Counter()).update(counts)
        return result

    def _sets(self) -> Counter[str]:
        now = self._synchronizer
        result = Counter({"complete": now.sets_complete, "of fewer cameras": now.sets_incomplete})
        result.update({f"not formed, {reason}": n for reason, n in now.sets_not_formed.items()})
        result.update(self._sets_before)
        return result


def _synchronizer(cameras: tuple[str, ...], config: SynchronizerConfig) -> ImageSynchronizer:
    return ImageSynchronizer(cameras, **asdict(replace(config, min_cameras=min(config.min_cameras, len(cameras)))))
