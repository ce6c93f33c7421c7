"""The whole core on the points of a detector: own start, motion, what is lost and found, late cameras, where to look next."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import (
    HUMAN,
    POINTS,
    image_set,
    off_m,
    person_at,
    places,
    seen_by,
    standing,
    swapped,
    without,
)
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.errors import TrackerError
from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.keypoints import COCO_17
from tracker_node.observation.image_set import ImageSet
from tracker_node.tracking.assessment import Assessment
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.initialization.initializer import Initializer
from tracker_node.tracking.keypoints.crops import crops_of
from tracker_node.tracking.tracker import Tracker

RIG, PERIOD_NS = circle_rig(3), 33_333_333
QUICK = {"modalities": ["keypoints"]}
SMALL = np.full((480, 640, 3), 90, np.uint8)


def state(t: float, x: float = 0.0) -> State:
    """Walking 1 m/s while the arms and a knee swing."""
    swing = 40.0 * np.sin(5.0 * t)
    return standing(
        x + 1.0 * t - 0.3, 0.1, 0.5 + t, left_shoulder_elevation_front=30.0 + swing, right_shoulder_elevation_front=30.0 - swing,
        left_hip_flexion=15.0 + 0.5 * swing, left_knee_flexion=25.0, right_elbow_flexion=40.0 + swing,
    )  # fmt: skip


def people(i: float, x: float = 0.0, sigma_px: float = 1.0) -> list[tuple]:
    rng = np.random.default_rng([round(1000 * i), 1])
    return [(person,) for person in seen_by(RIG, state(i * PERIOD_NS * 1e-9, x), rng, sigma_px)]


def shot(i: float, found: Sequence | None = None) -> ImageSet:
    return image_set(RIG, list(people(i) if found is None else found), round(i * PERIOD_NS), SMALL)


def true(i: float, x: float = 0.0) -> State:
    return state(i * PERIOD_NS * 1e-9, x)


def tracker(start: State | None = None, rig=RIG, **more) -> Tracker:
    return Tracker(rig, HUMAN, from_dict({**QUICK, **more}), None, start)


def errors(estimates: Sequence[TrackEstimate], x: float = 0.0) -> np.ndarray:
    return np.array([off_m(estimate.state, true(i, x)).mean() for i, estimate in enumerate(estimates)])


@pytest.fixture(scope="module")
def followed() -> list[TrackEstimate]:
    made = tracker()
    return [made.step(shot(i)) for i in range(15)]


def test_a_body_that_nobody_has_told_anything_of_is_tracked_from_the_first_set_on(followed):
    assert [estimate.status for estimate in followed] == [Status.TRACKING] * 15
    assert errors(followed).max() < 0.03
    assert errors(followed)[-5:].mean() < 0.01
    for estimate in followed:
        assert [camera.samples for camera in estimate.cameras] == [len(POINTS)] * 3 and 0.3 < estimate.residual < 4.0


def test_motion_is_followed(followed):
    step = true(14).difference(true(13)) / (PERIOD_NS * 1e-9)
    np.testing.assert_allclose(followed[-1].velocity[:3], step[:3], atol=0.25)


def test_the_same_points_give_the_same_bits_whatever_the_number_of_threads_and_after_a_reset(followed):
    made = tracker(threads=1)
    for _ in range(2):
        again = [made.step(shot(i)) for i in range(6)]
        for one, other in zip(again, followed, strict=False):
            np.testing.assert_array_equal(one.state.to_values(), other.state.to_values())
            np.testing.assert_array_equal(one.covariance, other.covariance)
        made.reset()


def test_without_people_nothing_is_known_and_somebody_who_comes_is_found():
    made, nobody = tracker(), [()] * 3
    assert made.step(shot(0, nobody)).status is Status.INITIALIZING
    alone = [people(1)[0], (), None]
    assert made.step(shot(1, alone)).status is Status.INITIALIZING
    assert made.expected_crops(2 * PERIOD_NS) == [()] * 3
    found = made.step(shot(2))
    assert found.status is Status.TRACKING and off_m(found.state, true(2)).mean() < 0.03


def test_a_lost_body_is_found_by_points_after_two_sets():
    """It is somewhere else at once: for two sets nobody believes that, then it is the body."""
    made, elsewhere = tracker(true(0)), 0.8
    for i in range(4):
        assert made.step(shot(i)).status is Status.TRACKING
    statuses = []
    for i in range(4, 8):
        estimate = made.step(shot(i, people(i, elsewhere)))
        statuses.append(estimate.status)
        crops = made.expected_crops((i + 1) * PERIOD_NS)
        assert (crops == [()] * 3) is (estimate.status is Status.LOST)
    assert statuses == [Status.LOST, Status.LOST, Status.TRACKING, Status.TRACKING]
    assert off_m(estimate.state, true(7, elsewhere)).mean() < 0.03


def test_who_is_found_far_from_where_a_body_was_a_moment_ago_is_somebody_else():
    """Somebody walks by who hides it, and is found alone; then it is found again. A second later it may be anybody."""
    for hidden, back_at in ((12, 0.0), (40, 1.5)):
        made, end = tracker(true(0)), 8 + hidden
        for i in range(8):
            made.step(shot(i))
        alone = [made.step(shot(i, people(i, 1.5))) for i in range(8, end)]
        assert {estimate.status for estimate in alone[:28]} == {Status.LOST}
        both = [(*one, *other) for one, other in zip(people(end), people(end, 1.5), strict=True)]
        again = made.step(shot(end, both))
        assert again.status is Status.TRACKING and off_m(again.state, true(end, back_at)).mean() < 0.03


def test_who_runs_is_found_where_he_has_run_to():
    made, speed = tracker(), 6.0
    for i in range(12):
        x = (speed - 1.0) * (i - 12) * PERIOD_NS * 1e-9
        made.step(shot(i, people(i, x)))
    for i in range(12, 20):
        assert made.step(shot(i, [()] * 3)).status is not Status.INITIALIZING
    x = (speed - 1.0) * (20 - 12) * PERIOD_NS * 1e-9
    again = made.step(shot(20, people(20, x)))
    assert again.status is Status.TRACKING and off_m(again.state, true(20, x)).mean() < 0.03


def test_a_lost_body_that_points_have_led_far_away_is_somebody_else():
    made, sets = tracker(true(0)), 8
    for i in range(sets):
        made.step(shot(i))
    made._track.lost, found = 1, Assessment(Status.TRACKING, "")
    for away_m, later_s, expected in ((0.8, 0.1, Status.TRACKING), (1.2, 0.1, Status.LOST), (1.2, 1.5, Status.TRACKING)):
        stamp_ns = round(sets * PERIOD_NS + 1e9 * later_s)
        assert made._unless_elsewhere(found, true(sets, away_m), stamp_ns).status is expected
    made._track.lost = 0
    assert made._unless_elsewhere(found, true(sets, 1.2), round(sets * PERIOD_NS)) is found


@pytest.mark.parametrize("turned", [1.5, np.pi])
def test_a_given_state_that_is_turned_about_is_so_for_two_sets(turned):
    """As where that of another moment is given."""
    there = true(0)
    about = se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, turned])), np.zeros(3))
    T = about @ there.T_world_root
    T[:3, 3] = there.T_world_root[:3, 3]
    made = tracker(State(T, there.joint_positions))
    estimates = [made.step(shot(i)) for i in range(5)]
    assert [estimate.status is Status.TRACKING for estimate in estimates] == [False] * 2 + [True] * 3
    assert "points of half of the cameras contradict it" in estimates[0].status_reason
    assert errors(estimates)[2:].max() < 0.03


def test_a_detector_that_exchanges_left_and_right_in_half_of_the_cameras_does_no_harm():
    rig = circle_rig(4)
    made = tracker(rig=rig)
    for i in range(30):
        rng = np.random.default_rng(i)
        found = seen_by(rig, true(i), rng, 1.0)
        lists = [(swapped(person) if i > 3 and k < 2 else person,) for k, person in enumerate(found)]
        estimate = made.step(image_set(rig, lists, round(i * PERIOD_NS), SMALL))
        assert off_m(estimate.state, true(i)).mean() < 0.03, i
    assert estimate.status is Status.TRACKING


def test_a_few_sets_without_people_are_bridged():
    made = tracker(true(0))
    for i in range(8):
        made.step(shot(i))
    missed = [made.step(shot(i, [None] * 3)) for i in range(8, 24)]
    assert [estimate.status for estimate in missed] == [Status.DEGRADED] * 15 + [Status.LOST]
    assert missed[0].status_reason == "no detector has looked: the body is where it is expected"
    assert missed[-1].status_reason == "0 points of the body are found"
    assert off_m(missed[0].state, true(8)).mean() < 0.06
    variances = [np.trace(estimate.covariance) for estimate in missed]
    assert (np.diff(variances[:15]) > 0.0).all()  # nothing is known of where it is but by how it has moved
    assert made.step(shot(24)).status is not Status.INITIALIZING


def late(i: int, of: int | None) -> ImageSet:
    """Image set i with the points of set ``of``; None: without any."""
    bare = shot(i, [None] * 3)
    if of is None:
        return bare
    found = zip(bare.images, people(of), strict=True)
    return replace(bare, images=tuple(replace(image, people=p, people_stamp_ns=round(of * PERIOD_NS)) for image, p in found))


def test_points_that_come_late_say_what_they_would_have_said_in_time():
    """Every third set has points, which come with the set after the next; the set between is fitted anew."""
    in_time, made = tracker(true(0)), tracker(true(0))
    for i in range(12):
        there = in_time.step(shot(i) if i % 3 == 0 else late(i, None))
        here = made.step(shot(0) if i == 0 else late(i, i - 2 if i > 2 and i % 3 == 2 else None))
        if i > 4 and i % 3 == 2:  # both have had the points of the set before the last
            assert off_m(here.state, there.state).max() < 1e-6
            np.testing.assert_allclose(here.covariance, there.covariance, rtol=1e-6, atol=1e-12)
    assert off_m(here.state, true(11)).mean() < 0.06


def test_late_points_begin_a_body_where_it_was_and_follow_it_to_where_it_is():
    made = tracker()
    assert [made.step(late(i, None)).status for i in range(3)] == [Status.INITIALIZING] * 3
    estimate = made.step(late(3, 0))
    assert estimate.status is Status.DEGRADED and off_m(made.step(late(4, 3)).state, true(4)).mean() < 0.1


def test_points_of_a_set_that_is_not_known_say_nothing():
    made, other = tracker(true(0)), tracker(true(0))
    for i in range(4):
        made.step(shot(i) if i < 2 else late(i, None))
        other.step(shot(i) if i < 2 else late(i, None))
    odd = late(4, 2)
    odd = replace(odd, images=tuple(replace(image, people_stamp_ns=-round(1.0e9)) for image in odd.images))
    np.testing.assert_array_equal(made.step(odd).state.to_values(), other.step(late(4, None)).state.to_values())


def test_detectors_are_sent_where_the_body_is_expected(followed):
    made = tracker(true(0))
    assert made.expected_crops(0) == [(crop,) for crop in crops_of(HUMAN, RIG, true(0))]
    for i in range(8):
        made.step(shot(i))
    for (crop,), there in zip(made.expected_crops(9 * PERIOD_NS), crops_of(HUMAN, RIG, true(9)), strict=True):
        np.testing.assert_allclose(crop.center, there.center, atol=12.0)
        assert crop.size == pytest.approx(there.size, rel=0.1)


def test_a_body_is_found_anew_once_a_camera_is_known_to_be_late_that_may_have_turned_it():
    """It is turned by 140 degrees until then, as images of two moments may have left it; by itself it stays so."""
    rig, turned = circle_rig(4), standing(turned=2.5).T_world_root[:3, :3]
    made, n_named = Tracker(rig, HUMAN, from_dict(QUICK)), 0
    for i in range(40):
        now, before = (true(k, -0.5 * k * PERIOD_NS * 1e-9) for k in (i, i - 12))
        if not n_named:
            made.set_state(State(se3.from_rotation_translation(turned, now.T_world_root[:3, 3]), now.joint_positions))
        rng = np.random.default_rng(i)
        found = [(person_at(c, places(before if c.name == "cam03" else now), rng, 1.0),) for c in rig]
        estimate = made.step(image_set(rig, found, round(i * PERIOD_NS), SMALL))
        n_named += bool(estimate.faults)
        if i < 12 or n_named:
            assert bool(off_m(estimate.state, now).mean() < 0.03) is (n_named > 0), i
        if n_named == 3:
            return
    pytest.fail("nobody is named")


def test_another_person_and_swaps_do_no_harm(followed):
    """Somebody else walks by in all cameras, and one camera takes left for right in every set."""
    made, estimates = tracker(true(0)), []
    for i in range(12):
        other = seen_by(RIG, standing(0.8 - 0.05 * i, -0.5, 2.0))
        seen = [(b, *a)[:: 1 if i % 2 else -1] for a, b in zip(people(i), other, strict=True)]
        seen[1] = tuple(swapped(person) for person in seen[1])
        estimates.append(made.step(shot(i, seen)))
    assert {estimate.status for estimate in estimates} == {Status.TRACKING}
    assert errors(estimates).max() < 0.035


def test_cameras_that_expose_late_are_taken_when_they_do():
    """Half a period late, at 1 m/s, a camera sees the body 17 mm farther: as if nothing was known of it, errors are larger."""
    results = []
    for told in (True, False):
        made, estimates = tracker(true(0), **{"keypoints.offset_scale": 0.01}), []
        for i in range(14):
            exact = [(person,) for person in seen_by(RIG, true(i))]
            exact[1] = (seen_by(RIG, true(i + 0.5))[1],)
            given = shot(i, exact)
            late = replace(given.images[1], stamp_ns=round((i + 0.5) * PERIOD_NS))
            first, in_time, last = given.images
            estimates.append(made.step(replace(given, images=(first, late if told else in_time, last))))
        results.append(errors(estimates)[6:].mean())
    assert results[0] < 0.6 * results[1]


def test_squared_errors_are_so_much_larger_than_fits_say(followed):
    made = tracker(**{"keypoints.error_scale": 6.0})
    for i, before in enumerate(followed[:4]):
        wide = made.step(shot(i))
        np.testing.assert_array_equal(wide.state.to_values(), before.state.to_values())
        np.testing.assert_allclose(wide.covariance, 3.0 * before.covariance, rtol=1e-9)
        np.testing.assert_allclose(wide.information, before.information / 3.0, rtol=1e-9)
        assert wide.innovation is None


def test_a_set_without_points_says_nothing_that_is_scaled():
    made = tracker(true(0))
    made.step(shot(0))
    information = made.step(shot(1, [None] * 3)).information
    assert not information[:6].any()  # that of the joints is of their rest


def test_covariances_are_honest():
    """Over many starts: mean squared errors of joints, in variances that the covariance says, without the factor for clothes."""
    ratios = []
    rows = [HUMAN.landmark_index(f"{s}_{j}") for s in ("left", "right") for j in ("shoulder", "elbow", "hip", "knee", "ankle")]
    for seed in range(25):
        rng, body = np.random.default_rng(seed), state(0.3)
        offsets = {}
        values = {"keypoints.error_scale": 1.0, "keypoints.outlier_fraction": 1e-4, "keypoints.sigma_fraction": 1e-3}
        made = tracker(body, **values)
        points = made._track.engine.modalities[0].offsets.body
        for k, name in enumerate(made._track.engine.modalities[0].names):
            offsets[name] = points.means[k] + np.sqrt(np.diag(points.covariances[k])) * rng.normal(size=3)
        seen = [(person,) for person in seen_by(RIG, body, rng, 3.0, offsets, stated_px=3.0)]
        estimate = made.step(shot(0, seen))
        where = Configuration(HUMAN, estimate.state)
        J = where.landmark_jacobian()[rows]
        e = where.landmarks_world[rows] - Configuration(HUMAN, body).landmarks_world[rows]
        variances = np.trace(J @ estimate.covariance @ np.swapaxes(J, 1, 2), axis1=1, axis2=2)
        ratios.append((e**2).sum(axis=1).sum() / variances.sum())
    assert 0.5 < np.mean(ratios) < 1.5  # the neutral pose is a prior, which the body is not drawn from


def test_points_of_another_detector_come_with_their_table():
    made = Tracker(RIG, HUMAN, from_dict(QUICK), None, None, None, COCO_17)
    offsets = {name: np.array(COCO_17[name].offset) if name in COCO_17 else np.zeros(3) for name in POINTS}
    for i in range(3):
        seen = [(without(person, ("left_heel", "right_heel")),) for person in seen_by(RIG, true(i), offsets=offsets)]
        estimate = made.step(shot(i, seen))
    assert estimate.status is Status.TRACKING
    assert [camera.samples for camera in estimate.cameras] == [len(COCO_17)] * 3


def test_hundreds_of_people_in_every_image_do_no_harm():
    rng, made = np.random.default_rng(1), tracker()
    for i in range(2):
        crowd = []
        for camera, (own,) in zip(RIG, people(i), strict=True):
            crowd_at = [standing(*rng.uniform(0.7, 1.2, 2), rng.uniform(0.0, 6.0)) for _ in range(150)]
            others = [person_at(camera, places(each), score=0.05) for each in crowd_at]
            crowd.append((*others, own))
        estimate = made.step(shot(i, crowd))
    assert estimate.status is Status.TRACKING and off_m(estimate.state, true(1)).mean() < 0.03


def test_a_detector_that_lacks_a_point_of_one_side_finds_a_first_state_too():
    def lacking(person):
        rows = [row for row, name in enumerate(person.names) if name != "left_heel"]
        arrays = {field: getattr(person, field)[rows] for field in ("pixels", "covariances", "scores")}
        return replace(person, names=tuple(person.names[row] for row in rows), **arrays)

    found = tracker().step(shot(0, [tuple(map(lacking, persons)) for persons in people(0)]))
    assert found.status is Status.TRACKING
    assert off_m(found.state, true(0)).mean() < 0.03


def test_a_tracker_that_is_not_to_look_for_the_body_waits_for_a_state():
    waiting = tracker(**{"initialization.enabled": False})
    assert waiting.step(shot(0)).status is Status.INITIALIZING
    waiting.set_state(true(1))
    assert waiting.step(shot(1)).status is Status.TRACKING


def test_of_several_people_the_one_at_a_place_is_tracked_and_is_found_again_when_lost():
    def both(i: float, here: bool = True) -> list[tuple]:
        return [(*one, *other) if here else other for one, other in zip(people(i), people(i, 0.9), strict=True)]

    made = tracker()
    assert off_m(made.step(shot(0, both(0))).state, true(0)).mean() < 0.03  # where the cameras look
    made.reinitialize(true(1, 0.9).T_world_root[:3, 3] + 0.1)
    estimates = [made.step(shot(i, both(i))) for i in range(1, 4)]
    assert all(estimate.status is Status.TRACKING for estimate in estimates)
    assert off_m(estimates[-1].state, true(3, 0.9)).mean() < 0.03
    for i in range(4, 9):  # nobody is seen, then both are
        made.step(shot(i, [()] * 3))
    assert off_m(made.step(shot(9, both(9))).state, true(9, 0.9)).mean() < 0.03


def test_a_body_that_is_to_be_found_anew_is_left_to_points_that_come_late(monkeypatch):
    """Outlines take seconds for a search, in which nobody else is tracked; after a second without points they are searched."""
    searched = []
    monkeypatch.setattr(Initializer, "find", lambda self, *found: searched.append(found[1].stamp_ns))
    made = tracker(modalities=["region", "keypoints"])
    made.step(shot(0))
    for i in range(1, 8):
        made.step(late(i, i - 3 if i > 3 else None))
    searched.clear()
    made.reinitialize()
    said = [made.step(late(i, None if i < 12 else i - 3)) for i in range(8, 16)]
    assert said[0].status is Status.INITIALIZING and said[-1].status is not Status.INITIALIZING and not searched
    assert off_m(said[-1].state, true(15)).mean() < 0.3  # the images show nothing
    made.reinitialize()
    for i in range(16, 48):
        made.step(late(i, None))
    assert searched and searched[0] - 16 * PERIOD_NS >= 1e9


def test_a_place_without_points_is_refused():
    made = Tracker(RIG, HUMAN, from_dict({"modalities": ["region"]}))
    with pytest.raises(TrackerError, match="a person is chosen by points: expected keypoints among the modalities"):
        made.reinitialize(np.zeros(3))
