"""The smoother against the whole trajectory solved at once, and against the filter on noisy measurements."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.sparse.linalg import splu, spsolve
from scipy.stats import chi2

from helpers.bodies.two_links import two_links
from tracker_node.geometry import so3
from tracker_node.model.configuration import State
from tracker_node.objective.constraints.prior import Prior
from tracker_node.tracking.config import MotionConfig
from tracker_node.tracking.motion.dynamics import Belief, Dynamics
from tracker_node.tracking.motion.model import MotionModel
from tracker_node.tracking.motion.smoother import Measurement, Smoother, smoothed_covariance

N = 8
CONFIG = MotionConfig(root_position_noise=1.0, root_angle_noise=2.0, joint_noise=3.0)
DYNAMICS = Dynamics.of(CONFIG, two_links().chain)


def smooth(measurements, dynamics, lag_s=np.inf):
    """One belief per measurement, in their order."""
    smoother = Smoother(dynamics, lag_s)
    for measurement in measurements:
        yield from smoother.add(measurement)
    yield from smoother.finish()


def most_probable(prior: Prior | None, measured: State, information: np.ndarray) -> State:
    """Gauss-Newton on prior times measurement."""
    state, terms = measured, [Prior(measured, information)] + ([prior] if prior else [])
    for _ in range(6):
        H, g = np.zeros((N, N)), np.zeros(N)
        for term in terms:
            term.add_to(H, g, state)
        state = state.retract(np.linalg.solve(H + 1e-12 * np.eye(N), -g))
    return state


def tracked(stamps_ns, measured, informations, config=CONFIG) -> tuple[list[Measurement], MotionModel]:
    """What a tracker would find: each estimate is the most probable one by prediction and measurement."""
    model, measurements = MotionModel(two_links().chain, config), []
    for stamp_ns, state, information in zip(stamps_ns, measured, informations, strict=True):
        prediction = model.predict(stamp_ns)
        if information is None:
            found = prediction.state if prediction else state
            model.coast(stamp_ns, found)
        else:
            found = most_probable(prediction.prior() if prediction else None, state, information)
            model.update(stamp_ns, found, information)
        measurements.append(Measurement(stamp_ns, found, information))
    return measurements, model


def walk(rng: np.random.Generator, stamps_ns, turning: bool) -> list[Belief]:
    """A body that moves as the process says; of unturning ones the root's rotation stays."""
    state, velocity = State(np.eye(4), np.zeros(2)), np.zeros(N)
    path = [Belief(state, velocity, np.zeros((2 * N, 2 * N)))]
    for elapsed_s in np.diff(stamps_ns) * 1e-9:
        after = DYNAMICS.propagate(Belief(state, velocity, np.zeros((2 * N, 2 * N))), elapsed_s)
        noise = np.linalg.cholesky(after.covariance) @ rng.normal(size=2 * N)
        if not turning:
            noise[[3, 4, 5, N + 3, N + 4, N + 5]] = 0.0
        state, velocity = after.state.retract(noise[:N]), after.velocity + noise[N:]
        path.append(Belief(state, velocity, after.covariance))
    return path


def stamps(rng: np.random.Generator, n: int) -> np.ndarray:
    return np.cumsum(rng.integers(10_000_000, 80_000_000, n)) + 5 * 10**9


