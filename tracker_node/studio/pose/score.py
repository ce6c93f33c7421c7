"""What is said of a pose while it is set by hand, whichever way it is scored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...model.configuration import State


@dataclass(frozen=True)
class CameraScore:
    """What one camera says of a pose: ``value`` up to 1, None where it sees too little of the body, by so many samples."""

    camera: str
    value: float | None
    samples: int


@dataclass(frozen=True)
class PoseScore:
    """Of a pose: all cameras together, each of them, and each part of the body (None: seen too little)."""

    total: float | None
    cameras: tuple[CameraScore, ...]
    parts: tuple[float | None, ...]


class PoseScorer(Protocol):
    """Scores poses of one body in images of one rig; 1 is best.

    ``name`` and ``meaning`` say of what the score is. Not for several threads at once.
    """

    name: str
    meaning: str

    def score(self, state: State, images: Mapping[str, np.ndarray]) -> PoseScore:
        """Of a state in images (h, w, 3) uint8 BGR by camera; cameras without one say nothing."""
        ...
