"""The kernels behind the contour objective: assembly, interpolation, and the pull of the silhouette's boundary."""

import numpy as np
import pytest

from helpers.bodies.bodies import random_state
from helpers.bodies.two_links import cameras, two_links
from helpers.numeric.finite_difference import numerical_jacobian
from tracker_node.geometry import se3
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.objective import contour_residual as kernel
from tracker_node.objective.chamfer.correspondences import ContourBody, ContourCorrespondences, ContourOptions, EvidenceMaps
from tracker_node.objective.constraints.prior import Prior
from tracker_node.render.contour.generators import SAMPLES, world_spheres
from tracker_node.render.contour.picks import N_PICK_COLUMNS


def test_assembly_is_what_dense_jacobians_give():
    """Residual by residual: rows g_i J_link, weights w_i, J^T W J and J^T W r with the zeros written out."""
    rng = np.random.default_rng(5)
    model = human_model()
    chain, configuration = model.chain, Configuration(model, random_state(model, rng))
    n_links = len(chain.links)
    normal, gradient = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6))
    rows, weights, residuals = [], [], []
    for link in rng.integers(0, n_links, 400):
        if link == 7:
            continue  # a link that no camera sees
        g, w, r = rng.normal(size=6), rng.uniform(0.1, 2.0), rng.normal()
        normal[link] += w * np.outer(g, g)
        gradient[link] += w * r * g
        rows.append(g @ (configuration.twists * chain.link_moved_by[link][:, None]).T)
        weights.append(w)
        residuals.append(r)
    J, W = np.array(rows), np.diag(weights)
    H, g = np.zeros((model.n_dof, model.n_dof)), np.zeros(model.n_dof)
    kernel.assemble(normal, gradient, chain.link_moved_by, configuration.twists, H, g)
    np.testing.assert_allclose(H, J.T @ W @ J, atol=1e-10 * np.abs(H).max())
    np.testing.assert_allclose(g, J.T @ W @ np.array(residuals), atol=1e-10 * np.abs(g).max())


def test_interpolation_is_exact_on_planes_and_ends_at_the_border():
    v, u = np.mgrid[0:20, 0:30].astype(np.float32)
    plane = 2.0 * u - 3.0 * v + 1.0
    inside, value, du, dv = kernel.bilinear(plane, 11.3, 7.8)
    assert inside
    assert (value, du, dv) == (pytest.approx(2 * 11.3 - 3 * 7.8 + 1, abs=1e-5), pytest.approx(2.0), pytest.approx(-3.0))
    for outside in ((-0.1, 5.0), (5.0, -0.1), (29.0, 5.0), (5.0, 19.0), (1e6, 5.0)):
        assert not kernel.bilinear(plane, *outside)[0]


def test_samples_read_the_silhouette_on_the_outline_and_edges_within_which_have_no_side():
    v, u = np.mgrid[0:20, 0:30].astype(np.float32)
    samples = np.array([[10.0, 5.0, 1.0, 0.0], [10.0, 5.0, -1.0, 0.0], [10.0, 5.0, 0.0, -1.0], [40.0, 5.0, 1.0, 0.0]])
    options = ContourOptions(inner_weight=0.3, alignment=0.6).packed()
    outline = kernel.read_samples(u - 8.0, v - 2.0, samples, np.ones(4, dtype=bool), options)
    assert outline[:, 0].tolist() == [1, 0, 0, 0] and outline[0, 1:].tolist() == [2.0, 1.0, 0.0, 1.0]
    within = kernel.read_samples(u - 8.0, v - 2.0, samples, np.zeros(4, dtype=bool), options)
    assert within[:, 0].tolist() == [0, 0, 1, 0] and within[2, 1:].tolist() == [3.0, 0.0, 1.0, 0.3]


def outline_of(state: State, model, camera) -> np.ndarray:
    """(n, N_SAMPLE_COLUMNS): the outline's samples that ``camera`` sees, as the kernel notes them."""
    body, options = ContourBody.of(model, [camera]), ContourOptions(samples_per_line=12, alignment=0.6)
    nothing = EvidenceMaps((0, 0), *np.zeros((2, 480, 640), np.float32), np.zeros((1, 4), np.float32))
    n, most, Ts = len(model.shapes), SAMPLES * 12, Configuration(model, state).Ts_world_shape
    spheres, samples = np.empty((n, 4)), np.zeros((n * most, kernel.N_SAMPLE_COLUMNS))
    world_spheres(Ts, body.arrays.bounds, spheres)
    seen = np.zeros((n, most), np.uint8), np.zeros((n, most, N_PICK_COLUMNS)), np.zeros(n, np.int64)
    n_links = len(model.chain.links)
    sums = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6)), np.zeros(kernel.N_STATISTICS)
    kernel.linearize_camera(
        body.arrays.packed, Ts, spheres, body.cameras[0], nothing.packed, options.packed(), 12, True, (*seen, samples, *sums)
    )
    return samples[samples[:, 0] != 0.0]


