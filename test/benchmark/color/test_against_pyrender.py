"""The benchmark against pyrender times the same body in the same place."""


import numpy as np
import pytest

from benchmark.color import against_pyrender as benchmark
from tracker_node.model.configuration import Configuration
from tracker_node.render.opengl.renderer import RendererError
from tracker_node.render.raycast import raycaster
from tracker_node.render.raycast.extent import body_extent


@pytest.fixture(scope="module")
def metrics():
    try:
        return benchmark.measure(rounds=1)
    except RendererError as error:
        pytest.skip(str(error))  # says what to install


def test_figures(metrics):
    fused = metrics["score.fused_one_camera_ms"]
    assert fused > 0.0
    for name in ("full", "cropped", "backend"):
        key = "score.pyrender_ratio" if name == "full" else f"score.pyrender_{name}_ratio"
        assert metrics[key] == pytest.approx(metrics[f"score.pyrender_{name}_ms"] / fused)


def test_plain_pyrender_draws_the_body_that_is_scored(metrics):
    scene = benchmark.make_scene(1)
    camera, configuration = scene.rig.cameras[0], Configuration(scene.model, scene.truth[0])
    plain = benchmark.PlainPyrender(scene, camera, configuration)
    whole = 0, 0, camera.model.width, camera.model.height
    u0, v0, u1, v1 = part = body_extent(configuration, camera, whole)
    image, crop = plain.draw(whole).copy(), plain.draw(part).copy()
    plain.close()
    drawn, mask = image.any(axis=2), raycaster.render_mask(configuration, camera) > 0
    assert metrics["score.one_camera_pixels"] == mask.sum()
    assert (drawn & mask).sum() / (drawn | mask).sum() > 0.93  # its edges are soft
    assert np.abs(image[v0:v1, u0:u1].astype(int) - crop).mean() < 1.0
    assert (v1 - v0) * (u1 - u0) < 0.2 * mask.size
