"""People as values, and what of them is impossible."""

from dataclasses import replace

import numpy as np
import pytest

from tracker_node.observation.keypoints.people import Person, checked

NAMES = ("nose", "left_knee", "right_knee")
GOOD = Person(
    NAMES, np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), np.tile(np.array([[4.0, 1.0], [1.0, 2.0]]), (3, 1, 1)),
    np.array([0.9, 1.0, 0.0]), 0.8, (0.0, 1.0, 6.0, 7.0),
)  # fmt: skip


@pytest.mark.parametrize(
    "wrong",
    [{"pixels": np.zeros((2, 2))}, {"covariances": np.zeros((3, 2))}, {"scores": np.zeros(4)}, {"names": NAMES[:2]}],
    ids=lambda wrong: next(iter(wrong)),
)
def test_each_point_has_a_place_a_covariance_and_a_score(wrong):
    with pytest.raises(ValueError, match="expected pixels, covariances, scores of shapes"):
        replace(GOOD, **wrong)


def test_a_skeleton_has_a_place_for_each_point():
    with pytest.raises(ValueError, match=r"expected a skeleton of shape \(n, 3\), got \(3,\)"):
        replace(GOOD, skeleton=np.zeros(3))


@pytest.mark.parametrize("value", [np.inf, np.nan, -2e3])
def test_an_impossible_place_in_a_skeleton_is_not_guessed(value):
    skeleton = np.arange(9.0).reshape(3, 3)
    skeleton[1, 2] = value
    found = checked(replace(GOOD, skeleton=skeleton)).skeleton
    assert found is not None and np.isnan(found[1]).all()
    np.testing.assert_array_equal(found[[0, 2]], skeleton[[0, 2]])
    assert checked(GOOD).skeleton is None


def test_a_person_of_no_points_is_one():
    nobody = Person((), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), 1.0, (0.0, 0.0, 1.0, 1.0))
    assert nobody.silhouette is None


def test_what_is_possible_stays_as_it_is():
    found = checked(GOOD)
    for field in ("pixels", "covariances", "scores"):
        np.testing.assert_array_equal(getattr(found, field), getattr(GOOD, field))
    assert (found.score, found.box, found.names) == (GOOD.score, GOOD.box, NAMES)


def changed(field: str, index, value: float) -> Person:
    array = getattr(GOOD, field).copy()
    array[index] = value
    return replace(GOOD, **{field: array})


IMPOSSIBLE = [
    ("pixels", (1, 0), np.nan), ("pixels", (1, 1), -np.inf), ("pixels", (1, 1), 2e6), ("pixels", (1, 0), -2e6),
    ("covariances", (1, 0, 0), -1.0), ("covariances", (1, 1, 1), -1.0), ("covariances", (1, 0, 1), 2.9),
    ("covariances", (1, 1, 0), np.nan), ("covariances", (1, 0, 0), np.inf), ("scores", 1, 1.1),
    ("scores", 1, -0.1), ("scores", 1, np.nan),
]  # fmt: skip


@pytest.mark.parametrize(("field", "index", "value"), IMPOSSIBLE)
def test_an_impossible_point_is_as_if_it_had_not_been_found_and_the_others_stay(field, index, value):
    found = checked(changed(field, index, value))
    assert found.scores.tolist() == [0.9, 0.0, 0.0] and found.pixels[1].tolist() == [0.0, 0.0]
    np.testing.assert_array_equal(found.covariances[1], np.eye(2))
    np.testing.assert_array_equal(found.pixels[[0, 2]], GOOD.pixels[[0, 2]])
    np.testing.assert_array_equal(found.covariances[[0, 2]], GOOD.covariances[[0, 2]])


@pytest.mark.parametrize(
    ("field", "index", "value"),
    [("pixels", (1, 0), 9e5), ("covariances", (1, 0, 0), 0.5), ("covariances", (1, 0, 1), -np.sqrt(8.0)), ("scores", 1, 0.0)],
)
def test_what_is_hardly_possible_is_possible(field, index, value):
    given = changed(field, index, value)
    np.testing.assert_array_equal(checked(given).pixels, given.pixels)
    assert checked(given).scores[1] == given.scores[1]


def test_covariances_are_symmetric_afterwards():
    assert checked(changed("covariances", (1, 1, 0), 0.7)).covariances[1].tolist() == [[4.0, 1.0], [1.0, 2.0]]


@pytest.mark.parametrize("wrong", [{"score": np.nan}, {"box": (0.0, np.inf, 1.0, 1.0)}, {"names": ("nose", "nose", "left_knee")}])
def test_a_person_without_a_place_or_with_a_point_twice_is_refused(wrong):
    with pytest.raises(ValueError, match=r"finite numbers for score and box|each name of a point once"):
        checked(replace(GOOD, **wrong))


@pytest.mark.parametrize("box", [(0.0, 0.0, 0.0, 0.0), (50.0, 10.0, 20.0, 90.0)])
def test_a_box_that_is_none_is_that_of_the_points(box):
    seen = GOOD.pixels[GOOD.scores > 0.0]
    left, top, right, bottom = checked(replace(GOOD, box=box)).box
    assert left < seen[:, 0].min() and right > seen[:, 0].max() and top < seen[:, 1].min() and bottom > seen[:, 1].max()
    assert right - left < 2.0 * max(np.ptp(seen, axis=0))
    assert checked(replace(GOOD, box=box, scores=np.zeros(3))).box == box


def test_points_that_are_shares_of_the_image_are_refused():
    with pytest.raises(ValueError, match="expected pixels, got points between 0 and 1"):
        checked(replace(GOOD, pixels=np.array([[0.2, 0.1], [0.5, 0.4], [0.9, 1.0]])))
