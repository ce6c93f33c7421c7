"""Bodies and cameras for the tests of renderers."""

import numpy as np

from tracker_node.camera.camera_model import CameraModel
from tracker_node.camera.camera_rig import Camera
from tracker_node.geometry import so3
from tracker_node.model.articulated_model import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.primitives import Box, Ellipsoid, Mesh, TruncatedCone

_K = np.array([[150.0, 0.7, 82.3], [0.0, 148.0, 58.1], [0.0, 0.0, 1.0]])
_WIDE_K = np.array([[70.0, 0.0, 80.0], [0.0, 70.0, 60.0], [0.0, 0.0, 1.0]])

LENSES = {
    "plain": CameraModel(160, 120, _K),
    "wide": CameraModel(160, 120, _WIDE_K),
    "radial": CameraModel(163, 120, _K, "plumb_bob", np.array([-0.3, 0.1, 0.002, -0.001, 0.0])),
    "fisheye": CameraModel(160, 120, _WIDE_K, "equidistant", np.array([0.05, -0.01, 0.0, 0.0])),
}


def look_at(eye, target, lens, name="camera"):
    """A camera at ``eye`` that looks at ``target``, its x axis across the world's z."""
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    up = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    T[:3, 3] = eye
    return Camera(name, lens, T)


def single_shape(primitive, T=None):
    """One shape on one link at the world's origin."""
    model = ArticulatedModel("one", KinematicChain(("base",), ()), (Shape("shape", "base", primitive),))
    return Configuration(model, State.neutral(model, T))


def tetrahedron(size):
    vertices = size * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))


def scattered_scene(seed, n=12, spread=0.7):
    """Shapes of every kind at random places and orientations."""
    rng = np.random.default_rng(seed)
    shapes = []
    for i in range(n):
        length = rng.uniform(0.2, 0.6)
        primitive = (
            TruncatedCone(rng.uniform(0.05, 0.2), rng.uniform(0.05, 0.2), rng.uniform(-1.2, 1.5), 0.0, length),
            Ellipsoid(tuple(rng.uniform(0.05, 0.3, 3))),
            Box(tuple(rng.uniform(0.1, 0.4, 3))),
            tetrahedron(rng.uniform(0.1, 0.2)),
        )[i % 4]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = so3.exp(rng.normal(size=3)), rng.uniform(-spread, spread, 3)
        shapes.append(Shape(f"shape{i}", "base", primitive, T))
    model = ArticulatedModel("scattered", KinematicChain(("base",), ()), tuple(shapes))
    return Configuration(model, State.neutral(model))
