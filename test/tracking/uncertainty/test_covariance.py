"""Covariances of fits: against sampled errors, second derivatives by differences, and where nothing is known."""

from dataclasses import replace

import numpy as np
import pytest

from tracker_node.geometry import se3
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.synthesis.subjects.figure import figure_model, figure_motion
from tracker_node.tracking.uncertainty.covariance import BEYOND_SECOND_ORDER, ImageEvidence, fit_covariance, link_bends

MODEL = figure_model()
BODY = Configuration(MODEL, figure_motion(n_images=1)[0])
N, N_LINKS = MODEL.n_dof, len(MODEL.chain.links)


def evidence(H: np.ndarray, scatter: np.ndarray) -> ImageEvidence:
    return ImageEvidence(H, scatter, np.zeros((N_LINKS, 6, 6)))


def test_it_is_the_scatter_of_estimates():
    """A fit of correlated measurements that takes them for independent, with a prior that is right."""
    rng = np.random.default_rng(1)
    J = 200.0 * rng.normal(size=(60, N))
    errors = np.linalg.cholesky(0.7 * np.eye(60) + 0.3 * np.kron(np.eye(6), np.ones((10, 10))))
    prior = np.diag(rng.uniform(1e4, 1e6, N))
    H, scatter = J.T @ J, J.T @ errors @ errors.T @ J
    n = 4000
    truth = rng.normal(size=(n, N)) / np.sqrt(np.diag(prior))
    measured = truth @ J.T + rng.normal(size=(n, 60)) @ errors.T
    estimates = np.linalg.solve(H + prior, J.T @ measured.T).T
    expected = np.cov((estimates - truth).T)
    found = fit_covariance(H + prior, evidence(H, scatter), BODY)[0]
    np.testing.assert_allclose(np.diag(found), np.diag(expected), rtol=0.12)
    np.testing.assert_allclose(found, expected, atol=0.1 * np.diag(expected).max())


def test_without_images_what_is_believed_is_taken_at_its_word():
    H = np.diag(np.linspace(1.0, 1e4, N))
    np.testing.assert_allclose(fit_covariance(H, None, BODY)[0], np.linalg.inv(H), rtol=1e-4)
    H[7] = H[:, 7] = 0.0
    unknown = fit_covariance(H, None, BODY)[0]
    assert np.isfinite(unknown).all() and unknown[7, 7] > 1e4  # rad^2: nothing is known of it


def test_links_bend_as_they_do_by_differences():
    model = human_model()
    rng = np.random.default_rng(2)
    state = State.neutral(model).retract(0.3 * rng.normal(size=model.n_dof))
    directions = np.zeros((model.n_dof, 3))
    directions[6:] = rng.normal(size=(model.n_dof - 6, 3))
    directions /= np.linalg.norm(directions, axis=0)
    body, h = Configuration(model, state), 1e-3
    found = link_bends(body, directions)
    for k, direction in enumerate(directions.T):
        ahead, behind = (Configuration(model, state.retract(s * h * direction)).Ts_world_link for s in (1.0, -1.0))
        for link, place in enumerate(body.Ts_world_link):
            back = se3.inverse(place)
            bend = (se3.log(ahead[link] @ back) + se3.log(behind[link] @ back)) / h**2
            np.testing.assert_allclose(found[k, link], bend, atol=1e-5)


def test_links_bend_along_two_directions_at_once_as_they_do_by_differences():
    model, rng, h = human_model(), np.random.default_rng(5), 1e-3
    body = Configuration(model, State.neutral(model).retract(0.3 * rng.normal(size=model.n_dof)))
    directions = rng.normal(size=(model.n_dof, 2))
    directions[:6, 0] = 0.0
    directions /= np.linalg.norm(directions, axis=0)

    def alone(direction: np.ndarray, link: int) -> np.ndarray:
        back = se3.inverse(body.Ts_world_link[link])
        places = [Configuration(model, body.state.retract(s * h * direction)).Ts_world_link[link] for s in (1.0, -1.0)]
        return sum(se3.log(place @ back) for place in places) / h**2

    found = link_bends(body, directions, (np.array([0]), np.array([1])))[0]
    for link in range(len(found)):
        both = alone(directions.sum(axis=1), link) - alone(directions[:, 0], link) - alone(directions[:, 1], link)
        np.testing.assert_allclose(found[link], 0.5 * both, atol=2e-5)


