"""The delay of a camera from its images of a moving body."""

import numpy as np
import pytest

from helpers.cameras.late_camera import MODEL, RIG, TRIAL
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import CalibrationError
from tracker_node.experiments.cross.methods import estimate_delay
from tracker_node.experiments.cross.throw import FIELD_PERIOD_S
from tracker_node.model.configuration import Configuration
from tracker_node.objective.color.score import ColorObjective
from tracker_node.render.raycast import raycaster

FIELDS = range(0, 30, 3)


def estimate(late_s: float, camera: str = "left", states=None) -> float:
    rig = CameraRig((RIG[camera],), lights=RIG.lights)
    objective = ColorObjective(MODEL, rig)

    def show(i: int) -> None:
        view = raycaster.render_color(Configuration(MODEL, TRIAL.state(FIELDS[i], late_s)), rig.cameras[0], rig.lights)
        objective.set_images([np.rint(view.rgb[:, :, ::-1]).astype(np.uint8)])

    states = [TRIAL.state(k) for k in FIELDS] if states is None else states
    return estimate_delay(objective, show, states, 3 * FIELD_PERIOD_S)


@pytest.mark.parametrize("late_s", [-0.003, 0.0, 0.004])
def test_the_delay_is_found_to_a_part_of_a_step(late_s):
    assert estimate(late_s) == pytest.approx(late_s, abs=0.0008)


def test_the_camera_above_finds_it_too():
    assert estimate(0.004, "top") == pytest.approx(0.004, abs=0.0015)


def test_a_delay_out_of_reach_is_said_with_the_camera():
    with pytest.raises(CalibrationError, match="camera 'left': its delay is not within 12 ms"):
        estimate(0.018)
