"""The same people in several cameras, by points that meet in space."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import NAMES, POINTS, ROWS, person_at, places, posed, seen_by, standing, swapped, without
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.camera.rig import CameraRig
from tracker_node.observation.keypoints.people import Person
from tracker_node.tracking.keypoints.people_groups import grouped, mirrored

RIG = circle_rig(3)
ONE = standing(-0.3, 0.4, 0.6, left_shoulder_elevation_front=50.0, right_hip_flexion=30.0)
OTHER = standing(0.6, -0.3, 2.0, right_shoulder_elevation_front=70.0, left_knee_flexion=40.0)


def noisy(state, seed: int = 1, sigma_px: float = 1.5, rig: CameraRig = RIG) -> list[Person]:
    return seen_by(rig, state, np.random.default_rng(seed), sigma_px)


def same(one: Person | None, other: Person | None) -> bool:
    return one is other if one is None or other is None else np.array_equal(one.pixels, other.pixels)


def test_mirrored_people_have_their_sides_exchanged():
    person = noisy(ONE)[0]
    person = replace(person, scores=np.arange(33.0), covariances=np.arange(33.0)[:, None, None] * np.eye(2))
    found, expected = mirrored(person), swapped(person)
    for field in ("pixels", "covariances", "scores"):
        np.testing.assert_array_equal(getattr(found, field), getattr(expected, field))
    assert found.names == NAMES and found.box == person.box


@pytest.mark.parametrize("orders", [(0, 0, 0), (0, 1, 0), (1, 0, 1), (1, 1, 0)])
def test_two_people_in_three_cameras(orders):
    one, other = noisy(ONE, 1), noisy(OTHER, 2)
    people = [(a, b) if order == 0 else (b, a) for a, b, order in zip(one, other, orders, strict=True)]
    groups = grouped(RIG, people)
    assert [group.count for group in groups] == [3, 3]
    sizes = [sum(max(p.box[2] - p.box[0], p.box[3] - p.box[1]) for p in persons) for persons in (one, other)]
    first, second = (one, other) if sizes[0] > sizes[1] else (other, one)
    for group, persons in zip(groups, (first, second), strict=True):
        assert all(same(a, b) for a, b in zip(group.persons, persons, strict=True))
    assert [group.size_px for group in groups] == pytest.approx(sorted(sizes, reverse=True))


def test_points_are_where_the_body_has_them():
    (group,) = grouped(RIG, [(person,) for person in noisy(ONE, sigma_px=0.0)])
    np.testing.assert_allclose(group.points[ROWS], places(ONE), atol=1e-6)
    assert np.isnan(np.delete(group.points, ROWS, axis=0)).all()
    assert group.misfit < 1e-9


def test_points_that_one_camera_is_sure_of_are_nowhere():
    people = noisy(ONE, sigma_px=0.0)
    for i in (0, 1):
        scores = people[i].scores.copy()
        scores[NAMES.index("left_knee")] = 0.49
        people[i] = replace(people[i], scores=scores)
    (group,) = grouped(RIG, [(person,) for person in people])
    assert np.isnan(group.points[NAMES.index("left_knee")]).all()
    scores[NAMES.index("left_knee")] = 0.5
    (group,) = grouped(RIG, [(people[0],), (replace(people[1], scores=scores),), (people[2],)])
    np.testing.assert_allclose(group.points[NAMES.index("left_knee")], places(ONE)[POINTS.index("left_knee")], atol=1e-6)


def test_near_cameras_count_more_where_rays_miss_each_other():
    """By the inverse square of the person's size in the image: ten times as large, a hundredth of the say."""
    people = noisy(ONE, sigma_px=0.0)
    off = replace(people[2], pixels=people[2].pixels + np.array([4.0, 0.0]))
    wide = replace(off, box=tuple(10.0 * x for x in off.box))
    (equal,), (hardly,) = (grouped(RIG, [(people[0],), (people[1],), (person,)]) for person in (off, wide))
    near, far = (np.linalg.norm(group.points[ROWS] - places(ONE), axis=1).mean() for group in (hardly, equal))
    assert near < 0.05 * far


def test_the_misfit_is_that_of_the_worst_camera_as_a_fraction_of_the_persons_size():
    """Two cameras that see a person from afar at 90 degrees; one has them 5 pixels too high, so each is 2.5 off."""
    people = noisy(ONE, sigma_px=0.0)
    high = replace(people[1], pixels=people[1].pixels + np.array([0.0, 5.0]))
    (group,) = grouped(RIG, [(people[0],), (high,), ()])
    misfits = []
    for i, person in ((0, people[0]), (1, high)):
        pixels = RIG.cameras[i].project(group.points[ROWS])[0]
        size = max(person.box[2] - person.box[0], person.box[3] - person.box[1])
        misfits.append(np.median(np.linalg.norm(pixels - person.pixels[ROWS], axis=1)) / size)
    assert group.misfit == pytest.approx(max(misfits)) and 0.001 < group.misfit < 0.01


def test_left_and_right_are_exchanged_where_one_camera_disagrees_with_two():
    people = noisy(ONE)
    for wrong in range(3):
        given = [swapped(person) if i == wrong else person for i, person in enumerate(people)]
        (group,) = grouped(RIG, [(person,) for person in given])
        as_found = [same(a, b) for a, b in zip(group.persons, people, strict=True)]
        assert as_found in ([True] * 3, [False] * 3)  # all three alike: the fit tells the front from the back
        if as_found == [False] * 3:
            assert all(same(a, swapped(b)) for a, b in zip(group.persons, people, strict=True))
        assert group.n_exchanged == (1 if all(as_found) else 2)
        other = group.exchanged()
        assert other.n_exchanged == 3 - group.n_exchanged and other.misfit == group.misfit
        assert all(same(a, swapped(b)) for a, b in zip(other.persons, group.persons, strict=True))
        left, right = NAMES.index("left_knee"), NAMES.index("right_knee")
        np.testing.assert_array_equal(other.points[[left, right]], group.points[[right, left]])


