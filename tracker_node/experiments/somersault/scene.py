"""The somersault as the experiments use it: two bodies with the same joint angles, cameras, light, target images.

Also how far the surfaces of the two bodies lie from each other, segment by segment, in the neutral pose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from ...camera.light import Light
from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...errors import UnknownNameError
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import N_ROOT, Configuration, State, from_variables, to_variables
from ...model.humans.segments18 import nurbs_human
from ...model.kinematic_chain import KinematicChain
from ...model.shapes.primitives import Ellipsoid
from ...render.opengl.tessellation import tessellate
from ...render.raycast import raycaster
from ...synthesis.scenes.scene import looking_at
from ..free_flight import FreeFlight, MassProperties
from ..plots import bgr_of
from ..target_images import TargetStudio

BACKENDS = ("pyrender", "raycaster")  # the renderer that does not score comes first
# A little piked, arms hanging, toes pointed. The pelvis moves sideways by the paper's 10 mm only with the arms nearly straight.
POSTURE_DEG = {"torso_flexion": 4.0, "chest_flexion": 3.0, "head_flexion": 10.0} | {
    f"{side}_{axis}": degrees
    for side in ("left", "right")
    for axis, degrees in (("hip_flexion", 14.0), ("knee_flexion", 6.0), ("ankle_dorsiflexion", -45.0), ("elbow_flexion", 20.0))
}
# Of the ellipsoid human in that pose, all of one density: its center of mass, and m^2 (one kilogram), axes of the pelvis.
MASS = MassProperties(
    np.array([0.0371, 0.0, -0.2131]), np.array([[0.1652, 0.0, 0.0129], [0.0, 0.1595, 0.0], [0.0129, 0.0, 0.0158]])
)
DURATION = 0.5  # seconds: with a shorter or longer flight of the paper's ranges the largest vertical step is larger
# At take-off, such that the ranges over 11 images are the paper's: velocity of the center of mass (m/s), momentum (m^2/s)
VELOCITY = np.array([1.85407, -0.01288, 0.89364])
_MOMENTUM = 2.09201
_TILT, _TWIST = 0.01683, 0.18273  # radians
IMAGE_SIZE = (768, 576)
CAMERA_NAMES = ("front", "side", "top")
_CAMERA_DISTANCE = 8.0  # meters from the middle of the flight
_FOCAL_PX = {"front": 1245.0, "side": 1245.0, "top": 1740.0}  # the whole flight just fits in every view
_MIDDLE = np.array([0.5, 0.0, 1.68])  # of the flight, meters


@dataclass(frozen=True, eq=False)
class SomersaultScene:
    """``measured`` is the body in the target images, ``tracked`` the one that is fitted to it, rigid both; they have the true
    ``variables`` (n, 6) and are in the states ``truth`` (n)."""

    measured: ArticulatedModel
    tracked: ArticulatedModel
    rig: CameraRig
    variables: np.ndarray
    truth: Sequence[State]

    def in_ambient_light(self) -> SomersaultScene:
        """The same in ambient light alone."""
        return replace(self, rig=replace(self.rig, lights=(Light("ambient", (0.8, 0.8, 0.8)),)))

    def film(self, body: ArticulatedModel, backend: str = BACKENDS[0]) -> list[list[np.ndarray]]:
        """Target images of a body in the true states, on black.

        Parameters
        ----------
        body : the body.
        backend : renderer, of `BACKENDS`.

        Returns
        -------
        (n image sets) of BGR images in the order of the rig.
        """
        with TargetStudio(self.rig, backend) as studio:
            return [studio.images(Configuration(body, state)) for state in self.truth]

    def draw(self, body: ArticulatedModel, states: Sequence[State]) -> list[list[np.ndarray]]:
        """Images of a body in any states, by the renderer that scores.

        Parameters
        ----------
        body : the body.
        states : one an image set.

        Returns
        -------
        (n image sets) of BGR images in the order of the rig.
        """
        return [
            [bgr_of(raycaster.render_color(Configuration(body, state), camera, self.rig.lights), camera) for camera in self.rig]
            for state in states
        ]


def somersault_scene(n_images: int = 11, width: int = 768) -> SomersaultScene:
    """The paper's experiment, or the first images of it, smaller.

    Parameters
    ----------
    n_images : the first so many image sets.
    width : of the images, pixels.

    Returns
    -------
    The scene.
    """
    measured, tracked = (rigid_body(body, POSTURE_DEG) for body in (nurbs_human(), surface_ellipsoids(nurbs_human())))
    variables = somersault_variables()[:n_images]
    return SomersaultScene(measured, tracked, somersault_rig(width), variables, somersault_states(tracked, variables, {}))


def surface_ellipsoids(body: ArticulatedModel) -> ArticulatedModel:
    """The body with the ellipsoid nearest to the surface of each of its shapes instead of this: no image has a say in it.

    Least squares over the triangles' centers, weighted by area, of the distance to first order, (|q| - 1) / |grad |q||, where
    q = (p - center) / half-axes (Taubin, IEEE PAMI 13, 1991). Half-axes keep the directions of the shape's axes.
    """
    shapes = []
    for shape in body.shapes:
        corners = np.concatenate([each.vertices[each.faces] for each in tessellate(shape.primitive, shape.color_rgb)])
        center, radii = _nearest_ellipsoid(corners)
        offset = se3.from_rotation_translation(np.eye(3), center)
        shapes.append(replace(shape, primitive=Ellipsoid(radii), T_link_shape=shape.T_link_shape @ offset))
    return replace(body, name="surface_ellipsoids", shapes=tuple(shapes))


def _nearest_ellipsoid(corners: np.ndarray) -> tuple[np.ndarray, tuple[float, float, float]]:
    """Center (3,) and half-axes of triangles (m, 3, 3), meters, rounded to 0.1 mm."""
    points, weights = corners.mean(axis=1), np.sqrt(_areas(corners))

    def residuals(unknown: np.ndarray) -> np.ndarray:
        q = (points - unknown[:3]) / unknown[3:]
        length = np.linalg.norm(q, axis=1)
        return weights * (length - 1.0) * length / np.linalg.norm(q / unknown[3:], axis=1)

    low, high = points.min(axis=0), points.max(axis=0)
    found = least_squares(residuals, np.concatenate([0.5 * (low + high), 0.5 * (high - low)]), x_scale=0.1)
    x, y, z = np.round(found.x[3:], 4).tolist()
    return np.round(found.x[:3], 4), (x, y, z)


RANGES = np.array([1.000, 0.010, 0.790, *np.deg2rad([360.0, 8.0, 180.0])])
"""Of the pose variables over all images (Table 1 of the paper), meters and radians."""
TAKE_OFF_HEIGHT = 2.09


def somersault_variables(n_images: int = 11) -> np.ndarray:
    """Pose variables (n_images, 6) of the somersault, evenly spaced from take-off to landing, in the order of
    `model.configuration.ROOT_NAMES`. The center of mass falls freely: the pelvis circles about a parabola."""
    row = np.array([0.0, 0.0, TAKE_OFF_HEIGHT, 0.0, _TILT, _TWIST])
    start = from_variables(row)
    momentum = start.T_world_root[:3, :3].T @ np.array([0.0, _MOMENTUM, 0.0])
    flight = FreeFlight(MASS, start, VELOCITY, np.linalg.solve(MASS.inertia, momentum), DURATION)
    times, rows = np.linspace(0.0, DURATION, n_images), []
    steps = np.unique(np.concatenate([times, np.linspace(0.0, DURATION, 41)]))
    for time in steps:  # small ones: full turns are counted on the way
        row = to_variables(flight.state(time), row)[:N_ROOT]
        rows.append(row)
    return np.array(rows)[np.searchsorted(steps, times)]


def somersault_states(model: ArticulatedModel, variables: np.ndarray, angles_deg: Mapping[str, float]) -> list[State]:
    """The body with fixed joint angles through the flight.

    Parameters
    ----------
    model : the body.
    variables : (n, 6) pose variables.
    angles_deg : joint axis -> angle.

    Returns
    -------
    n states.
    """
    angles = pose_angles(model, angles_deg)
    return [from_variables(np.concatenate([row, angles])) for row in variables]


def rigid_body(model: ArticulatedModel, angles_deg: Mapping[str, float]) -> ArticulatedModel:
    """The body with joint angles that it keeps: its shapes on one link, six degrees of freedom; the pose is that of its root.

    Parameters
    ----------
    model : the body.
    angles_deg : joint axis -> angle.

    Returns
    -------
    The rigid body.
    """
    posed = Configuration(model, State(np.eye(4), pose_angles(model, angles_deg)))
    shapes = tuple(
        replace(shape, link="body", T_link_shape=T) for shape, T in zip(model.shapes, posed.Ts_world_shape, strict=True)
    )
    return ArticulatedModel(model.name, KinematicChain(("body",), ()), shapes)


def pose_angles(model: ArticulatedModel, degrees: Mapping[str, float]) -> np.ndarray:
    """Joint angles with some axes at given angles, the others neutral.

    Parameters
    ----------
    model : the body.
    degrees : joint axis -> angle.

    Returns
    -------
    (n_axes,) radians.
    """
    angles = np.array([axis.neutral for axis in model.chain.axes])
    names = [axis.name for axis in model.chain.axes]
    for name, value in degrees.items():
        if name not in names:
            raise UnknownNameError("joint axis", name, names)
        angles[names.index(name)] = np.deg2rad(value)
    return angles


def somersault_rig(width: int = IMAGE_SIZE[0]) -> CameraRig:
    """Front, side and top view of the flight and the lights, all known; smaller images for ``width`` below 768."""
    scale = width / IMAGE_SIZE[0]
    height = round(scale * IMAGE_SIZE[1])
    front = looking_at(_MIDDLE + _CAMERA_DISTANCE * np.array([1.0, 0.0, 0.0]), _MIDDLE)
    side = looking_at(_MIDDLE - _CAMERA_DISTANCE * np.array([0.0, 1.0, 0.0]), _MIDDLE)
    # Seen from above, the flight goes to the right of the image.
    top = se3.from_rotation_translation(np.diag([1.0, -1.0, -1.0]), _MIDDLE + _CAMERA_DISTANCE * np.array([0.0, 0.0, 1.0]))
    lights = (
        Light("ambient", (0.35, 0.35, 0.35)),
        Light("directional", (0.45, 0.45, 0.45), direction=(-1.0, -0.6, -0.8)),
        Light("directional", (0.30, 0.30, 0.30), direction=(-0.2, 1.0, -0.7)),
    )
    cameras = []
    for name, place in zip(CAMERA_NAMES, (front, side, top), strict=True):
        focal = scale * _FOCAL_PX[name]
        K = np.array([[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])
        cameras.append(Camera(name, CameraModel(width, height, K), place))
    return CameraRig(tuple(cameras), lights=lights)


_N_CANDIDATES = 8  # faces with the nearest centers, among which the nearest face is searched


@dataclass(frozen=True)
class SurfaceDistance:
    """Millimeters from the surface of ``segment`` of one body to that of the other, and back."""

    segment: str
    mean_mm: float
    max_mm: float
    back_mean_mm: float
    back_max_mm: float


def segment_distances(one: ArticulatedModel, other: ArticulatedModel) -> tuple[SurfaceDistance, ...]:
    """Whole surfaces of shapes of one name, the parts within neighbors included; in the order of ``one``.

    Means are weighted by area.

    Parameters
    ----------
    one, other : bodies with shapes of the same names.

    Returns
    -------
    One a segment.

    Raises
    ------
    ValueError : bodies whose shapes have different names.
    """
    here, there = _surfaces(one), _surfaces(other)
    if set(here) != set(there):
        raise ValueError(f"expected shapes of the same names, got {sorted(set(here) ^ set(there))} in one body only")
    rows = []
    for name, surface in here.items():
        forth = _mean_and_max(surface, there[name])
        back = _mean_and_max(there[name], surface)
        rows.append(SurfaceDistance(name, *forth, *back))
    return tuple(rows)


def distance_table(one: ArticulatedModel, other: ArticulatedModel) -> str:
    """Table of `segment_distances`, with means over all segments and the largest distances.

    Parameters
    ----------
    one, other : bodies with shapes of the same names.

    Returns
    -------
    Lines of text.
    """
    rows = segment_distances(one, other)
    lines = [f"{'surface distance, mm':22s}{one.name + ' -> ' + other.name:>36s}{'and back':>18s}"]
    lines.append(f"{'segment':22s}{'mean':>27s}{'max':>9s}{'mean':>9s}{'max':>9s}")
    mean = SurfaceDistance(
        "all", float(np.mean([r.mean_mm for r in rows])), max(r.max_mm for r in rows),
        float(np.mean([r.back_mean_mm for r in rows])), max(r.back_max_mm for r in rows),
    )  # fmt: skip
    for r in (*rows, mean):
        lines.append(f"{r.segment:22s}{r.mean_mm:27.1f}{r.max_mm:9.1f}{r.back_mean_mm:9.1f}{r.back_max_mm:9.1f}")
    return "\n".join(lines)


def point_distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distances of points to the nearest of some triangles.

    Exact unless the nearest triangle's center is not among the nearest few: triangles should be small against their distances or
    of one size.

    Parameters
    ----------
    points : (n, 3).
    corners : (m, 3, 3) of the triangles.

    Returns
    -------
    (n,) in the unit of the points.
    """
    _, near = cKDTree(corners.mean(axis=1)).query(points, k=min(_N_CANDIDATES, len(corners)))
    near = near.reshape(len(points), -1)
    repeated = np.repeat(points, near.shape[1], axis=0)
    off = trimesh.triangles.closest_point(corners[near.ravel()], repeated) - repeated
    return np.linalg.norm(off, axis=1).reshape(near.shape).min(axis=1)


def _areas(corners: np.ndarray) -> np.ndarray:
    return 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)


def _mean_and_max(surface: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    areas = _areas(surface)
    distances = 1000.0 * point_distances(surface.mean(axis=1), other)
    return float(areas @ distances / areas.sum()), float(distances.max())


def _surfaces(model: ArticulatedModel) -> dict[str, np.ndarray]:
    """Name of a shape -> its triangles (m, 3, 3) in the root's frame."""
    found = {}
    for shape, T in zip(model.shapes, Configuration(model, State.neutral(model)).Ts_world_shape, strict=True):
        patches = tessellate(shape.primitive, shape.color_rgb)
        found[shape.name] = np.concatenate([se3.apply(T, patch.vertices)[patch.faces] for patch in patches])
    return found