def test_without_turns_it_is_batch_least_squares():
    """All states and velocities at once, by sparse normal equations: means and covariances agree."""
    rng, n = np.random.default_rng(0), 25
    times, still = stamps(rng, n), [3, 4, 5]
    truth = walk(rng, times, turning=False)
    informations: list[np.ndarray | None] = []
    measured = []
    for k, body in enumerate(truth):
        rows = rng.normal(size=(N if k == 0 else rng.integers(1, N), N)) * 60.0
        rows[:, still] = 0.0
        information = rows.T @ rows
        information[still, still] = 1e8
        informations.append(None if k in (7, 8, 9) else information)
        noise = np.linalg.pinv(rows) @ rng.normal(size=len(rows))
        noise[still] = 0.0
        measured.append(body.state.retract(noise))
    measurements, _ = tracked(times, measured, informations)

    kept = [i for i in range(2 * N) if i % N not in still]
    size = len(kept)
    H, b = sparse.lil_matrix((n * size, n * size)), np.zeros(n * size)
    origin = State(np.eye(4), np.zeros(2))
    first = np.zeros(2 * N)
    first[:N], first[N:] = 1.0, 2.0 / (DYNAMICS.noise**2 * DYNAMICS.memory_s)
    H[:size, :size] += np.diag(first[kept])
    b[:size] += (first * np.append(measured[0].difference(origin), np.zeros(N)))[kept]
    for k in range(n):
        at = slice(k * size, (k + 1) * size)
        if informations[k] is not None:
            full = np.zeros((2 * N, 2 * N))
            full[:N, :N] = informations[k]
            x = np.append(measured[k].difference(origin), np.zeros(N))
            H[at, at] += full[np.ix_(kept, kept)]
            b[at] += (full @ x)[kept]
        if k + 1 < n:
            rest = Belief(origin, np.zeros(N), np.zeros((2 * N, 2 * N)))
            elapsed_s = (times[k + 1] - times[k]) * 1e-9
            F = DYNAMICS.transition(rest, elapsed_s)[np.ix_(kept, kept)]
            W = np.linalg.inv(DYNAMICS.propagate(rest, elapsed_s).covariance[np.ix_(kept, kept)])
            after = slice((k + 1) * size, (k + 2) * size)
            H[at, at] += F.T @ W @ F
            H[after, after] += W
            H[at, after] += -F.T @ W
            H[after, at] += -W @ F
    H = H.tocsc()
    solved = spsolve(H, b).reshape(n, size)
    inverse = splu(H)

    for k, belief in enumerate(smooth(measurements, DYNAMICS)):
        mean = np.append(belief.state.difference(origin), belief.velocity)[kept]
        unit = np.zeros((n * size, size))
        unit[k * size : (k + 1) * size] = np.eye(size)
        covariance = inverse.solve(unit)[k * size : (k + 1) * size]
        sigma = np.sqrt(np.diag(covariance))
        assert np.abs(mean - solved[k]).max() < 1e-3 * sigma.max()
        np.testing.assert_allclose(belief.covariance[np.ix_(kept, kept)], covariance, atol=1e-4 * np.outer(sigma, sigma).max())


def runs(n_runs: int, n: int):
    """Turning bodies with noisy measurements of all but a moment's degrees of freedom."""
    for seed in range(n_runs):
        rng = np.random.default_rng(seed)
        times = stamps(rng, n)
        truth = walk(rng, times, turning=True)
        rows = np.linalg.cholesky(np.linalg.inv(np.diag([0.04] * 3 + [0.1] * 3 + [0.15] * 2) ** 2)).T
        information = rows.T @ rows
        measured = [body.state.retract(np.linalg.solve(rows, rng.normal(size=N))) for body in truth]
        yield times, truth, measured, [information] * n


def test_it_is_better_than_the_filter_and_as_sure_as_it_says():
    errors: dict[str, list[float]] = {"filter": [], "lag": [], "all": []}
    velocities: dict[str, list[float]] = {"filter": [], "lag": [], "all": []}
    nees = []
    for times, truth, measured, informations in runs(5, 25):
        measurements, _ = tracked(times, measured, informations)
        found = {
            "filter": list(smooth(measurements, DYNAMICS, 1e-9)),
            "lag": list(smooth(measurements, DYNAMICS, 0.1)),
            "all": list(smooth(measurements, DYNAMICS)),
        }
        for kind, beliefs in found.items():
            for body, belief in list(zip(truth, beliefs, strict=True))[3:-3]:
                off = np.append(body.state.difference(belief.state), body.velocity - belief.velocity)
                errors[kind].append(np.sum(off[:N] ** 2))
                velocities[kind].append(np.sum(off[N:] ** 2))
                if kind == "all":
                    nees.append(off @ np.linalg.solve(belief.covariance, off))
    rms = {kind: np.sqrt(np.mean(values)) for kind, values in errors.items()}
    assert rms["all"] < rms["lag"] < rms["filter"]
    assert rms["all"] < 0.85 * rms["filter"]
    speeds = {kind: np.sqrt(np.mean(values)) for kind, values in velocities.items()}
    assert speeds["all"] < speeds["lag"] < speeds["filter"]
    # Neighboring instants share errors: three are worth some one.
    degrees = 2 * N * len(nees) / 3
    low, high = chi2.ppf([0.005, 0.995], degrees) / degrees
    assert low < np.mean(nees) / (2 * N) < high


