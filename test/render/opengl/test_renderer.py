"""The renderer on OpenGL: what is its own. What it has in common with all renderers: test_renderer_contract.py."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, LIGHTS, look_at, scattered_scene, single_shape
from tracker_node.camera.light import Light
from tracker_node.camera.model import CameraModel
from tracker_node.errors import UnknownNameError
from tracker_node.experiments.target_images import BACKENDS, make_renderer
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.model.shapes.primitives import Box, Ellipsoid
from tracker_node.render.opengl.renderer import PyrenderRenderer
from tracker_node.render.raycast import raycaster
from tracker_node.render.raycast.extent import body_extent

K = np.array([[820.0, 0.0, 381.4], [0.0, 815.0, 290.8], [0.0, 0.0, 1.0]])
PAL = CameraModel(768, 576, K)
BENT = CameraModel(768, 576, K, "plumb_bob", np.array([-0.25, 0.1, 0.002, -0.001, 0.0]))
FISHEYE = CameraModel(768, 576, K @ np.diag([0.7, 0.7, 1.0]), "equidistant", np.array([0.05, -0.01, 0.0, 0.0]))


def posed(model, seed):
    rng = np.random.default_rng(seed)
    state = State.neutral(model)
    return Configuration(model, State(np.eye(4), state.joint_positions + rng.uniform(-0.4, 0.4, model.n_dof - 6)))


@pytest.mark.parametrize(
    "make",
    [lambda: posed(ellipsoid_human(), 1), lambda: posed(human_model(), 2), lambda: scattered_scene(5)],
    ids=["ellipsoids", "cones", "all shapes"],
)
@pytest.mark.parametrize("lens", [PAL, BENT, FISHEYE], ids=["plain", "bent", "fisheye"])
def test_agrees_with_the_ray_caster(renderer, make, lens):
    configuration = make()
    middle = configuration.Ts_world_shape[:, :3, 3].mean(axis=0)
    camera = replace(look_at(np.add(middle, (2.5, -1.5, 0.6)), middle, lens), gain=(1.1, 1.0, 0.9), gamma=1.8)
    ours, cast = (r.render_color(configuration, camera, LIGHTS) for r in (renderer, raycaster))
    common, either = (ours.labels > 0) & (cast.labels > 0), (ours.labels > 0) | (cast.labels > 0)
    assert either.sum() > 10_000
    assert common.sum() / either.sum() >= 0.998
    assert (ours.labels == cast.labels)[common].mean() >= 0.998
    same = common & (ours.labels == cast.labels)
    assert np.abs(ours.rgb - cast.rgb)[common].mean() <= 0.5
    assert np.percentile(np.abs(ours.depth[same] - cast.depth[same]), 99) < 1e-3


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("seed", range(3))
def test_extent_holds_the_body_and_little_else(lens, seed):
    configuration = scattered_scene(seed, n=3)
    camera = look_at((0.4, -3.0, 0.8), (0.5, 0.0, 0.2), LENSES[lens])
    whole = 0, 0, camera.model.width, camera.model.height
    labels = raycaster.render_view(configuration, camera).labels
    u0, v0, u1, v1 = body_extent(configuration, camera, whole)
    rows, columns = np.flatnonzero(labels.any(axis=1)), np.flatnonzero(labels.any(axis=0))
    assert v0 <= rows[0] and rows[-1] < v1 and u0 <= columns[0] and columns[-1] < u1
    assert (u1 - u0) * (v1 - v0) <= 2.5 * (len(rows) + 8) * (len(columns) + 8)


def test_extent_of_what_is_not_seen(renderer):
    ball = single_shape(Ellipsoid((0.1, 0.1, 0.1)))
    whole = 0, 0, 768, 576
    away = look_at((0.0, -3.0, 0.0), (0.0, -6.0, 0.0), PAL)
    aside = look_at((0.0, -3.0, 0.0), (3.0, -2.0, 0.0), PAL)
    for camera in (away, aside):
        assert body_extent(ball, camera, whole) is None
        view = renderer.render_color(ball, camera)
        assert not view.labels.any() and not view.rgb.any() and np.isinf(view.depth).all()
    within = look_at((0.0, -0.05, 0.0), (0.0, 3.0, 0.0), PAL)
    assert body_extent(ball, within, whole) == whole


def test_part_of_an_image_is_that_part(renderer):
    configuration = scattered_scene(4)
    camera = look_at((0.4, -3.0, 0.8), (0.0, 0.0, 0.0), BENT)
    whole = renderer.render_color(configuration, camera, LIGHTS)
    u0, v0, u1, v1 = region = (331, 207, 500, 391)
    part = renderer.render_color(configuration, camera, LIGHTS, region)
    assert part.region == region and part.labels.any()
    assert (part.labels == whole.labels[v0:v1, u0:u1]).mean() > 0.9995
    assert np.abs(part.rgb - whole.rgb[v0:v1, u0:u1]).mean() < 0.02


def test_pictures_of_odd_width(renderer):
    """Rows of such a picture are not whole words in memory."""
    rng = np.random.default_rng(3)
    picture = rng.integers(0, 256, (3, 5, 3), dtype=np.uint8)
    background = single_shape(Box((1.0, 0.1, 0.6), None, (None, None, None, picture, None, None)))
    view = renderer.render_color(background, look_at((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), PAL))
    rows, columns = np.flatnonzero(view.labels.any(axis=1)), np.flatnonzero(view.labels.any(axis=0))
    at_v = rows[0] + (np.arange(3) + 0.5) * len(rows) / 3
    at_u = columns[0] + (np.arange(5) + 0.5) * len(columns) / 5
    centers = view.rgb[np.ix_(at_v.astype(int), at_u.astype(int))]  # of texels, where nothing of their neighbors is seen
    assert np.abs(centers - picture).max() < 6.0


def test_spot_fades_from_four_fifths_of_its_angle(renderer):
    """A lamp at the camera lights a wall: on a ring about the middle all is known."""
    wall = single_shape(Box((4.0, 0.1, 4.0)))
    camera = look_at((0.0, -2.05, 0.0), (0.0, 0.0, 0.0), PAL)
    lamp = Light("spot", (1.0, 0.5, 0.25), position=(0.0, -2.05, 0.0), direction=(0.0, 1.0, 0.0), half_angle=0.25)
    view = renderer.render_color(wall, camera, [lamp])
    u, v = np.meshgrid(np.arange(768), np.arange(576))
    angle = np.arctan(np.hypot((u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1]))
    share = np.clip((np.cos(angle) - np.cos(0.25)) / (np.cos(0.2) - np.cos(0.25)), 0.0, 1.0) * np.cos(angle)
    assert np.abs(view.rgb - 180.0 * share[..., None] * (1.0, 0.5, 0.25)).max() < 1.5


def test_two_renderers_do_not_share_their_end(renderer):
    ball, camera = single_shape(Ellipsoid((0.1, 0.2, 0.3))), look_at((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), PAL)
    before = renderer.render_view(ball, camera)
    with PyrenderRenderer() as other:
        assert (other.render_view(ball, camera).labels == before.labels).all()
    assert (renderer.render_view(ball, camera).labels == before.labels).all()
    with pytest.raises(ValueError, match="closed"):
        other.render_view(ball, camera)


def test_another_thread_is_told_what_is_wrong(renderer):
    ball, camera = single_shape(Ellipsoid((0.1, 0.2, 0.3))), look_at((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), PAL)
    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match="on the thread that made the renderer"):
        pool.submit(renderer.render_view, ball, camera).result()


def test_too_many_lights(renderer):
    ball, camera = single_shape(Ellipsoid((0.1, 0.2, 0.3))), look_at((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), PAL)
    with pytest.raises(ValueError, match="at most 16 lights, got 17"):
        renderer.render_color(ball, camera, [Light("ambient")] * 17)


def run_python(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **environment}, check=False
    )


@pytest.mark.parametrize(
    ("platform", "start"),
    [
        ("nonsense", "from tracker_node.render.opengl.renderer import OpenGLContext as start"),
        ("glx", f"from {make_renderer.__module__} import make_renderer\ndef start(): make_renderer('pyrender').__enter__()"),
    ],
)
def test_without_opengl_one_line_says_what_to_install(platform, start):
    code = f"""
from tracker_node.errors import TrackerError
{start}
try:
    start()
    print("started")
except TrackerError as error:
    print(error)
"""
    done = run_python(code, PYOPENGL_PLATFORM=platform)
    lines = done.stdout.strip().splitlines()
    assert done.returncode == 0 and len(lines) == 1, done.stdout + done.stderr
    for words in (f"PYOPENGL_PLATFORM={platform}", "sudo apt-get install libegl1", "ray-caster needs none"):
        assert words in lines[0]


def test_ray_caster_does_not_load_opengl():
    code = """
import sys
from tracker_node.experiments.target_images import make_renderer
with make_renderer("raycaster") as renderer:
    print(sorted({"pyrender", "OpenGL"} & set(sys.modules)), hasattr(renderer, "render_color"))
"""
    done = run_python(code, PYOPENGL_PLATFORM="nonsense")
    assert done.stdout.split() == ["[]", "True"], done.stderr


def test_unknown_renderer_is_told_the_others():
    with pytest.raises(UnknownNameError) as caught, make_renderer("povray"):
        pass
    assert all(name in str(caught.value) for name in ("povray", *BACKENDS))
