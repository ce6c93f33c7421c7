"""Who of the people in an image is the body, and whether left and right have been exchanged."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, NAMES, POINTS, person_at, places, posed, seen_by, standing, swapped, without
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.model.configuration import State
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.observation.keypoints.people import Person
from tracker_node.tracking.config import KeypointConfig
from tracker_node.tracking.keypoints.choice import _LEAST, PersonChoice
from tracker_node.tracking.keypoints.modality import KeypointModality

RIG = circle_rig(3)
TRUE = standing(0.1, -0.1, 0.6, left_shoulder_elevation_front=50.0, right_hip_flexion=30.0, right_knee_flexion=40.0)
AWAY = standing(1.0, 0.4, 2.0)


class Start:
    """Finds what it is told to."""

    def __init__(self, state: State | None = None):
        self.asked: list = []
        self._state = state

    def reset(self) -> None:
        pass

    def find(self, people, near=None):
        self.asked.append((people, near))
        return self._state


def choice(start: Start | None = None, rig=RIG) -> PersonChoice:
    modality = KeypointModality(rig, HUMAN, KeypointConfig(), BLAZEPOSE)
    return PersonChoice(rig, modality, start or Start())  # type: ignore[arg-type]


def true_people(sigma_px: float = 2.0) -> list[Person]:
    return seen_by(RIG, TRUE, np.random.default_rng(1), sigma_px)


def test_the_body_is_found_wherever_it_stands_in_the_list():
    people, others = true_people(), seen_by(RIG, AWAY)
    lists = [(people[0], others[0]), (others[1], people[1]), (others[2], people[2], others[2])]
    assert list(choice().choose(lists, TRUE)) == people


def test_an_expectation_that_is_ten_centimeters_off_will_do():
    people, others = true_people(), seen_by(RIG, AWAY)
    near = State(TRUE.T_world_root.copy(), TRUE.joint_positions)
    near.T_world_root[:3, 3] += (0.08, -0.06, 0.0)
    assert list(choice().choose([(other, own) for own, other in zip(people, others, strict=True)], near)) == people


def test_nobody_is_the_body_where_all_are_elsewhere():
    others = seen_by(RIG, AWAY)
    assert list(choice().choose([(others[0],), (), None], TRUE)) == [None, None, None]


def test_without_a_detector_there_are_no_persons():
    assert choice().choose((), TRUE) == ()


def test_left_and_right_that_were_exchanged_are_exchanged_back():
    people = true_people()
    found = choice().choose([(swapped(people[0]),), (people[1],), (seen_by(RIG, AWAY)[2], swapped(people[2]))], TRUE)
    for person, expected in zip(found, people, strict=True):
        np.testing.assert_array_equal(person.pixels, expected.pixels)
        np.testing.assert_array_equal(person.scores, expected.scores)
        assert person.names == NAMES
    assert found[1] is people[1]


class OneOf(Start):
    """The body may begin in one state; a point costs what it is off, in pixels."""

    def candidates(self, people, near=None):
        self.asked.append((people, near))
        return [(self._state, 1.0)]

    def cost(self, state, persons):
        found = zip(RIG, persons, strict=True)
        return np.mean([np.abs(each.pixels - person_at(camera, places(state)).pixels).mean() for camera, each in found])


def test_a_body_that_cameras_show_exchanged_may_stand_otherwise():
    turned = standing(0.1, -0.1, 0.6 + np.pi, left_shoulder_elevation_front=50.0)
    made, lists = choice(start := OneOf(TRUE)), [(person,) for person in true_people()]
    for n in range(2):
        assert made.otherwise(lists, turned) is None and made.is_contradicted is (n > 0) and not start.asked
        made.choose(lists, turned)
    assert made.otherwise(lists, turned) is TRUE and not made.is_contradicted
    np.testing.assert_array_equal(start.asked[0][1], turned.T_world_root[:3, 3])
    assert made.otherwise(lists, turned) is None  # asked again later


def test_a_detector_that_exchanges_in_half_of_the_cameras_is_not_believed():
    lists = [(swapped(person),) if i != 1 else (person,) for i, person in enumerate(true_people())]
    made = choice(OneOf(standing(0.1, -0.1, 0.6 + np.pi)))
    for _ in range(3):
        made.choose(lists, TRUE)
    assert made.is_contradicted and made.otherwise(lists, TRUE) is None and not made.is_contradicted


@pytest.mark.parametrize("several", [False, True])
def test_cameras_that_show_others_only_contradict_a_body(several):
    others, own = seen_by(RIG, AWAY), true_people()
    lists = [(own[0],) if several else (), (others[1],), (others[2],)]
    made = choice()
    made.choose(lists, TRUE)  # nothing spoke for it before
    assert made.is_contradicted
    made.choose([(own[0],), (own[1],), (others[2],)], TRUE)
    assert not made.is_contradicted


def test_covariances_are_exchanged_with_their_points():
    person = true_people()[0]
    own = np.arange(1.0, len(NAMES) + 1.0)[:, None, None] * np.eye(2)
    (found, *_) = choice().choose([(swapped(replace(person, covariances=own)),), (), ()], TRUE)
    assert found.covariances[NAMES.index("left_knee"), 0, 0] == 1.0 + NAMES.index("left_knee")
    assert found.covariances[NAMES.index("nose"), 1, 1] == 1.0 + NAMES.index("nose")


def in_the_middle() -> State:
    """A body of which both sides are seen at nearly the same pixels, so that somebody flat is where it is expected."""
    camera = RIG.cameras[0]
    x, y = camera.center[:2]
    return standing(0.0, 0.0, float(np.arctan2(y, x)) + 0.5 * np.pi)


def flat(expected: State) -> Person:
    """Somebody whose left and right are at one place: nothing tells a swap."""
    person = seen_by(RIG, expected)[0]
    return replace(person, pixels=0.5 * (person.pixels + swapped(person).pixels))


def alone() -> PersonChoice:
    return choice(rig=replace(RIG, cameras=RIG.cameras[:1]))


def test_one_camera_alone_is_believed_whatever_the_state_says():
    """It may be the state that is turned about."""
    person, made = swapped(true_people()[0]), alone()
    assert all(made.choose([(person,)], TRUE)[0] is person for _ in range(3))


def test_points_that_jump_from_side_to_side_are_a_swap_in_a_camera_that_is_alone_and_not_for_ever():
    made, person = alone(), true_people()[0]
    exchanged = swapped(person)
    shown = [person] * 60 + [exchanged] * 20 + [person] * 4 + [exchanged] * 80
    said = [made.choose([(each,)], TRUE)[0] is each for each in shown]
    assert said[:84] == [True] * 60 + [False] * 20 + [True] * 4
    assert 20 < said[84:].index(True) <= 60 and all(said[-20:])


def test_a_swap_that_came_unseen_is_over_soon_after_points_have_jumped_back():
    """In between all points are in the middle: nothing tells when they were exchanged, and that they are right is more likely."""
    made, person = alone(), true_people()[0]
    middle = replace(person, pixels=0.5 * (person.pixels + swapped(person).pixels))
    said = [made.choose([(each,)], TRUE)[0] is each for each in [person] * 4 + [middle, swapped(person)] + [person] * 12]
    assert all(said[:6]) and all(said[-6:])


def test_image_sets_are_counted_once_in_which_people_are_seen_but_not_the_body():
    made, elsewhere = choice(), seen_by(RIG, standing(2.0, 0.0, 0.0))
    for n in range(1, 4):
        assert made.choose([(person,) for person in elsewhere], TRUE) == [None] * 3
        assert made.denied_sets(n) == made.denied_sets(n) == n
    made.choose([(person,) for person in elsewhere], TRUE)
    assert made.denied_sets(2) == 3  # gone through again
    made.choose([None, None, None], TRUE)
    assert made.denied_sets(4) == 3  # no detector has looked
    for people in ([(), (), ()], [(true_people()[0],), (elsewhere[1],), ()]):
        made.choose([(person,) for person in elsewhere], TRUE)
        assert made.denied_sets(2**40) > 0
        made.restart()
        made.choose(people, TRUE)
        assert made.denied_sets(9) == 0


@pytest.mark.parametrize("scores", [0.0, 0.02])
def test_somebody_of_whom_no_point_was_found_is_not_seen(scores):
    """Detectors of a single animal send it in every image, hidden or not, with points that were not found."""
    made = choice()
    for n, person in enumerate([(), *seen_by(RIG, standing(2.0, 0.0, 0.0))]):
        people = [(replace(person, scores=np.full(len(NAMES), scores)),) if person else () for _ in RIG.names]
        assert made.choose(people, TRUE) == [None] * 3
        assert made.denied_sets(n) == 0


def test_a_camera_that_was_not_looked_at_keeps_what_is_known_of_its_sides():
    rig = replace(RIG, cameras=RIG.cameras[:1])
    made, person = choice(rig=rig), true_people()[0]
    for people in [(person,)] * 60 + [None]:
        made.choose([people], TRUE)
    assert made.choose([(swapped(person),)], TRUE)[0] is not person
    np.testing.assert_array_equal(made.choose([(swapped(person),)], TRUE)[0].pixels, person.pixels)


def test_a_camera_that_swaps_goes_on_to_swap_for_a_while():
    """Its log odds, ten at most, come down by 0.7 a set to those of before: -2."""
    made, expected = choice(), in_the_middle()
    ambiguous, beside = flat(expected), (seen_by(RIG, expected)[1],)
    assert made.choose([(ambiguous,), (), ()], expected)[0] is ambiguous
    made.choose([(swapped(true_people()[0]),), (), ()], TRUE)
    odds, exchanged = 10.0, []
    for _ in range(8):
        odds = 0.7 * odds - 0.3 * 2.0
        found = made.choose([(ambiguous,), beside, ()], expected)[0]
        exchanged.append(found is not ambiguous)
        assert exchanged[-1] == (odds > 0.0), odds
    assert exchanged == [True] * 5 + [False] * 3
    made.choose([(swapped(true_people()[0]),), (), ()], TRUE)
    made.reset()
    assert made.choose([(ambiguous,), (), ()], expected)[0] is ambiguous


def test_swaps_of_one_camera_are_not_those_of_another():
    made, expected = choice(), in_the_middle()
    made.choose([(), (swapped(true_people()[1]),), ()], TRUE)
    ambiguous = flat(expected)
    assert made.choose([(ambiguous,), (), ()], expected)[0] is ambiguous


def by_hand(person: Person, i: int, expected: State) -> float:
    """Sum over points of score times log of (85 % near, by 10 cm and the covariance; 15 % anywhere in four boxes)."""
    camera, points = RIG.cameras[i], places(expected)
    focal = camera.model.K[0, 0]
    depths = [(camera.T_cam_world @ [*point, 1.0])[2] for point in points]
    sigma_px = 0.10 * focal / np.median(depths)
    left, top, right, bottom = person.box
    total = 0.0
    for name, place in zip(POINTS, points, strict=True):
        row = NAMES.index(name)
        S = person.covariances[row] + sigma_px**2 * np.eye(2)
        e = person.pixels[row] - camera.project(place[None])[0][0]
        density = np.exp(-0.5 * e @ np.linalg.solve(S, e)) / (2.0 * np.pi * np.sqrt(np.linalg.det(S)))
        total += person.scores[row] * np.log(0.85 * density * 4.0 * (right - left) * (bottom - top) + 0.15)
    return total


@pytest.mark.parametrize("i", range(3))
def test_people_are_compared_by_where_their_points_are_expected(i):
    made, rng = choice(), np.random.default_rng(3)
    modality = made._modality
    person = replace(true_people(20.0)[i], scores=rng.uniform(0.2, 1.0, len(NAMES)))
    person = replace(person, covariances=rng.uniform(1.0, 400.0, (len(NAMES), 1, 1)) * np.array([[1.0, 0.3], [0.3, 0.5]]))
    points = modality.places(TRUE)
    camera = RIG.cameras[i]
    depth = np.median((points - camera.center) @ camera.T_world_cam[:3, 2])
    pixels, seen = camera.project(points)
    sigma_px = 0.10 * camera.model.K[0, 0] / depth
    agreement, sure = made._agreement(person, pixels, seen, sigma_px)
    assert agreement == pytest.approx(by_hand(person, i, TRUE))
    assert sure == pytest.approx(sum(person.scores[NAMES.index(name)] for name in POINTS))
    assert made._agreement(person, pixels, np.zeros_like(seen), sigma_px) == (0.0, 0.0)


def test_somebody_is_the_body_as_long_as_that_is_likely_enough():
    """Where exactly the log-likelihood ratio goes through its least as the body is expected farther and farther away."""
    person, taken, ratios = true_people(0.0)[0], [], []
    for x in np.linspace(0.0, 0.6, 31):
        expected = State(TRUE.T_world_root.copy(), TRUE.joint_positions)
        expected.T_world_root[:2, 3] += x * np.array([-np.sin(0.2), np.cos(0.2)])  # across the first camera's sight
        taken.append(choice().choose([(person,), (), ()], expected)[0] is not None)
        ratios.append(max(by_hand(person, 0, expected), by_hand(swapped(person), 0, expected)))
    assert taken == [ratio > _LEAST * len(POINTS) for ratio in ratios]
    assert all(taken[:6]) and not any(taken[20:])  # 10 cm off it is, 40 cm off it is not


@pytest.mark.parametrize("score", [0.2, 0.5])
def test_somebody_whose_points_are_half_hidden_is_the_body_where_they_are_and_is_not_elsewhere(score):
    own, other = (replace(each[0], scores=np.full(len(NAMES), score)) for each in (true_people(), seen_by(RIG, AWAY)))
    assert choice().choose([(other, own), (), ()], TRUE)[0] is own
    assert choice().choose([(other,), (), ()], TRUE)[0] is None


def test_points_that_were_not_found_do_not_matter():
    """Wherever they are, or nowhere."""
    some = without(true_people()[0], ("left_wrist", "nose"))
    elsewhere = replace(some, pixels=np.nan_to_num(some.pixels, nan=-5000.0))
    sure = replace(some, scores=np.where(np.array(NAMES) == "nose", 1.0, some.scores))
    for person in (some, elsewhere, sure):
        assert choice().choose([(person,), (), ()], TRUE)[0] is person


def test_five_hundred_people_do_no_harm():
    rng, camera = np.random.default_rng(2), RIG.cameras[0]
    crowd = [person_at(camera, places(standing(*rng.uniform(0.7, 1.2, 2), rng.uniform(0.0, 6.0)))) for _ in range(500)]
    crowd[333] = true_people()[0]
    assert choice().choose([tuple(crowd), (), ()], TRUE)[0] is crowd[333]


def test_the_beginning_is_that_of_the_start_and_swaps_are_forgotten():
    state, people = posed(1), [(person,) for person in true_people()]
    start = Start(state)
    made = choice(start)
    made._swaps[:] = 9.0
    assert made.find(people) is state and made.find(people, near := np.zeros(3)) is state
    assert start.asked == [(people, None), (people, near)]
    np.testing.assert_array_equal(made._swaps, -2.0)


def with_exchanged(person: Person, *joints: str) -> Person:
    """The person with left and right of these joints alone exchanged."""
    other, rows = swapped(person), [NAMES.index(f"{side}_{joint}") for joint in joints for side in ("left", "right")]
    pixels, covariances, scores = person.pixels.copy(), person.covariances.copy(), person.scores.copy()
    pixels[rows], covariances[rows], scores[rows] = other.pixels[rows], other.covariances[rows], other.scores[rows]
    return replace(person, pixels=pixels, covariances=covariances, scores=scores)


def test_single_joints_that_one_camera_has_exchanged_are_exchanged_back():
    people = true_people()
    covariances = np.arange(1.0, len(NAMES) + 1.0)[:, None, None] * np.eye(2)
    people[2] = replace(people[2], covariances=covariances, scores=np.linspace(0.9, 1.0, len(NAMES)))
    found = choice().choose([(people[0],), (people[1],), (with_exchanged(people[2], "shoulder", "elbow"),)], TRUE)
    for name in ("pixels", "covariances", "scores"):
        np.testing.assert_array_equal(getattr(found[2], name), getattr(people[2], name))
    assert found[0] is people[0] and found[1] is people[1]


def test_joints_that_all_cameras_have_exchanged_stay():
    """The body may be so, and what is expected wrong."""
    people = tuple((with_exchanged(person, "knee"),) for person in true_people())
    assert list(choice().choose(people, TRUE)) == [person for (person,) in people]


def test_a_pair_is_exchanged_where_it_costs_four_less(monkeypatch):
    """Half squares up to three standard deviations, of the covariance and of 5 cm, and linear from there, times the scores."""
    made, person = choice(), replace(true_people()[0], scores=np.full(len(NAMES), 0.8))
    expected = made._modality.places(TRUE)
    camera = RIG.cameras[0]
    depth = np.median((expected - camera.center) @ camera.T_world_cam[:3, 2])
    variance = (0.05 * camera.model.K[0, 0] / depth) ** 2
    points = list(made._modality.names)
    pixels, _ = camera.project(expected)
    gains = made._pair_gains(0, person, expected)

    def cost(name: str, place: str) -> float:
        row = NAMES.index(name)
        e = person.pixels[row] - pixels[points.index(place)]
        far = float(np.sqrt(e @ np.linalg.solve(person.covariances[row] + variance * np.eye(2), e)))
        return 0.8 * (0.5 * far**2 if far < 3.0 else 3.0 * far - 4.5)

    for joint in ("shoulder", "hip", "ankle"):
        one, other = f"left_{joint}", f"right_{joint}"
        gain = cost(one, one) + cost(other, other) - cost(one, other) - cost(other, one)
        assert gains[[points.index(one), points.index(other)]] == pytest.approx([gain, gain])
    assert gains[points.index("nose")] == 0.0
    for gain, exchanged in ((3.9, False), (4.1, True)):
        told = {0: np.where(np.isin(points, ["left_hip", "right_hip"]), gain, 0.0), 1: np.full(len(points), -5.0)}
        monkeypatch.setattr(made, "_pair_gains", lambda i, *_, told=told: told.get(i, np.zeros(len(points))))
        (found, *_) = made.choose([(person,), (), ()], TRUE)
        assert (found is not person) == exchanged
