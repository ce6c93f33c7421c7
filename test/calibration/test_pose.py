import numpy as np
import pytest

from helpers.bodies.bodies import crane, random_state
from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.calibration import pose
from tracker_node.calibration.pose import _Landmarks, fit_state_to_landmarks
from tracker_node.errors import UnknownNameError
from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model

HUMAN = human_model()


def landmarks(model, state):
    return dict(zip(model.landmark_names, Configuration(model, state).landmarks_world, strict=True))


@pytest.fixture
def no_pull(monkeypatch):
    """To neutral, so that an exact fit is exact."""
    for name in ("_FREE_SIGMA_RAD", "_STIFF_SIGMA_RAD"):
        monkeypatch.setattr(pose, name, 1e4)


@pytest.mark.parametrize("seed", range(6))
def test_a_posed_human_is_found_without_a_start(seed, no_pull):
    state = random_state(HUMAN, np.random.default_rng(seed), 0.45)
    fit = fit_state_to_landmarks(HUMAN, landmarks(HUMAN, state))
    assert fit.mean_residual_m < 1e-4
    assert max(fit.residuals_m.values()) < 1e-3


def test_upside_down_and_turned_away():
    upside_down = se3.from_rotation_translation(so3.exp([np.pi, 0, 0]) @ so3.exp([0, 0, 2.5]), np.array([3.0, -2.0, 1.0]))
    state = State.neutral(HUMAN, upside_down)
    fit = fit_state_to_landmarks(HUMAN, landmarks(HUMAN, state))
    assert fit.mean_residual_m < 1e-6
    assert np.allclose(fit.state.T_world_root, upside_down, atol=1e-5)


def test_a_body_that_is_no_human_is_fitted_too(no_pull):
    model = crane()
    state = random_state(model, np.random.default_rng(3), 0.5)
    fit = fit_state_to_landmarks(model, landmarks(model, state))
    assert fit.mean_residual_m < 1e-4


def test_limits_hold_and_the_rest_still_fits():
    targets = landmarks(HUMAN, State.neutral(HUMAN))
    # A wrist behind the upper arm: the elbow does not bend that way
    targets["left_wrist"] = targets["left_elbow"] + np.array([-0.2, 0.0, -0.1])
    fit = fit_state_to_landmarks(HUMAN, targets)
    q = fit.state.joint_positions
    assert np.all((q >= HUMAN.chain.lower) & (q <= HUMAN.chain.upper))
    assert fit.residuals_m["right_wrist"] < 5e-3


def test_weights_choose_between_targets():
    targets = landmarks(HUMAN, State.neutral(HUMAN))
    targets["head"] = targets["head"] + np.array([0.0, 0.0, 0.3])
    plain = fit_state_to_landmarks(HUMAN, targets)
    light = fit_state_to_landmarks(HUMAN, targets, weights={"head": 1e-6})
    assert light.residuals_m["neck"] < 1e-3 < plain.residuals_m["neck"]
    assert light.residuals_m["head"] > plain.residuals_m["head"]


def test_few_targets_keep_near_the_start(no_pull):
    state = random_state(HUMAN, np.random.default_rng(8), 0.3)
    everything = landmarks(HUMAN, state)
    fit = fit_state_to_landmarks(HUMAN, {"left_wrist": everything["left_wrist"]}, state)
    assert fit.iterations < 20
    assert np.allclose(landmarks(HUMAN, fit.state)["left_wrist"], everything["left_wrist"], atol=1e-4)


def test_gradient_of_the_cost_matches_finite_differences():
    rng = np.random.default_rng(2)
    targets = {name: point + rng.normal(scale=0.05, size=3) for name, point in landmarks(HUMAN, State.neutral(HUMAN)).items()}
    problem = _Landmarks(HUMAN, targets, {"head": 3.0})
    state = random_state(HUMAN, rng, 0.4)
    gradient = problem.linearize(state).g
    assert_jacobian(2.0 * gradient, lambda d: problem.linearize(state.retract(d)).cost, step=1e-4)


def test_what_cannot_be_fitted_is_refused():
    with pytest.raises(UnknownNameError, match="'tail'; valid: head"):
        fit_state_to_landmarks(HUMAN, {"tail": np.zeros(3)})
    with pytest.raises(ValueError, match="at least 3"):
        fit_state_to_landmarks(HUMAN, {"head": np.zeros(3)})
