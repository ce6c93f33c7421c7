"""People of an image made of what files tell: covariances from scores, boxes, resampled images."""

import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.keypoints.camera_people import (
    MOST_IMAGES,
    MOST_PEOPLE,
    CameraPeople,
    CovarianceRule,
    FoundPerson,
    PeopleOfImages,
    found_points,
)

POINTS = np.array([[100.0, 200.0, 1.0], [140.0, 300.0, 0.5], [0.0, 0.0, 0.0]])


def people(points=POINTS, **changes) -> CameraPeople:
    return CameraPeople("cam1", ("a", "b", "c"), {3: (FoundPerson(points),)}, **changes)


def test_covariances_are_shares_of_the_size_that_fall_with_the_score():
    person = people()[3][0]
    height = 100.0 + 2.0 * 10.0  # points, and a tenth of the longer side around them
    assert person.box == (90.0, 190.0, 150.0, 310.0)
    np.testing.assert_allclose(person.covariances[0], np.eye(2) * (0.01 * height) ** 2)
    np.testing.assert_allclose(person.covariances[1], np.eye(2) * (0.03 * height) ** 2)
    np.testing.assert_allclose(person.pixels[2], [120.0, 250.0])  # not found: somewhere finite
    assert person.scores.tolist() == [1.0, 0.5, 0.0] and person.score == 0.75
    rule = CovarianceRule(0.2, 0.1, least_px=15.0)
    np.testing.assert_allclose(rule.sigma_px(np.array([0.0, 0.5, 1.0]), 100.0), [20.0, 15.0, 15.0])


def test_a_box_of_the_file_says_the_size():
    found = FoundPerson(POINTS, 0.4, (0.0, 0.0, 300.0, 400.0))
    person = CameraPeople("cam1", ("a", "b", "c"), {0: (found,)})[0][0]
    assert person.box == (0.0, 0.0, 300.0, 400.0) and person.score == 0.4
    np.testing.assert_allclose(person.covariances[0, 0, 0], 4.0**2)


def test_pixels_of_images_that_are_made_smaller():
    """Pixel centers are integers: the edge of the image at -0.5 stays there."""
    person = people().for_images(640, 480, (320, 240))[3][0]
    np.testing.assert_allclose(person.pixels[0], [(100.0 + 0.5) / 2 - 0.5, (200.0 + 0.5) / 2 - 0.5])
    np.testing.assert_allclose(person.box[3] - person.box[1], 60.0)


def test_shares_of_an_image():
    shares = POINTS / [640.0, 480.0, 1.0]
    at_once = people(shares, normalized=True).for_images(640, 480, (320, 240))[3][0]
    np.testing.assert_allclose(at_once.pixels[0], [49.5, 99.5])
    with pytest.raises(ValueError, match="shares"):
        people(shares, normalized=True)[3]


def test_nobody_without_a_point():
    assert people(np.zeros((3, 3)))[3] == ()
    assert list(people()) == [3] and len(people()) == 1


def test_points_that_are_missing_or_beyond():
    points = found_points(np.array([[1.0, 2.0, 1.7], [np.nan, 2.0, 0.5], [1.0, 2.0, np.nan], [3.0, 4.0, -1.0]]), "f", "x")
    np.testing.assert_array_equal(points, [[1.0, 2.0, 1.0], [0.0] * 3, [0.0] * 3, [0.0] * 3])
    for value in (np.inf, 2e6):
        with pytest.raises(FileFormatError, match="f: field 'x': expected u, v, score of a point, finite"):
            found_points(np.array([[1.0, value, 0.5]]), "f", "x")


def test_limits():
    images, person = PeopleOfImages("f"), FoundPerson(POINTS)
    for _ in range(MOST_PEOPLE):
        images.add(0, person, "f", "people")
    with pytest.raises(FileFormatError, match="at most 1000 people in one image"):
        images.add(0, person, "f", "people")
    with pytest.raises(FileFormatError, match=r"as many for each person \(3\), got '2 points'"):
        images.add(1, FoundPerson(POINTS[:2]), "f", "people")
    with pytest.raises(FileFormatError, match="at most 1000 points"):
        PeopleOfImages("f").add(0, FoundPerson(np.zeros((1001, 3))), "f", "people")
    for number in (-1, MOST_IMAGES):
        with pytest.raises(FileFormatError, match="the number of an image"):
            images.look(number, "f", "frame")


def test_five_hundred_people():
    images = PeopleOfImages("f")
    for i in range(500):
        images.add(0, FoundPerson(POINTS + np.array([i, 0.0, 0.0])), "f", "people")
    assert len(images.camera(("a", "b", "c"))[0]) == 500
