"""Direct alignment of frozen surface points: derivatives, the way to the minimum, and what may not be won."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.bodies.two_links import cameras, two_links
from helpers.numeric.finite_difference import numerical_jacobian
from helpers.numeric.naive import render_color
from tracker_node.camera.rig import CameraRig
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.points.photometry import COST, COUNT, PhotometryOptions, SurfacePhotometry, features_of
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize

RIG = CameraRig(tuple(replace(camera, model=camera.model.resized(320, 240)) for camera in cameras()))
COLORS = ((200, 60, 40), (40, 90, 210), (60, 200, 80))
ARM = two_links()
ARM = replace(ARM, shapes=tuple(replace(s, color_rgb=c) for s, c in zip(ARM.shapes, COLORS, strict=True)))
TRUTH = State.neutral(ARM).retract(np.array([0.02, -0.03, 0.01, 0.1, -0.2, 0.15, 0.5, -0.3]))
GROUND_RGB = (120, 115, 110)


@pytest.fixture(scope="module")
def images() -> list[np.ndarray]:
    """The arm before a plain ground, drawn by brute force."""
    result = []
    for camera in RIG:
        labels, rgb = render_color(Configuration(ARM, TRUTH), camera)[::2]
        picture = np.where(labels[:, :, None] > 0, rgb, GROUND_RGB)
        result.append(np.rint(picture[:, :, ::-1]).astype(np.uint8))
    return result


def photometry(images, representation="raw", expected=TRUTH, **changes) -> SurfacePhotometry:
    made = SurfacePhotometry(ARM, RIG, PhotometryOptions(representation, levels=3, **changes))
    made.set_images(images, expected, 60)
    return made


def test_squared_distances_of_features_are_those_of_the_representation():
    rng = np.random.default_rng(1)
    a, b = rng.uniform(20.0, 250.0, (2, 50, 3))
    raw = ((a - b) ** 2).sum(axis=1)
    share = [255.0 * c / c.sum(axis=1, keepdims=True) for c in (a, b)]
    normalized = ((share[0] - share[1]) ** 2).sum(axis=1)
    for options, expected in (
        (PhotometryOptions("raw"), raw),
        (PhotometryOptions("normalized"), normalized),
        (PhotometryOptions("blend", 0.3), 0.7 * raw + 0.3 * normalized),
    ):
        found = ((features_of(a, options) - features_of(b, options)) ** 2).sum(axis=1)
        np.testing.assert_allclose(found, expected, rtol=1e-4)
    bright = [features_of(factor * a, PhotometryOptions("normalized")) for factor in (0.5, 1.0)]
    np.testing.assert_allclose(*bright, rtol=1e-5)


@pytest.mark.parametrize("representation", ["raw", "normalized", "blend"])
@pytest.mark.parametrize("level", [0, 1])
def test_the_gradient_is_that_of_the_cost(images, representation, level):
    """In all, and for what rides on the second link alone; smooth images, whose differences are derivatives."""
    images = [cv2.GaussianBlur(image, (0, 0), 5.0 * (1 + level)) for image in images]
    state = TRUTH.retract(np.array([0.01, -0.005, 0.008, 0.02, 0.03, -0.02, 0.05, 0.04]))
    whole = photometry(images, representation).correspond(TRUTH, level)
    for here in (whole, whole.on_links(np.array([False, True]))):
        equations = here.linearize(state)
        assert equations.cost == pytest.approx(here.cost(state), rel=1e-12)
        np.testing.assert_allclose(equations.H, equations.H.T)

        def half_cost(d, here=here):
            return np.array([0.5 * here.cost(state.retract(d))])

        # In units of what each degree of freedom does to the image, for sums of millions of differences nearly cancel
        scale = np.sqrt(np.maximum(np.diag(equations.H), 1e-9))
        numeric, analytic = numerical_jacobian(half_cost, ARM.n_dof, 1e-4)[0] / scale, equations.g / scale
        moves = np.diag(equations.H) > 0.0
        assert np.linalg.norm((numeric - analytic)[moves]) < 0.12 * np.linalg.norm(numeric[moves])


def test_points_are_not_held_where_they_begin(images):
    """They begin in the middle of pixels: were the image bent there, any step would cost as its length, not as its square."""
    here = photometry(images).correspond(TRUTH, 0)
    for direction in np.eye(ARM.n_dof)[:3]:  # up to a fifth of a pixel, which is 7 mm wide

        def rise(step_m, direction=direction):
            costs = [here.cost(TRUTH.retract(side * step_m * direction)) for side in (-1.0, 1.0)]
            return sum(costs) - 2.0 * here.cost(TRUTH)

        assert rise(1.4e-3) == pytest.approx(16.0 * rise(0.35e-3), rel=0.1)


def test_information_on_links_is_that_of_the_state(images):
    here, body = photometry(images).correspond(TRUTH, 0), Configuration(ARM, TRUTH)
    J = np.where(ARM.chain.link_moved_by[:, :, None], body.twists, 0.0)
    H = (J @ here.link_information(TRUTH) @ np.swapaxes(J, 1, 2)).sum(axis=0)
    np.testing.assert_allclose(H, here.linearize(TRUTH).H, rtol=1e-9, atol=1e-6)


def test_a_body_that_is_off_comes_back(images):
    """Fifteen pixels and fifteen degrees: a pixel is 7 mm wide."""
    start = TRUTH.retract(np.array([0.06, 0.05, -0.05, 0.1, -0.1, 0.1, 0.25, 0.2]))
    here, state = photometry(images, expected=start), start
    options = LevenbergMarquardtOptions(max_iterations=2, tolerance=1e-6)
    for level in (2, 1, 0):
        for _ in range(6):  # points are frozen anew each time
            state = minimize(here.correspond(state, level), state, ARM.chain, options).state
    tips = [Configuration(ARM, s).Ts_world_shape[2, :3, 3] for s in (start, state, TRUTH)]
    assert np.linalg.norm(tips[0] - tips[2]) > 0.1
    assert np.linalg.norm(tips[1] - tips[2]) < 0.004
    assert abs(state.joint_positions - TRUTH.joint_positions)[0] < np.deg2rad(1.5)


def test_nothing_is_won_by_hiding_or_leaving(images):
    """The same points count wherever the body is; one that has left the picture costs as much as a difference of the scale."""
    here = photometry(images, robust_scale=50.0).correspond(TRUTH, 0)
    right, count = here.cost(TRUTH), here.sums(TRUTH)[:, COUNT]
    gone = TRUTH.retract(np.array([0.0, 0.0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    away, sums = here.cost(gone), here.sums(gone)
    np.testing.assert_array_equal(sums[:, COUNT], count)
    np.testing.assert_allclose(sums[:, COST], count * 50.0**2 * np.log(2.0))
    assert right < 0.25 * away
    assert not here.linearize(gone).g.any()


def test_a_camera_without_an_image_or_the_body_has_no_part(images):
    one = photometry([images[0], None]).correspond(TRUTH, 0)
    equations = one.linearize(TRUTH)
    assert equations.count > 100 and one.sums(TRUTH)[1, COUNT] == 0
    nowhere = TRUTH.retract(np.array([0.0, 0.0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    equations = photometry(images, expected=nowhere).correspond(nowhere, 0).linearize(nowhere)
    assert (equations.count, equations.cost) == (0, 0.0) and not equations.H.any()


def test_colors_by_camera_win_over_those_of_the_model(images):
    swapped = [images[0], images[1][:, :, ::-1].copy()]  # the second camera has red and blue interchanged
    made = photometry(swapped)
    before = made.correspond(TRUTH, 0).cost(TRUTH)
    colors = np.array([COLORS, [c[::-1] for c in COLORS]], dtype=float)
    made.set_colors(colors)
    assert made.correspond(TRUTH, 0).cost(TRUTH) < 0.3 * before


def test_a_camera_that_is_late_sees_where_the_body_has_moved_on_to(images):
    """What fits best, and the derivatives, are those of the state before the body moves on."""
    offsets = [None, np.array([0.03, 0.02, -0.04, 0.1, 0.2, -0.1, 0.1, -0.2])]
    before = TRUTH.retract(-offsets[1])  # the second camera shows it in TRUTH
    made = SurfacePhotometry(ARM, RIG, PhotometryOptions("raw", levels=3))
    made.set_images([None, cv2.GaussianBlur(images[1], (0, 0), 5.0)], before, 60, offsets)
    alone = photometry([None, cv2.GaussianBlur(images[1], (0, 0), 5.0)]).correspond(TRUTH, 0)
    late = made.correspond(before, 0, [None, TRUTH.difference(before)])
    assert late.cost(before) == pytest.approx(alone.cost(TRUTH), rel=0.02)
    assert made.correspond(before, 0).cost(before) > 1.5 * late.cost(before)
    state = before.retract(np.array([0.01, -0.005, 0.008, 0.02, 0.03, -0.02, 0.05, 0.04]))
    equations = late.linearize(state)

    def half_cost(d):
        return np.array([0.5 * late.cost(state.retract(d))])

    scale = np.sqrt(np.maximum(np.diag(equations.H), 1e-9))
    numeric, analytic = numerical_jacobian(half_cost, ARM.n_dof, 1e-4)[0] / scale, equations.g / scale
    assert np.linalg.norm(numeric - analytic) < 0.12 * np.linalg.norm(numeric)
