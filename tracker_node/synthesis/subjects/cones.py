"""A subject that *is* the tracker's model: its cones and ellipsoids as fine triangle meshes, for figures without model error."""

from __future__ import annotations

import numpy as np

from ...geometry import se3, so3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF, Axis
from ...render.opengl.tessellation import tessellate
from ..scenes.rasterizer import ColoredMesh

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
            patches = tessellate(shape.primitive, shape.color_rgb)
            self._vertices.append(np.concatenate([patch.vertices for patch in patches]))
            self._normals.append(np.concatenate([patch.normals for patch in patches]))
            for patch in patches:
                faces.append(patch.faces + start)
                start += len(patch.vertices)
            colors.append(np.tile(np.array(shape.color_rgb, dtype=np.uint8), (len(self._vertices[-1]), 1)))
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
