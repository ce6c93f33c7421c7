"""How the benchmark of starts judges a trial; the searches themselves take minutes."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmark.contour import start as contour_start
from tracker_node.evaluation.truth.files import EVALUATED_JOINTS
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import ImageSet
from tracker_node.tracking.estimate import Status

MODEL = human_model()
STAMPS = np.arange(30) * 33_000_000


class Scripted:
    """A tracker that has a state from the third image set on: the true one, an arm aside."""

    def __init__(self, arm_deg: float):
        self._arm = np.radians(arm_deg)

    def reset(self):
        self._sets = 0

    def step(self, image_set):
        self._sets += 1
        status = Status.INITIALIZING if self._sets < 3 else Status.TRACKING
        joints = State.neutral(MODEL).joint_positions.copy()
        joints[MODEL.chain.dof_names.index("left_shoulder_elevation_front") - 6] += self._arm
        return SimpleNamespace(status=status, status_reason="", state=State(np.eye(4), joints))


def recording() -> contour_start.Recording:
    body = Configuration(MODEL, State.neutral(MODEL))
    joints = body.landmarks_world[[MODEL.landmark_index(name) for name in EVALUATED_JOINTS]]
    shape = (len(STAMPS), len(EVALUATED_JOINTS))
    truth = Trajectories(tuple(EVALUATED_JOINTS), STAMPS, np.broadcast_to(joints, (*shape, 3)), np.ones(shape, dtype=bool))
    return contour_start.Recording(None, MODEL, {}, [ImageSet(int(stamp), ()) for stamp in STAMPS], truth, 0.0)


@pytest.mark.parametrize(("arm_deg", "success"), [(0.0, True), (10.0, True), (60.0, False)])
def test_every_joint_must_be_near_the_truth(arm_deg, success):
    trial = contour_start.trial_from(4, recording(), Scripted(arm_deg))
    assert trial.success is success
    assert trial.until == 2
    assert (trial.mean_m < 1e-9) == (arm_deg == 0.0)
    assert "TRACKING" in trial.told


def test_a_body_that_is_never_found_is_a_failure():
    tracker = Scripted(0.0)
    tracker.step = lambda image_set: SimpleNamespace(status=Status.INITIALIZING, status_reason="", state=None)
    trial = contour_start.trial_from(20, recording(), tracker)
    assert not trial.success and trial.until == 10
