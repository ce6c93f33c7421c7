"""Detected points as least squares: derivatives against differences, offsets that stay unknown, outliers that say nothing."""

import numpy as np
import pytest

from helpers.bodies.bodies import random_state
from helpers.cameras.camera_rigs import circle_rig
from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.human import human_model
from tracker_node.objective.keypoints.correspondences import (
    BodyPoints,
    GuessedDepths,
    KeypointCorrespondences,
    ObservedPoints,
    packed_cameras,
)

HUMAN = human_model()
NAMES = ("left_wrist", "right_knee", "nose", "left_hip", "right_elbow")


def body_points(sigma_m=0.03, means=None):
    rows = [HUMAN.landmark_index(name) for name in NAMES]
    n = len(rows)
    covariances = np.tile(sigma_m**2 * np.eye(3), (n, 1, 1))
    means = np.zeros((n, 3)) if means is None else means
    return BodyPoints(HUMAN, HUMAN.landmark_links[rows], HUMAN.landmark_positions[rows], means, covariances)


def scene(seed, noise_px=3.0, outliers=0.05, n_cameras=3):
    rng = np.random.default_rng(seed)
    rig = circle_rig(n_cameras)
    state = random_state(HUMAN, rng, 0.3)
    body = body_points()
    T = Configuration(HUMAN, state).Ts_world_link[body.links]
    points = np.einsum("nij,nj->ni", T[:, :3, :3], body.positions) + T[:, :3, 3]
    pixels = np.stack([camera.project(points)[0] for camera in rig], axis=1)
    pixels = pixels + noise_px * rng.normal(size=pixels.shape)
    half = rng.normal(size=(*pixels.shape[:2], 2, 2))
    covariances = half @ np.swapaxes(half, 2, 3) + noise_px**2 * np.eye(2)
    found = np.full(pixels.shape[:2], outliers)
    found[0, 1] = 1.0
    observed = ObservedPoints(pixels, covariances, found, np.full(n_cameras, 640.0 * 480.0))
    return rig, state, body, observed


@pytest.mark.parametrize("seed", range(4))
def test_the_gradient_is_that_of_the_cost(seed):
    rig, state, body, observed = scene(seed)
    near = state.retract(0.01 * np.random.default_rng(seed).normal(size=HUMAN.n_dof))
    points = KeypointCorrespondences(body, packed_cameras(rig), observed.packed())
    g = points.linearize(near).g
    assert_jacobian(2.0 * g, lambda d: np.array(points.linearize(near.retract(d)).cost), tolerance=1e-5)


def guesses(rig, body, state, seed):
    rng, n = np.random.default_rng(seed), len(rig)
    bones = np.array([[-1.0, 0.0, 0.0, 0.0, 1.0], [0.0, -0.5, 1.0, -0.5, 0.0]])
    middle, centers = body.places(state).mean(axis=0), np.array([camera.center for camera in rig])
    away = np.linalg.norm(middle - centers, axis=1)
    rays = (middle - centers) / away[:, None]
    depths = 0.6 * (rays @ (bones @ body.places(state)).T) + 0.1 * rng.normal(size=(n, 2))
    depths[1, 0] = np.nan
    away = away + 0.2 * rng.normal(size=n)
    return GuessedDepths(bones, np.full(2, 0.6), depths, np.array([0.1, 0.2]), away, 0.05 * away, centers, rays, 0.3)


def compared(depths, body, state, sharpness):
    """H, g and cost of guesses alone."""
    H, g = np.zeros((HUMAN.n_dof, HUMAN.n_dof)), np.zeros(HUMAN.n_dof)
    return H, g, depths.add_to(H, g, body, Configuration(HUMAN, state), sharpness)


@pytest.mark.parametrize("sharpness", [1.0, 0.1])
def test_the_gradient_of_guessed_depths_is_that_of_their_cost(sharpness):
    rig, state, body, observed = scene(5)
    near = state.retract(0.02 * np.random.default_rng(5).normal(size=HUMAN.n_dof))
    depths = guesses(rig, body, state, 5)

    def cost(d):
        return np.array(compared(depths, body, near.retract(d), sharpness)[2])

    H, g, _ = compared(depths, body, near, sharpness)
    assert_jacobian(2.0 * g, cost, tolerance=1e-5)
    assert np.linalg.eigvalsh(H)[0] > -1e-9 * np.trace(H)
    with_them, without = (
        KeypointCorrespondences(body, packed_cameras(rig), observed.packed(), sharpness, each).linearize(near)
        for each in (depths, None)
    )
    np.testing.assert_allclose(with_them.H - without.H, H, atol=1e-6 * np.abs(without.H).max())


def test_a_guess_that_is_wrong_altogether_says_nothing():
    rig, state, body, _ = scene(6)
    depths = guesses(rig, body, state, 6)
    depths.depths[:], depths.distances[:] = 20.0, 90.0
    H, g, _ = compared(depths, body, state, 1.0)
    assert np.abs(H).max() < 1e-9 and np.abs(g).max() < 1e-9


def test_information_is_the_curvature_without_noise_and_outliers():
    rig, state, body, observed = scene(1, noise_px=1e-9, outliers=1e-12)
    covariances = np.tile(4.0 * np.eye(2), (*observed.pixels.shape[:2], 1, 1))
    sharp = ObservedPoints(observed.pixels, covariances, observed.outliers, observed.areas)
    points = KeypointCorrespondences(body, packed_cameras(rig), sharp.packed())
    H = points.linearize(state).H
    assert_jacobian(H, lambda d: points.linearize(state.retract(d)).g, step=1e-4, tolerance=1e-4)


def test_any_number_of_cameras_leaves_the_offset_unknown():
    rig, state, body, observed = scene(2, noise_px=1e-3, n_cameras=8)
    sharp = ObservedPoints(observed.pixels, 1e-3 * observed.covariances, observed.outliers, observed.areas)
    H = KeypointCorrespondences(body, packed_cameras(rig), sharp.packed()).linearize(state).H
    variances = 1.0 / np.linalg.eigvalsh(H[:3, :3])  # of the root's place, all else known
    assert variances == pytest.approx(0.03**2 / len(NAMES), rel=1e-2)


def test_an_outlier_says_nothing():
    rig, state, body, observed = scene(3)
    cameras = packed_cameras(rig)
    observed.pixels[2, 0] += 200.0
    with_outlier = KeypointCorrespondences(body, cameras, observed.packed()).at(state)
    observed.outliers[2, 0] = 1.0
    without = KeypointCorrespondences(body, cameras, observed.packed()).at(state)
    assert with_outlier.weights[2, 0] < 1e-6 and without.weights[2, 0] == -1.0
    np.testing.assert_allclose(with_outlier.equations.H, without.equations.H, rtol=1e-6, atol=1e-3)


def test_equations_of_cameras_add_up_where_offsets_are_known():
    rig, state, body, observed = scene(0)
    known = BodyPoints(body.model, body.links, body.positions, body.means, 1e-12 * body.covariances)
    points = KeypointCorrespondences(known, packed_cameras(rig), observed.packed())
    body_there = Configuration(HUMAN, state)
    total = np.zeros((HUMAN.n_dof, HUMAN.n_dof))
    for own in points.camera_equations(state):
        J = HUMAN.chain.link_moved_by[:, :, None] * body_there.twists[None]
        total += np.einsum("lia,lab,ljb->ij", J, own.normal, J)
    np.testing.assert_allclose(points.linearize(state).H, total, rtol=1e-5, atol=1e-2)
