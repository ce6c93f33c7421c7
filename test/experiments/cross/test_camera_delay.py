"""The delay of a camera from its images of a moving body."""

from types import SimpleNamespace

import numpy as np
import pytest

from helpers.cameras.late_camera import MODEL, RIG
from tracker_node.errors import CalibrationError
from tracker_node.experiments.cross import methods
from tracker_node.experiments.cross.methods import Method, estimate_delay
from tracker_node.experiments.cross.throw import twisting_somersault
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.model.configuration import Configuration

BLUE = np.full((144, 192, 3), (120, 60, 40), np.uint8)
TRIAL = twisting_somersault(MODEL)
FIELDS = range(32)


def mean_square(late_s: float):
    """The score of a few fields in whose images camera top is late by ``late_s``, as a function of the delay."""
    seen = [[TRIAL.state(field, late) for late in (0.0, 0.0, late_s)] for field in FIELDS]
    with TargetStudio(RIG, "raycaster") as studio:
        video = [[studio.image(i, Configuration(MODEL, state), BLUE) for i, state in enumerate(states)] for states in seen]
    footage = SimpleNamespace(interpolated=video.__getitem__)
    scene = SimpleNamespace(model=MODEL, rigs={"true": RIG}, picked_colors=lambda *_: None)
    states = [TRIAL.state(field) for field in FIELDS]
    known = Method("", "", "true")
    return lambda delay: methods._Fitter(scene, TRIAL, footage, known, (0.0, 0.0, delay)).mean_square(states)


@pytest.mark.parametrize("late_s", [-0.003, 0.005])
def test_the_delay_is_found_to_a_part_of_a_step(late_s):
    assert estimate_delay(mean_square(late_s), "top") == pytest.approx(late_s, abs=0.0005)


def test_the_parabola_is_exact():
    assert estimate_delay(lambda delay: 3.0 + (delay - 0.0031) ** 2, "top") == pytest.approx(0.0031)


@pytest.mark.parametrize("late_s", [-0.018, 0.018])
def test_a_delay_out_of_reach_is_said_with_the_camera(late_s):
    with pytest.raises(CalibrationError, match="camera 'top': its delay is not within 12 ms"):
        estimate_delay(lambda delay: (delay - late_s) ** 2, "top")


def test_a_body_at_rest_tells_no_delay():
    with pytest.raises(CalibrationError, match="nothing moves"):
        estimate_delay(lambda delay: 1.0, "top")


def test_only_the_late_camera_gets_a_delay(monkeypatch):
    asked = []

    class Scored:
        def __init__(self, *given):
            self.late_s = given[-1]

        def mean_square(self, states):
            asked.append((self.late_s, states))
            return (self.late_s[2] - 0.002) ** 2

    monkeypatch.setattr(methods, "_Fitter", Scored)
    monkeypatch.setattr(methods, "track", lambda *_: SimpleNamespace(states=("rough",)))
    scene = SimpleNamespace(late_s=(0.0, 0.0, 0.004), rig=RIG)
    assert methods.estimated_times(scene, TRIAL, None) == pytest.approx((0.0, 0.0, 0.002))
    assert {late[:2] for late, _ in asked} == {(0.0, 0.0)} and {states for _, states in asked} == {("rough",)}
