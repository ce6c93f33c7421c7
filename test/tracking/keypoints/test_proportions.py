"""A body of another size than the person's is told by points whose distances no joint changes."""

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, image_set, seen_by, standing
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.model.variants import scaled_uniformly
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import LimbStatus, Status
from tracker_node.tracking.keypoints.modality import points_of
from tracker_node.tracking.keypoints.proportions import Proportions
from tracker_node.tracking.tracker import Tracker

RIG = circle_rig(3)
GRAY = np.full((480, 640, 3), 90, np.uint8)


def walking(i):
    swing = 40.0 * np.sin(0.3 * i)
    bent = {"left_hip_flexion": swing, "right_knee_flexion": 30.0 + 0.5 * swing, "left_elbow_flexion": 60.0 + swing}
    return standing(0.01 * i, 0.0, 0.5, **bent)


def people(i):
    return seen_by(RIG, walking(i), np.random.default_rng(i), 2.0)


def looked(scale, n=60, cameras=3):
    proportions = Proportions(RIG, *points_of(scaled_uniformly(HUMAN, scale), BLAZEPOSE))
    for i in range(n):
        proportions.look([person if k < cameras else None for k, person in enumerate(people(i))])
    return proportions


@pytest.mark.parametrize(("scale", "said"), [(1.0, ""), (0.95, ""), (0.8, "% farther from each"), (1.2, "% nearer to each")])
def test_the_size_of_a_body_is_compared_with_that_of_the_person(scale, said):
    proportions = looked(scale)
    assert proportions.ratio == pytest.approx(1.0 / scale, rel=0.03)
    assert bool(proportions.doubt) is bool(said) and said in proportions.doubt


@pytest.mark.parametrize("seen", [{"n": 20}, {"cameras": 1}])
def test_what_is_seen_for_a_moment_or_by_one_camera_says_nothing(seen):
    assert np.isnan(looked(0.8, **seen).ratio) and looked(0.8, **seen).doubt == ""


@pytest.mark.parametrize("scale", [0.7, 1.4])
def test_a_tracker_says_so_and_is_not_sure_of_it(scale):
    """Nobody suits a body that is far too small; one that is too large is somewhere."""
    made = Tracker(RIG, scaled_uniformly(HUMAN, scale), from_dict({"modalities": ["keypoints"]}))
    estimates = [made.step(image_set(RIG, [(person,) for person in people(i)], i * 33_333_333, GRAY)) for i in range(48)]
    assert "is it the person's body?" in made.doubt_of_size
    for each in estimates[-8:]:
        assert each.status is (Status.INITIALIZING if scale < 1.0 else Status.DEGRADED)
        assert made.doubt_of_size.split(" %")[1] in each.status_reason
        assert all(limb.status is not LimbStatus.TRACKING for limb in each.limbs)
    made.reset()
    assert made.doubt_of_size == ""
