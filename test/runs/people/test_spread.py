"""Which image sets of a recording are looked at for people, and where in their images."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import seen_by, standing
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.runs.people.detection import Expecting, people_of_sets

RIG = circle_rig(3)
PEOPLE = dict(zip(RIG.names, seen_by(RIG, standing()), strict=True))
BLACK = np.zeros((2, 2, 3), np.uint8)


class Sets:
    """So many image sets, whose stamps are their numbers; in every third one the second camera has no image."""

    rig = RIG

    def __init__(self, n_sets: int, n_expected: int | None):
        self._n_sets, self.n_expected, self.n_taken = n_sets, n_expected, 0

    def __iter__(self) -> Iterator[ImageSet]:
        for i in range(self._n_sets):
            self.n_taken += 1
            names = [name for name in RIG.names if i % 3 or name != RIG.names[1]]
            yield ImageSet(i, tuple(CameraImage(name, i, BLACK) for name in names))


class Finder:
    """Finds somebody in the first camera of each set and in the second, nobody in the third; and keeps what was asked."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def __call__(self, tracker: Expecting, image_set: ImageSet) -> ImageSet:
        assert tracker.expected_crops(image_set.stamp_ns) == [()] * len(RIG)
        self.asked.append(image_set.stamp_ns)
        found = {RIG.names[0]: (PEOPLE[RIG.names[0]],), RIG.names[1]: (PEOPLE[RIG.names[1]],), RIG.names[2]: None}
        return replace(image_set, images=tuple(replace(each, people=found[each.camera]) for each in image_set.images))


@pytest.mark.parametrize(
    ("n_sets", "n_expected", "wanted", "rows"),
    [
        (10, 10, 4, [0, 2, 5, 7]),
        (25, 25, 20, [0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13, 15, 16, 17, 18, 20, 21, 22, 23]),
        (3, 3, 20, [0, 1, 2]),
        (9, 9, 1, [0]),
        (9, None, 3, [0, 1, 2]),  # of a length that nobody knows
        (4, 10, 4, [0, 2]),  # that breaks off
        (0, 0, 4, []),
    ],
)
def test_sets_are_spread_evenly(n_sets: int, n_expected: int | None, wanted: int, rows: list[int]) -> None:
    finder, said = Finder(), []
    found = people_of_sets(Sets(n_sets, n_expected), wanted, finder, lambda *what: said.append(what))
    assert finder.asked == rows and len(found) == len(rows)
    most = min(wanted, n_expected or wanted)
    assert said == [("people", i + 1, most) for i in range(len(rows))]


def test_nothing_is_read_behind_the_last_set() -> None:
    sets = Sets(100, 100)
    people_of_sets(sets, 2, Finder())
    assert sets.n_taken == 51


def test_a_camera_without_an_image_or_without_anybody_sees_nobody() -> None:
    first, second = people_of_sets(Sets(2, 2), 2, Finder())
    assert list(first) == [(PEOPLE[RIG.names[0]],), (), ()]
    assert list(second) == [(PEOPLE[RIG.names[0]],), (PEOPLE[RIG.names[1]],), ()]
