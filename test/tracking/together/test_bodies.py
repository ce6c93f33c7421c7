"""Two people who pass each other, by trackers that know of each other; who of the people found is whose body."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, off_m, seen_by, standing
from helpers.bodies.detected_people import image_set as with_points
from helpers.cameras.camera_rigs import circle_rig
from helpers.cameras.two_people import MODELS, N_SETS, SCENE, image_set, mean_error_m, states
from tracker_node.model.configuration import Configuration
from tracker_node.runs.loop import StartRequest, TrackingLoop
from tracker_node.tracking.config import TrackerConfig, from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.together.bodies import Bodies, shared_threads
from tracker_node.tracking.tracker import Tracker


def trackers(**changes):
    config = replace(TrackerConfig(threads=1), **changes)
    return {name: Tracker(SCENE.rig, model, config, None, states(0)[name]) for name, model in MODELS.items()}


@pytest.fixture(scope="module")
def sets():
    return [image_set(i) for i in range(N_SETS)]


def step(bodies, image_set):
    worst = bodies.estimate(image_set)
    bodies.learn()
    assert any(worst is estimate for estimate in bodies.estimates.values())
    return bodies.estimates


def followed(sets, together):
    """By body, the mean errors, and how often it was not TRACKING."""
    each = trackers()
    bodies, errors = Bodies(each), {name: [] for name in each}
    for i, one in enumerate(sets):
        estimates = step(bodies, one) if together else {name: tracker.step(one) for name, tracker in each.items()}
        for name, estimate in estimates.items():
            assert estimate.status is not Status.LOST
            errors[name].append(mean_error_m(name, estimate.state, i))
    return {name: np.array(found) for name, found in errors.items()}


def test_people_who_pass_each_other_are_followed_more_exactly_together(sets):
    together, apart = followed(sets, True), followed(sets, False)
    for name in MODELS:
        assert together[name].mean() < 0.007 and together[name].max() < 0.03
    assert sum(e.mean() for e in together.values()) < 0.7 * sum(e.mean() for e in apart.values())


def test_each_knows_where_the_other_is_expected(sets):
    bodies = Bodies(trackers())
    for one in sets[:2]:
        step(bodies, one)
    given = bodies.image_sets(sets[2])
    for name, other in (("one", "other"), ("other", "one")):
        (neighbor,) = given[name].neighbors
        true = Configuration(MODELS[other], states(2)[other])
        np.testing.assert_allclose(neighbor.body.landmarks_world, true.landmarks_world, atol=0.03)
        assert all(colors.sum(axis=1) == pytest.approx(1.0, rel=0.05) for colors in neighbor.colors)


def test_one_body_alone_sees_its_images_as_they_are(sets):
    each = {"one": trackers()["one"]}
    assert Bodies(each).image_sets(sets[0])["one"] is sets[0]


def test_bodies_at_once_are_what_they_are_one_after_the_other(sets):
    one_by_one, at_once = Bodies(trackers()), Bodies(trackers(), 2)
    for one in sets[:6]:
        others = step(at_once, one)
        for name, estimate in step(one_by_one, one).items():
            np.testing.assert_array_equal(estimate.state.to_values(), others[name].state.to_values())


def test_a_recording_that_begins_again_is_tracked_as_before(sets):
    bodies = Bodies(trackers())
    loop, found = TrackingLoop(bodies), []
    for one in [*sets[:3], *sets[:3]]:
        loop.step(one)
        found.append({name: estimate.state for name, estimate in bodies.estimates.items()})
    for first, again in zip(found[:3], found[3:], strict=True):
        for name in MODELS:
            np.testing.assert_array_equal(first[name].joint_positions, again[name].joint_positions)


RIG, PERIOD_NS = circle_rig(4), 33_333_333
BLANK = np.full((480, 640, 3), 90, np.uint8)
POINTS_ALONE = from_dict({"modalities": ["keypoints"], "threads": 1})


def walking(name, i):
    """Two who change places within two seconds, half a meter beside each other on their ways."""
    along, swing = 0.9 - 0.03 * i, 30.0 * np.sin(0.25 * i)
    arms = {"left_shoulder_elevation_front": 20.0 + swing, "right_shoulder_elevation_front": 20.0 - swing}
    return standing(along, 0.25, np.pi, **arms) if name == "one" else standing(-along, -0.25, 0.0, **arms)


def points_of(i, names=("one", "other")):
    """Everybody's points in every camera, in an order that changes."""
    rng, found = np.random.default_rng(i), [[] for _ in RIG]
    for name in names:
        for persons, person in zip(found, seen_by(RIG, walking(name, i), rng, 1.0), strict=True):
            persons.insert(rng.integers(len(persons) + 1), person)
    return with_points(RIG, [tuple(persons) for persons in found], i * PERIOD_NS, BLANK)


