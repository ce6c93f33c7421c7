"""What a renderer gives, and what every renderer can do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..camera.light import Light
from ..camera.rig import Camera
from ..model.configuration import Configuration

Region = tuple[int, int, int, int]
"""Part of an image as (u0, v0, u1, v1): columns u0 <= u < u1, rows v0 <= v < v1."""


@dataclass(frozen=True, eq=False)
class RenderedView:
    """A body as one camera sees it, in ``region`` of the image.

    Attributes
    ----------
    labels : (h, w) uint8; 0 where there is nothing, i + 1 where ``model.shapes[i]`` is in front.
    depth : (h, w) float32, meters along the optical axis; infinite where there is nothing.
    region : where in the image the arrays lie.
    """

    labels: np.ndarray
    depth: np.ndarray
    region: Region

    @property
    def mask(self) -> np.ndarray:
        """(h, w) uint8, 255 where the body is."""
        return np.where(self.labels > 0, np.uint8(255), np.uint8(0))


@dataclass(frozen=True, eq=False)
class ColoredView(RenderedView):
    """A body as one camera sees it, in its colors.

    Attributes
    ----------
    rgb : (h, w, 3) float32 in 0..255, not rounded; 0 where there is nothing.
    """

    rgb: np.ndarray


class Renderer(Protocol):
    """Draws a body by labels, depth and colors."""

    def render_view(self, configuration: Configuration, camera: Camera, region: Region | None = None) -> RenderedView:
        """Labels and depth of a body.

        Parameters
        ----------
        configuration : the posed body.
        camera : with its lens and pose.
        region : part of the image to draw; the whole image without it.

        Returns
        -------
        The view on the region.
        """
        ...

    def render_color(
        self, configuration: Configuration, camera: Camera, lights: Sequence[Light] = (), region: Region | None = None
    ) -> ColoredView:
        """The same with colors.

        Parameters
        ----------
        configuration, camera : as of `render_view`.
        lights : in the world; none stands for an ambient light of intensity one (see `camera.light`).
        region : as of `render_view`.

        Returns
        -------
        The view on the region.
        """
        ...
