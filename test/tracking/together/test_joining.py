"""People who come into the images and leave them: found by points, each a body with a name of its own."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, POINTS, image_set, off_m, seen_by, standing
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.errors import TrackerError
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.keypoints import BLAZEPOSE, expected_offsets
from tracker_node.model.variants import scaled_uniformly
from tracker_node.runs.loop import TrackingLoop
from tracker_node.tracking.config import TrackerConfig, from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.together.bodies import Bodies
from tracker_node.tracking.together.joining import NOBODY_YET, Joining, JoiningOptions
from tracker_node.tracking.tracker import Tracker

RIG, PERIOD_NS = circle_rig(4), 33_333_333
BLANK = np.full((480, 640, 3), 90, np.uint8)
POINTS_ALONE = from_dict({"modalities": ["keypoints"], "threads": 1})
NAMES = ("person_1", "person_2", "person_3")


def here(x, i, step=0.01):
    """Somebody who walks along y."""
    return standing(x, step * i - 0.3, 0.5 * np.pi, left_shoulder_elevation_front=20.0 * np.sin(0.2 * i))


def shot(i, *places, cameras=(0, 1, 2, 3), step=0.01, **body):
    """People at places, as cameras see them, in an order that changes."""
    rng, found = np.random.default_rng(i), [[] for _ in RIG]
    for x in places:
        for k, person in enumerate(seen_by(RIG, here(x, i, step), rng, 1.0, **body)):
            if k in cameras:
                found[k].insert(rng.integers(len(found[k]) + 1), person)
    return image_set(RIG, [tuple(persons) for persons in found], i * PERIOD_NS, BLANK)


def room(named=(), **options):
    """Bodies with these names, and whoever comes."""
    joining = Joining(
        RIG, JoiningOptions(HUMAN, POINTS_ALONE, NAMES, **options), lambda m, s: Tracker(RIG, m, POINTS_ALONE, None, s)
    )
    return Bodies({name: Tracker(RIG, HUMAN, POINTS_ALONE) for name in named}, joining=joining)


def leg_and_arm_m(model):
    landmarks = dict(zip(model.landmark_names, Configuration(model, State.neutral(model)).landmarks_world, strict=True))
    ends = ("left_hip", "left_ankle"), ("left_shoulder", "left_wrist")
    return np.array([np.linalg.norm(landmarks[a] - landmarks[b]) for a, b in ends])


def run(bodies, shots):
    """By image set, what is said of who is here."""
    found = []
    for one in shots:
        bodies.estimate(one)
        bodies.learn()
        found.append(bodies.estimates)
    return found


def tracked(estimates):
    return {name for name, estimate in estimates.items() if estimate.status is Status.TRACKING}


def test_who_comes_is_a_body_of_his_own_and_who_stays_away_has_left():
    bodies = room(gone_s=0.5)
    shots = [shot(i) for i in range(5)] + [shot(i, -0.9) for i in range(5, 15)] + [shot(i, -0.9, 0.9) for i in range(15, 40)]
    shots += [shot(i, 0.9) for i in range(40, 62)]
    found = run(bodies, shots)
    assert found[4] == {} and {each.status_reason for each in bodies.absent.values()} >= {NOBODY_YET}
    assert tracked(found[14]) == {"person_1"} and tracked(found[39]) == {"person_1", "person_2"}
    assert off_m(found[39]["person_1"].state, here(-0.9, 39)).mean() < 0.04
    assert off_m(found[39]["person_2"].state, here(0.9, 39)).mean() < 0.04
    assert found[45]["person_1"].status is Status.LOST
    assert set(found[61]) == {"person_2"} == tracked(found[61])
    left = bodies.absent["person_1"]
    assert left.status is Status.LOST and left.status_reason == "has left: LOST for 0.5 s"
    assert bodies.absent["person_3"].status is Status.INITIALIZING


def test_who_comes_later_is_somebody_else_and_those_who_may_come_are_so_many():
    bodies = room(gone_s=0.2)
    shots, n = [], 0
    for _ in range(4):
        shots += [shot(i, -0.9) for i in range(n, n + 10)] + [shot(i) for i in range(n + 10, n + 22)]
        n += 22
    found = run(bodies, shots[:70])
    assert not bodies.turned_away
    found += run(bodies, shots[70:])
    seen = [tracked(found[k]) for k in (9, 31, 53, 75)]
    assert seen == [{"person_1"}, {"person_2"}, {"person_3"}, set()]  # three names are all that there are
    assert bodies.turned_away == "somebody has come for whom no name is left: joining.most is 3"
    bodies.reset()
    assert not bodies.turned_away and tracked(run(bodies, [shot(i, -0.9) for i in range(10)])[-1]) == {"person_1"}


def test_a_body_that_is_lost_does_not_become_somebody_who_comes_elsewhere():
    bodies = room(named=("anna",))
    shots = [shot(i, -1.2) for i in range(10)] + [shot(i) for i in range(10, 14)] + [shot(i, 1.2) for i in range(14, 24)]
    found = run(bodies, shots)
    assert tracked(found[9]) == {"anna"} and found[23]["anna"].status is Status.LOST
    assert tracked(found[23]) == {"person_1"}
    assert off_m(found[23]["person_1"].state, here(1.2, 23)).mean() < 0.04


def test_a_body_that_is_lost_is_found_again_where_it_can_be_by_then():
    bodies = room()
    shots = [shot(i, -0.9) for i in range(10)] + [shot(i) for i in range(10, 16)] + [shot(i, -0.6) for i in range(16, 24)]
    found = run(bodies, shots)
    assert found[15]["person_1"].status is Status.LOST and tracked(found[23]) == {"person_1"} == set(found[23])


def test_time_in_which_nobody_was_looked_for_does_not_count():
    """A search for another body may last: who was LOST before is looked for again before it is said to have left."""
    bodies = room(gone_s=2.0)
    shots = [shot(i, -0.9) for i in range(10)] + [shot(i) for i in range(10, 16)]
    after = 16 + round(17e9 / PERIOD_NS)
    found = run(bodies, shots + [shot(after)] + [shot(i) for i in range(after + 1, after + 9)])
    assert found[15]["person_1"].status is Status.LOST and "person_1" in found[-1]
    run(bodies, [shot(i) for i in range(after + 9, after + 60)])
    assert "has left" in bodies.absent["person_1"].status_reason


@pytest.mark.parametrize("cameras", [(0,), ()])
def test_nobody_joins_whom_fewer_than_two_cameras_see(cameras):
    assert run(room(), [shot(i, 0.0, cameras=cameras) for i in range(12)])[-1] == {}


def test_nobody_joins_who_is_seen_in_one_look():
    shots = [shot(0, 0.0), *(shot(i) for i in range(1, 60)), shot(60, 0.0), *(shot(i) for i in range(61, 64))]
    assert run(room(), shots)[-1] == {}


@pytest.mark.parametrize("late", [0, 9])
def test_who_is_seen_late_begins_where_he_is_by_now(late):
    bodies, came = room(), None
    for i in range(40):
        seen = shot(i - late, 0.0, step=0.035) if i >= late else shot(i)
        images = tuple(replace(image, stamp_ns=i * PERIOD_NS, people_stamp_ns=image.stamp_ns) for image in seen.images)
        bodies.estimate(replace(seen, stamp_ns=i * PERIOD_NS, images=images if late else seen.images))
        if bodies.estimates and came is None:
            came = i
            assert off_m(bodies.estimates["person_1"].state, here(0.0, i, 0.035)).mean() < (0.12 if late else 0.05)
    assert came is not None
    roots = [state.T_world_root[:3, 3] for state in (bodies.estimates["person_1"].state, here(0.0, 39, 0.035))]
    assert np.linalg.norm(roots[0] - roots[1]) < 0.1  # arms have swung on meanwhile


def test_lengths_are_those_of_who_comes():
    tall = scaled_uniformly(HUMAN, 1.1)
    offsets = dict(zip(POINTS, expected_offsets(tall, [BLAZEPOSE[name] for name in POINTS]), strict=True))
    bodies = room()
    run(bodies, [shot(i, 0.0, model=tall, offsets=offsets) for i in range(12)])
    lengths = leg_and_arm_m(bodies.trackers["person_1"].model) / leg_and_arm_m(HUMAN)
    assert lengths == pytest.approx([1.1, 1.1], abs=0.07)  # one image set says no more


def test_a_recording_that_begins_again_has_the_same_people():
    bodies, shots = room(), [shot(i, -0.9, *([0.9] * (i > 8))) for i in range(20)]
    loop, found = TrackingLoop(bodies), []
    for one in [*shots, *shots]:
        loop.step(one)
        found.append({name: estimate.state.to_values() for name, estimate in bodies.estimates.items()})
    assert set(found[19]) == {"person_1", "person_2"}
    for first, again in zip(found[:20], found[20:], strict=True):
        np.testing.assert_equal(first, again)


def test_other_parameters_keep_who_has_joined():
    loop = TrackingLoop(room())
    for i in range(10):
        loop.step(shot(i, -0.9))
    loop.exchange(None)
    loop.exchange(room())
    for i in range(10, 22):
        loop.step(shot(i, -0.9, 0.9))
    assert tracked(loop.estimates) == {"person_1", "person_2"}
    assert off_m(loop.estimates["person_1"].state, here(-0.9, 21)).mean() < 0.04


def test_a_detector_looks_anywhere_while_nobody_is_here():
    bodies = room()
    assert bodies.expected_crops(0) == [()] * len(RIG)
    run(bodies, [shot(i, 0.0) for i in range(10)])
    assert [len(crops) for crops in bodies.expected_crops(10 * PERIOD_NS)] == [1] * len(RIG)


def test_points_are_what_people_who_join_are_found_by():
    with pytest.raises(TrackerError, match="expected keypoints among the modalities, got region"):
        JoiningOptions(HUMAN, replace(TrackerConfig(), modalities=("region",)))
