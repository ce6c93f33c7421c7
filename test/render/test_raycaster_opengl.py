"""The ray-caster against OpenGL, which knows nothing of closed forms: triangles, rasterized by another program."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at, scattered_scene
from tracker_node.camera.model import CameraModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.render.opengl.renderer import RendererError
from tracker_node.render.raycast.raycaster import render_view
from tracker_node.synthesis.scenes.rasterizer import Rasterizer
from tracker_node.synthesis.subjects.cones import ModelSubject

LENS = CameraModel(640, 480, np.array([[610.0, 0.0, 322.4], [0.0, 605.0, 236.8], [0.0, 0.0, 1.0]]))


@pytest.fixture(scope="module")
def rasterizer():
    try:
        opened = Rasterizer()
    except RendererError as error:
        pytest.skip(str(error))  # says what to install
    with opened:
        yield opened


def human():
    model = human_model()
    angles = np.random.default_rng(4).uniform(-0.4, 0.4, model.n_dof - 6)
    return Configuration(model, State(np.eye(4), State.neutral(model).joint_positions + angles))


@pytest.mark.parametrize("make", [human, lambda: scattered_scene(8), lambda: scattered_scene(9)], ids=["human", "a", "b"])
@pytest.mark.parametrize("eye", [(0.3, -3.0, 0.5), (2.0, 1.5, 1.2)])
def test_masks_and_depths_agree(rasterizer, make, eye):
    configuration = make()
    middle = configuration.Ts_world_shape[:, :3, 3].mean(axis=0)
    camera = look_at(middle + eye, middle, LENS)
    rasterizer.show(ModelSubject(configuration.model).mesh(configuration))
    # OpenGL samples pixels off their centers: thrice as large, the middle pixel of each nine is a ray's
    large = LENS.resized(3 * LENS.width, 3 * LENS.height)
    color, depth = rasterizer.render(replace(camera, model=large))
    drawn, depth = color[1::3, 1::3, 3] > 127, depth[1::3, 1::3]
    view = render_view(configuration, camera)
    cast = view.labels > 0
    assert cast.sum() > 10_000
    assert (drawn & cast).sum() / (drawn | cast).sum() >= 0.995
    difference = np.abs(depth - view.depth)[drawn & cast]
    assert np.percentile(difference, 95) < 0.004  # the rest lies on steep slopes and outlines of parts
    assert np.median(difference) < 0.0006
