"""Extrapolation, velocities, and the order in which images and starts meet the fit."""

from types import SimpleNamespace

import numpy as np
import pytest

from helpers.bodies.wooden_cross import cross
from tracker_node.experiments.cross.methods import extrapolated, refine_video, track_video, velocities
from tracker_node.experiments.cross.throw import side_somersault, twisting_somersault
from tracker_node.model.configuration import from_variables, to_variables

PERIOD_S = 0.02
TRIAL = twisting_somersault(cross())


def line(k: float) -> np.ndarray:
    """Variables that are linear in time and go beyond a full turn."""
    return np.array([0.1, -0.2, 1.0, 2.9, 0.05, -1.0]) + k * np.array([0.02, 0.01, -0.03, 0.2, 0.01, 0.12])


def test_extrapolation_is_linear_in_the_variables_also_across_a_turn():
    for k in range(20):
        next_state = extrapolated([from_variables(line(k)), from_variables(line(k + 1))])
        np.testing.assert_allclose(next_state.T_world_root, from_variables(line(k + 2)).T_world_root, atol=1e-9)
    only = from_variables(line(0))
    assert extrapolated([only]) is only


def test_velocities_are_those_of_the_motion():
    states = TRIAL.states()
    found = velocities(states, PERIOD_S)
    h = 1e-4
    for k in (5, 12, 30):
        moved = TRIAL.flight.state(TRIAL.start_s + k * PERIOD_S + h).difference(states[k]) / h
        np.testing.assert_allclose(found[k][:3], moved[:3], atol=0.15)
        np.testing.assert_allclose(found[k][3:], moved[3:], atol=0.5)
    np.testing.assert_allclose(found[0], states[1].difference(states[0]) / PERIOD_S)
    np.testing.assert_allclose(found[-1], states[-1].difference(states[-2]) / PERIOD_S)
    np.testing.assert_array_equal(velocities(states[:1], PERIOD_S)[0], np.zeros(6))


class Recorder:
    """A fit that finds the truth, and writes down what it was asked."""

    def __init__(self, truth):
        self.truth, self.shown, self.starts, self.velocities = truth, [], [], []

    def show(self, image, velocity):
        self.shown.append(image)
        self.velocities.append(velocity)

    def fit(self, start):
        self.starts.append(start)
        return SimpleNamespace(state=self.truth[self.shown[-1]], evaluations=10 + self.shown[-1])


def test_each_image_set_starts_from_the_extrapolation_of_the_two_before():
    truth = side_somersault(cross()).states()[:6]
    recorder = Recorder(truth)
    start = truth[0].retract(np.full(6, 0.01))
    tracked = track_video(recorder.show, 6, start, recorder.fit, PERIOD_S)
    assert recorder.shown == list(range(6))
    assert recorder.starts[0] is start and recorder.starts[1] is truth[0]
    for k in range(2, 6):
        expected = 2 * to_variables(truth[k - 1], to_variables(truth[k])) - to_variables(truth[k - 2], to_variables(truth[k]))
        np.testing.assert_allclose(to_variables(recorder.starts[k], expected), expected, atol=1e-9)
        np.testing.assert_allclose(recorder.velocities[k], truth[k - 1].difference(truth[k - 2]) / PERIOD_S)
    assert recorder.velocities[:2] == [None, None]
    np.testing.assert_array_equal(tracked.evaluations, np.arange(10, 16))
    assert tracked.evaluations_per_variable == pytest.approx(12.5 / 6)


def test_refinement_starts_from_the_estimates_and_knows_velocities_from_the_first_image_on():
    truth = side_somersault(cross()).states()[:5]
    recorder = Recorder(truth)
    tracked = refine_video(recorder.show, truth, recorder.fit, PERIOD_S)
    assert recorder.starts == truth and tracked.states == tuple(truth)
    np.testing.assert_allclose(recorder.velocities[2], truth[3].difference(truth[1]) / (2 * PERIOD_S))
