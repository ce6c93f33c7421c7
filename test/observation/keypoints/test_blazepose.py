"""BlazePose around its networks: what goes in, and what is made of their outputs; stand-ins answer, and the real ones once."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from helpers.sources.weights import weights_or_skip
from tracker_node.model.humans.measures import mirrored_name
from tracker_node.observation.keypoints import blazepose
from tracker_node.observation.keypoints.blazepose import (
    N_POINTS,
    NAMES,
    BlazePose,
    BlazePoseFiles,
    PersonDetector,
    PointNetwork,
)
from tracker_node.observation.keypoints.crop import Crop, mapped
from tracker_node.observation.keypoints.people import Person, Silhouette

IMAGE = np.full((300, 400, 3), (10, 20, 30), np.uint8)
SIZE = 400.0  # of the square around the image


@dataclass
class Network:
    """Answers what it is told to, and keeps what it was given."""

    outputs: list
    given: list = field(default_factory=list)

    def __call__(self, image: np.ndarray) -> list:
        self.given.append(image)
        return self.outputs.pop(0) if isinstance(self.outputs[0], list) else self.outputs


@pytest.fixture
def networks(monkeypatch: pytest.MonkeyPatch) -> dict[str, Network]:
    """By name of the file."""
    found: dict[str, Network] = {}
    monkeypatch.setattr(blazepose, "_Network", lambda path, threads: found[str(path)])
    return found


def logit(p: Any) -> Any:
    return np.log(np.asarray(p) / (1.0 - np.asarray(p)))


def detections(*people: tuple[int, float, tuple[float, ...]]) -> list[np.ndarray]:
    """Outputs of the detector: cell, probability, and the values of that cell."""
    values, logits = np.zeros((2254, 12), np.float32), np.full((2254, 1), -90.0, np.float32)
    for cell, p, own in people:
        values[cell, : len(own)], logits[cell] = own, logit(p)
    return [values, logits]


def whole(points: list) -> np.ndarray:
    """From pixels of the detector's input, counted from the corner, to those of the image."""
    return (np.array(points) - 112.0) * SIZE / 224.0 + [199.5, 149.5]


def test_names_are_those_of_both_sides():
    assert len(NAMES) == len(set(NAMES)) == N_POINTS == 33
    assert {mirrored_name(name) for name in NAMES} == set(NAMES)
    assert (NAMES[0], NAMES[11], NAMES[12], NAMES[23], NAMES[32]) == (
        "nose", "left_shoulder", "right_shoulder", "left_hip", "right_foot_index",
    )  # fmt: skip


def test_cells_of_the_detector_lie_in_three_grids():
    """28 x 28 cells of 8 pixels with two anchors each, 14 x 14 of 16 with two, 7 x 7 of 32 with six; row by row."""
    anchors = blazepose._anchors()
    assert anchors.shape == (2254, 2)
    assert anchors[[0, 1, 2, 56]].tolist() == [[4.0, 4.0], [4.0, 4.0], [12.0, 4.0], [4.0, 12.0]]
    assert anchors[[1568, 1570, 1596]].tolist() == [[8.0, 8.0], [24.0, 8.0], [8.0, 24.0]]
    assert anchors[[1960, 1965, 1966, 2253]].tolist() == [[16.0, 16.0], [16.0, 16.0], [48.0, 16.0], [208.0, 208.0]]


def test_the_detector_sees_the_whole_image_in_red_green_blue(networks):
    networks["d"] = network = Network(detections())
    assert PersonDetector("d").find(IMAGE) == []
    (given,) = network.given
    assert given.shape == (224, 224, 3) and given.dtype == np.float32
    np.testing.assert_allclose(given[112, 112], np.array([30, 20, 10]) * 2.0 / 255.0 - 1.0, atol=1e-6)
    np.testing.assert_allclose(given[2, 112], -1.0)  # beyond a wide image it is black


def test_a_person_is_where_the_cell_says(networks):
    """The middle of the hips and a point on the circle are told from the cell's center; the head is on that side."""
    networks["d"] = Network(detections((2, 0.8, (10.0, 5.0, 40.0, 60.0, 88.0, 96.0, 108.0, 56.0))))
    (found,) = PersonDetector("d").find(IMAGE)
    center, top = whole([[12.0 + 88.0, 4.0 + 96.0], [12.0 + 108.0, 4.0 + 56.0]])
    assert found.score == pytest.approx(0.8, abs=1e-6)
    np.testing.assert_allclose(found.crop.center, center, atol=1e-4)
    du, dv = top - center
    assert found.crop.size == pytest.approx(2.5 * np.hypot(du, dv), rel=1e-5)
    assert found.crop.angle == pytest.approx(np.arctan2(du, -dv), abs=1e-6) and found.crop.angle > 0.0


