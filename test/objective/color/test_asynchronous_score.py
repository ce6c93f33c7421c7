"""The score of cameras that expose at different instants."""

import math

import numpy as np
import pytest

from helpers.cameras.late_camera import LATE, MODEL, RIG, STATE, VELOCITY, images
from tracker_node.objective.color.asynchronous import AsynchronousObjective
from tracker_node.objective.color.score import ColorObjective, ColorOptions, Outcome


def objective(late_s, options=None, shown=LATE) -> AsynchronousObjective:
    result = AsynchronousObjective(MODEL, RIG, late_s, options)
    result.set_images(images(shown))
    result.velocity = VELOCITY
    return result


@pytest.mark.parametrize("representation", ["raw", "normalized"])
def test_without_delays_it_is_the_plain_score(representation):
    options = ColorOptions(representation)
    plain = ColorObjective(MODEL, RIG, options)
    plain.set_images(images(LATE))
    for change in np.random.default_rng(0).normal(size=(4, 6)) * 0.02:
        state = STATE.retract(change)
        expected, got = plain.evaluate(state), objective((0.0, 0.0, 0.0), options).evaluate(state)
        assert got.rms == pytest.approx(expected.rms, rel=1e-5)
        np.testing.assert_allclose(got.camera_rms, expected.camera_rms, rtol=1e-5)
        np.testing.assert_array_equal(got.camera_pixels, expected.camera_pixels)


def test_equal_delays_that_are_split_up_add_up_to_the_whole():
    """Delays of a nanosecond, so that every camera is a part of its own, change nothing."""
    plain = objective((0.0, 0.0, 0.0))
    split = objective((0.0, 1e-9, 2e-9))
    state = STATE.retract(np.array([0.01, 0.0, -0.01, 0.02, 0.0, 0.01]))
    assert split.score(state) == pytest.approx(plain.score(state), rel=1e-5)


def test_the_late_camera_agrees_only_when_its_delay_is_known():
    knowing, ignorant = objective(LATE).evaluate(STATE), objective((0.0, 0.0, 0.0)).evaluate(STATE)
    np.testing.assert_array_equal(knowing.camera_rms[:2], ignorant.camera_rms[:2])
    assert knowing.camera_rms[2] < 0.5 * ignorant.camera_rms[2]
    assert knowing.rms < ignorant.rms


def test_a_body_without_velocity_is_scored_where_it_is():
    resting = objective(LATE)
    resting.velocity = None
    assert resting.score(STATE) == pytest.approx(objective((0.0, 0.0, 0.0)).score(STATE), rel=1e-5)


def test_decimated_scores_are_near_and_not_the_same():
    whole = objective(LATE)
    state = STATE.retract(np.array([0.02, 0.0, 0.0, 0.0, 0.02, 0.0]))
    half = whole.at_row_step(2)
    assert half.scores([state])[0] == half.score(state) == pytest.approx(whole.score(state), rel=0.2)
    assert half.score(state) != whole.score(state)
    assert whole.at_row_step(1) is whole and half.at_row_step(1) is whole


def test_rows_are_left_out_from_the_beginning_where_options_say_so():
    whole, thin = objective(LATE), objective(LATE, ColorOptions(row_step=2))
    state = STATE.retract(np.array([0.02, 0.0, 0.0, 0.0, 0.02, 0.0]))
    assert thin.score(state) == whole.at_row_step(2).score(state) != whole.score(state)
    assert thin.evaluate(state).camera_pixels.sum() == pytest.approx(0.5 * whole.evaluate(state).camera_pixels.sum(), rel=0.1)
    assert thin.at_row_step(2) is thin and thin.at_row_step(1).score(state) == whole.score(state)


def test_what_cannot_be_scored_is_infinite():
    whole = objective(LATE)
    away = STATE.retract(np.array([50.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    score = whole.evaluate(away)
    assert math.isinf(score.rms) and score.outcome != Outcome.SCORED
    assert math.isinf(objective(LATE, ColorOptions(min_pixels=100000)).score(STATE))
    assert objective(LATE, ColorOptions(min_pixels=100000)).evaluate(STATE).outcome == Outcome.EMPTY_MASK


def test_as_many_delays_as_cameras():
    with pytest.raises(ValueError, match="expected 3 delays"):
        AsynchronousObjective(MODEL, RIG, (0.0, 0.0))
