"""Contour lines as residuals of everything that can be wrong at once: the pose, the body's shape, the camera and its time.

A line joins a point of the body's contour with a place in an image where the evidence puts that contour, in one direction only:
r = n . (pixel of the point - c) - mean, n the contour's normal. Along the contour nothing is known, and so nothing has to be:
that a contour slides on a smooth body as something changes does not move it along n, and the point may be taken as fixed to its
shape (in coordinates of the shape's size, so that it goes with a shape that grows). This is the objective of bundle adjustment,
for lines instead of points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..camera.rig import CameraRig
from ..compiled.kernels import compiled
from ..geometry import se3
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..model.shape_parameters import ShapeSpace, half_extents
from ..model.shapes.primitives import Primitive, TruncatedCone

N_CAMERA = 8  # derivatives by a camera: twist in its own frame (6), logarithm of its focal length, its time (seconds)
FOCAL, TIME = 6, 7


@dataclass(frozen=True, eq=False)
class ContourLines:
    """Lines of one image set, all cameras, sorted by shape.

    Attributes
    ----------
    camera, shape : (n,) indices.
    points : (n, 3) contour point in its shape's own coordinates, see `normalized`.
    centers : (n, 2) where the line was drawn, pixels. normals : (n, 2) unit, outward.
    means, variances : (n,) along the normal, where the evidence puts the contour, pixels and pixels^2.
    """

    camera: np.ndarray
    shape: np.ndarray
    points: np.ndarray
    centers: np.ndarray
    normals: np.ndarray
    means: np.ndarray
    variances: np.ndarray

    def __len__(self) -> int:
        return len(self.camera)

    def sorted(self) -> ContourLines:
        """In the order of shapes, which `linearize_lines` relies on."""
        order = np.argsort(self.shape, kind="stable")
        return ContourLines(*(getattr(self, name)[order] for name in self.__dataclass_fields__))


def normalized(primitive: Primitive, points: np.ndarray) -> np.ndarray:
    """Points of a shape's frame in units of the shape itself: they stay when it grows, and on the surface if they were.

    Parameters
    ----------
    primitive : the shape.
    points : (n, 3) meters, its frame.

    Returns
    -------
    (n, 3), no unit.
    """
    if isinstance(primitive, TruncatedCone):
        radius = 1.0 + primitive.k * points[:, 2]
        height = (points[:, 2] - primitive.z1) / (primitive.z2 - primitive.z1)
        return np.column_stack([points[:, 0] / (primitive.a * radius), points[:, 1] / (primitive.b * radius), height])
    return points / half_extents(primitive)


def denormalized(primitive: Primitive, points: np.ndarray) -> np.ndarray:
    """Inverse of `normalized`.

    Parameters
    ----------
    primitive : the shape.
    points : (n, 3) in units of the shape.

    Returns
    -------
    (n, 3) meters, its frame.
    """
    if isinstance(primitive, TruncatedCone):
        z = primitive.z1 + points[:, 2] * (primitive.z2 - primitive.z1)
        radius = 1.0 + primitive.k * z
        return np.column_stack([primitive.a * radius * points[:, 0], primitive.b * radius * points[:, 1], z])
    return points * half_extents(primitive)


def _points_in_shapes(model: ArticulatedModel, lines: ContourLines) -> np.ndarray:
    """(n, 3) points of the lines in the frames of their shapes, meters."""
    result = np.empty_like(lines.points)
    for k, rows in _runs(lines.shape):
        result[rows] = denormalized(model.shapes[k].primitive, lines.points[rows])
    return result


@dataclass(frozen=True, eq=False)
class LineEquations:
    """Residuals (n,), pixels, and their derivatives by the tangent of the state (n, n_dof), by shape parameters (n, n_shape) and
    by the line's own camera (n, `N_CAMERA`). ``valid`` (n,) is False where a camera cannot see the point: zeros there."""

    residuals: np.ndarray
    by_state: np.ndarray
    by_shape: np.ndarray
    by_camera: np.ndarray
    valid: np.ndarray


