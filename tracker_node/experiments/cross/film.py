"""Films a thrown cross as analog interlaced video.

Every field is drawn at its own instant over a still background, goes through the faults of camera and tape, and is woven with the
next one into an image.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration
from ...observation.deinterlace import first_line, interpolate_lines, separate_fields, weave_fields
from ..target_images import TargetStudio
from .throw import LATE_CAMERA, LATE_S, CrossTrial
from .video_faults import TapeFaults, record


@dataclass(frozen=True, eq=False)
class Footage:
    """``images[camera][j]`` is the j-th interlaced image (h, w, 3) BGR uint8 of a camera, of the fields 2 j and 2 j + 1."""

    images: tuple[tuple[np.ndarray, ...], ...]
    n_fields: int

    def interpolated(self, field: int) -> list[np.ndarray]:
        """Every camera's image of one instant at full height, missing lines interpolated."""
        return [interpolate_lines(own, first_line(field)) for own in self.own_lines(field)]

    def own_lines(self, field: int) -> list[np.ndarray]:
        """Every camera's field of one instant at half height: the lines that were exposed."""
        return [np.ascontiguousarray(separate_fields(camera[field // 2])[field % 2]) for camera in self.images]


def film(
    model: ArticulatedModel, trial: CrossTrial, studio: TargetStudio, backgrounds: Sequence[np.ndarray],
    rng: np.random.Generator, faults: TapeFaults | None = None, done: Callable[[int], None] = lambda field: None,
) -> Footage:  # fmt: skip
    """Interlaced video of a trial from every camera of the studio.

    Parameters
    ----------
    backgrounds : (h, w, 3) BGR uint8, one of each camera.
    done : told every field that has been filmed.
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
