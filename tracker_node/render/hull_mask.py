"""Where a posed body is in an image, quickly: every convex part is the convex hull of a few of its projected points.

Cones and boxes are exact (up to the number of rim points), ellipsoids are inscribed by about one percent of their radius, and a
mesh is replaced by its convex hull. For exact masks, labels and depth there is the ray-caster.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..camera.camera_model import CameraModel
from ..geometry import se3
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import Configuration
from ..model.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone

_RIM = 16
_FRACTION_BITS = 4  # sub-pixel bits of the polygon filler


def _hull_points(primitive: Primitive) -> np.ndarray:
    angles = 2.0 * np.pi * np.arange(_RIM) / _RIM
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    if isinstance(primitive, TruncatedCone):
        rims = []
        for z in (primitive.z1, primitive.z2):
            scale = 1.0 + primitive.k * z
            rims.append(np.column_stack([circle * [primitive.a * scale, primitive.b * scale], np.full(_RIM, z)]))
        return np.concatenate(rims)
    if isinstance(primitive, Ellipsoid):
        rings = [
            np.column_stack([circle * np.cos(e), np.full(_RIM, np.sin(e))])
            for e in np.radians([-67.5, -45, -22.5, 0, 22.5, 45, 67.5])
        ]
        return np.concatenate([*rings, [[0, 0, 1], [0, 0, -1]]]) * np.array(primitive.radii)
    if isinstance(primitive, Box):
        corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        return corners * np.array(primitive.size)
    if isinstance(primitive, Mesh):
        return primitive.vertices
    raise TypeError(f"expected a primitive, got {type(primitive).__name__}")


class HullMask:
    """Projects the hull points of a model's shapes; one object serves all cameras and images."""

    def __init__(self, model: ArticulatedModel):
        clouds = [_hull_points(shape.primitive) for shape in model.shapes]
        ends = np.cumsum([len(cloud) for cloud in clouds])
        self._slices = [slice(int(end) - len(cloud), int(end)) for cloud, end in zip(clouds, ends, strict=True)]
        self._counts = np.array([len(cloud) for cloud in clouds])
        self._starts = ends - self._counts
        points = [se3.apply(shape.T_link_shape, cloud) for shape, cloud in zip(model.shapes, clouds, strict=True)]
        self._points = np.concatenate(points)
        self._links = np.repeat(model.shape_links, [len(cloud) for cloud in clouds])

    def project(
        self, configuration: Configuration, camera: CameraModel, T_cam_world: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixels (n, 2), validity (n,) and depth (n,) in metres of all hull points."""
        T = configuration.Ts_world_link[self._links]
        world = np.einsum("nij,nj->ni", T[:, :3, :3], self._points) + T[:, :3, 3]
        points = se3.apply(T_cam_world, world)
        return *camera.project(points), points[:, 2]

    def fill(self, pixels: np.ndarray, valid: np.ndarray, depths: np.ndarray, region: tuple[int, int, int, int]) -> np.ndarray:
        """Labels (uint8: 0 outside, i + 1 for shape i) on the crop ``region`` (u0, v0, u1, v1) from the result of `project`.

        Nearer parts are painted over farther ones, by the mean depth of their points.
        """
        u0, v0, u1, v1 = region
        labels = np.zeros((v1 - v0, u1 - u0), dtype=np.uint8)
        scaled = np.round((pixels - [u0, v0]) * (1 << _FRACTION_BITS)).clip(-(2**28), 2**28).astype(np.int32)
        far_to_near = np.argsort(-np.add.reduceat(depths, self._starts) / self._counts, kind="stable")
        visible = np.logical_and.reduceat(valid, self._starts)
        for index in far_to_near:
            if visible[index]:
                hull = cv2.convexHull(scaled[self._slices[index]])
                cv2.fillConvexPoly(labels, hull, int(index) + 1, shift=_FRACTION_BITS)
        return labels
