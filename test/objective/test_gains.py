"""The best gains of images are those of least squares, within their limits; a score in them is that of images so lit."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from test.objective.color.test_score import SUN, bent_state, noise_images
from tracker_node.camera.rig import CameraRig
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.objective.color.alignment import PhotometricObjective, PhotometricOptions
from tracker_node.objective.color.score import ColorObjective, ColorOptions
from tracker_node.objective.gains import LEAST, MOST, TINT, gains_of, squares_left
from tracker_node.objective.points.photometry import SurfacePhotometry
from tracker_node.parallel import Workers
from tracker_node.render.raycast.raycaster import render_color


def sums(model, image):
    return (model * model).sum(), (model * image).sum(axis=0), (image * image).sum(axis=0)


def test_gains_are_those_of_least_squares_and_what_is_left_is_left():
    rng = np.random.default_rng(1)
    model = rng.uniform(20, 220, (500, 3))
    image = model / (1.5, 1.6, 1.45) + rng.normal(size=(500, 3))
    mm, products, squares = sums(model, image)
    gains = gains_of(products, squares)
    expected = [np.linalg.lstsq(image[:, [c]], model[:, c], rcond=None)[0][0] for c in range(3)]
    np.testing.assert_allclose(gains, expected, rtol=1e-12)
    assert squares_left(mm, products, squares) == pytest.approx(((model - gains * image) ** 2).sum(), rel=1e-9)


def test_gains_have_limits_and_a_black_image_has_none():
    model = np.full((10, 3), 200.0)
    for factor, gain in ((0.01, MOST), (100.0, LEAST)):
        np.testing.assert_allclose(gains_of(*sums(model, factor * model)[1:]), gain)
    tinted = model * (0.2, 1.0, 1.0)
    gains = gains_of(*sums(model, tinted)[1:])
    assert gains[0] == pytest.approx(TINT * 2.2 / 2.04) and gains[1] == gains[2] == 1.0  # the best gain of all is 2.2 / 2.04
    np.testing.assert_array_equal(gains_of(np.zeros(3), np.zeros(3)), 1.0)
    assert squares_left(1200.0, np.zeros(3), np.zeros(3)) == 1200.0  # a body before black costs all of its colors


@pytest.mark.parametrize("make_model", [ellipsoid_human, human_model])  # all smooth, and with a mesh
@pytest.mark.parametrize("representation", ["raw", "blend"])
def test_a_gained_score_is_that_of_images_in_their_best_gains(make_model, representation):
    model, rig = make_model(), CameraRig(circle_rig(2).cameras, lights=SUN)
    state, images = bent_state(model), [image // 3 + 30 for image in noise_images(rig)]
    objective = ColorObjective(model, rig, ColorOptions(representation, gained=True), workers=Workers(1))
    objective.set_images(images)
    squares, count = 0.0, 0
    for camera, image in zip(rig, images, strict=True):
        view = render_color(Configuration(model, state), camera, SUN)
        expected, seen = view.rgb[view.labels > 0].astype(float), image[view.labels > 0][:, ::-1].astype(float)
        gains = gains_of(*sums(expected, seen)[1:])
        raw = ((expected - gains * seen) ** 2).sum()
        shares = [255.0 * c / np.maximum(c.sum(axis=1, keepdims=True), 1.0) for c in (expected, seen)]
        squares += raw if representation == "raw" else 0.5 * raw + 0.5 * ((shares[0] - shares[1]) ** 2).sum()
        count += len(seen)
    assert objective.score(state) == pytest.approx(np.sqrt(squares / (3 * count)), rel=3e-3)
    assert np.abs(objective.scores([state]) - objective.score(state)).max() < 1e-9


def test_the_cost_of_an_alignment_is_the_score_whatever_the_light():
    model, rig = ellipsoid_human(), CameraRig(circle_rig(2).cameras, lights=SUN)
    state = bent_state(model)
    shown = [render_color(Configuration(model, state), camera, SUN).rgb[..., ::-1] for camera in rig]
    lit = [np.rint(image * factor).astype(np.uint8) for image, factor in zip(shown, (0.5, 0.8), strict=True)]
    score = ColorObjective(model, rig, ColorOptions(gained=True), workers=Workers(1))
    pyramid = PhotometricObjective(model, rig, PhotometricOptions(levels=1, gained=True), workers=Workers(1))
    for objective in (score, pyramid):
        objective.set_images(lit)
    level = pyramid.at_level(0)
    there = level.linearize(state)
    assert np.sqrt(there.cost / there.count) == pytest.approx(score.score(state), abs=0.1) and score.score(state) < 1.0
    off = state.retract(np.concatenate([[0.02, 0.0, 0.01], np.zeros(model.n_dof - 3)]))
    known = PhotometricObjective(model, rig, PhotometricOptions(levels=1), workers=Workers(1))
    known.set_images([np.rint(image).astype(np.uint8) for image in shown])
    steps = [-np.linalg.solve(e.H[:3, :3], e.g[:3]) for e in (each.at_level(0).linearize(off) for each in (pyramid, known))]
    np.testing.assert_allclose(steps[0], steps[1], atol=0.15 * np.linalg.norm(steps[1]))


def test_gains_of_a_surface_are_those_of_its_images():
    model, rig = ellipsoid_human(), CameraRig(circle_rig(2).cameras, lights=SUN)
    state = bent_state(model)
    shown = [render_color(Configuration(model, state), camera, SUN).rgb[..., ::-1] for camera in rig]
    lit = [np.rint(image * factor).astype(np.uint8) for image, factor in zip(shown, (0.5, (0.9, 1.0, 1.1)), strict=True)]
    gains = SurfacePhotometry(model, rig).gains([lit[0], lit[1]], state)
    np.testing.assert_allclose(gains[0], 2.0, rtol=0.02)
    np.testing.assert_allclose(gains[1], [1 / 1.1, 1.0, 1 / 0.9], rtol=0.03)
    np.testing.assert_array_equal(SurfacePhotometry(model, rig).gains([None, lit[1]], state)[0], 1.0)