def test_two_directions_that_are_hardly_known_bend_each_other():
    """Against sampled errors: what all others do to make up for where they lead beside the tangent."""
    names = ("left_shoulder_flexion", "left_shoulder_abduction", "left_shoulder_internal_rotation")
    weak = np.eye(N)[:, [MODEL.chain.dof_names.index(name) for name in names]]
    spreads = np.radians([8.0, 5.0, 6.0])
    H = 1e6 * np.eye(N) + (weak * (1.0 / spreads**2 - 1e6)) @ weak.T
    links = np.tile(1e5 * np.eye(6), (N_LINKS, 1, 1))
    added = fit_covariance(H, ImageEvidence(H, H, links), BODY)[0] - fit_covariance(H, evidence(H, H), BODY)[0]
    errors = np.random.default_rng(6).normal(size=(4000, 3)) * spreads
    pulls = 0.5e5 * link_bends(BODY, weak @ errors.T)
    makes_up = np.linalg.solve(H, np.einsum("kla,na,ln->nk", pulls, BODY.twists, MODEL.chain.link_moved_by))
    expected = BEYOND_SECOND_ORDER * makes_up @ makes_up.T / len(errors)
    np.testing.assert_allclose(added, expected, atol=0.1 * np.diag(expected).max())
    assert np.linalg.eigvalsh(expected)[-2] > 0.05 * np.linalg.eigvalsh(expected)[-1]  # not the arc of one of them alone


def test_what_is_hardly_known_leads_along_an_arc():
    direction = np.zeros(N)
    for name in ("left_shoulder_abduction", "left_shoulder_internal_rotation"):
        direction[MODEL.chain.dof_names.index(name)] = 1.0
    direction /= np.sqrt(2.0)
    H = 1e6 * np.eye(N) + (1.0 / np.radians(8.0) ** 2 - 1e6) * np.outer(direction, direction)
    links = np.tile(1e5 * np.eye(6), (N_LINKS, 1, 1))
    added = fit_covariance(H, ImageEvidence(H, H, links), BODY)[0] - fit_covariance(H, evidence(H, H), BODY)[0]
    values, vectors = np.linalg.eigh(added)
    assert values[-1] > 1e-6 and np.abs(values[:-1]).max() < 1e-3 * values[-1]  # one direction alone
    pull = 1e5 * link_bends(BODY, direction[:, None])[0]
    expected = np.linalg.solve(H, np.einsum("la,na,ln->n", pull, BODY.twists, MODEL.chain.link_moved_by))
    assert abs(vectors[:, -1] @ expected) > 0.999 * np.linalg.norm(expected)


def test_what_is_not_trusted_says_nothing():
    rng = np.random.default_rng(3)
    J = rng.normal(size=(2 * N, N))
    told = ImageEvidence(J.T @ J, 0.5 * J.T @ J, np.tile(np.eye(6), (N_LINKS, 1, 1)))
    moved_by = MODEL.chain.link_moved_by
    np.testing.assert_allclose(told.weighted(np.ones(N), moved_by).information, told.information)
    trust = np.ones(N)
    arm = MODEL.chain.link_index("left_forearm")
    trust[np.flatnonzero(moved_by[arm] & ~moved_by[MODEL.chain.link_index("left_upper_arm")])] = 0.0
    doubted = told.weighted(trust, moved_by)
    assert not doubted.information[trust == 0.0].any() and not doubted.scatter[:, trust == 0.0].any()
    assert not doubted.normal[arm].any() and doubted.normal[0].any()