def test_detections_of_one_person_are_averaged_by_their_probabilities(networks):
    same = (0.0, 0.0, 40.0, 60.0, 10.0, 0.0, 10.0, -20.0)
    shifted = (2.0, 0.0, 40.0, 60.0, 16.0, 0.0, 16.0, -20.0)
    other = (100.0, 100.0, 40.0, 60.0, 100.0, 100.0, 100.0, 80.0)
    networks["d"] = Network(detections((0, 0.6, same), (1, 0.9, shifted), (2, 0.4, other), (3, 0.29, other)))
    first, second = PersonDetector("d").find(IMAGE)
    assert (first.score, second.score) == (pytest.approx(0.9), pytest.approx(0.4))
    np.testing.assert_allclose(first.crop.center, whole([[4.0 + (0.9 * 16.0 + 0.6 * 10.0) / 1.5, 4.0]])[0], atol=1e-3)
    np.testing.assert_allclose(second.crop.center, whole([[12.0 + 100.0, 4.0 + 100.0]])[0], atol=1e-3)
    assert first.crop.angle == pytest.approx(0.0, abs=1e-6)


def test_boxes_lie_about_their_middles(networks):
    """60 x 60 and, 20 beside and above its middle, 80 x 80: a third of both is common, and it is one person."""
    networks["d"] = Network(
        detections((0, 0.9, (100.0, 100.0, 60.0, 60.0, 9.0, 9.0)), (1, 0.8, (80.0, 80.0, 80.0, 80.0, 9.0, 9.0)))
    )
    assert len(PersonDetector("d").find(IMAGE)) == 1
    networks["d"] = Network(
        detections((0, 0.9, (100.0, 100.0, 60.0, 60.0, 9.0, 9.0)), (1, 0.8, (76.0, 76.0, 80.0, 80.0, 9.0, 9.0)))
    )
    assert len(PersonDetector("d").find(IMAGE)) == 2


def test_a_probability_of_three_tenths_is_a_person(networks):
    own = (0.0, 0.0, 40.0, 60.0, 10.0, 0.0, 10.0, -20.0)
    networks["d"] = Network(detections((0, 0.3001, own), (500, 0.2999, own)))
    assert len(PersonDetector("d").find(IMAGE)) == 1


def test_overlaps_are_of_the_union():
    box = np.array([10.0, 20.0, 40.0, 50.0])
    others = np.array([box, [30.0, 20.0, 40.0, 50.0], [10.0, 45.0, 40.0, 50.0], [60.0, 20.0, 5.0, 5.0], [20.0, 30.0, 10.0, 10.0]])
    np.testing.assert_allclose(blazepose._overlaps(box, others), [1.0, 1.0 / 3.0, 1.0 / 3.0, 0.0, 0.05])


def test_a_circle_is_never_smaller_than_a_few_pixels():
    crop = blazepose._crop_around(np.array([5.0, 6.0]), np.array([5.0, 5.5]))
    assert (crop.center, crop.size) == ((5.0, 6.0), 8.0)


CROP = Crop((210.0, 140.0), 192.0, 0.4)


def answer(
    points: np.ndarray, scores=0.9, presence: float = 0.95, maps: np.ndarray | None = None, mask: np.ndarray | None = None
):
    """Outputs of the network of points: pixels of its input from the corner, and 64 x 64 heat maps that say nothing."""
    values = np.zeros((39, 5), np.float32)
    values[:, :2] = points
    values[:, 3] = logit(np.broadcast_to(scores, 39))
    maps = np.full((64, 64, 39), -90.0, np.float32) if maps is None else maps
    mask = np.full((256, 256, 1), -20.0, np.float32) if mask is None else mask
    return [values.ravel(), np.array([presence], np.float32), mask, maps, np.zeros(117, np.float32)]


def somewhere() -> np.ndarray:
    return np.random.default_rng(3).uniform(40.0, 210.0, (39, 2)).astype(np.float32)


def test_points_come_from_the_square_into_the_image(networks):
    points, scores = somewhere(), np.linspace(0.1, 0.9, 39)
    networks["p"] = network = Network(answer(points, scores))
    person = PointNetwork("p").read(IMAGE, CROP)
    np.testing.assert_allclose(person.pixels, mapped(CROP.to_image(256), points[:33] - 0.5), atol=1e-4)
    np.testing.assert_allclose(person.scores, scores[:33], atol=1e-6)
    assert person.names == NAMES and person.score == pytest.approx(0.95)
    low, high = person.pixels.min(axis=0), person.pixels.max(axis=0)
    assert person.box == pytest.approx((*low, *high))
    given = network.given[0]
    assert given.shape == (256, 256, 3) and given.dtype == np.float32
    np.testing.assert_allclose(given[128, 128], np.array([30, 20, 10]) / 255.0, atol=1e-6)


