"""What a detector has found is found again by pixels, crop and code."""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.clothed._people import KeptPeople, is_near, packed, unpacked
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.blazepose import NAMES, BlazePoseFiles
from tracker_node.observation.keypoints.crop import Crop
from tracker_node.observation.keypoints.people import Person, Silhouette

CROP = Crop((20.0, 15.0), 30.0, 0.1)


class Counting:
    """Finds a person in each image, and counts."""

    def __init__(self):
        self.crops = []

    def detect(self, image, expected=()):
        self.crops.append(tuple(expected))
        return (person(float(image[0, 0, 0])),)


class Expecting:
    def expected_crops(self, stamp_ns):
        return [(CROP,), ()]


def person(at, silhouette=None):
    n = len(NAMES)
    pixels = at + np.arange(2.0 * n).reshape(n, 2)
    return Person(NAMES, pixels, np.tile(np.eye(2), (n, 1, 1)), np.full(n, 0.9), 0.8, (1.0, 2.0, 3.0, 4.0), silhouette)


def same(a, b):
    if (a.silhouette is None) != (b.silhouette is None):
        return False
    if a.silhouette is not None:
        np.testing.assert_array_equal(a.silhouette.probabilities, b.silhouette.probabilities)
    for name in ("pixels", "covariances", "scores"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    return (a.score, a.box) == (b.score, b.box) and (a.silhouette is None or a.silhouette.origin == b.silhouette.origin)


@pytest.fixture
def files(tmp_path):
    for name in ("detector", "points"):
        (tmp_path / name).write_bytes(name.encode())
    return BlazePoseFiles(tmp_path / "detector", tmp_path / "points")


def test_people_are_the_same_after_packing():
    people = (person(1.0), person(2.0, Silhouette(np.arange(12, dtype=np.uint8).reshape(3, 4), (5, 6))))
    people = (people[0], replace(people[1], skeleton=np.arange(3.0 * len(NAMES)).reshape(-1, 3)))
    again = unpacked(packed(people))
    assert again[0].skeleton is None
    np.testing.assert_array_equal(again[1].skeleton, people[1].skeleton)
    assert len(again) == 2 and all(same(a, b) for a, b in zip(people, again, strict=True))
    assert unpacked(packed(())) == ()


def test_the_detector_is_asked_once(files, tmp_path):
    image_set = ImageSet(7, tuple(CameraImage(f"cam{i}", 7, np.full((8, 9, 3), i, np.uint8)) for i in (1, 2)))
    asked, again = Counting(), Counting()
    first, ms = KeptPeople(files, tmp_path / "kept.sqlite", detector=asked).with_people(Expecting(), image_set)
    kept = KeptPeople(files, tmp_path / "kept.sqlite", detector=again)
    second, ms_again = kept.with_people(Expecting(), image_set)
    assert asked.crops == [(CROP,), ()] and again.crops == [] and ms == ms_again
    assert (kept.asked, kept.kept) == (2, 2)
    for a, b in zip(first.images, second.images, strict=True):
        assert same(a.people[0], b.people[0])


def test_other_pixels_weights_and_crops_are_asked_for_anew(files, tmp_path):
    image, moved = np.zeros((8, 9, 3), np.uint8), Crop((20.5, 15.0), 30.2, 0.1)
    asked, path = Counting(), tmp_path / "kept.sqlite"
    kept = KeptPeople(files, path, detector=asked)
    kept.find(image, CROP)
    kept.find(image + 1, CROP)
    kept.find(image, moved)
    files.points.write_bytes(b"others")
    KeptPeople(files, path, detector=asked).find(image, CROP)
    assert len(asked.crops) == 4


def test_a_near_crop_will_do_where_that_is_wanted(files, tmp_path):
    image, asked = np.zeros((8, 9, 3), np.uint8), Counting()
    kept = KeptPeople(files, tmp_path / "kept.sqlite", near=True, detector=asked)
    kept.find(image, CROP)
    kept.find(image, Crop((20.5, 15.0), 30.2, 0.1 + 2 * np.pi))
    kept.find(image, Crop((25.0, 15.0), 30.0, 0.1))
    kept.find(image, None)
    assert len(asked.crops) == 3
    assert not is_near(CROP, 20.0, 15.0, 33.0, 0.1) and not is_near(CROP, 20.0, 15.0, 30.0, 0.2)