def test_somebody_whom_one_camera_does_not_see_is_the_second():
    one, other = noisy(ONE, 1), noisy(OTHER, 2)
    groups = grouped(RIG, [(one[0],), (one[1], other[1]), (other[2], one[2])])
    assert [group.count for group in groups] == [3, 2]
    assert groups[1].persons[0] is None and same(groups[1].persons[1], other[1]) and same(groups[1].persons[2], other[2])
    assert same(groups[0].persons[2], one[2])


def test_different_people_do_not_meet():
    """Rays of points of two people on one floor may miss each other by little, but not where one stands on a box."""
    above = standing(0.6, -0.3, 2.0)
    above.T_world_root[2, 3] += 0.5
    one, other = noisy(ONE, 1), noisy(above, 2)
    assert grouped(RIG, [(one[0],), (other[1],), ()]) == []


def test_one_camera_or_nobody_makes_no_group():
    one, other = noisy(ONE, 1), noisy(OTHER, 2)
    assert grouped(RIG, [(one[0], other[0]), (), None]) == [] and grouped(RIG, [None, None, None]) == []


def test_cameras_at_one_place_do_not_tell_how_far_anybody_is():
    first = RIG.cameras[0]
    rig = CameraRig((first, replace(first, name="beside")))
    assert grouped(rig, [(person,) for person in noisy(ONE, sigma_px=0.0, rig=rig)]) == []


@pytest.mark.parametrize(("known", "groups"), [(6, 1), (5, 0)])
def test_two_cameras_need_six_points_in_common(known, groups):
    people = noisy(ONE, sigma_px=0.0)
    scores = np.zeros(33)
    scores[ROWS[:known]] = 1.0
    assert len(grouped(RIG, [(people[0],), (replace(people[1], scores=scores),), ()])) == groups


def test_points_of_other_detectors_are_not_compared():
    people = noisy(ONE, sigma_px=0.0)
    renamed = replace(people[1], names=tuple(f"{name}_" for name in NAMES))
    assert grouped(RIG, [(people[0],), (renamed,), ()]) == []


def test_outliers_of_a_camera_do_not_part_a_group():
    people, rng = noisy(ONE), np.random.default_rng(4)
    for i, person in enumerate(people):
        pixels = person.pixels.copy()
        pixels[rng.choice(ROWS, 4, replace=False)] += rng.uniform(-200.0, 200.0, (4, 2))
        people[i] = replace(person, pixels=pixels)
    (group,) = grouped(RIG, [(person,) for person in people])
    assert group.count == 3


def test_nobody_is_in_two_groups():
    """Twins of one score and one box: both go with the first group that takes one of them."""
    people = [noisy(posed(seed), seed) for seed in range(3)]
    lists = [tuple(persons[i] for persons in people) for i in range(3)]
    groups = grouped(RIG, lists)
    for i in range(3):
        used = [group.persons[i].box for group in groups if group.persons[i] is not None]
        assert len(used) == len(set(used)) <= 3


def test_a_person_is_as_large_as_the_longer_side_of_the_box():
    camera = RIG.cameras[0]
    person = person_at(camera, places(ONE))
    wide = replace(person, box=(0.0, 0.0, 300.0, 100.0))
    (group,) = grouped(RIG, [(wide,), (noisy(ONE, sigma_px=0.0)[1],), ()])
    other = noisy(ONE, sigma_px=0.0)[1].box
    assert group.size_px == pytest.approx(300.0 + max(other[2] - other[0], other[3] - other[1]))


def test_people_of_one_box_are_told_apart_by_their_scores_and_of_one_score_by_their_boxes():
    one, other = noisy(ONE, 1), noisy(OTHER, 2)
    boxed = [replace(b, box=a.box, score=0.9) for a, b in zip(one, other, strict=True)]
    for second in (boxed, other):
        groups = grouped(RIG, list(zip(one, second, strict=True)))
        assert [group.count for group in groups] == [3, 3]


def test_points_that_are_not_numbers_meet_nowhere():
    people = [without(person, ("left_wrist",)) for person in noisy(ONE, sigma_px=0.0)]
    for given in (people, [replace(person, scores=np.ones(33) * np.isin(np.arange(33), ROWS)) for person in people]):
        (group,) = grouped(RIG, [(person,) for person in given])
        assert np.isnan(group.points[NAMES.index("left_wrist")]).all() and group.count == 3
        np.testing.assert_allclose(group.points[NAMES.index("left_elbow")], places(ONE)[POINTS.index("left_elbow")], atol=1e-6)


def test_of_many_people_in_an_image_the_six_surest_and_largest_are_looked_at():
    """Hundreds of others are small, or hardly anybody."""
    rng, one = np.random.default_rng(3), noisy(ONE)
    crowd = []
    for camera, person in zip(RIG, one, strict=True):
        others = [person_at(camera, rng.uniform([-1, -1, 0.2], [1, 1, 1.9], (len(POINTS), 3)), score=0.05) for _ in range(500)]
        crowd.append((*others[:250], person, *others[250:]))
    first = grouped(RIG, crowd)[0]
    assert all(a is b for a, b in zip(first.persons, one, strict=True))
    large = [replace(person, score=1.0, box=(0.0, 0.0, 900.0, 900.0)) for person in crowd[0][:5]]
    assert (
        grouped(RIG, [(*large, one[0]), (one[1],), ()]) != [] and grouped(RIG, [(*large, large[0], one[0]), (one[1],), ()]) == []
    )