def test_what_images_alone_say():
    rng = np.random.default_rng(4)
    J = rng.normal(size=(N - 2, N))  # two directions that no image tells
    H = J.T @ J
    told = evidence(H, 0.25 * H)
    assert told.measurement()[1] is None
    offset = rng.normal(size=N)
    found, pull = replace(told, gradient=-H @ offset).measurement()
    np.testing.assert_allclose(found, 4.0 * H, atol=1e-4 * np.abs(H).max())
    np.testing.assert_allclose(pull, 4.0 * H @ offset, atol=1e-3 * np.abs(H @ offset).max())
    assert (np.linalg.eigvalsh(found)[:2] < 1e-4).all()


def test_what_is_believed_less_is_not_elsewhere():
    rng = np.random.default_rng(7)
    J = rng.normal(size=(3 * N, N))
    H, offset, trust = J.T @ J, rng.normal(size=N), np.ones(N)
    trust[8:12] = 0.4
    sure, _ = ImageEvidence(H, 0.5 * H, np.zeros((N_LINKS, 6, 6)), -H @ offset).measurement()
    less, pull = ImageEvidence(H, 0.5 * H, np.zeros((N_LINKS, 6, 6)), -H @ offset).measurement(trust)
    np.testing.assert_allclose(np.linalg.solve(less, pull), offset, atol=1e-3)
    np.testing.assert_allclose(np.diag(less)[8:12], 0.16 * np.diag(sure)[8:12], rtol=1e-6)


def test_what_comes_of_arcs_is_told_apart():
    H = 1e6 * np.eye(N)
    for name in ("left_shoulder_abduction", "left_shoulder_internal_rotation"):
        k = MODEL.chain.dof_names.index(name)
        H[k, k] = 1.0 / np.radians(6.0) ** 2
    links = np.tile(1e5 * np.eye(6), (N_LINKS, 1, 1))
    covariance, arcs = fit_covariance(H, ImageEvidence(H, H, links), BODY)
    straight, nothing = fit_covariance(H, evidence(H, H), BODY)
    np.testing.assert_allclose(covariance - arcs, straight, atol=1e-12)
    assert arcs.any() and not nothing.any()


def weak_shoulder(degrees: float) -> tuple[np.ndarray, ImageEvidence, np.ndarray]:
    """(H, images, direction): all is well known but one turn of a shoulder about two of its axes."""
    direction = np.zeros(N)
    for name in ("left_shoulder_abduction", "left_shoulder_internal_rotation"):
        direction[MODEL.chain.dof_names.index(name)] = np.sqrt(0.5)
    H = 1e6 * np.eye(N) + (1.0 / np.radians(degrees) ** 2 - 1e6) * np.outer(direction, direction)
    return H, ImageEvidence(H, H, np.tile(1e5 * np.eye(6), (N_LINKS, 1, 1))), direction


def test_directions_known_to_a_degree_are_straight():
    for degrees, bent in ((0.95, False), (1.05, True)):
        H, images, _ = weak_shoulder(degrees)
        assert fit_covariance(H, images, BODY)[1].any() == bent


def test_arcs_are_followed_up_to_thirty_degrees():
    across = []
    for degrees in (15.0, 30.0, 60.0, 80.0):
        H, images, direction = weak_shoulder(degrees)
        beside = np.eye(N) - np.outer(direction, direction)
        across.append(np.trace(beside @ fit_covariance(H, images, BODY)[1] @ beside))
    assert across[0] == pytest.approx(across[1] / 16.0, rel=1e-3)  # the fourth power of the standard deviation
    assert across[1:] == pytest.approx([across[1]] * 3, rel=1e-3)


