"""Image sets from images, with accounts that outlast a change of cameras or of the synchronizer's parameters."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass, field, replace

from ...observation.image_set import CameraImage, ImageSet
from ...observation.synchronizer import ImageSynchronizer
from ...tracking.config import SynchronizerConfig


@dataclass(frozen=True, eq=False)
class _Account:
    """A synchronizer and what came before it; exchanged as one, since another thread reads the counts."""

    synchronizer: ImageSynchronizer
    config: SynchronizerConfig
    images_before: dict[str, Counter[str]] = field(default_factory=dict)
    sets_before: Counter[str] = field(default_factory=Counter)
    jumps_before: int = 0

    def images(self) -> dict[str, Counter[str]]:
        result = {camera: Counter(counts) for camera, counts in self.images_before.items()}
        for camera, counts in self.synchronizer.counters.items():
            result.setdefault(camera, Counter()).update(counts)
        return result

    def sets(self) -> Counter[str]:
        now = self.synchronizer
        result = Counter({"complete": now.sets_complete, "of fewer cameras": now.sets_incomplete})
        result.update({f"not formed, {reason}": n for reason, n in now.sets_not_formed.items()})
        result.update(self.sets_before)
        return result

    def jumps(self) -> int:
        return self.jumps_before + self.synchronizer.clock_jumps


class SetFormation:
    """An `ImageSynchronizer` that can be exchanged. With fewer cameras than ``min_cameras`` all of them are asked for."""

    def __init__(self, cameras: tuple[str, ...], config: SynchronizerConfig):
        self._now = _Account(_synchronizer(cameras, config), config)

    def change(self, cameras: tuple[str, ...], config: SynchronizerConfig) -> None:
        """Other cameras or parameters; images that wait are counted as ``reset``."""
        old = self._now
        if cameras == old.synchronizer.cameras and config == old.config:
            return
        old.synchronizer.reset()
        self._now = _Account(_synchronizer(cameras, config), config, old.images(), old.sets(), old.jumps())

    def add(self, image: CameraImage) -> list[ImageSet]:
        """As `ImageSynchronizer.add`."""
        return self._now.synchronizer.add(image)

    def flush(self) -> list[ImageSet]:
        """As `ImageSynchronizer.flush`."""
        return self._now.synchronizer.flush()

    def reset(self) -> None:
        """As `ImageSynchronizer.reset`."""
        self._now.synchronizer.reset()

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        """Per camera that is or was in use, what became of its images: see `ImageSynchronizer.counters`."""
        return {camera: dict(counts) for camera, counts in self._now.images().items()}

    @property
    def clock_jumps(self) -> int:
        """How often stamps went back by more than images overtake each other."""
        return self._now.jumps()

    @property
    def sets(self) -> dict[str, int]:
        """``complete`` and ``of fewer cameras``, and ``not formed, <reason>`` for each reason."""
        return dict(self._now.sets())


def _synchronizer(cameras: tuple[str, ...], config: SynchronizerConfig) -> ImageSynchronizer:
    return ImageSynchronizer(cameras, **asdict(replace(config, min_cameras=min(config.min_cameras, len(cameras)))))
