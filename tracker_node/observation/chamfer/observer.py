"""Evidence of one camera: learns the colors of body and background, and turns an image into distance maps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np

from ...errors import CalibrationError
from ..appearance import SEEN, ColorModel, Region, SceneModel, body_log_odds, grown, shrunk
from .boundary import boundary_points, boundary_shifts, edge_distance, shift_map
from .distance_transform import signed_distance


class BackgroundOptions(Protocol):
    """The fields of the tracker's background configuration that are read here (their meaning is stated there)."""

    @property
    def sigma(self) -> float: ...
    @property
    def shadow(self) -> float: ...
    @property
    def learning_rate(self) -> float: ...
    @property
    def body_margin_px(self) -> int: ...


class ObserverOptions(Protocol):
    """The fields of the tracker's chamfer configuration that are read here."""

    @property
    def silhouette(self) -> str: ...
    @property
    def threshold(self) -> float: ...
    @property
    def smoothing_px(self) -> int: ...
    @property
    def color_rate(self) -> float: ...
    @property
    def reach_px(self) -> int: ...
    @property
    def truncation_px(self) -> float: ...

    @property
    def edge_truncation_px(self) -> float: ...
    @property
    def boundary_step_px(self) -> int: ...

    @property
    def refine_boundary(self) -> bool: ...
    @property
    def canny_low(self) -> float: ...
    @property
    def canny_high(self) -> float: ...


@dataclass(frozen=True, eq=False)
class Observation:
    """Evidence of one image on the crop ``region`` (u0, v0, u1, v1).

    ``silhouette`` uint8 (0 or 1), ``edges`` uint8 (0 or 255), ``silhouette_distance`` float32 signed (positive outside) and
    ``edge_distance`` float32, pixels, truncated. ``boundary`` (n, 4) points of the silhouette's boundary and normals. ``empty``
    when no pixel is body.
    """

    camera: str
    region: Region
    silhouette: np.ndarray
    edges: np.ndarray
    silhouette_distance: np.ndarray
    edge_distance: np.ndarray
    boundary: np.ndarray
    empty: bool


def checked_backgrounds(camera: str, width: int, height: int, given: np.ndarray | list | None) -> list[np.ndarray]:
    """Background images of a camera as a list.

    Parameters
    ----------
    camera : its name.
    width, height : of its images, pixels.
    given : BGR image of the empty scene, or a list of them, or None.

    Returns
    -------
    There may be none.

    Raises
    ------
    CalibrationError : one of them has another size than the camera's images.
    """
    backgrounds = [] if given is None else ([given] if isinstance(given, np.ndarray) else list(given))
    for image in backgrounds:
        if image.shape[:2] != (height, width):
            got = f"{image.shape[1]}x{image.shape[0]}"
            raise CalibrationError(camera, f"expected a background image of {width}x{height}, got {got}")
    return backgrounds