def line_residuals(
    lines: ContourLines, model: ArticulatedModel, rig: CameraRig, states: list[State]
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals of the lines.

    Parameters
    ----------
    lines : sorted by shape.
    model, rig : body and cameras.
    states : per camera, where it sees the body.

    Returns
    -------
    (n,) pixels, and (n,) which are valid.
    """
    points = _points_in_shapes(model, lines)
    residuals, valid = np.zeros(len(lines)), np.zeros(len(lines), dtype=bool)
    for i, camera in enumerate(rig):
        rows = np.flatnonzero(lines.camera == i)
        if len(rows):
            Ts = Configuration(model, states[i]).Ts_world_shape[lines.shape[rows]]
            world = np.einsum("nij,nj->ni", Ts[:, :3, :3], points[rows]) + Ts[:, :3, 3]
            pixels, valid[rows] = camera.project(world)
            offset = np.where(valid[rows, None], pixels - lines.centers[rows], 0.0)
            residuals[rows] = np.where(valid[rows], np.sum(lines.normals[rows] * offset, axis=1) - lines.means[rows], 0.0)
    return residuals, valid


def linearize_lines(
    lines: ContourLines,
    space: ShapeSpace,
    s: np.ndarray,
    model: ArticulatedModel,
    rig: CameraRig,
    states: list[State],
    velocity: np.ndarray | None = None,
) -> LineEquations:
    """Residuals of the lines with their derivatives.

    Parameters
    ----------
    lines : sorted by shape.
    space, s, model : shape parameters, and the body that they make (``space.body(s)``).
    rig : cameras.
    states : per camera, where it sees the body.
    velocity : (n_dof,) tangent a second, for the derivative by a camera's time.

    Returns
    -------
    Residuals and derivatives of all lines.
    """
    n, chain = len(lines), model.chain
    points = _points_in_shapes(model, lines)
    residuals, valid = np.zeros(n), np.zeros(n, dtype=bool)
    by_state, by_shape, by_camera = np.zeros((n, chain.n_dof)), np.zeros((n, len(space))), np.zeros((n, N_CAMERA))
    for i, camera in enumerate(rig):
        rows = np.flatnonzero(lines.camera == i)
        if not len(rows):
            continue
        configuration = Configuration(model, states[i])
        links = model.shape_links[lines.shape[rows]]
        Ts = configuration.Ts_world_shape[lines.shape[rows]]
        world = np.einsum("nij,nj->ni", Ts[:, :3, :3], points[rows]) + Ts[:, :3, 3]
        T = camera.T_cam_world
        local = se3.apply(T, world)
        pixels, derivatives, seen = camera.model.project_with_jacobian(local)
        valid[rows] = seen
        normals = np.where(seen[:, None], lines.normals[rows], 0.0)
        residuals[rows] = np.sum(normals * (pixels - lines.centers[rows]), axis=1) - np.where(seen, lines.means[rows], 0.0)
        in_camera = np.einsum("ni,nij->nj", normals, derivatives)  # (n, 3) derivative by the point in the camera's frame
        in_world = in_camera @ T[:3, :3]
        wrench = np.hstack([in_world, np.cross(world, in_world)])
        by_state[rows] = (wrench @ configuration.twists.T) * chain.link_moved_by[links]
        by_shape[rows] = _by_shape(space, s, configuration, lines.shape[rows], points[rows], in_world)
        by_camera[rows, :3] = in_camera
        by_camera[rows, 3:6] = np.cross(local, in_camera)
        by_camera[rows, FOCAL] = np.sum(normals * (pixels - camera.model.K[:2, 2]), axis=1)
        if velocity is not None:
            by_camera[rows, TIME] = by_state[rows] @ velocity
    return LineEquations(residuals, by_state, by_shape, by_camera, valid)


@compiled
def normal_equations(J, residuals, weights, H, g):
    """Add J^T W J and J^T W r. One thread: such a product gains nothing by two.

    Parameters
    ----------
    J, residuals, weights : (n, m), (n,), (n,).
    H, g : (m, m) and (m,), added to.
    """
    n, m = J.shape
    for row in range(n):
        weight = weights[row]
        if weight == 0.0:
            continue
        line = J[row]
        for a in range(m):
            scaled = weight * line[a]
            if scaled == 0.0:
                continue
            g[a] += scaled * residuals[row]
            for b in range(a, m):
                H[a, b] += scaled * line[b]
    for a in range(m):
        for b in range(a):
            H[a, b] = H[b, a]


def _by_shape(space, s, configuration: Configuration, shapes: np.ndarray, points: np.ndarray, in_world: np.ndarray) -> np.ndarray:
    """(n, n_shape) derivatives of in_world . point by the shape parameters."""
    model = configuration.model
    of_link = _link_origins_D_shape(space, configuration)
    result = np.empty((len(points), len(space)))
    for k, rows in _runs(shapes):
        link, shape, T_link_shape = model.shape_links[k], model.shapes[k], model.Ts_link_shape[k]
        in_link = in_world[rows] @ configuration.Ts_world_link[link, :3, :3]
        in_shape = (in_link @ T_link_shape[:3, :3]) * points[rows]
        unshifted = T_link_shape[:3, 3] - space.shifts[k] @ s
        place = unshifted[:, None] * space.log_places[link] + space.shifts[k]
        result[rows] = in_world[rows] @ of_link[link] + in_link @ place + in_shape @ space.log_sizes[k]
        if isinstance(shape.primitive, TruncatedCone):
            widening = (in_shape[:, 0] + in_shape[:, 1]) * _widening(shape.primitive, points[rows, 2])
            result[rows] += widening[:, None] * space.tapers[k]
    return result


def _link_origins_D_shape(space: ShapeSpace, configuration: Configuration) -> np.ndarray:
    """(n_links, 3, n_shape) derivative of the links' origins, world axes, at a fixed state."""
    chain = configuration.model.chain
    result = np.zeros((len(chain.links), 3, len(space)))
    for link in range(1, len(chain.links)):
        parent = chain.parents[link]
        moved = chain.offsets[link, :3, 3][:, None] * space.log_places[parent]
        result[link] = result[parent] + configuration.Ts_world_link[parent, :3, :3] @ moved
    return result


def landmarks_D_shape(space: ShapeSpace, configuration: Configuration) -> np.ndarray:
    """Derivative of the landmarks by the shape parameters, at a fixed state.

    Parameters
    ----------
    space : shape parameters.
    configuration : the body in its state.

    Returns
    -------
    (n_landmarks, 3, n_shape), world axes.
    """
    model = configuration.model
    links = model.landmark_links
    own = model.landmark_positions[:, :, None] * space.log_places[links]
    return _link_origins_D_shape(space, configuration)[links] + configuration.Ts_world_link[links, :3, :3] @ own


def _widening(cone: TruncatedCone, z: np.ndarray) -> np.ndarray:
    """Derivative of the logarithm of a cone's radius at z by its taper."""
    share = (z - cone.z1) / (cone.z2 - cone.z1)
    near, far = 1.0 + cone.k * cone.z1, 1.0 + cone.k * cone.z2
    return 0.5 * (far * share - near * (1.0 - share)) / (1.0 + cone.k * z)


def _runs(shapes: np.ndarray):
    """(shape, slice) of each run of equal entries in a sorted array."""
    if not len(shapes):
        return
    borders = np.flatnonzero(np.diff(shapes)) + 1
    for start, stop in zip([0, *borders], [*borders, len(shapes)], strict=True):
        yield int(shapes[start]), slice(int(start), int(stop))
