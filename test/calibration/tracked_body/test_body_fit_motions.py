"""What a fit of a body takes of a run besides its images: motions with the delays of single images, and pulls to its poses."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.tracked_body.body_fit import motions_of, pose_priors
from tracker_node.model.configuration import State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.config import TrackerConfig

RIG = circle_rig(3)
PIXELS = np.zeros((2, 2, 3), np.uint8)


def images(stamp_ns, **late_ms):
    found = tuple(CameraImage(name, stamp_ns + late * 1_000_000, PIXELS) for name, late in late_ms.items())
    return ImageSet(stamp_ns, found)


def test_delays_are_seconds_after_the_set_in_the_order_of_the_rig():
    sets = [images(10**18, cam03=-4, cam01=12), images(10**18 + 7, cam02=1)]
    first, second = motions_of(RIG, sets, 8, [np.ones(8), 2.0 * np.ones(8)])
    assert first.delays_s == pytest.approx([0.012, 0.0, -0.004])
    assert second.delays_s == pytest.approx([0.0, 0.001, 0.0])
    assert second.velocity.tolist() == [2.0] * 8


@pytest.mark.parametrize("velocities", [None, [np.zeros(8)]])
def test_of_a_body_that_stands_still_delays_do_not_matter(velocities):
    (motion,) = motions_of(RIG, [images(10**18, cam01=12)], 8, velocities)
    assert motion.velocity.tolist() == [0.0] * 8
    assert motion.delays_s.tolist() == [0.0, 0.0, 0.0]


def test_poses_are_held_by_metres_and_radians():
    model = crane()
    states = [State.neutral(model), State.neutral(model).retract(0.1 * np.ones(model.n_dof))]
    config = TrackerConfig()
    priors = pose_priors(model, states, config)
    assert len(priors) == 2
    for state, (stay, rest) in zip(states, priors, strict=True):
        assert stay.mean is state
        assert stay.information.tolist() == pytest.approx([25.0] * 3 + [1.0 / 0.09] * (model.n_dof - 3))
        pulls = [config.motion.neutral_angle * axis.stiffness / 18.0 for axis in model.chain.axes]
        assert rest.information.tolist() == pytest.approx([0.0] * 6 + pulls)
        np.testing.assert_array_equal(rest.mean.T_world_root, state.T_world_root)