def test_the_skeleton_is_turned_with_the_square_and_keeps_its_meters(networks):
    guessed = np.random.default_rng(2).normal(size=(39, 3)).astype(np.float32)
    networks["p"] = Network([*answer(somewhere())[:-1], guessed.ravel()])
    skeleton = PointNetwork("p").read(IMAGE, CROP).skeleton
    c, s = np.cos(CROP.angle), np.sin(CROP.angle)
    np.testing.assert_allclose(skeleton, guessed[:33] @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]), atol=1e-6)


@pytest.mark.parametrize(("presence", "somebody"), [(0.5, True), (0.49, False), (np.nan, False)])
def test_nobody_is_there_where_the_network_says_so(networks, presence, somebody):
    networks["p"] = Network(answer(somewhere(), presence=presence))
    assert (PointNetwork("p").read(IMAGE, CROP) is not None) is somebody


def peaked(cell: tuple[int, int], along: tuple[int, int], p: float = 0.8) -> np.ndarray:
    """Heat maps that are as high at a cell and at two beside it."""
    maps = np.full((64, 64, 39), -90.0, np.float32)
    (u, v), (du, dv) = cell, along
    for step in (-1, 0, 1):
        maps[v + step * dv, u + step * du, 0] = logit(p)
    return maps


def test_points_with_a_sharp_map_are_where_its_mean_is(networks):
    """A cell is where its first pixel begins, 4 * 21 - 0.5: so the network finds the same in a mirrored image."""
    points = somewhere()
    points[0] = 84.0, 100.0
    networks["p"] = Network(answer(points, maps=peaked((21, 24), (1, 0))))
    person = PointNetwork("p").read(IMAGE, CROP)
    np.testing.assert_allclose(person.pixels[0], mapped(CROP.to_image(256), np.array([[83.5, 95.5]]))[0], atol=1e-3)
    np.testing.assert_allclose(person.pixels[1], mapped(CROP.to_image(256), points[1:2] - 0.5)[0], atol=1e-4)


def test_points_whose_map_is_low_stay_where_the_network_has_them(networks):
    points = somewhere()
    points[0] = 84.0, 100.0
    networks["p"] = Network(answer(points, maps=peaked((21, 24), (1, 0), 0.29)))
    person = PointNetwork("p").read(IMAGE, CROP)
    np.testing.assert_allclose(person.pixels[0], mapped(CROP.to_image(256), points[:1] - 0.5)[0], atol=1e-4)


@pytest.mark.parametrize("along", [(1, 0), (0, 1)])
def test_covariances_are_turned_and_scaled_with_the_square(networks, along):
    """Second moments S of the map times its own mean moment: a map twice as wide is four times as wrong; so is half a peak."""
    points = somewhere()
    points[0] = 86.0, 98.0
    networks["p"] = Network(answer(points, maps=peaked((21, 24), along)))
    covariance = PointNetwork("p").read(IMAGE, CROP).covariances[0]
    S = np.diag(2.0 / 3.0 * np.array(along)) + 0.05 * np.eye(2)
    A = CROP.to_image(256)[:, :2] * 4.0
    np.testing.assert_allclose(covariance, A @ (0.25 / 0.8**2 * 0.5 * np.trace(S) * S) @ A.T, rtol=1e-3)
    angle = 0.5 * np.arctan2(2.0 * covariance[0, 1], covariance[0, 0] - covariance[1, 1])
    assert angle == pytest.approx(CROP.angle if along == (1, 0) else CROP.angle - 0.5 * np.pi, abs=1e-3)


def test_the_silhouette_lies_in_the_image_where_it_does_in_the_square(networks):
    mask = np.full((256, 256, 1), -20.0, np.float32)
    v, u = np.mgrid[:256, :256]
    mask[np.hypot(u - 150, v - 90) < 30] = 20.0
    networks["p"] = Network(answer(somewhere(), mask=mask))
    found = PointNetwork("p").read(IMAGE, CROP).silhouette
    assert found.probabilities.dtype == np.uint8
    whole_image = np.zeros((300, 400), np.uint8)
    (left, top), (height, width) = found.origin, found.probabilities.shape
    whole_image[top : top + height, left : left + width] = found.probabilities
    v, u = np.nonzero(whole_image > 127)
    np.testing.assert_allclose([u.mean(), v.mean()], mapped(CROP.to_image(256), np.array([[150.0, 90.0]]))[0], atol=0.2)
    assert len(u) == pytest.approx(np.pi * (30 * 192 / 256) ** 2, rel=0.03)
    assert set(np.unique(whole_image)) >= {0, 255}


