"""Scores of bodies of any shapes: every pixel of the image counts, those at its edges too, with the colors that are given."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, LIGHTS, colored_scene, look_at
from tracker_node.camera.rig import CameraRig
from tracker_node.objective.color.score import ColorObjective
from tracker_node.parallel import Workers
from tracker_node.render.raycast.raycaster import render_color, render_mask


@pytest.fixture(scope="module")
def filled():
    """A box so near that it reaches over the upper and the left edge of the image."""
    configuration = colored_scene(1, 0.0, names=("box",))
    rig = CameraRig((look_at((0.4, 0.5, 0.1), (0.0, 0.0, 0.0), LENSES["plain"]),), lights=LIGHTS)
    return configuration, rig


def objective(configuration, rig, images, colors=None):
    result = ColorObjective(configuration.model, rig, workers=Workers(1), colors_rgb=colors)
    result.set_images(images)
    return result


def seen(configuration, rig):
    views = [render_color(configuration, camera, rig.lights) for camera in rig]
    return [np.clip(np.round(view.rgb[..., ::-1]), 0, 255).astype(np.uint8) for view in views]


def test_pixels_at_the_edges_count(filled):
    configuration, rig = filled
    mask = render_mask(configuration, rig.cameras[0]) > 0
    assert mask[0].any()
    assert mask[:, 0].any()
    found = objective(configuration, rig, seen(configuration, rig)).evaluate(configuration.state)
    assert found.camera_pixels.sum() == mask.sum()
    assert found.rms < 0.6  # images are rounded


def test_colors_that_are_given_are_taken_instead_of_the_model_s(filled):
    configuration, rig = filled
    n = len(configuration.model.shapes)
    own = np.array([shape.color_rgb for shape in configuration.model.shapes], dtype=float)[None]
    images = seen(configuration, rig)
    stated = objective(configuration, rig, images).evaluate(configuration.state).rms
    given = objective(configuration, rig, images, own).evaluate(configuration.state).rms
    assert given == pytest.approx(stated, abs=1e-6)
    black = objective(configuration, rig, images, np.zeros((1, n, 3))).evaluate(configuration.state)
    mask = render_mask(configuration, rig.cameras[0]) > 0
    assert black.rms == pytest.approx(np.sqrt(np.mean(images[0][mask].astype(float) ** 2)), rel=2e-3)