def test_the_forward_pass_is_the_tracker():
    """A lag of nothing gives back what the tracker itself has found, with its velocities."""
    times, _, measured, informations = next(runs(1, 12))
    measurements, model = tracked(times, measured, informations)
    *_, last = smooth(measurements, DYNAMICS, 1e-9)
    np.testing.assert_allclose(last.state.difference(measurements[-1].state), 0.0, atol=1e-9)
    np.testing.assert_allclose(last.velocity, model.velocity, rtol=1e-9)
    np.testing.assert_allclose(last.velocity_covariance, model.velocity_covariance, rtol=1e-9)


def test_a_lost_stretch_is_bridged():
    """A body that turned and walked on unseen is found between where it was last and where it was next."""
    times = np.arange(20) * 33_000_000
    truth = []
    for t in times * 1e-9:
        T = np.eye(4)
        T[:3, :3], T[0, 3] = so3.exp([0.0, 0.0, 2.0 * t]), 1.5 * t
        truth.append(State(T, np.array([1.0 * t, 0.0])))
    informations = [None if 8 <= k < 13 else 1e6 * np.eye(N) for k in range(20)]
    measurements, _ = tracked(times, truth, informations)
    nowhere = State(np.eye(4), np.zeros(2))
    lost = [s if s.information is not None else Measurement(s.stamp_ns, nowhere, None) for s in measurements]
    beliefs = list(smooth(lost, DYNAMICS))
    off = [np.abs(t.difference(b.state)).max() for t, b in zip(truth, beliefs, strict=True)]
    assert max(off[8:13]) < 0.02
    sigma = [np.sqrt(b.state_covariance[6, 6]) for b in beliefs]
    assert min(sigma[8:13]) > 3.0 * max(sigma[3:7])


