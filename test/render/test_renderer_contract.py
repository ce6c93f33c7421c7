"""What every renderer must do, against brute force ray by ray and against what is known without rendering."""

import pickle
from contextlib import ExitStack
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, LIGHTS, RENDERERS, colored_scene, colored_shapes, look_at, single_shape
from helpers.numeric import naive
from tracker_node.camera.light import Light
from tracker_node.camera.model import CameraModel
from tracker_node.errors import TrackerError
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import BOX_FACES, Box, Ellipsoid, Mesh

# Large enough for outlines to be a small part of the image
LARGE = CameraModel(320, 240, np.array([[300.0, 0.0, 162.3], [0.0, 300.0, 118.1], [0.0, 0.0, 1.0]]))
BENT = CameraModel(320, 240, LARGE.K, "plumb_bob", np.array([-0.3, 0.1, 0.002, -0.001, 0.0]))
AMBIENT = Light("ambient", (1.0, 1.0, 1.0))


@pytest.fixture(scope="module", params=RENDERERS)
def renderer(request):
    with ExitStack() as stack:
        try:
            made = RENDERERS[request.param]()
            opened = stack.enter_context(made) if hasattr(made, "__enter__") else made
        except TrackerError as error:
            pytest.skip(str(error))  # says what to install
        yield opened


@cache
def brute_force(scene):
    """Labels, depth and colors of a pickled scene; the same for every renderer, and slow."""
    model, state, camera, lights = pickle.loads(scene)
    return naive.render_color(Configuration(model, state), camera, lights)


def assert_like_brute_force(renderer, configuration, camera, lights=LIGHTS):
    """The agreement that is asked of all renderers; returns the share of the image that the body covers."""
    view = renderer.render_color(configuration, camera, lights)
    labels, depth, rgb = brute_force(pickle.dumps((configuration.model, configuration.state, camera, lights)))
    drawn, expected = view.labels > 0, labels > 0
    common = drawn & expected
    assert common.sum() / (drawn | expected).sum() >= 0.995
    assert (view.labels == labels)[common].mean() >= 0.995
    assert np.abs(view.rgb - rgb)[common].mean() <= 1.0
    same = common & (view.labels == labels)
    assert np.median(np.abs(view.depth[same] / depth[same] - 1.0)) <= 5e-4
    assert (view.rgb[~drawn] == 0.0).all()
    assert np.isinf(view.depth[~drawn]).all()
    return common.mean()


@pytest.mark.parametrize("name", colored_shapes(0))
def test_each_kind_of_surface(renderer, name):
    configuration = colored_scene(5, spread=0.1, names=[name])
    covered = assert_like_brute_force(renderer, configuration, look_at((0.2, -1.3, 0.3), (0.0, 0.0, 0.0), LARGE))
    assert covered > 0.05


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("lens", [LARGE, BENT], ids=["plain", "bent"])
def test_shapes_of_all_kinds_through_one_another(renderer, seed, lens):
    configuration = colored_scene(seed, spread=0.4)
    camera = look_at((0.0, -2.5, 0.3), (0.0, 0.0, 0.0), lens)
    assert assert_like_brute_force(renderer, configuration, camera) > 0.1
    assert len(np.unique(renderer.render_view(configuration, camera).labels)) >= 9


def test_fisheye(renderer):
    camera = look_at((0.0, -1.2, 0.3), (0.0, 0.0, 0.0), LENSES["fisheye"].resized(320, 240))
    assert assert_like_brute_force(renderer, colored_scene(2), camera) > 0.1


def test_views_with_and_without_color_agree(renderer):
    configuration, camera = colored_scene(3), look_at((0.0, -2.5, 0.3), (0.0, 0.0, 0.0), BENT)
    plain, colored = renderer.render_view(configuration, camera), renderer.render_color(configuration, camera, LIGHTS)
    np.testing.assert_array_equal(plain.labels, colored.labels)
    np.testing.assert_allclose(plain.depth, colored.depth, rtol=1e-4)


