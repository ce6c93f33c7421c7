"""Image sets from images, with accounts that outlast a change of cameras or of the synchronizer's parameters."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from ..observation.image_set import CameraImage, ImageSet
from ..observation.synchronizer import ImageSynchronizer
from ..tracking.config import SynchronizerConfig


def make_synchronizer(cameras: tuple[str, ...], config: SynchronizerConfig) -> ImageSynchronizer:
    """A synchronizer by its parameters; with fewer cameras than ``min_cameras`` all of them are asked for.

    Parameters
    ----------
    cameras : names, in the order of the rig.
    config : its parameters.

    Returns
    -------
    synchronizer : without images.
    """
    return ImageSynchronizer(
        cameras,
        image_period_s=config.image_period_s,
        tolerance=config.tolerance,
        queue_s=config.queue_s,
        min_cameras=min(config.min_cameras, len(cameras)),
    )


@dataclass(frozen=True, eq=False)
class _Account:
    """A synchronizer and what came before it; exchanged as one, since another thread reads the counts."""

    synchronizer: ImageSynchronizer
    config: SynchronizerConfig
    images_before: dict[str, Counter[str]] = field(default_factory=dict)
    sets_before: Counter[str] = field(default_factory=Counter)
    not_formed_before: Counter[str] = field(default_factory=Counter)
    jumps_before: int = 0

    def images(self) -> dict[str, Counter[str]]:
        result = {camera: Counter(counts) for camera, counts in self.images_before.items()}
        for camera, counts in self.synchronizer.counters.items():
            result.setdefault(camera, Counter()).update(counts)
        return result

    def sets(self) -> Counter[str]:
        now = self.synchronizer
        result = Counter({"complete": now.sets_complete, "of fewer cameras": now.sets_incomplete})
        result.update(self.sets_before)
        return result

    def not_formed(self) -> Counter[str]:
        result = Counter(self.synchronizer.sets_not_formed)
        result.update(self.not_formed_before)
        return result

    def jumps(self) -> int:
        return self.jumps_before + self.synchronizer.clock_jumps

    def changed(self, cameras: tuple[str, ...], config: SynchronizerConfig) -> _Account:
        """The next one; nothing may wait any more."""
        made = make_synchronizer(cameras, config)
        return _Account(made, config, self.images(), self.sets(), self.not_formed(), self.jumps())


class SetFormation:
    """Matches images to sets, as an `ImageSynchronizer` that can be exchanged and that cameras can be taken out of."""

    def __init__(self, cameras: tuple[str, ...], config: SynchronizerConfig):
        self._now = _Account(make_synchronizer(cameras, config), config)
        self._leaving: dict[str, int] = {}  # camera -> stamp of its last image

    @property
    def cameras(self) -> tuple[str, ...]:
        """Those that sets are made of now."""
        return self._now.synchronizer.cameras

    def change(self, cameras: tuple[str, ...], config: SynchronizerConfig) -> None:
        """Other cameras or parameters; images that wait are counted as ``reset``.

        Parameters
        ----------
        cameras : names, in the order of the rig.
        config : parameters of the synchronizer.
        """
        old = self._now
        if cameras == old.synchronizer.cameras and config == old.config:
            return
        old.synchronizer.reset()
        self._now = old.changed(cameras, config)
        self._leaving.clear()

    def drop(self, camera: str, last_stamp_ns: int) -> None:
        """No image of ``camera`` comes after this stamp; its sets up to there are still made.

        Parameters
        ----------
        camera : its name.
        last_stamp_ns : integer nanoseconds.
        """
        self._leaving[camera] = last_stamp_ns

    def add(self, image: CameraImage) -> list[ImageSet]:
        """As `ImageSynchronizer.add`."""
        sets = self._without_those_gone(image.stamp_ns) if self._leaving else []
        return sets + self._now.synchronizer.add(image)

    def _without_those_gone(self, stamp_ns: int) -> list[ImageSet]:
        config = self._now.config
        tolerance_ns = round(config.tolerance * config.image_period_s * 1e9)
        gone = [camera for camera, last_ns in self._leaving.items() if stamp_ns > last_ns + tolerance_ns]
        if not gone:
            return []
        sets = self.flush()
        for camera in gone:
            del self._leaving[camera]
        self._now = self._now.changed(tuple(camera for camera in self.cameras if camera not in gone), config)
        return sets

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
        now = self._now
        return {**now.sets(), **{f"not formed, {reason}": n for reason, n in now.not_formed().items()}}

    @property
    def sets_not_formed(self) -> dict[str, int]:
        """Time steps without a set, by the reasons of the synchronizer."""
        return dict(self._now.not_formed())