def test_the_smoother_expects_less_of_a_body_than_the_tracker():
    """States that a tracker found by a prediction of its own are taken for what the images said, not for what came of it."""
    rng, n = np.random.default_rng(3), 25
    times = stamps(rng, n)
    rows = rng.normal(size=(n, 3, N)) * 30.0
    rows[:, :, 3:6] = 0.0
    informations = [r.T @ r + np.diag([1.0] * 3 + [1e8] * 3 + [1.0] * 2) for r in rows]
    noises = np.array([rng.multivariate_normal(np.zeros(N), np.linalg.inv(information)) for information in informations])
    noises[:, 3:6] = 0.0
    measured = [body.state.retract(e) for body, e in zip(walk(rng, times, turning=False), noises, strict=True)]
    own, _ = tracked(times, measured, informations)
    wide = replace(CONFIG, root_position_noise=4.0, root_angle_noise=8.0, joint_noise=12.0)
    of_another, _ = tracked(times, measured, informations, wide)
    pulled = [
        replace(s, innovation=s.information @ m.difference(s.state)) for s, m in zip(of_another, measured, strict=True)
    ]  # fmt: skip
    expected, found, taken = (list(smooth(s, DYNAMICS)) for s in (own, pulled, of_another))
    sigma = np.sqrt(np.diag(expected[n // 2].state_covariance))
    offs = [np.array([a.state.difference(b.state) for a, b in zip(beliefs, expected, strict=True)]) for beliefs in (found, taken)]
    assert np.abs(offs[0] / sigma).max() < 1e-3 < 0.1 < np.abs(offs[1] / sigma).max()


def test_a_sighting_is_where_images_and_rest_would_have_the_body():
    rng = np.random.default_rng(8)
    state, offset = State(np.eye(4), np.array([0.3, -0.2])), 0.1 * rng.normal(size=N)
    information, stiffness = np.diag(rng.uniform(50.0, 100.0, N)), np.array([0.0] * 6 + [20.0, 30.0])
    estimate = SimpleNamespace(stamp_ns=1, state=state, information=information, innovation=information @ offset)
    measurement = Measurement.of(estimate, Prior(State(np.eye(4), np.zeros(2)), stiffness))
    best = offset.copy()
    best[6:] = (np.diag(information)[6:] * offset[6:] - stiffness[6:] * state.joint_positions) / (
        np.diag(information)[6:] + stiffness[6:]
    )
    np.testing.assert_allclose(np.linalg.solve(measurement.information, measurement.innovation), best, atol=1e-12)


def test_arcs_shrink_with_the_square_of_variances():
    straight, arcs = np.diag(np.linspace(1.0, 2.0, N)), 0.1 * np.ones((N, N))
    estimate = SimpleNamespace(covariance=straight + arcs, second_order=arcs)
    covariance = np.zeros((2 * N, 2 * N))
    covariance[:N, :N] = 0.5 * straight
    belief = Belief(State(np.eye(4), np.zeros(2)), np.zeros(N), covariance)
    np.testing.assert_allclose(smoothed_covariance(belief, estimate), 0.5 * straight + 0.25 * arcs)
    belief.covariance[:N, :N] = 3.0 * straight
    np.testing.assert_allclose(smoothed_covariance(belief, estimate), 3.0 * straight + arcs)  # never more than the tracker's
    belief.covariance[:N, :N] = 0.5 * straight
    estimate.second_order = None
    np.testing.assert_allclose(smoothed_covariance(belief, estimate), 0.5 * straight)


@pytest.mark.parametrize("lag_s", [0.05, 0.1, np.inf])
def test_every_sighting_is_answered_once_and_in_time(lag_s):
    times, _, measured, informations = next(runs(1, 15))
    informations = [None, None, *informations[2:]]
    measurements, _ = tracked(times, measured, informations)
    smoother, answered = Smoother(DYNAMICS, lag_s), []
    for i, measurement in enumerate(measurements):
        answered += smoother.add(measurement)
        old = [s for s in measurements[: i + 1] if (measurement.stamp_ns - s.stamp_ns) * 1e-9 >= lag_s]
        assert len(answered) == len(old)
    answered += smoother.finish()
    assert len(answered) == len(measurements)
    assert [belief is None for belief in answered] == [True, True] + [False] * 13
    assert smoother.finish() == []


def test_misuse_is_refused():
    with pytest.raises(ValueError, match="lag"):
        Smoother(DYNAMICS, 0.0)
    smoother = Smoother(DYNAMICS)
    smoother.add(Measurement(10, State(np.eye(4), np.zeros(2)), None))
    with pytest.raises(ValueError, match="order"):
        smoother.add(Measurement(9, State(np.eye(4), np.zeros(2)), None))


def test_only_joints_say_how_much_better_an_arc_is_known():
    straight = np.diag([9.0] * 6 + [1.0, 2.0])
    arcs = np.ones((N, N))
    estimate = SimpleNamespace(covariance=straight + arcs, second_order=arcs)
    covariance = np.zeros((2 * N, 2 * N))
    covariance[:N, :N] = np.diag([0.0] * 6 + [0.5, 1.0])
    belief = Belief(State(np.eye(4), np.zeros(2)), np.zeros(N), covariance)
    np.testing.assert_allclose(smoothed_covariance(belief, estimate), covariance[:N, :N] + 0.25)
    estimate.covariance = arcs  # nothing is said of the straight part
    np.testing.assert_allclose(smoothed_covariance(belief, estimate), covariance[:N, :N] + 1.0)


def test_an_estimate_without_images_is_no_sighting_of_the_body():
    state = State(np.eye(4), np.zeros(2))
    estimate = SimpleNamespace(stamp_ns=5, state=state, information=None, innovation=None)
    measurement = Measurement.of(estimate, Prior(state, np.ones(N)))
    assert (measurement.stamp_ns, measurement.state, measurement.information, measurement.innovation) == (5, state, None, None)


def test_the_rest_adds_to_the_information_of_the_images():
    state = State(np.eye(4), np.array([0.3, -0.2]))
    information, stiffness = np.diag(np.arange(1.0, 9.0)), np.array([0.0] * 6 + [20.0, 30.0])
    estimate = SimpleNamespace(stamp_ns=5, state=state, information=information, innovation=None)
    measurement = Measurement.of(estimate, Prior(State(np.eye(4), np.zeros(2)), stiffness))
    np.testing.assert_allclose(measurement.information, information + np.diag(stiffness))
    assert measurement.innovation is None


def test_two_sightings_of_one_instant_are_one_twice_as_sure():
    """No time passes between them, and neither does the body move."""
    state, other = State(np.eye(4), np.zeros(2)), State(np.eye(4), np.array([0.2, 0.0]))
    information = 1e4 * np.eye(N)
    measurements = [Measurement(10, one, information, information @ one.difference(state) * 0.0) for one in (state, other)]
    first, second = smooth(measurements, DYNAMICS)
    np.testing.assert_allclose(second.state_covariance, np.linalg.inv(2e4 * np.eye(N) + np.eye(N)), rtol=1e-6)
    np.testing.assert_allclose(first.state_covariance, second.state_covariance, rtol=1e-6)
    np.testing.assert_allclose(first.state.joint_positions, second.state.joint_positions, atol=1e-9)
    assert second.state.joint_positions[0] == pytest.approx(0.1, rel=1e-3)
