"""Slow and obvious versions of what the package does fast."""

import numpy as np
from scipy.spatial.transform import Rotation

from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone


def nearest_hit(primitive, origin, directions):
    """Smallest t > 0 with origin + t * direction on the surface, infinite without; directions (n, 3), shape frame."""
    return nearest_surface(primitive, origin, directions, (0, 0, 0))[0]


def nearest_surface(primitive, origin, directions, color_rgb):
    """t as of `nearest_hit`, and unit normals (n, 3), outward (of a mesh: turned to the viewer), and colors (n, 3) there."""
    n = len(directions)
    nearest, normals, colors = np.full(n, np.inf), np.zeros((n, 3)), np.zeros((n, 3))
    with np.errstate(all="ignore"):
        for t, normal, color in _surfaces(primitive, origin, directions, color_rgb):
            nearer = (t > 0) & (t < nearest)
            nearest[nearer] = t[nearer]
            normals[nearer] = np.broadcast_to(normal, (n, 3))[nearer]
            colors[nearer] = np.broadcast_to(color, (n, 3))[nearer]
        return nearest, normals / np.linalg.norm(normals, axis=1, keepdims=True), colors


def _surfaces(primitive, origin, directions, color_rgb):
    """(t, normals, colors) of every piece of a surface, one after the other; t infinite where its plane or quadric is missed."""
    if isinstance(primitive, Ellipsoid):
        r = np.array(primitive.radii)
        for t in _roots(directions / r, origin / r, np.array([1.0, 1.0, 1.0]), -1.0):
            yield t, (origin + t[:, None] * directions) / r**2, color_rgb
    elif isinstance(primitive, TruncatedCone):
        for t, normals in _cone_hits(primitive, origin, directions):
            yield t, normals, color_rgb
    elif isinstance(primitive, Box):
        yield from _box_surfaces(primitive, origin, directions, color_rgb)
    elif isinstance(primitive, Mesh):
        yield from _mesh_surfaces(primitive, origin, directions, color_rgb)


def _roots(d, o, signs, constant):
    a, b, c = (signs * d * d).sum(axis=1), (signs * o * d).sum(axis=1), (signs * o * o).sum() + constant
    root = np.sqrt(b * b - a * c)
    return [np.nan_to_num(t, nan=np.inf) for t in ((-b - root) / a, (-b + root) / a)]


def _cone_hits(cone, origin, directions):
    lift = np.array([1 / cone.a, 1 / cone.b, cone.k])
    o = origin * lift + np.array([0.0, 0.0, 1.0])
    for t in _roots(directions * lift, o, np.array([1.0, 1.0, -1.0]), 0.0):
        x, y, z = (origin + t[:, None] * directions).T
        angle = np.arctan2(y / cone.b, x / cone.a)
        normals = np.stack([cone.b * np.cos(angle), cone.a * np.sin(angle), np.full_like(t, -cone.a * cone.b * cone.k)], axis=1)
        yield np.where((z >= cone.z1) & (z <= cone.z2), t, np.inf), normals
    for z, normal in ((cone.z1, (0.0, 0.0, -1.0)), (cone.z2, (0.0, 0.0, 1.0))):
        t = (z - origin[2]) / directions[:, 2]
        points = origin + t[:, None] * directions
        scale = 1 + cone.k * z
        inside = (points[:, 0] / (cone.a * scale)) ** 2 + (points[:, 1] / (cone.b * scale)) ** 2 <= 1
        yield np.where(inside, t, np.inf), normal


# Upper left, upper right and lower left corner of each face as seen from outside with z (on +z and -z: y) upright
_FACE_CORNERS = {
    "+x": ((1, -1, 1), (1, 1, 1), (1, -1, -1)),
    "-x": ((-1, 1, 1), (-1, -1, 1), (-1, 1, -1)),
    "+y": ((1, 1, 1), (-1, 1, 1), (1, 1, -1)),
    "-y": ((-1, -1, 1), (1, -1, 1), (-1, -1, -1)),
    "+z": ((-1, 1, 1), (1, 1, 1), (-1, -1, 1)),
    "-z": ((1, 1, -1), (-1, 1, -1), (1, -1, -1)),
}


def _box_surfaces(box, origin, directions, color_rgb):
    half = 0.5 * np.array(box.size)
    for i, (name, corners) in enumerate(_FACE_CORNERS.items()):
        axis, side = "xyz".index(name[1]), 1.0 if name[0] == "+" else -1.0
        t = (side * half[axis] - origin[axis]) / directions[:, axis]
        points = origin + t[:, None] * directions
        others = [j for j in range(3) if j != axis]
        t = np.where((np.abs(points[:, others]) <= half[others]).all(axis=1), t, np.inf)
        colors = color_rgb if box.face_colors_rgb is None else box.face_colors_rgb[i]
        if box.textures is not None and box.textures[i] is not None:
            upper_left, upper_right, lower_left = (np.array(corner) * half for corner in corners)
            right, down = upper_right - upper_left, lower_left - upper_left
            u, v = ((points - upper_left) @ along / (along @ along) for along in (right, down))
            colors = bilinear(box.textures[i], u, v)
        yield t, side * np.eye(3)[axis], colors


