"""Points in messages as a tracker uses them: whatever another program sends, and with the images of a set."""

from types import SimpleNamespace

import numpy as np
import pytest

from tracker_node.errors import CalibrationError
from tracker_node.loaders.bag.message_types import KEYPOINTS, message_of, stamp_ns_of
from tracker_node.observation.image_set import CameraImage
from tracker_node.observation.keypoints.blazepose import NAMES
from tracker_node.observation.keypoints.crop import Crop
from tracker_node.observation.keypoints.people import Person, Silhouette
from tracker_node.runs.messages import crops, crops_in, keypoints
from tracker_node.runs.messages.people import MOST_PEOPLE, detected_people, with_known_names, with_people

STAMP_NS = 3_000_000_005


def person(names=NAMES, score=0.9, silhouette=None, seed=0):
    rng = np.random.default_rng(seed)
    n = len(names)
    covariances = np.tile(np.array([[4.0, 1.0], [1.0, 9.0]]), (n, 1, 1))
    return Person(names, rng.uniform(0, 100, (n, 2)), covariances, np.full(n, 0.8), score, (1.0, 2.0, 90.0, 95.0), silhouette)


def message(*people, camera="cam01"):
    image = CameraImage(camera, STAMP_NS, np.zeros((120, 160, 3), np.uint8), people=people)
    return message_of(KEYPOINTS, keypoints(image, "frame"))


def test_what_blazepose_says_is_taken_as_it_is():
    detected = detected_people(message(person(), person(seed=1)))
    assert (detected.stamp_ns, detected.notes, len(detected.people)) == (STAMP_NS, (), 2)
    assert np.array_equal(detected.people[1].pixels, person(seed=1).pixels)


def test_of_five_hundred_people_the_likeliest_are_used():
    detected = detected_people(message(*(person(score=i / 500) for i in range(500))))
    assert [p.score for p in detected.people] == [i / 500 for i in range(499, 499 - MOST_PEOPLE, -1)]
    assert f"{MOST_PEOPLE} of 500" in detected.notes[0]


def test_names_that_the_body_lacks_are_told():
    detected = with_known_names(detected_people(message(person(("tail", "left_wrist")))), NAMES, "cam01")
    assert detected.notes == ("names that the body lacks are left out: tail",)
    assert not with_known_names(detected_people(message(person())), NAMES, "cam01").notes
    assert not with_known_names(detected_people(message()), NAMES, "cam01").people


@pytest.mark.parametrize("names", [("tail",), ("a", "b")])
def test_points_without_a_known_name_are_refused(names):
    with pytest.raises(CalibrationError, match=r"cam01.*no point has a name"):
        with_known_names(detected_people(message(person(names))), NAMES, "cam01")


def test_points_that_are_not_finite_are_not_found():
    wrong = person()
    wrong.pixels[3] = np.nan
    wrong.covariances[5] = np.inf
    (found,) = detected_people(message(wrong)).people
    assert np.isfinite(found.pixels).all() and np.flatnonzero(found.scores == 0).tolist() == [3, 5]


def test_a_message_that_contradicts_itself_is_refused():
    broken = message(person())
    broken.persons[0].u = broken.persons[0].u[:-1]
    with pytest.raises(CalibrationError, match=r"cam01.*33"):
        detected_people(broken)


def test_late_points_keep_their_stamp_and_points_in_time_have_none():
    detected = detected_people(message(person()))
    image = CameraImage("cam01", STAMP_NS, np.zeros((120, 160, 3), np.uint8))
    assert with_people(image, detected).people_stamp_ns is None
    later = CameraImage("cam01", STAMP_NS + 1, image.pixels)
    assert with_people(later, detected).people_stamp_ns == STAMP_NS


@pytest.mark.parametrize("origin, fits", [((0, 0), True), ((150, 0), False), ((0, 100), False)])
def test_a_silhouette_beyond_the_image_is_left_out(origin, fits):
    detected = detected_people(message(person(silhouette=Silhouette(np.full((30, 20), 200, np.uint8), origin))))
    (found,) = with_people(CameraImage("cam01", STAMP_NS, np.zeros((120, 160, 3), np.uint8)), detected).people
    assert (found.silhouette is not None) == fits


def test_crops_there_and_back():
    squares = [Crop((10.0, 20.0), 80.0, 0.3), None]
    content = crops(STAMP_NS, "world", ("a", "b"), squares)
    read = SimpleNamespace(**{name: value for name, value in content.items() if name != "header"})
    assert crops_in(read) == {"a": squares[0]}
    read.angle[0] = float("nan")
    assert crops_in(read) == {}
    assert stamp_ns_of(message(person()).header.stamp) == STAMP_NS
