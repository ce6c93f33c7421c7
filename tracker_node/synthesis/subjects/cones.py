"""A subject that *is* the tracker's model: its cones and ellipsoids as fine triangle meshes, for figures without model error."""

from __future__ import annotations

import numpy as np

from ...geometry import se3, so3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF, Axis
from ...model.shapes.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone
from ..scenes.rasterizer import ColoredMesh

_AROUND = 96  # a circle of 15 cm radius is then true to 0.1 mm

# About what angles (degrees, by the end of the axis' name) joints swing, so that limbs stay off the trunk and each other.
_MIDDLES_DEG = {
    "shoulder_elevation_front": 45.0, "elbow_flexion": 40.0, "hip_flexion": 20.0, "hip_abduction": 12.0, "knee_flexion": 35.0,
}  # fmt: skip


class ModelSubject:
    """Meshes of a model's shapes, posed together.

    Attributes
    ----------
    faces, colors_rgb : of the union of all shapes, as `ColoredMesh` has them.
    """

    def __init__(self, model: ArticulatedModel):
        self.model = model
        self._vertices, self._normals, faces, colors = [], [], [], []
        start = 0
        for shape in model.shapes:
            vertices, normals, own = tessellate(shape.primitive)
            self._vertices.append(vertices)
            self._normals.append(normals)
            faces.append(own + start)
            colors.append(np.tile(np.array(shape.color_rgb, dtype=np.uint8), (len(vertices), 1)))
            start += len(vertices)
        self.faces, self.colors_rgb = np.concatenate(faces), np.concatenate(colors)

    def mesh(self, configuration: Configuration) -> ColoredMesh:
        """All shapes in the world, meters."""
        Ts = configuration.Ts_world_shape
        vertices = [se3.apply(T, v) for T, v in zip(Ts, self._vertices, strict=True)]
        normals = [n @ T[:3, :3].T for T, n in zip(Ts, self._normals, strict=True)]
        return ColoredMesh(np.concatenate(vertices), self.faces, self.colors_rgb, np.concatenate(normals))

    def points(self, configuration: Configuration, shapes: np.ndarray) -> np.ndarray:
        """Vertices of some shapes.

        Parameters
        ----------
        configuration : the body in a state.
        shapes : (n_shapes,) bool.

        Returns
        -------
        (n, 3) meters, world.
        """
        Ts = configuration.Ts_world_shape
        return np.concatenate([se3.apply(Ts[i], self._vertices[i]) for i in np.flatnonzero(shapes)])