def bilinear(picture, u, v):
    """Color of a picture at (u, v) from its upper left corner, 0..1: between the four nearest texels' centers."""
    height, width = picture.shape[:2]
    x, y = (np.nan_to_num(u) * width - 0.5).clip(0, width - 1), (np.nan_to_num(v) * height - 0.5).clip(0, height - 1)
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    color = np.zeros((len(x), 3))
    for di, wx in ((0, 1 - (x - i)), (1, x - i)):
        for dj, wy in ((0, 1 - (y - j)), (1, y - j)):
            color += (wx * wy)[:, None] * picture[np.minimum(j + dj, height - 1), np.minimum(i + di, width - 1)]
    return color


def _mesh_surfaces(mesh, origin, directions, color_rgb):
    for i, face in enumerate(mesh.faces):
        corners = mesh.vertices[face]
        t, weights = _triangle_hit(corners, origin, directions)
        flat = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normals = flat if mesh.normals is None else weights @ mesh.normals[face]
        normals = normals if flat @ (origin - corners[0]) > 0 else -normals
        if mesh.texture is not None:
            u, v = (weights @ mesh.uv[i]).T
            colors = bilinear(mesh.texture, u, 1 - v)
        elif mesh.vertex_colors_rgb is not None:
            colors = weights @ mesh.vertex_colors_rgb[face]
        else:
            colors = color_rgb if mesh.face_colors_rgb is None else mesh.face_colors_rgb[i]
        yield t, normals, colors


def _triangle_hit(corners, origin, directions):
    """t and the weights (n, 3) of the corners, by Cramer's rule: origin + t d = corner 0 + beta (edge 1) + gamma (edge 2)."""
    edges, start = corners[1:] - corners[0], origin - corners[0]
    across = np.cross(edges[0], edges[1])
    determinant = -directions @ across
    t = (start @ across) / determinant
    beta, gamma = -directions @ np.cross(start, edges[1]) / determinant, -directions @ np.cross(edges[0], start) / determinant
    hit = (np.abs(determinant) > 1e-15) & (beta >= 0) & (gamma >= 0) & (beta + gamma <= 1)
    return np.where(hit, t, np.inf), np.stack([1 - beta - gamma, beta, gamma], axis=1)


def render(configuration, camera):
    """Labels and depth of every pixel, ray by ray: depth along the optical axis."""
    return render_color(configuration, camera)[:2]


def render_color(configuration, camera, lights=()):
    """Labels, depth and colors (h, w, 3), not rounded, of every pixel, ray by ray."""
    model = camera.model
    pixels = np.stack(np.meshgrid(np.arange(model.width), np.arange(model.height)), axis=-1).reshape(-1, 2)
    rays, valid = model.rays(pixels)
    rays = rays / rays[:, 2:]
    depth, labels, rgb = np.full(len(rays), np.inf), np.zeros(len(rays), dtype=np.uint8), np.zeros((len(rays), 3))
    for i, (shape, T_world_shape) in enumerate(zip(configuration.model.shapes, configuration.Ts_world_shape, strict=True)):
        T_shape_cam = np.linalg.inv(T_world_shape) @ camera.T_world_cam
        t, normals, colors = nearest_surface(shape.primitive, T_shape_cam[:3, 3], rays @ T_shape_cam[:3, :3].T, shape.color_rgb)
        nearer = valid & (t < depth)
        depth[nearer], labels[nearer] = t[nearer], i + 1
        points = camera.T_world_cam[:3, 3] + t[nearer, None] * (rays[nearer] @ camera.T_world_cam[:3, :3].T)
        light = sum((light_on(one, points, normals[nearer] @ T_world_shape[:3, :3].T) for one in lights), np.zeros(3))
        light = light if lights else np.ones(3)
        rgb[nearer] = np.minimum(colors[nearer] * (np.array(camera.gain) * light) ** (1.0 / camera.gamma), 255.0)
    size = model.height, model.width
    return labels.reshape(size), depth.reshape(size), rgb.reshape(*size, 3)


def light_on(light, points, normals):
    """Light (n, 3) that reaches points of a surface with unit normals from one `camera.light.Light`; world."""
    if light.kind == "ambient":
        factor = np.ones(len(points))
    elif light.kind == "directional":
        factor = (normals @ -(np.array(light.direction) / np.linalg.norm(light.direction))).clip(0)
    else:
        to_light = np.array(light.position) - points
        to_light /= np.linalg.norm(to_light, axis=1, keepdims=True)
        factor = (normals * to_light).sum(axis=1).clip(0)
        if light.kind == "spot":
            cosine = -to_light @ (np.array(light.direction) / np.linalg.norm(light.direction))
            factor = factor * np.interp(cosine, np.cos(light.half_angle * np.array([1.0, 0.8])), [0.0, 1.0])
    return factor[:, None] * np.array(light.intensity)


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
            motion = np.eye(4)
            if axis.prismatic:
                motion[:3, 3] = np.array(axis.direction) * angle_of[axis.name]
            else:
                motion[:3, :3] = Rotation.from_rotvec(np.array(axis.direction) * angle_of[axis.name]).as_matrix()
            result = result @ motion
        return result

    return {link: transform(link) for link in chain.links}
