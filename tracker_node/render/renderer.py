"""What a renderer gives, and what every renderer can do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..camera.camera_rig import Camera
from ..model.configuration import Configuration

Region = tuple[int, int, int, int]
"""Part of an image as (u0, v0, u1, v1): columns u0 <= u < u1, rows v0 <= v < v1."""


@dataclass(frozen=True, eq=False)
class RenderedView:
    """A body as one camera sees it, in ``region`` of the image.

    Attributes
    ----------
    labels : (h, w) uint8; 0 where there is nothing, i + 1 where ``model.shapes[i]`` is in front.
    depth : (h, w) float32, metres along the optical axis; infinite where there is nothing.
    region : where in the image the arrays lie.
    """

    labels: np.ndarray
    depth: np.ndarray
    region: Region

    @property
    def mask(self) -> np.ndarray:
        """(h, w) uint8, 255 where the body is."""
        return np.where(self.labels > 0, np.uint8(255), np.uint8(0))


class Renderer(Protocol):
    """Draws a body by labels and depth."""

    def render_view(self, configuration: Configuration, camera: Camera, region: Region | None = None) -> RenderedView:
        """The view of ``camera``, or the part of it in ``region``."""
        ...
