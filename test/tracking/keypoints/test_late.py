"""Points of earlier images are moved by the body's motion since, and not by what points have corrected."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.blazepose import NAMES
from tracker_node.observation.keypoints.people import Person, Silhouette
from tracker_node.tracking.keypoints.late import LatePoints, _Projector

HUMAN, RIG = human_model(), circle_rig(3)
PERIOD_NS = 33_333_333
PIXELS = np.zeros((4, 4, 3), np.uint8)


def state(i: float) -> State:
    """The body at image i: it accelerates, and bends."""
    delta = np.zeros(HUMAN.n_dof)
    delta[0], delta[7] = 0.002 * i * i, 0.03 * i
    return State.neutral(HUMAN).retract(delta)


def seen(i: float) -> list[Person]:
    """The body at image i in each camera, without error; points that the body does not have are at the origin."""
    projector, people = _Projector(RIG, HUMAN, BLAZEPOSE), []
    for pixels in projector.project(state(i))[0]:
        own = dict(zip(projector.names, pixels, strict=True))
        points = np.array([own.get(name, np.zeros(2)) for name in NAMES])
        covariances = np.tile(np.eye(2), (len(NAMES), 1, 1))
        mask = Silhouette(np.zeros((3, 3), np.uint8), (0, 0))
        people.append(Person(NAMES, points, covariances, np.ones(len(NAMES)), 1.0, (0.0, 0.0, 100.0, 200.0), mask))
    return people


def image_set(i: int, of: int | None = None) -> ImageSet:
    """Image set i with the points of image ``of``."""
    people = [None] * len(RIG) if of is None else [(person,) for person in seen(of)]
    late_ns = None if of in (None, i) else of * PERIOD_NS
    stamp_ns = i * PERIOD_NS
    images = (CameraImage(n, stamp_ns, PIXELS, people=p, people_stamp_ns=late_ns) for n, p in zip(RIG.names, people, strict=True))
    return ImageSet(stamp_ns, tuple(images))


def own_rows() -> list[int]:
    return [NAMES.index(name) for name in _Projector(RIG, HUMAN, BLAZEPOSE).names]


@pytest.fixture
def late() -> LatePoints:
    """Has followed the body from image 0 to 9."""
    late = LatePoints(RIG, HUMAN, BLAZEPOSE)
    for i in range(10):
        late.add(i * PERIOD_NS, state(i), state(i), corrected=False)
    return late


def test_points_in_time_stay_as_they_are(late):
    given = image_set(10, 10)
    assert late.brought(given, state(10)) == [image.people for image in given.images]


def test_images_without_points_have_none(late):
    assert late.brought(image_set(10), state(10)) == [None] * len(RIG)


@pytest.mark.parametrize("of", [2, 9])
def test_late_points_are_where_the_body_is_now(late, of):
    for people, expected in zip(late.brought(image_set(10, of), state(10)), seen(10), strict=True):
        assert np.allclose(people[0].pixels[own_rows()], expected.pixels[own_rows()], atol=1e-6)
        assert people[0].silhouette is None


def test_the_later_and_the_farther_the_less_they_say(late):
    spreads = [np.trace(late.brought(image_set(10, of), state(10))[0][0].covariances[own_rows()[0]]) for of in (9, 6, 2)]
    assert 2.0 < spreads[0] < spreads[1] < spreads[2]


def test_what_points_have_corrected_is_no_motion():
    """The tracker was 10 cm off until points put it right; others of before that are on their way, and are moved by 2 cm."""
    late, at_rest = LatePoints(RIG, HUMAN, BLAZEPOSE), State.neutral(HUMAN)
    moved, right = np.zeros(HUMAN.n_dof), np.zeros(HUMAN.n_dof)
    moved[0], right[0] = 0.02, 0.12
    late.add(0, at_rest, at_rest, corrected=False)
    late.add(PERIOD_NS, at_rest.retract(moved), at_rest.retract(right), corrected=True)
    (before,), *_ = late.brought(image_set(2, 2), at_rest.retract(right))
    (after,), *_ = late.brought(image_set(2, 0), at_rest.retract(right))
    first = seen(0)[0].pixels
    projector = _Projector(RIG, HUMAN, BLAZEPOSE)
    true = projector.project(at_rest.retract(moved))[0][0] - projector.project(at_rest)[0][0]
    assert np.allclose(after.pixels[own_rows()] - first[own_rows()], true, atol=1e-6)
    assert before.silhouette is not None


def test_before_anything_is_known_points_stay_where_they_are():
    late = LatePoints(RIG, HUMAN, BLAZEPOSE)
    (person,), *_ = late.brought(image_set(10, 4), state(10))
    assert np.array_equal(person.pixels, seen(4)[0].pixels) and np.trace(person.covariances[0]) > 2.0


@pytest.mark.parametrize("names", [("left_wrist", "tail"), ("left_wrist", "left_paw"), ("tail",)])
def test_points_that_the_detector_lacks_are_not_found_and_others_left_out(late, names):
    """Both sides of every point are there: a detector may take one for the other."""
    n = len(names)
    person = Person(names, np.full((n, 2), 7.0), np.tile(np.eye(2), (n, 1, 1)), np.ones(n), 1.0, (0.0, 0.0, 9.0, 9.0))
    image = CameraImage(RIG.names[0], 10 * PERIOD_NS, PIXELS, people=(person,))
    (found,) = late.brought(ImageSet(image.stamp_ns, (image,)), state(10))[0]
    assert {"left_wrist", "right_wrist", "nose"} <= set(found.names) and not {"tail", "left_paw"} & set(found.names)
    seen = {name for name, score in zip(found.names, found.scores, strict=True) if score > 0.0}
    assert seen == {"left_wrist"} & set(names)
