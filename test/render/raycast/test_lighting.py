"""Light on a surface, in figures: lamps of every kind, spots to the edge of their cones, and what a camera shows of it."""

import numpy as np
import pytest

from tracker_node.camera import light as packing
from tracker_node.camera.light import Light, pack_lights
from tracker_node.geometry import se3
from tracker_node.render.raycast.lighting import N_COLUMNS, displayed, irradiance, lights_in_camera

T = se3.exp(np.array([0.3, -0.5, 1.0, 0.4, -0.7, 0.2]))  # T_cam_world
WHITE = (1.0, 0.5, 0.25)


def light_on(lights, point, normal, T_cam_world=T):
    """(r, g, b) at a point with a normal, both of the world."""
    packed = lights_in_camera(pack_lights(tuple(lights)), T_cam_world)
    assert packed.shape == (len(lights), N_COLUMNS)
    x, n = se3.apply(T_cam_world, np.asarray(point, dtype=float)), T_cam_world[:3, :3] @ np.asarray(normal, dtype=float)
    return np.array(irradiance(packed, *np.float32(x), *np.float32(n)))


def test_ambient_light_is_the_same_everywhere():
    for normal in ((0, 0, 1), (0, 0, -1), (1, 0, 0)):
        np.testing.assert_allclose(light_on([Light("ambient", WHITE)], (1, 2, 3), normal), WHITE, rtol=1e-5)


@pytest.mark.parametrize(("normal", "share"), [((0, 0, 1), 1.0), ((0, 0.6, 0.8), 0.8), ((1, 0, 0), 0.0), ((0, 0, -1), 0.0)])
def test_a_sun_shines_by_the_cosine_and_not_from_behind(normal, share):
    sun = Light("directional", WHITE, direction=(0.0, 0.0, -3.0))
    np.testing.assert_allclose(light_on([sun], (5, -3, 2), normal), share * np.array(WHITE), atol=1e-5)


@pytest.mark.parametrize(("point", "share"), [((0, 0, 0), 1.0), ((3, 0, 0), 0.8), ((0, 0, 5), 0.0)])
def test_a_lamp_shines_from_its_place_as_strong_at_any_distance(point, share):
    lamp = Light("point", WHITE, position=(0.0, 0.0, 4.0))
    np.testing.assert_allclose(light_on([lamp], point, (0, 0, 1)), share * np.array(WHITE), atol=1e-5)


def test_lights_add_up():
    lights = [Light("ambient", (0.1, 0.2, 0.3)), Light("directional", WHITE, direction=(0.0, 0.0, -1.0))]
    np.testing.assert_allclose(light_on(lights, (0, 0, 0), (0, 0, 1)), [1.1, 0.7, 0.55], rtol=1e-5)


def test_a_spot_ends_at_its_cone():
    """Straight down from four meters; its edge is at tan(0.5) times that."""
    spot = Light("spot", (1.0, 1.0, 1.0), position=(0.0, 0.0, 4.0), direction=(0.0, 0.0, -2.0), half_angle=0.5)

    def at(angle):
        return light_on([spot], (4.0 * np.tan(angle), 0.0, 0.0), (0, 0, 1))[0] / np.cos(angle)

    assert at(0.0) == pytest.approx(1.0)
    assert at(0.51) == 0.0
    shares = [at(angle) for angle in np.linspace(0.0, 0.5, 26)]
    assert np.all(np.diff(shares) <= 1e-6)
    assert shares[-2] < 0.5
    assert shares[-1] == pytest.approx(0.0, abs=1e-4)
    packed = pack_lights((spot,))
    slope, constant = lights_in_camera(packed, np.eye(4))[0, 7:9]
    outer, inner = packed[0, packing.COS_OUTER], packed[0, packing.COS_INNER]
    assert constant + slope * outer == pytest.approx(0.0, abs=1e-4)
    assert constant + slope * inner == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(
    ("color", "light", "gain", "power", "shown"),
    [(100.0, 0.5, 1.0, 1.0, 50.0), (100.0, 0.5, 2.0, 1.0, 100.0), (200.0, 1.0, 2.0, 1.0, 255.0), (100.0, 0.25, 1.0, 0.5, 50.0),
     (100.0, 0.5, 0.5, 0.5, 50.0), (100.0, 0.0, 1.0, 0.5, 0.0)],
)  # fmt: skip
def test_a_camera_shows_color_times_light(color, light, gain, power, shown):
    """The light is bent by gamma, the color is not."""
    assert displayed(*map(np.float32, (color, light, gain, power))) == pytest.approx(shown, abs=1e-2)