def by_points(**near):
    made = {name: Tracker(RIG, HUMAN, POINTS_ALONE) for name in ("one", "other")}
    for name, place in near.items():
        made[name].reinitialize(np.array(place))
    return made


def run_by_points(each, shots):
    bodies = Bodies(each)
    return [step(bodies, shot) for shot in shots]


def test_nobody_is_two_bodies_and_who_changes_places_stays_who_he_is():
    found = run_by_points(by_points(one=(0.9, 0.3, 1.0)), [points_of(i) for i in range(60)])
    for i, estimates in enumerate(found):
        for name, estimate in estimates.items():
            assert estimate.status is Status.TRACKING, (i, name, estimate.status_reason)
            assert off_m(estimate.state, walking(name, i)).mean() < 0.04


def test_both_begin_in_the_first_image_set_each_where_it_is_wanted():
    found = run_by_points(by_points(one=(-0.9, -0.2, 1.0), other=(0.9, 0.2, 1.0)), [points_of(0)])
    assert off_m(found[0]["one"].state, walking("other", 0)).mean() < 0.04
    assert off_m(found[0]["other"].state, walking("one", 0)).mean() < 0.04


def test_who_comes_later_is_found_and_who_goes_is_lost():
    shots = [points_of(i, ("one",)) for i in range(5)] + [points_of(i) for i in range(5, 15)]
    shots += [points_of(i, ("other",)) for i in range(15, 20)]
    found = run_by_points(by_points(), shots)
    (first,) = {name for name in found[0] if found[0][name].status is Status.TRACKING}
    late = "other" if first == "one" else "one"
    assert {each[late].status for each in found[:5]} == {Status.INITIALIZING}
    assert {each[name].status for each in found[5:15] for name in each} == {Status.TRACKING}
    assert off_m(found[14][late].state, walking("other", 14)).mean() < 0.04
    assert found[19][first].status is Status.LOST and found[19][late].status is Status.TRACKING


def test_a_detector_looks_at_each_and_at_all_while_one_is_unknown():
    bodies = Bodies(by_points())
    assert bodies.expected_crops(0) == [()] * len(RIG)
    step(bodies, points_of(0))
    assert [len(crops) for crops in bodies.expected_crops(PERIOD_NS)] == [2] * len(RIG)


def test_other_parameters_take_everybody_over(sets):
    old, new = Bodies(trackers()), Bodies(trackers())
    loop = TrackingLoop(old)
    for one in sets[:3]:
        loop.step(one)
    loop.exchange(new)
    loop.step(sets[3])
    for name, estimate in new.estimates.items():
        assert mean_error_m(name, estimate.state, 3) < 0.02


def test_other_parameters_twice_before_an_image_set_and_after_a_pause_without_lenses(sets):
    loop = TrackingLoop(Bodies(trackers()))
    for one in sets[:3]:
        loop.step(one)
    for new in (Bodies(trackers()), Bodies(trackers()), None, Bodies(trackers())):
        loop.exchange(new)
    assert set(loop.estimates) == set(MODELS)  # where everybody was is known all the time
    loop.step(sets[3])
    for name, estimate in loop.estimates.items():
        assert mean_error_m(name, estimate.state, 3) < 0.02


def test_each_body_is_asked_by_itself_and_the_others_go_on(sets):
    loop = TrackingLoop(Bodies(trackers()))
    for one in sets[:3]:
        loop.step(one)
    raised = {name: states(3)[name].retract(np.eye(1, MODELS[name].n_dof, 2)[0]) for name in MODELS}
    for name in MODELS:
        loop.begin(StartRequest(lambda tracker, name=name: tracker.set_state(raised[name]), raised[name], body=name))
    assert set(loop.requests) == set(MODELS)
    loop.begin(StartRequest(lambda tracker: tracker.set_state(states(3)["one"]), body="one"))
    new = Bodies(trackers())
    loop.exchange(new)
    asked = new.trackers["other"].expected(sets[3].stamp_ns).to_values()
    np.testing.assert_allclose(asked, raised["other"].to_values(), atol=1e-12)
    assert mean_error_m("one", new.trackers["one"].expected(sets[3].stamp_ns), 3) < 1e-9
    loop.begin(StartRequest(lambda tracker: tracker.reinitialize()))
    assert list(loop.requests) == [""] and new.trackers["other"].expected(sets[3].stamp_ns) is None


