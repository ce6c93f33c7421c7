"""Bodies and cameras for the tests of renderers."""

import numpy as np

from tracker_node.camera.light import Light
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.geometry import so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone
from tracker_node.render.opengl.renderer import PyrenderRenderer
from tracker_node.render.raycast.raycaster import RaycastRenderer

RENDERERS = {"raycaster": RaycastRenderer, "pyrender": PyrenderRenderer}
"""What makes each renderer, or something whose ``with`` statement gives it; a `TrackerError` tells why it cannot work here."""

LIGHTS = (
    Light("ambient", (0.25, 0.22, 0.2)),
    Light("directional", (0.3, 0.35, 0.4), direction=(1.0, 1.0, -0.5)),
    Light("point", (0.3, 0.2, 0.3), position=(-2.0, -2.0, 0.5)),
    Light("spot", (0.5, 0.6, 0.4), position=(0.4, -2.5, 2.0), direction=(-0.1, 2.5, -2.0), half_angle=0.35),
)

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


def single_shape(primitive, T=None, color_rgb=(180, 180, 180)):
    """One shape on one link at the world's origin."""
    model = ArticulatedModel("one", KinematicChain(("base",), ()), (Shape("shape", "base", primitive, color_rgb=color_rgb),))
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


def picture(seed, width=24, height=16):
    """A smooth picture without symmetry, RGB."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    waves = rng.uniform(-4, 4, (2, 3))
    phase = waves[0] * x[..., None] + waves[1] * y[..., None] + rng.uniform(0, 6, 3)
    return (128 + 120 * np.sin(phase)).astype(np.uint8)


def icosahedron(size, normals=False, **colors):
    golden = 0.5 * (1 + np.sqrt(5))
    corners = np.array([(0, a, b * golden) for a in (-1, 1) for b in (-1, 1)])
    corners = np.concatenate([corners, np.roll(corners, 1, axis=1), np.roll(corners, 2, axis=1)])
    unit = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    faces = [
        (a, b, c) if np.linalg.det(unit[[a, b, c]]) > 0 else (a, c, b)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if max(np.linalg.norm(corners[i] - corners[j]) for i, j in ((a, b), (b, c), (c, a))) < 2.1
    ]
    return Mesh(size * unit, np.array(faces), normals=unit if normals else None, **colors)


def colored_shapes(seed, size=0.25):
    """One primitive of every kind and way of coloring: (name, primitive)."""
    rng = np.random.default_rng(seed)

    def random_colors(n):
        return rng.integers(30, 230, (n, 3))

    square = Mesh(
        np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1.0]]) * 1.5 * size,
        np.array([[0, 1, 2], [0, 2, 3]]),
        uv=np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1.0]]]),
        texture=picture(seed, 20, 20),
    )
    pictures = tuple(None if i == 3 else picture(seed + i) for i in range(6))
    return {
        "ellipsoid": Ellipsoid((size, 0.6 * size, 1.3 * size)),
        "cone": TruncatedCone(0.8 * size, 0.5 * size, -0.6 / size, 0.0, size),
        "cylinder": TruncatedCone(0.5 * size, 0.5 * size, 0.0, -1.5 * size, 1.5 * size),
        "box": Box((2 * size, size, 1.5 * size)),
        "box of colored faces": Box((1.5 * size, 2 * size, size), random_colors(6)),
        "box with pictures": Box((1.8 * size, 1.8 * size, 1.8 * size), random_colors(6), pictures),
        "mesh": icosahedron(size),
        "smooth mesh": icosahedron(size, normals=True),
        "mesh of colored faces": icosahedron(size, face_colors_rgb=random_colors(20)),
        "mesh of colored corners": icosahedron(size, normals=True, vertex_colors_rgb=random_colors(12)),
        "mesh with a picture": square,
    }


def colored_scene(seed, spread=0.6, names=None):
    """All of `colored_shapes` (or those of ``names``) at random places and orientations, many through one another."""
    rng = np.random.default_rng(seed)
    shapes = []
    for name, primitive in colored_shapes(seed).items():
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = so3.exp(rng.normal(size=3)), rng.uniform(-spread, spread, 3)
        color = tuple(int(c) for c in rng.integers(60, 230, 3))
        if names is None or name in names:
            shapes.append(Shape(name, "base", primitive, T, color))
    model = ArticulatedModel("colored", KinematicChain(("base",), ()), tuple(shapes))
    return Configuration(model, State.neutral(model))