@pytest.mark.parametrize("region", [(37, 21, 181, 150), (150, 100, 151, 101), (0, 0, 320, 1)])
def test_a_region_is_that_part_of_the_image(renderer, region):
    configuration, camera = colored_scene(3, spread=0.4), look_at((0.0, -2.0, 0.3), (0.0, 0.0, 0.0), BENT)
    whole, part = (renderer.render_color(configuration, camera, LIGHTS, r) for r in (None, region))
    inside = slice(region[1], region[3]), slice(region[0], region[2])
    assert part.region == region
    assert whole.region == (0, 0, 320, 240)
    np.testing.assert_array_equal(part.labels, whole.labels[inside])
    np.testing.assert_allclose(part.depth, whole.depth[inside], rtol=1e-5)
    np.testing.assert_allclose(part.rgb, whole.rgb[inside], atol=1.0)


def test_without_lights_colors_are_those_of_the_model(renderer):
    configuration, camera = colored_scene(4, names=["ellipsoid"]), look_at((0.0, -1.5, 0.3), (0.0, 0.0, 0.0), LARGE)
    view = renderer.render_color(configuration, camera)
    color = configuration.model.shapes[0].color_rgb
    np.testing.assert_allclose(view.rgb[view.labels > 0], np.broadcast_to(color, (int((view.labels > 0).sum()), 3)), atol=1.0)


def test_a_spot_lights_its_cone_and_nothing_else(renderer):
    """A white floor far below a spot: full strength within 0.8 of the half angle, ambient light outside."""
    floor = Mesh(np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    configuration = single_shape(floor, color_rgb=(200, 200, 200))
    height, half_angle = 4.0, 0.3
    lights = Light("ambient", (0.1,) * 3), Light("spot", (0.8,) * 3, (0.5, 0.2, height), (0.0, 0.0, -1.0), half_angle)
    camera = look_at((0.0, -1.0, 5.0), (0.2, 0.0, 0.0), LARGE)
    rgb = renderer.render_color(configuration, camera, lights).rgb

    def brightness(angle, around):
        reach = height * np.tan(angle)
        point = np.array([0.5 + reach * np.cos(around), 0.2 + reach * np.sin(around), 0.0])
        pixels, valid = camera.project(point)
        assert valid
        u, v = np.round(pixels).astype(int)
        return rgb[v, u, 0]

    for around in np.arange(0.0, 6.0, 0.7):
        for angle in (0.0, 0.1, 0.2):
            assert brightness(angle, around) == pytest.approx(200 * (0.1 + 0.8 * np.cos(angle)), abs=1.5)
        assert brightness(1.1 * half_angle, around) == pytest.approx(20.0, abs=1.0)
        # Half-way along the edge's ramp, in cosines
        middle = np.arccos(0.5 * (np.cos(half_angle) + np.cos(0.8 * half_angle)))
        assert brightness(middle, around) == pytest.approx(200 * (0.1 + 0.4 * np.cos(middle)), abs=10.0)


QUARTERS = np.array([[[230, 20, 20], [20, 230, 20]], [[20, 20, 230], [220, 220, 220]]], dtype=np.uint8)
OUTSIDE = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@pytest.mark.parametrize("face", BOX_FACES)
def test_pictures_land_upright_on_every_face(renderer, face):
    """Seen from outside with z (on +z and -z: y) upright, the image shows the picture as it is."""
    picture = QUARTERS.repeat(8, axis=0).repeat(8, axis=1)
    textures = tuple(picture if name == face else None for name in BOX_FACES)
    configuration = single_shape(Box((0.6, 0.5, 0.4), np.full((6, 3), 90), textures))
    outward = np.array(OUTSIDE[face[1]]) * (1.0 if face[0] == "+" else -1.0)
    view = renderer.render_color(configuration, look_at(2.0 * outward, (0.0, 0.0, 0.0), LARGE))
    rows, columns = (np.flatnonzero((view.labels > 0).any(axis=axis)) for axis in (1, 0))
    for i, row in enumerate(np.percentile(rows, [25, 75]).astype(int)):
        for j, column in enumerate(np.percentile(columns, [25, 75]).astype(int)):
            np.testing.assert_allclose(view.rgb[row, column], QUARTERS[i, j], atol=1.5)


def test_a_picture_on_a_mesh_has_v_upward(renderer):
    square = Mesh(
        np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1.0]]), np.array([[0, 1, 2], [0, 2, 3]]),
        uv=np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1.0]]]),
        texture=QUARTERS.repeat(8, axis=0).repeat(8, axis=1),
    )  # fmt: skip
    rgb = renderer.render_color(single_shape(square), look_at((0.0, -4.0, 0.0), (0.0, 0.0, 0.0), LARGE)).rgb
    for i, row in enumerate((80, 160)):
        for j, column in enumerate((125, 200)):
            np.testing.assert_allclose(rgb[row, column], QUARTERS[i, j], atol=1.5)