def scattered_boundary(state: State, model, camera, offset_px: float) -> np.ndarray:
    """A point straight outward of every outline sample, ``offset_px`` away: the nearest sample stays the same nearby."""
    outline = outline_of(state, model, camera)
    points = outline[:, :4].copy()
    points[:, :2] += offset_px * outline[:, 2:4]
    distance = np.linalg.norm(points[:, None, :2] - outline[None, :, :2], axis=2)
    alone = np.sort(distance, axis=1)[:, 1] > abs(offset_px) + 0.5
    return points[alone].astype(np.float32)


@pytest.mark.parametrize("offset_px", [-1.5, 0.7, 2.5])
@pytest.mark.parametrize("scale_px", [3.0, 1e3])
def test_the_pull_of_the_boundary_has_the_gradient_of_its_cost(offset_px, scale_px):
    model = two_links(hand=False)
    state = State(se3.exp([0.02, 0.05, -0.1, 0.1, 0.2, 0.3]), np.array([0.6, 0.4]))
    boundaries = [scattered_boundary(state, model, camera, offset_px) for camera in cameras()]
    assert min(len(b) for b in boundaries) >= 10
    flat = np.zeros((2, 480, 640), np.float32)  # maps without a slope: the samples themselves say nothing
    maps = [EvidenceMaps((0, 0), *flat, boundary) for boundary in boundaries]
    options = ContourOptions(samples_per_line=12, boundary_weight=0.7, boundary_scale_px=scale_px)
    objective = ContourCorrespondences(ContourBody.of(model, cameras()), maps, options, state)
    equations = objective.linearize(state)
    assert equations.count == 0
    n_points, scale_sq = sum(len(b) for b in boundaries), scale_px**2
    expected = 0.7 * n_points * scale_sq * offset_px**2 / (scale_sq + offset_px**2)
    assert equations.cost == pytest.approx(expected, rel=1e-4)
    numeric = numerical_jacobian(lambda d: objective.linearize(state.retract(d)).cost, 8, step=2e-5)
    # The pull takes the sample's normal for fixed, which turns a little with the body: the more, the larger the distance
    assert np.abs(2 * equations.g - numeric).max() < 0.03 * np.abs(numeric).max()


def test_boundary_points_beyond_the_reach_or_with_another_normal_are_not_explained():
    model = two_links(hand=False)
    state = State(se3.exp([0.02, 0.05, -0.1, 0.1, 0.2, 0.3]), np.array([0.6, 0.4]))
    camera = cameras()[0]
    near = scattered_boundary(state, model, camera, 1.0)
    far, turned = near.copy(), near.copy()
    far[:, :2] += 300.0
    turned[:, 2:] *= -1.0
    flat = np.zeros((2, 480, 640), np.float32)
    for boundary, unexplained in ((near, 0), (far, len(near)), (turned, len(near))):
        maps = [EvidenceMaps((0, 0), *flat, boundary)]
        options = ContourOptions(samples_per_line=12, reach_px=5.0)
        contours = ContourCorrespondences(ContourBody.of(model, [camera]), maps, options, state)
        equations = contours.linearize(state)
        assert contours.residuals(state)[0].stats[kernel.N_UNEXPLAINED] == unexplained
        assert (equations.cost > 0) == (unexplained == 0)


@pytest.mark.parametrize("seed", range(5))
def test_a_prior_pulls_along_the_gradient_of_its_cost(seed):
    rng = np.random.default_rng(seed)
    model = two_links()
    mean, state = random_state(model, rng), random_state(model, rng)
    prior = Prior(mean, rng.uniform(0.0, 50.0, 8) * (rng.random(8) < 0.8))

    def cost(d):
        return prior.add_to(np.zeros((8, 8)), np.zeros(8), state.retract(d))

    H, g = np.ones((8, 8)), np.ones(8)
    prior.add_to(H, g, state)
    scale = max(1.0, np.abs(g).max())
    # Rotation's weights may differ by axis; the cost is then a form of the rotation vector, and the gradient still exact
    np.testing.assert_allclose(2 * (g - 1.0), numerical_jacobian(cost, 8), atol=1e-6 * scale)
    np.testing.assert_allclose(H, H.T, atol=1e-9)
    assert np.linalg.eigvalsh(H - 1.0).min() > -1e-9
    assert cost(mean.difference(state)) == pytest.approx(0.0, abs=1e-12)
