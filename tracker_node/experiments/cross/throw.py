"""The wooden cross of Trewartha, Yeadon & Knight: where it flies, who films it, and what the experimenters know of that.

World: x in the direction of the throw, y to the left of it, z up, the floor at 0. The flights stay within a volume of 2 m. The
paper gives neither sizes nor distances; those here are chosen so that the volume fills the images.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...camera.light import Light
from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...geometry import se3
from ...model.articulated import ArticulatedModel, Landmark, Shape
from ...model.configuration import State, from_variables
from ...model.kinematic_chain import KinematicChain
from ...model.shapes.primitives import Box
from ...synthesis.scenes.scene import looking_at
from ..free_flight import FreeFlight, mass_properties

FIELD_PERIOD_S = 0.02
LATE_CAMERA, LATE_S = "top", 0.004  # not genlocked: it exposes so much later than the others
IMAGE_SIZE = (768, 576)
MIDDLE = np.array([0.0, 0.0, 1.25])  # of the volume
VOLUME = 2.0  # meters along each axis
DISTORTION = {"left": -0.12, "right": -0.10, "top": -0.09}  # k1: barrels of 1 to 2 % in the corners, as of zoom lenses
YELLOW_RGB = (250, 215, 30)
UP, DOWN = 0.38, 0.62  # meters from the crossing to the ends of the long prism
LEFT, RIGHT = 0.40, 0.25  # ... of the short one
LONG_SECTION = (0.060, 0.090)  # thickness (x) and breadth (y)
SHORT_SECTION = (0.045, 0.080)  # thickness (x) and breadth (z)


@dataclass(frozen=True, eq=False)
class CrossTrial:
    """One throw: ``n_fields`` time steps of video, the first at ``start_s`` of the ``flight``."""

    name: str
    n_fields: int
    flight: FreeFlight
    start_s: float = 0.01

    def state(self, field: int, late_s: float = 0.0) -> State:
        """State of the cross at an exposure.

        Parameters
        ----------
        field : its number.
        late_s : seconds after the genlocked cameras.

        Returns
        -------
        The state.
        """
        return self.flight.state(self.start_s + field * FIELD_PERIOD_S + late_s)

    def states(self) -> list[State]:
        """At every field of the genlocked cameras."""
        return [self.state(field) for field in range(self.n_fields)]


def side_somersault(model: ArticulatedModel) -> CrossTrial:
    """39 fields; the cross turns in its own plane, about its axis of largest inertia, with a slight wobble."""
    return _trial(model, "side", 39, angles_deg=(-20.0, 4.0, 90.0), spin=(0.5, 8.3, -0.3))


def twisting_somersault(model: ArticulatedModel) -> CrossTrial:
    """34 fields; about its axis of middle inertia, so that the cross makes half a twist by itself."""
    return _trial(model, "twist", 34, angles_deg=(-25.0, 11.0, -6.0), spin=(0.0, 10.0, 0.0))


def _trial(
    model: ArticulatedModel, name: str, n_fields: int, angles_deg: tuple[float, float, float], spin: tuple[float, float, float]
) -> CrossTrial:
    duration = n_fields * FIELD_PERIOD_S + 0.04
    velocity = np.array([1.1, 0.12, 9.81 * duration / 2.0 + 0.25])
    body = mass_properties(model)
    start = from_variables(np.concatenate([[-0.5 * 1.1 * duration, -0.05, 0.0], np.deg2rad(angles_deg)]))
    rotation = start.T_world_root[:3, :3]
    place = start.T_world_root[:3, 3] - rotation @ body.center + [0.0, 0.0, MIDDLE[2] - 0.45]
    start = State(se3.from_rotation_translation(rotation, place), np.zeros(0))
    return CrossTrial(name, n_fields, FreeFlight(body, start, velocity, rotation.T @ np.array(spin), duration))


def cross_rig() -> CameraRig:
    """The cameras and lights as they are: two genlocked cameras with horizontal axes, one above, two spotlights.

    The three cameras answer differently to light, since they are of two makes: gain by channel and gamma.
    """
    places = {
        "left": (looking_at(MIDDLE + np.array([-4.9, -4.8, 0.0]), MIDDLE), 1560.0, (6.0, -9.0), (1.0, 1.0, 1.0), 2.2),
        "right": (looking_at(MIDDLE + np.array([5.0, -4.6, 0.0]), MIDDLE), 1535.0, (-8.0, 5.0), (1.04, 1.0, 0.95), 2.2),
        "top": (_above(MIDDLE + np.array([0.15, -0.1, 5.2])), 960.0, (4.0, 7.0), (0.95, 1.0, 1.1), 1.9),
    }
    cameras = []
    for name, (T_world_cam, focal, offset, gain, gamma) in places.items():
        center = 0.5 * (np.array(IMAGE_SIZE) - 1.0) + offset
        K = np.array([[focal, 0.0, center[0]], [0.0, focal, center[1]], [0.0, 0.0, 1.0]])
        cameras.append(Camera(name, CameraModel(*IMAGE_SIZE, K), T_world_cam, gain=gain, gamma=gamma))
    spots = (
        Light("spot", (0.75, 0.75, 0.75), (-2.5, -4.0, 3.8), (2.5, 4.0, -2.6), np.deg2rad(28.0)),
        Light("spot", (0.65, 0.65, 0.65), (3.4, -3.2, 4.0), (-3.4, 3.2, -2.7), np.deg2rad(28.0)),
    )
    return CameraRig(tuple(cameras), lights=(Light("ambient", (0.25, 0.25, 0.25)), *spots))


def _above(center: np.ndarray) -> np.ndarray:
    """T_world_cam of a camera that looks straight down; the throw goes to the right of its image."""
    return se3.from_rotation_translation(np.diag([1.0, -1.0, -1.0]), center)


def measured_lights(lights: tuple[Light, ...], rng: np.random.Generator) -> tuple[Light, ...]:
    """Lights as they were measured: 20 cm off, with an intensity that is 15 % wrong.

    Parameters
    ----------
    lights : as they are.
    rng : random directions and signs.

    Returns
    -------
    The lights.
    """
    measured = []
    for light in lights:
        factor = 1.0 + 0.15 * rng.choice([-1.0, 1.0])
        red, green, blue = (float(factor * v) for v in light.intensity)
        light = replace(light, intensity=(red, green, blue))
        if light.position is not None:
            direction = rng.standard_normal(3)
            x, y, z = light.position + 0.2 * direction / np.linalg.norm(direction)
            light = replace(light, position=(x, y, z))
        measured.append(light)
    return tuple(measured)


def control_points(rng: np.random.Generator) -> np.ndarray:
    """(20, 3) meters: four balls on each of five surveyed poles, in the corners of the volume and near its middle, put up at
    random."""
    half = 0.5 * VOLUME
    corners = np.array([(-half, -half), (half, -half), (-half, half), (half, half), (0.1, -0.1)])
    feet = corners + rng.uniform(-0.15, 0.15, corners.shape)
    heights = MIDDLE[2] + np.linspace(-0.9, 0.85, 4)
    points = [[*foot, height] for foot in feet for height in heights]
    return np.array(points) + rng.uniform(-0.05, 0.05, (len(points), 3)) * [0.0, 0.0, 1.0]


def digitized(camera: Camera, points: np.ndarray, sigma_px: float, rng: np.random.Generator) -> np.ndarray:
    """Pixels of points as someone clicks on them.

    Parameters
    ----------
    camera : the camera.
    points : (n, 3) world, meters.
    sigma_px : standard deviation of the error along u and v.
    rng : random errors.

    Returns
    -------
    (n, 2).
    """
    return camera.project(points)[0] + sigma_px * rng.standard_normal((len(points), 2))


def yellow_stick() -> ArticulatedModel:
    """A rigid cross in the plane x = 0: origin in the crossing, the long prism along z, the short one along y."""
    long = Box((*LONG_SECTION, UP + DOWN))
    short = Box((SHORT_SECTION[0], LEFT + RIGHT, SHORT_SECTION[1]))
    shapes = (
        Shape("long", "cross", long, _at(0.0, 0.0, 0.5 * (UP - DOWN)), YELLOW_RGB),
        Shape("short", "cross", short, _at(0.0, 0.5 * (LEFT - RIGHT), 0.0), YELLOW_RGB),
    )
    landmarks = (
        Landmark("crossing", "cross", (0.0, 0.0, 0.0)),
        Landmark("top", "cross", (0.0, 0.0, UP)),
        Landmark("bottom", "cross", (0.0, 0.0, -DOWN)),
        Landmark("left_end", "cross", (0.0, LEFT, 0.0)),
        Landmark("right_end", "cross", (0.0, -RIGHT, 0.0)),
    )
    return ArticulatedModel("yellow_stick", KinematicChain(("cross",), ()), shapes, landmarks)


def _at(x: float, y: float, z: float) -> np.ndarray:
    return se3.from_rotation_translation(np.eye(3), np.round((x, y, z), 6))
