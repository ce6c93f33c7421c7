"""Image sets are kept for points that come later, which find theirs again."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.people import Person
from tracker_node.tracking.config import MotionConfig
from tracker_node.tracking.keypoints import late as module
from tracker_node.tracking.keypoints.late import LatePoints, PastSet
from tracker_node.tracking.motion.model import MotionModel

HUMAN, RIG = human_model(), circle_rig(3)
PERIOD_NS = 33_333_333
PIXELS = np.zeros((4, 4, 3), np.uint8)
MOTION = MotionModel(HUMAN.chain, MotionConfig())


def person(*names: str, at: float = 7.0) -> Person:
    n = len(names)
    return Person(names, np.full((n, 2), at), np.tile(np.eye(2), (n, 1, 1)), np.ones(n), 1.0, (0.0, 0.0, 9.0, 9.0))


def image_set(i: float, of: float | None = None, cameras: int = 3) -> ImageSet:
    """Image set i with a person in each camera, found in image ``of``; None: nobody has looked."""
    late_ns = None if of in (None, i) else round(of * PERIOD_NS)
    stamp_ns = round(i * PERIOD_NS)
    people = None if of is None else (person("left_wrist", at=of),)
    images = [CameraImage(name, stamp_ns, PIXELS, people=people, people_stamp_ns=late_ns) for name in RIG.names[:cameras]]
    return ImageSet(stamp_ns, tuple(images))


def past(i: float, of: float | None = None) -> PastSet:
    return PastSet(image_set(i, of), [], MOTION)


@pytest.fixture
def late() -> LatePoints:
    """Has seen image sets 0 to 9."""
    made = LatePoints(RIG, HUMAN, BLAZEPOSE)
    for i in range(10):
        made.add(past(i))
    return made


def numbers(sets: list[PastSet]) -> list[int]:
    return [round(each.image_set.stamp_ns / PERIOD_NS) for each in sets]


def test_points_in_time_are_those_of_the_images_alone(late):
    assert late.in_time(image_set(10)) == late.in_time(image_set(10, 9)) == [None] * 3
    assert [len(people) for people in late.in_time(image_set(10, 10))] == [1] * 3
    assert late.since(image_set(10)) == late.since(image_set(10, 10)) == []


def test_late_points_are_those_of_their_set_and_the_sets_since_come_with_it(late):
    found = late.since(image_set(10, 6))
    assert numbers(found) == [6, 7, 8, 9] and numbers(late.since(image_set(10, 2))) == [2, 3, 4, 5]
    for people in found[0].people:
        assert (people[0].pixels[people[0].scores > 0.0] == 6.0).all()
    assert list(found[1].people) == []


def test_a_camera_without_late_points_keeps_those_that_it_had():
    made = LatePoints(RIG, HUMAN, BLAZEPOSE)
    had = [(person("nose"),)] * 3
    made.add(PastSet(image_set(0), had, MOTION))
    found = made.since(image_set(1, 0, cameras=2))[0].people
    assert "left_wrist" in found[0][0].names and found[2] is had[2]


@pytest.mark.parametrize(("of", "expected"), [(6.4, 6), (5.6, 6), (-0.6, None), (-40, None)])
def test_the_set_of_the_nearest_stamp_is_theirs_within_half_of_the_time_between_sets(late, of, expected):
    found = numbers(late.since(image_set(10, of)))
    assert (found[0] if found else None) == expected


def test_sets_are_kept_for_a_second_and_for_so_many_bytes(late, monkeypatch):
    for i in range(10, 60):
        late.add(past(i))
    assert late.since(image_set(60, 20)) == []
    assert numbers(late.since(image_set(60, 30)))[0] == 30
    for i in range(30, 60):
        late.add(past(i))
    monkeypatch.setattr(module, "_MOST_BYTES", 4 * 3 * PIXELS.nbytes)
    for i in range(60, 70):
        late.add(past(i))
    assert late.since(image_set(70, 65)) == [] and numbers(late.since(image_set(70, 66))) == [66, 67, 68, 69]


def test_nothing_is_kept_of_a_detector_that_is_never_late():
    made = LatePoints(RIG, HUMAN, BLAZEPOSE)
    for i in range(5):
        made.add(past(i, i))
    assert made.since(image_set(5, 3)) == []


@pytest.mark.parametrize("names", [("left_wrist", "tail"), ("left_wrist", "left_paw"), ("tail",)])
def test_points_that_the_detector_lacks_are_not_found_and_others_left_out(late, names):
    """Both sides of every point are there: a detector may take one for the other."""
    image = CameraImage(RIG.names[0], 10 * PERIOD_NS, PIXELS, people=(person(*names),))
    (found,) = late.in_time(ImageSet(image.stamp_ns, (image,)))[0]
    assert {"left_wrist", "right_wrist", "nose"} <= set(found.names) and not {"tail", "left_paw"} & set(found.names)
    seen = {name for name, score in zip(found.names, found.scores, strict=True) if score > 0.0}
    assert seen == {"left_wrist"} & set(names)


def test_points_may_come_for_a_second_after_a_reset_where_some_have_come_before(late):
    assert not late.may_come(10 * PERIOD_NS)  # nobody knows of a detector
    late.since(image_set(10, 6))
    late.reset()
    assert late.may_come(0)
    late.add(past(11))
    assert [late.may_come(round(i * PERIOD_NS)) for i in (12, 40, 42)] == [True, True, False]