def test_one_arc_has_half_the_bend_as_its_mean_and_that_squared_twice_as_its_variance():
    """Of e^2 b / 2 with e normal of variance v: the second moment is (v b / 2)^2 + 2 (v b / 2)^2."""
    H, images, direction = weak_shoulder(8.0)
    pull = 1e5 * link_bends(BODY, direction[:, None])[0]
    makes_up = np.linalg.solve(H, np.einsum("la,na,ln->n", pull, BODY.twists, MODEL.chain.link_moved_by))
    half = 0.5 * np.radians(8.0) ** 2 * makes_up
    expected = BEYOND_SECOND_ORDER * 3.0 * np.outer(half, half)
    np.testing.assert_allclose(fit_covariance(H, images, BODY)[1], expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())


def test_trust_is_a_share_of_the_root_of_information():
    rng = np.random.default_rng(3)
    J, moved_by = rng.normal(size=(2 * N, N)), MODEL.chain.link_moved_by
    told = ImageEvidence(J.T @ J, 0.5 * J.T @ J, np.tile(np.eye(6), (N_LINKS, 1, 1)), rng.normal(size=N))
    trust = np.ones(N)
    k = MODEL.chain.dof_names.index("left_shoulder_abduction")
    trust[k] = 0.5
    half = told.weighted(trust, moved_by)
    scale = np.where(np.arange(N) == k, 0.5, 1.0)
    np.testing.assert_allclose(half.information, told.information * np.outer(scale, scale))
    np.testing.assert_allclose(half.scatter, told.scatter * np.outer(scale, scale))
    np.testing.assert_allclose(half.normal[:, 0, 0], np.where(moved_by[:, k], 0.25, 1.0))
    assert half.gradient is None


def test_trust_in_all_changes_nothing():
    rng = np.random.default_rng(9)
    J = rng.normal(size=(3 * N, N))
    told = ImageEvidence(J.T @ J, 0.5 * J.T @ J, np.zeros((N_LINKS, 6, 6)), rng.normal(size=N))
    for a, b in zip(told.measurement(), told.measurement(np.ones(N)), strict=True):
        np.testing.assert_array_equal(a, b)


def test_degrees_of_freedom_of_any_unit_are_measured_alike():
    """Meters, millimeters, radians: units change what is said as they should, over ten powers of ten."""
    rng = np.random.default_rng(10)
    J, offset = rng.normal(size=(3 * N, N)), rng.normal(size=N)
    H = J.T @ J
    units = 10.0 ** rng.uniform(0.0, 2.0, N)
    both = np.outer(units, units)
    M, pull = ImageEvidence(H, 2.0 * H, np.zeros((N_LINKS, 6, 6)), -H @ offset).measurement()
    scaled, pulled = ImageEvidence(both * H, 2.0 * both * H, np.zeros((N_LINKS, 6, 6)), -units * (H @ offset)).measurement()
    np.testing.assert_allclose(M, 0.5 * H, rtol=1e-4, atol=1e-4 * np.abs(H).max())
    np.testing.assert_allclose(scaled / both, 0.5 * H, atol=1e-3 * np.abs(H).max())
    np.testing.assert_allclose(pulled / units, pull, atol=1e-3 * np.abs(pull).max())


def test_other_modes_make_covariance_and_measurement_as_wide_as_they_are_far():
    rng = np.random.default_rng(12)
    J, offset, modes = rng.normal(size=(3 * N, N)), rng.normal(size=N), 0.3 * rng.normal(size=(N, 2))
    H = J.T @ J
    alone = ImageEvidence(H, 0.5 * H, np.zeros((N_LINKS, 6, 6)), -H @ offset)
    wide = replace(alone, modes=modes)
    added = fit_covariance(H, wide, BODY)[0] - fit_covariance(H, alone, BODY)[0]
    np.testing.assert_allclose(added, modes @ modes.T, atol=1e-9)
    (M, pull), (less, less_pull) = alone.measurement(), wide.measurement()
    np.testing.assert_allclose(np.linalg.inv(less), np.linalg.inv(M) + modes @ modes.T, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(np.linalg.solve(less, less_pull), np.linalg.solve(M, pull), rtol=1e-6)