class Observer:
    """Evidence of one camera.

    Parameters
    ----------
    camera : its name.
    size : width and height of the images, pixels.
    given : BGR image of the empty scene, or a list of them, or None.

    Raises
    ------
    CalibrationError : a background image of another size, or none where the options ask for one.
    """

    def __init__(
        self,
        camera: str,
        size: tuple[int, int],
        options: ObserverOptions,
        background: BackgroundOptions,
        given: np.ndarray | list | None = None,
    ):
        self.camera, self._options, self._background = camera, options, background
        width, height = size
        backgrounds = checked_backgrounds(camera, width, height, given)
        if options.silhouette == "background" and not backgrounds:
            raise CalibrationError(
                camera, "chamfer.silhouette 'background' needs an image of the empty scene; the rig names none"
            )
        self.learns = options.silhouette == "both"
        self._size, self._backgrounds = (height, width), backgrounds
        self._colors, self._scene = ColorModel(), self._empty_scene()

    def _empty_scene(self) -> SceneModel:
        """The background as its images have it, or unknown."""
        sigma = self._background.sigma
        return SceneModel.from_images(self._backgrounds, sigma) if self._backgrounds else SceneModel(*self._size, sigma)

    def begin(self, bgr: np.ndarray, region: Region, body: np.ndarray, margin_px: int) -> None:
        """Learn colors and background anew from an image in which the body is about where it is drawn.

        Parameters
        ----------
        bgr : (height, width, 3) uint8.
        region : (u0, v0, u1, v1) of ``body``.
        body : (h, w) uint8 labels on the region, 0 beside the body.
        margin_px : the body lies within so much of the labels.
        """
        if not self.learns:
            return
        u0, v0, u1, v1 = region
        near = grown(body, margin_px)
        self._colors = ColorModel()
        self._colors.learn(bgr[v0:v1, u0:u1], shrunk(body, 2), near == 0, 1.0)
        whole = np.zeros(bgr.shape[:2], dtype=np.uint8)
        whole[v0:v1, u0:u1] = near
        self._scene = self._empty_scene()
        self._scene.learn_first(bgr, whole)

    def learn(self, bgr: np.ndarray, region: Region, body: np.ndarray) -> None:
        """Mix in an image in which the body is known.

        Parameters
        ----------
        bgr : (height, width, 3) uint8.
        region : (u0, v0, u1, v1) of ``body``.
        body : (h, w) uint8 labels on the region, 0 beside the body.
        """
        options, background = self._options, self._background
        if not self.learns:
            return
        u0, v0, u1, v1 = region
        near = grown(body, background.body_margin_px)
        self._colors.learn(bgr[v0:v1, u0:u1], shrunk(body, 2), near == 0, options.color_rate)
        if background.learning_rate > 0:
            self._scene.update(bgr, near, background.learning_rate, region)

    def observe(self, bgr: np.ndarray, region: Region, predicted: np.ndarray) -> Observation:
        """Evidence of an image around the predicted body.

        Parameters
        ----------
        bgr : (height, width, 3) uint8.
        region : (u0, v0, u1, v1), the crop.
        predicted : (h, w) uint8 labels on the crop, 0 beside the body.

        Returns
        -------
        Silhouette, edges and their distance maps on the crop.
        """
        options = self._options
        u0, v0, u1, v1 = region
        odds = body_log_odds(bgr, region, self._scene, self._colors, self._background.shadow)
        silhouette = (odds > options.threshold).view(np.uint8)
        if options.smoothing_px > 1:
            silhouette = np.asarray(cv2.medianBlur(silhouette, options.smoothing_px), dtype=np.uint8)
        near = grown(predicted, options.reach_px)
        silhouette &= near
        gray = cv2.cvtColor(bgr[v0:v1, u0:u1], cv2.COLOR_BGR2GRAY)
        to_edge, edges = edge_distance(gray, silhouette, options.canny_low, options.canny_high, options.edge_truncation_px)
        to_silhouette = signed_distance(silhouette, options.truncation_px)
        to_silhouette = np.asarray(cv2.blur(to_silhouette, (3, 3)), dtype=np.float32)  # evens out the staircase of the mask
        trusted = cv2.erode(near, _SQUARE)  # where the silhouette is cut off by the reach, there is no boundary
        boundary = boundary_points(silhouette, to_silhouette, trusted, _FINE_STEP)
        if options.refine_boundary:
            to_silhouette -= self._refinement(bgr, region, boundary)
        boundary = np.ascontiguousarray(boundary[:: max(1, round(options.boundary_step_px / _FINE_STEP))])
        return Observation(self.camera, region, silhouette, edges, to_silhouette, to_edge, boundary, not silhouette.any())

    def _refinement(self, bgr: np.ndarray, region: Region, boundary: np.ndarray) -> np.ndarray:
        """How far outward the silhouette's boundary is to be moved (float32, pixels, on the crop)."""
        u0, v0, u1, v1 = region
        scene = self._scene
        seen = (scene.known[v0:v1, u0:u1] == SEEN).view(np.uint8)
        shifts, weights = boundary_shifts(bgr[v0:v1, u0:u1], scene.mean[v0:v1, u0:u1], seen, boundary)
        return shift_map(boundary, shifts, weights, (v1 - v0, u1 - u0), _WINDOW)


_FINE_STEP = 2  # pixels between the boundary points that are refined
_WINDOW = 11  # pixels over which refined boundary points are averaged
_SQUARE = np.ones((7, 7), dtype=np.uint8)