def test_a_square_beyond_the_image_has_a_silhouette_within_it(networks):
    mask = np.full((256, 256, 1), logit(0.6), np.float32)
    for center in ((390.0, 290.0), (5.0, 5.0), (200.0, 150.0)):
        networks["p"] = Network(answer(somewhere(), mask=mask))
        found = PointNetwork("p").read(IMAGE, Crop(center, 150.0)).silhouette
        (left, top), (height, width) = found.origin, found.probabilities.shape
        low = np.maximum(np.floor(np.array(center) - 75.0), 0)
        assert abs(left - low[0]) <= 1 and abs(top - low[1]) <= 1
        assert left >= 0 and top >= 0 and left + width <= 400 and top + height <= 300
        assert np.median(found.probabilities) == round(0.6 * 255)


FILES = BlazePoseFiles(Path("d"), Path("p"))
LEFT, RIGHT = (0.0, 0.0, 40.0, 60.0, 60.0, 100.0, 60.0, 60.0), (120.0, 0.0, 40.0, 60.0, 160.0, 100.0, 160.0, 60.0)


def test_where_people_are_expected_the_detector_is_not_asked(networks):
    networks["d"], networks["p"] = (
        Network(detections((0, 0.9, LEFT))),
        Network([answer(somewhere()), answer(somewhere(), presence=0.1)]),
    )
    people = BlazePose(FILES).detect(IMAGE, (CROP, Crop((100.0, 100.0), 80.0)))
    assert len(people) == 1 and networks["d"].given == []
    assert BlazePose.names == NAMES


def test_people_are_looked_for_again_without_those_who_were_found(networks):
    """The first is covered with the image's mean color; nobody new ends the search."""
    mask = np.full((256, 256, 1), 20.0, np.float32)
    networks["d"] = Network([detections((0, 0.9, LEFT)), detections((0, 0.6, RIGHT)), detections()])
    networks["p"] = Network([answer(somewhere(), presence=0.9, mask=mask), answer(somewhere(), presence=0.7)])
    image = np.random.default_rng(0).integers(0, 255, (300, 400, 3)).astype(np.uint8)
    before = image.copy()
    people = BlazePose(FILES).detect(image)
    assert [person.score for person in people] == pytest.approx([0.9, 0.7])
    first, second, _ = networks["d"].given
    u, v = 64, 104  # in the middle of the first person
    mean = image.reshape(-1, 3).mean(axis=0).astype(np.uint8)[::-1] * 2.0 / 255.0 - 1.0
    np.testing.assert_allclose(second[v - 5 : v + 5, u - 5 : u + 5], np.broadcast_to(mean, (10, 10, 3)), atol=0.02)
    np.testing.assert_array_equal(first[:, 200:], second[:, 200:])
    np.testing.assert_array_equal(image, before)


def test_where_nobody_is_found_the_search_ends(networks):
    networks["d"], networks["p"] = Network(detections((0, 0.9, LEFT))), Network(answer(somewhere(), presence=0.1))
    assert BlazePose(FILES).detect(IMAGE) == () and len(networks["d"].given) == 1


def test_no_more_people_than_asked_for(networks):
    networks["d"] = Network([detections((0, 0.9, LEFT), (20, 0.8, RIGHT)), detections((0, 0.9, LEFT))])
    networks["p"] = Network(answer(somewhere()))
    assert len(BlazePose(FILES, most=1).detect(IMAGE)) == 1 and len(networks["d"].given) == 1


def test_what_is_covered_is_the_silhouette_and_its_border():
    image = np.random.default_rng(0).integers(0, 255, (30, 40, 3)).astype(np.uint8)
    shown = np.zeros((10, 12), np.uint8)
    shown[4:6, 5:7], shown[0, 0] = 200, 64
    nobody = np.zeros((33, 2)), np.tile(np.eye(2), (33, 1, 1)), np.zeros(33)
    person = Person(NAMES, *nobody, 1.0, (0.0, 0.0, 1.0, 1.0), Silhouette(shown, (20, 8)))
    found = blazepose._without(image, [person, Person(NAMES, *nobody, 1.0, (0.0, 0.0, 1.0, 1.0))])
    changed = (found != image).any(axis=2)
    expected = np.zeros((30, 40), bool)
    expected[8 + 2 : 8 + 8, 20 + 3 : 20 + 9] = True
    np.testing.assert_array_equal(changed, expected)
    np.testing.assert_array_equal(found[expected], np.broadcast_to(image.reshape(-1, 3).mean(axis=0).astype(np.uint8), (36, 3)))


def test_the_real_networks_find_nobody_in_noise():
    """Files of the right shapes: what is asked of them is there."""
    made = BlazePose(weights_or_skip())
    image = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (240, 320, 3)).astype(np.uint8), (0, 0), 5)
    assert made.detect(image) == ()
    assert all(person.pixels.shape == (33, 2) for person in made.detect(image, (Crop((160.0, 120.0), 200.0),)))