def tessellate(primitive: Primitive, around: int = _AROUND) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles of a shape in its own frame.

    Parameters
    ----------
    primitive : the shape.
    around : vertices on a circle.

    Returns
    -------
    Vertices (n, 3), meters.
    Unit normals (n, 3).
    Faces (m, 3), outward.
    """
    if isinstance(primitive, TruncatedCone):
        return _cone(primitive, around)
    if isinstance(primitive, Ellipsoid):
        return _ellipsoid(np.array(primitive.radii), around)
    if isinstance(primitive, Box):
        return _box(0.5 * np.array(primitive.size))
    return _flat(primitive)


def _cone(cone: TruncatedCone, around: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    angles = 2.0 * np.pi * np.arange(around) / around
    c, s = np.cos(angles), np.sin(angles)
    side_normals = np.stack([cone.b * c, cone.a * s, np.full(around, -cone.a * cone.b * cone.k)], axis=1)
    side_normals /= np.linalg.norm(side_normals, axis=1, keepdims=True)
    rings = []
    for z in (cone.z1, cone.z2):
        scale = 1.0 + cone.k * z
        rings.append(np.stack([cone.a * scale * c, cone.b * scale * s, np.full(around, z)], axis=1))
    here, following = np.arange(around), (np.arange(around) + 1) % around
    sides = np.concatenate(
        [np.stack([here, following, following + around], axis=1), np.stack([here, following + around, here + around], axis=1)]
    )
    vertices, normals, faces = [*rings], [side_normals, side_normals], [sides]
    for ring, z, direction in ((rings[0], cone.z1, -1.0), (rings[1], cone.z2, 1.0)):
        start = sum(len(v) for v in vertices)
        vertices.append(np.vstack([ring, [0.0, 0.0, z]]))
        normals.append(np.tile([0.0, 0.0, direction], (around + 1, 1)))
        pair = (here, following) if direction > 0 else (following, here)
        faces.append(np.stack([*pair, np.full(around, around)], axis=1) + start)
    return np.concatenate(vertices), np.concatenate(normals), np.concatenate(faces)


def _ellipsoid(radii: np.ndarray, around: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n_rings = around // 2
    polar = np.pi * np.arange(n_rings + 1) / n_rings
    azimuth = 2.0 * np.pi * np.arange(around) / around
    sphere = np.stack([
        np.outer(np.sin(polar), np.cos(azimuth)), np.outer(np.sin(polar), np.sin(azimuth)),
        np.repeat(np.cos(polar)[:, None], around, axis=1),
    ], axis=-1).reshape(-1, 3)  # fmt: skip
    normals = sphere / radii
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    i, j = np.meshgrid(np.arange(n_rings), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    faces = np.concatenate([
        np.stack([a, a + around, b + around], axis=-1).reshape(-1, 3), np.stack([a, b + around, b], axis=-1).reshape(-1, 3),
    ])  # fmt: skip
    return sphere * radii, normals, faces


def _box(half: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([[q[0], q[1], q[2]] for q in quads] + [[q[0], q[2], q[3]] for q in quads])
    return _flat(Mesh(corners, faces))


def _flat(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every triangle with vertices of its own, so that edges stay sharp."""
    triangles = mesh.vertices[mesh.faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
    count = 3 * len(triangles)
    return triangles.reshape(-1, 3), np.repeat(normals, 3, axis=0), np.arange(count).reshape(-1, 3)


def waves(model: ArticulatedModel, rate_hz: float, n_images: int, seed: int = 1, amplitude_rad: float = 0.35) -> list[State]:
    """A smooth motion of every degree of freedom: each joint swings about a middle angle with a frequency of its own.

    Every angle stays inside its limits. The root sways by some centimeters and degrees; its height is that of a standing body
    (the lowest shape of the first image touches the floor z = 0).

    Parameters
    ----------
    model : the body.
    rate_hz : states per second.
    n_images : number of states.
    seed : of phases and frequencies.
    amplitude_rad : of the joints, at most.

    Returns
    -------
    One state an image.
    """
    rng = np.random.default_rng(seed)
    chain = model.chain
    lower, upper = chain.lower, chain.upper
    middle = np.array([_middle(axis) for axis in chain.axes])
    room = 0.45 * (upper - lower)
    amplitude = np.minimum(amplitude_rad, room) * rng.uniform(0.5, 1.0, chain.n_axes)
    middle = np.clip(middle, lower + amplitude, upper - amplitude)
    frequency_hz, phase = rng.uniform(0.3, 0.7, chain.n_axes), rng.uniform(0.0, 2.0 * np.pi, chain.n_axes)
    t = np.arange(n_images) / rate_hz
    joints = middle + amplitude * np.sin(2.0 * np.pi * frequency_hz * t[:, None] + phase)
    sway = rng.uniform(0.25, 0.5, (2, 3)), rng.uniform(0.0, 2.0 * np.pi, (2, 3))
    curves = np.sin(2.0 * np.pi * sway[0] * t[:, None, None] + sway[1])  # (n, 2, 3)
    states = []
    for i in range(n_images):
        rotation = so3.exp([0.0, 0.0, 0.6 * curves[i, 1, 2]]) @ so3.exp([0.1 * curves[i, 1, 0], 0.1 * curves[i, 1, 1], 0.0])
        pose = se3.from_rotation_translation(rotation, curves[i, 0] * [0.25, 0.25, 0.03])
        states.append(State(pose, joints[i]))
    return standing(model, states)


def _middle(axis: Axis) -> float:
    return next((np.radians(deg) for ending, deg in _MIDDLES_DEG.items() if axis.name.endswith(ending)), axis.neutral)


def standing(model: ArticulatedModel, states: list[State]) -> list[State]:
    """Raise a motion so that the lowest point of its first state lies on the floor z = 0.

    Parameters
    ----------
    model : the body.
    states : of the motion.

    Returns
    -------
    The raised states.
    """
    lowest = ModelSubject(model).mesh(Configuration(model, states[0])).vertices[:, 2].min()
    lift = np.zeros(N_ROOT_DOF + model.chain.n_axes)
    lift[2] = -lowest
    return [state.retract(lift) for state in states]
