"""Two engines in one step: who is asked what, in which order, and whose answer counts."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.model.configuration import State
from tracker_node.observation.image_set import ImageSet
from tracker_node.optimize.fitter import Fit
from tracker_node.tracking.assessment import Assessment
from tracker_node.tracking.engine import SequentialEngine
from tracker_node.tracking.estimate import Status

MODEL = crane()
START = State.neutral(MODEL)
IMAGES = ["image"]


def moved(x):
    T = np.eye(4)
    T[0, 3] = x
    return replace(START, T_world_root=T)


class Recorded:
    """An engine that finds the body so far from where it begins, and writes down what it is asked."""

    def __init__(self, name, log, by, status=Status.TRACKING, jumped=False, counts=(1, 2)):
        self.name, self.log, self.by, self.counts = name, log, by, counts
        self.assessment = Assessment(status, name, jumped=jumped)

    def _say(self, what, *values):
        self.log.append((self.name, what, *values))

    def reset(self):
        self._say("reset")

    def begin(self, images, start, *, known=False):
        self._say("begin", start.T_world_root[0, 3])
        return moved(start.T_world_root[0, 3] + self.by)

    def observe(self, images, expected, delays=None):
        self._say("observe", None if expected is None else expected.T_world_root[0, 3], delays)

    def fit(self, start, first, prior=None):
        self._say("fit", start.T_world_root[0, 3], first, prior)
        return Fit(moved(start.T_world_root[0, 3] + self.by), None, *self.counts, True, None, None)

    def assess(self, fit, image_set):
        return self.assessment

    def report(self, fit, image_set):
        return self.name

    def learn(self, images, state):
        self._say("learn", state.T_world_root[0, 3])


def both(**colors):
    log = []
    engines = Recorded("colors", log, 1.0, counts=(3, 5), **colors), Recorded("contours", log, 10.0, counts=(20, 40))
    return SequentialEngine(*engines), log


def test_contours_begin_where_colors_end():
    engine, log = both()
    engine.observe(IMAGES, START, "delays")
    result = engine.fit(START, True, "prior")
    assert result.state.T_world_root[0, 3] == 11.0
    assert (result.iterations, result.evaluations) == (23, 45)
    assert log == [
        ("colors", "observe", 0.0, "delays"), ("colors", "fit", 0.0, True, None),
        ("contours", "observe", 1.0, "delays"), ("contours", "fit", 1.0, True, "prior"),
    ]  # fmt: skip


def test_where_colors_have_lost_the_body_contours_begin_where_it_is_expected():
    engine, log = both(status=Status.LOST, jumped=True)
    engine.observe(IMAGES, START)
    assert engine.fit(START, False).state.T_world_root[0, 3] == 10.0
    assert log[2:] == [("contours", "observe", 0.0, None), ("contours", "fit", 0.0, False, None)]
    assert not engine.assess(None, ImageSet(0, ())).jumped


def test_with_nothing_expected_contours_look_at_nothing():
    engine, log = both(jumped=True)
    engine.observe(IMAGES, None)
    assert engine.fit(START, False).state.T_world_root[0, 3] == 10.0
    assert ("contours", "observe", None, None) in log
    assert not engine.assess(None, ImageSet(0, ())).jumped


@pytest.mark.parametrize("jumped", [True, False])
def test_the_assessment_is_of_contours_but_for_jumps(jumped):
    engine, _ = both(jumped=jumped)
    engine.observe(IMAGES, START)
    engine.fit(START, False)
    found = engine.assess(None, ImageSet(0, ()))
    assert found.reason == "contours"
    assert found.jumped == jumped
    assert engine.report(None, ImageSet(0, ())) == "contours"


def test_both_begin_learn_and_forget():
    engine, log = both()
    assert engine.begin(IMAGES, START).T_world_root[0, 3] == 11.0
    engine.learn(IMAGES, START)
    engine.reset()
    assert log == [
        ("colors", "begin", 0.0), ("contours", "begin", 1.0), ("colors", "learn", 0.0), ("contours", "learn", 0.0),
        ("colors", "reset"), ("contours", "reset"),
    ]  # fmt: skip