def test_other_parameters_do_not_teach_a_body_the_colors_of_who_stands_before_it(sets):
    """In the middle of the clip they cover each other."""
    middle = N_SETS // 2
    learned = {}
    for shown in (True, False):
        old = Bodies(trackers())
        for one in sets[:middle]:
            step(old, one)
        learned[shown] = []
        for name, new in trackers().items():
            given = old.image_sets(sets[middle - 1])[name] if shown else sets[middle - 1]
            new.take_over(old.trackers[name], given)
            learned[shown] += [each for each in new.as_neighbor(sets[middle].stamp_ns).colors if each is not None]
    off = [0.5 * np.abs(a - b).sum(axis=1).max() for a, b in zip(learned[True], learned[False], strict=True)]
    assert max(off) > 0.05
    loop = TrackingLoop(Bodies(trackers()))
    for one in sets[:middle]:
        loop.step(one)
    new = Bodies(trackers())
    loop.exchange(new)
    found = [each for name in new.trackers for each in new.trackers[name].as_neighbor(sets[middle].stamp_ns).colors]
    for a, b in zip(found, learned[True], strict=True):
        np.testing.assert_array_equal(a, b)


def test_things_beside_people_are_not_looked_for_by_the_detector_of_people(sets):
    """Nor do they keep it from looking where people are."""
    person, thing = trackers(modalities=("region", "keypoints"))["one"], trackers()["other"]
    bodies = Bodies({"thing": thing, "one": person})
    thing.reinitialize()
    assert bodies.expected_crops(0) == person.expected_crops(0) != [()] * len(SCENE.rig)
    given = bodies.image_sets(sets[0])
    assert len(given["thing"].neighbors) == 1 and not given["one"].neighbors


def with_late_points(now, late):
    """An image set with the points of an earlier one."""
    pairs = zip(now.images, late.images, strict=True)
    return replace(now, images=tuple(replace(a, people=b.people, people_stamp_ns=b.stamp_ns) for a, b in pairs))


def test_late_points_are_each_ones_too():
    """Of two image sets before, as a live graph has them."""
    bodies, period = Bodies(by_points(one=(0.9, 0.3, 1.0))), range(40)
    for i in period:
        step(bodies, with_late_points(points_of(i, ()), points_of(max(i - 2, 0))))
    for name, estimate in bodies.estimates.items():
        assert estimate.status is not Status.LOST and off_m(estimate.state, walking(name, period[-1])).mean() < 0.15


def test_late_points_make_no_difference_of_threads(sets):
    """Bodies learn within an estimate then, while others draw them."""
    both = [Bodies(trackers(modalities=("region", "keypoints")), n) for n in (1, 2)]
    for i, one in enumerate(sets[10:18]):
        late = sets[10 + max(i - 2, 0)]
        of_each = [seen_by(SCENE.rig, states(10 + max(i - 2, 0))[name], np.random.default_rng(i), 1.0) for name in MODELS]
        people = [replace(image, people=found) for image, found in zip(late.images, zip(*of_each, strict=True), strict=True)]
        found = [step(bodies, with_late_points(one, replace(late, images=tuple(people)))) for bodies in both]
        for name in MODELS:
            values = [each[name].state.to_values() for each in found]
            np.testing.assert_array_equal(*values)


def test_late_points_go_to_who_was_there_then():
    """One a step behind the other: by where they are now each would have the points of both in a third of the cameras."""
    bodies = Bodies(by_points())
    for i in range(4):
        step(bodies, one_behind_the_other(i))
    now, late = one_behind_the_other(8), one_behind_the_other(3)
    given = bodies.image_sets(with_late_points(now, late))
    assert [[len(image.people) for image in given[name].images] for name in given] == [[1] * len(RIG)] * 2


def one_behind_the_other(i):
    """At 2 meters a second."""
    rng, along = np.random.default_rng(i), 0.067 * i - 0.5
    persons = [seen_by(RIG, standing(along - back, 0.0, 0.0), rng, 1.0) for back in (0.0, 0.45)]
    return with_points(RIG, list(zip(*persons, strict=True)), i * PERIOD_NS, BLANK)


def test_threads_go_to_bodies_first():
    assert [shared_threads(*each) for each in ((1, 2), (2, 2), (2, 3), (4, 2), (8, 3), (2, 1))] == [
        (1, 1), (2, 1), (2, 1), (2, 2), (3, 2), (1, 2)
    ]  # fmt: skip
