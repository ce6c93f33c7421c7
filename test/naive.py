"""Slow and obvious versions of what the package does fast."""

import numpy as np
from scipy.spatial.transform import Rotation

from tracker_node.model.primitives import Box, Ellipsoid, Mesh, TruncatedCone


def nearest_hit(primitive, origin, directions):
    """Smallest t > 0 with origin + t * direction on the surface, infinite without; directions (n, 3), shape frame."""
    hits = []
    with np.errstate(all="ignore"):
        if isinstance(primitive, Ellipsoid):
            r = np.array(primitive.radii)
            hits += _roots(directions / r, origin / r, np.array([1.0, 1.0, 1.0]), -1.0)
        elif isinstance(primitive, TruncatedCone):
            hits += _cone_hits(primitive, origin, directions)
        elif isinstance(primitive, Box):
            half = 0.5 * np.array(primitive.size)
            for axis in range(3):
                for side in (-1.0, 1.0):
                    t = (side * half[axis] - origin[axis]) / directions[:, axis]
                    points = origin + t[:, None] * directions
                    others = [j for j in range(3) if j != axis]
                    hits.append(np.where((np.abs(points[:, others]) <= half[others]).all(axis=1), t, np.inf))
        elif isinstance(primitive, Mesh):
            for face in primitive.faces:
                hits.append(_triangle_hit(primitive.vertices[face], origin, directions))
        hits = np.array(hits)
        return np.where(hits > 0, hits, np.inf).min(axis=0)


def _roots(d, o, signs, constant):
    a, b, c = (signs * d * d).sum(axis=1), (signs * o * d).sum(axis=1), (signs * o * o).sum() + constant
    root = np.sqrt(b * b - a * c)
    return [np.nan_to_num(t, nan=np.inf) for t in ((-b - root) / a, (-b + root) / a)]


def _cone_hits(cone, origin, directions):
    lift = np.array([1 / cone.a, 1 / cone.b, cone.k])
    o = origin * lift + np.array([0.0, 0.0, 1.0])
    hits = []
    for t in _roots(directions * lift, o, np.array([1.0, 1.0, -1.0]), 0.0):
        z = origin[2] + t * directions[:, 2]
        hits.append(np.where((z >= cone.z1) & (z <= cone.z2), t, np.inf))
    for z in (cone.z1, cone.z2):
        t = (z - origin[2]) / directions[:, 2]
        points = origin + t[:, None] * directions
        scale = 1 + cone.k * z
        inside = (points[:, 0] / (cone.a * scale)) ** 2 + (points[:, 1] / (cone.b * scale)) ** 2 <= 1
        hits.append(np.where(inside, t, np.inf))
    return hits


def _triangle_hit(corners, origin, directions):
    # Barycentric coordinates and t from one 3x3 system per ray
    matrix = np.empty((len(directions), 3, 3))
    matrix[:, :, 0], matrix[:, :, 1], matrix[:, :, 2] = corners[1] - corners[0], corners[2] - corners[0], -directions
    flat = np.abs(np.linalg.det(matrix)) < 1e-15
    matrix[flat] = np.eye(3)
    beta, gamma, t = np.linalg.solve(matrix, np.broadcast_to(origin - corners[0], directions.shape)[..., None])[..., 0].T
    return np.where(~flat & (beta >= 0) & (gamma >= 0) & (beta + gamma <= 1), t, np.inf)


def render(configuration, camera):
    """Labels and depth of every pixel, ray by ray: depth along the optical axis."""
    model = camera.model
    pixels = np.stack(np.meshgrid(np.arange(model.width), np.arange(model.height)), axis=-1).reshape(-1, 2)
    rays, valid = model.rays(pixels)
    rays = rays / rays[:, 2:]
    depth, labels = np.full(len(rays), np.inf), np.zeros(len(rays), dtype=np.uint8)
    for i, (shape, T_world_shape) in enumerate(zip(configuration.model.shapes, configuration.Ts_world_shape, strict=True)):
        T_shape_cam = np.linalg.inv(T_world_shape) @ camera.T_world_cam
        t = nearest_hit(shape.primitive, T_shape_cam[:3, 3], rays @ T_shape_cam[:3, :3].T)
        nearer = valid & (t < depth)
        depth[nearer], labels[nearer] = t[nearer], i + 1
    return labels.reshape(model.height, model.width), depth.reshape(model.height, model.width)


def distance_to(mask, truncation):
    """Distance of every pixel to the nearest one of the mask, by comparing all pairs."""
    rows, columns = np.indices(mask.shape)
    distance = np.full(mask.shape, float(truncation))
    for v, u in np.argwhere(mask):
        distance = np.minimum(distance, np.hypot(rows - v, columns - u))
    return distance


def link_transforms(model, state):
    """Link name -> T_world_link, by walking from each link up to the root."""
    chain = model.chain
    joint_of = {joint.child: joint for joint in chain.joints}
    angle_of = dict(zip((axis.name for axis in chain.axes), state.joint_positions, strict=True))

    def transform(link):
        if link not in joint_of:
            return state.T_world_root
        joint = joint_of[link]
        result = transform(joint.parent) @ joint.T_parent_joint
        for axis in joint.axes:
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(np.array(axis.direction) * angle_of[axis.name]).as_matrix()
            result = result @ turn
        return result

    return {link: transform(link) for link in chain.links}