def test_colors_of_corners_follow_perspective(renderer):
    """Half-way along a strip that runs into the distance, the color is half-way, wherever that is in the image."""
    strip = Mesh(
        np.array([[-1, 0, 0], [1, 0, 0], [1, 8, 0], [-1, 8, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]),
        vertex_colors_rgb=np.array([[0, 0, 0], [0, 0, 0], [240, 120, 60], [240, 120, 60]]),
    )  # fmt: skip
    camera = look_at((0.0, -2.0, 1.0), (0.0, 4.0, 0.0), LARGE)
    rgb = renderer.render_color(single_shape(strip), camera).rgb
    for share in (0.2, 0.5, 0.8):
        u, v = camera.project(np.array([0.3, 8 * share, 0.0]))[0]
        row = int(np.round(v))
        ray = camera.T_world_cam[:3, :3] @ camera.model.rays(np.array([[np.round(u), row]]))[0][0]
        reached = (camera.center - camera.center[2] / ray[2] * ray)[1] / 8
        np.testing.assert_allclose(rgb[row, int(np.round(u))], reached * np.array([240, 120, 60]), atol=1.5)


def test_gain_and_gamma(renderer):
    """The displayed color is color (gain light)^(1 / gamma), up to 255."""
    configuration = single_shape(Ellipsoid((0.3, 0.3, 0.3)), color_rgb=(250, 120, 60))
    camera = look_at((0.0, -1.5, 0.3), (0.0, 0.0, 0.0), LARGE)
    linear = renderer.render_color(configuration, camera, LIGHTS)
    answering = replace(camera, gain=(1.8, 0.7, 1.0), gamma=2.2)
    view = renderer.render_color(configuration, answering, LIGHTS)
    inside = view.labels > 0
    color = np.array([250.0, 120.0, 60.0])
    expected = np.minimum(color * (np.array(answering.gain) * linear.rgb[inside] / color) ** (1 / 2.2), 255.0)
    difference = np.abs(view.rgb[inside] - expected)
    assert difference.mean() <= 1.0
    assert (view.rgb[inside][:, 0] == 255.0).mean() > 0.01, "the test must reach the clipping"


def test_a_body_behind_the_camera_is_not_seen(renderer):
    camera = look_at((0.0, -3.0, 0.0), (0.0, -6.0, 0.0), LARGE)
    view = renderer.render_color(colored_scene(1), camera, LIGHTS)
    assert not view.labels.any()
    assert not view.mask.any()
    assert np.isinf(view.depth).all()
    assert not view.rgb.any()


def test_a_body_partly_outside_the_image(renderer):
    camera = look_at((0.0, -1.5, 0.3), (0.8, 0.0, 0.6), BENT)
    configuration = colored_scene(6)
    assert assert_like_brute_force(renderer, configuration, camera) > 0.02
    labels = renderer.render_view(configuration, camera).labels
    assert labels[:, 0].any() or labels[-1].any()


def test_the_nearer_of_two_shapes_shows(renderer):
    """One depth order for all kinds of shapes: each of four in front of the other three in turn."""
    primitives = [colored_shapes(0)[name] for name in ("ellipsoid", "cylinder", "box", "smooth mesh")]
    for front in range(4):
        shapes = []
        for i, primitive in enumerate(primitives):
            T = np.eye(4)
            T[1, 3] = -0.8 if i == front else 0.5 + 0.3 * i
            shapes.append(Shape(f"s{i}", "base", primitive, T))
        model = ArticulatedModel("row", KinematicChain(("base",), ()), tuple(shapes))
        view = renderer.render_view(Configuration(model, State.neutral(model)), look_at((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), LARGE))
        assert view.labels[118, 162] == front + 1
