"""The tracker's model as a subject: the same outline as the tracker's own renderer draws, a motion within the limits."""

import numpy as np
import pytest

from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.human import human_model
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.synthesis.scenes.rasterizer import Rasterizer
from tracker_node.synthesis.scenes.scene import CameraImaging, SceneConfig, make_rig
from tracker_node.synthesis.subjects.cones import ModelSubject, waves


@pytest.fixture(scope="module")
def model():
    return human_model()


def test_two_independent_renderers_agree_on_the_outline(model):
    """pyrender's triangles against the ray caster's closed forms, through the lens: masks differ by slivers only."""
    config = SceneConfig(n_cameras=3, noise_levels=0.0, blur_px=0.0)
    configuration = Configuration(model, waves(model, 30.0, 1)[0])
    mesh = ModelSubject(model).mesh(configuration)
    with Rasterizer() as rasterizer:
        rasterizer.show(mesh)
        for camera in make_rig(config):
            imaging = CameraImaging(camera, config)
            color, _, window = rasterizer.render_region(imaging.pinhole, mesh.vertices)
            view = np.zeros((imaging.pinhole.model.height, imaging.pinhole.model.width, 3), np.float32)
            view[window] = color[:, :, 3:]
            coverage = imaging.expose(view, np.random.default_rng(0))[:, :, 0] / 255.0
            cast = render_mask(configuration, camera) > 0
            both = (coverage > 0.5) & cast
            assert both.sum() / ((coverage > 0.5) | cast).sum() > 0.985
            v, u = np.indices(cast.shape)
            for axis in (u, v):
                seen, expected = (axis * coverage).sum() / coverage.sum(), axis[cast].mean()
                assert abs(seen - expected) < 0.35  # of some 250 pixels; a mask without anti-aliasing knows it no better
            assert coverage.sum() == pytest.approx(cast.sum(), rel=4e-3)


def test_waves_move_everything_smoothly_within_the_limits(model):
    states = waves(model, 30.0, 90)
    joints = np.array([state.joint_positions for state in states])
    assert (joints >= model.chain.lower).all() and (joints <= model.chain.upper).all()
    assert np.ptp(joints, axis=0).min() > np.radians(8.0)
    assert np.abs(np.diff(joints, axis=0)).max() < np.radians(3.5)
    landmarks = np.array([Configuration(model, state).landmarks_world for state in states])
    assert np.linalg.norm(np.diff(landmarks, axis=0), axis=2).max() < 0.12
    lowest = ModelSubject(model).mesh(Configuration(model, states[0])).vertices[:, 2].min()
    assert lowest == pytest.approx(0.0, abs=1e-9)


def test_another_seed_is_another_motion(model):
    a, b = waves(model, 30.0, 2, seed=1), waves(model, 30.0, 2, seed=2)
    assert np.abs(a[0].joint_positions - b[0].joint_positions).max() > 0.1
    np.testing.assert_array_equal(a[1].joint_positions, waves(model, 30.0, 2, seed=1)[1].joint_positions)
