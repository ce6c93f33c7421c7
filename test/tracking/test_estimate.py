"""What a status means, how camera faults are told, and how sure landmarks are."""

import numpy as np
import pytest

from helpers.ros.samples import arm, some_estimate
from tracker_node.tracking.estimate import DELAYED, TURNED, CameraFault, LimbStatus, Status


def test_states_and_which_may_be_used():
    assert [(s.name, int(s), s.has_state, s.known) for s in Status] == [
        ("INITIALIZING", 0, False, False), ("TRACKING", 1, True, True), ("DEGRADED", 2, True, True), ("LOST", 3, True, False),
    ]  # fmt: skip
    assert [(s.name, int(s)) for s in LimbStatus] == [("TRACKING", 1), ("DEGRADED", 2), ("LOST", 3), ("UNSEEN", 4)]


def test_a_turned_camera_is_told_in_degrees():
    fault = CameraFault("b", TURNED, np.pi / 60.0, np.pi / 360.0, 0)
    assert fault.text == "b is turned by 3.0 degrees (+- 0.5) from where its calibration has it" and fault.rivals == ()


@pytest.mark.parametrize(("size", "when"), [(0.05, "late"), (-0.05, "early")])
def test_a_delayed_camera_is_told_in_milliseconds_with_its_rivals(size, when):
    fault = CameraFault("b", DELAYED, size, 0.002, 0, ("a", "c"))
    assert fault.text == f"images of b or a or c are 50 ms (+- 2) {when}"


def test_a_landmark_is_as_uncertain_as_the_root_that_carries_it():
    model, estimate = arm(), some_estimate(arm())
    estimate.covariance[:] = 0.0
    estimate.covariance[0, 0], estimate.covariance[2, 2] = 4.0, 9.0
    (covariance,) = estimate.landmark_covariances(model)
    assert np.allclose(covariance, np.diag([4.0, 0.0, 9.0]), atol=1e-12)
