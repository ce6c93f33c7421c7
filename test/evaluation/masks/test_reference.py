"""Reference silhouettes: difference to a still, outlines by hand, and their file."""

import json

import cv2
import numpy as np
import pytest

from tracker_node.errors import FileFormatError, SourceError, TrackerError
from tracker_node.evaluation.masks import reference
from tracker_node.evaluation.masks.reference import (
    CameraMasks,
    channel_gains,
    load_reference_masks,
    polygon_mask,
    read_still,
    still_difference_mask,
)
from tracker_node.evaluation.metrics import intersection_over_union
from tracker_node.loaders.fetched_files import data_file
from tracker_node.loaders.images.source import open_source

SIZE = (400, 300)
MASKS = "config/balancing_masks.json"


def scene(seed: int = 0) -> np.ndarray:
    """A smooth colored room with one nearly black piece of furniture."""
    rng = np.random.default_rng(seed)
    room = cv2.resize(rng.uniform(70, 180, (6, 8, 3)).astype(np.float32), SIZE, interpolation=cv2.INTER_CUBIC)
    room[80:220, 60:140] = (30, 55, 52)
    return room


def noisy(image: np.ndarray, seed: int = 1) -> np.ndarray:
    """As a lens and a codec give it: soft edges, noise."""
    soft = cv2.GaussianBlur(image.astype(np.float64), (0, 0), 1.5)
    return np.clip(soft + np.random.default_rng(seed).normal(0, 2, image.shape), 0, 255).astype(np.uint8)


def body(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The image with a body of skin and black shorts, and its silhouette."""
    mask = np.zeros(image.shape[:2], dtype=np.uint8)
    cv2.ellipse(mask, (200, 110), (40, 60), 0, 0, 360, 255, -1)
    cv2.rectangle(mask, (170, 150), (230, 240), 255, -1)
    with_body = image.copy()
    with_body[mask > 0] = (110, 140, 200)
    with_body[(mask > 0) & (np.arange(image.shape[0])[:, None] > 180)] = (14, 16, 18)
    return with_body, mask


def test_body_under_other_exposure_with_a_shadow():
    empty = scene()
    picture, mask = body(empty)
    lit = picture * np.array([1.1, 1.0, 0.93])
    shade = np.zeros(mask.shape, dtype=np.uint8)
    cv2.ellipse(shade, (260, 240), (60, 18), 0, 0, 360, 255, -1)
    lit[(shade > 0) & (mask == 0)] *= 0.75
    found = still_difference_mask(noisy(lit), noisy(empty, 2))
    assert set(np.unique(found)) == {0, 255}
    assert intersection_over_union(found, mask) > 0.95
    without_body = cv2.erode(((shade > 0) & (mask == 0)).astype(np.uint8), np.ones((9, 9))) > 0
    assert (found[without_body] > 0).mean() < 0.02


def test_someone_at_the_border_of_the_still_is_not_the_body():
    empty = scene()
    picture, mask = body(empty)
    still = empty.copy()
    still[100:, :120] = (200, 60, 60)  # bigger than the body, and gone since
    assert intersection_over_union(still_difference_mask(noisy(picture), noisy(still, 2)), mask) > 0.95


def test_a_hand_may_reach_the_border():
    empty = scene()
    picture, mask = body(empty)
    arm = np.zeros_like(mask)
    cv2.rectangle(arm, (220, 90), (SIZE[0] - 1, 112), 255, -1)
    picture[arm > 0] = (110, 140, 200)
    whole = mask | arm
    assert intersection_over_union(still_difference_mask(noisy(picture), noisy(empty, 2)), whole) > 0.93


def test_an_opening_stays_open():
    empty = scene()
    picture, mask = body(empty)
    opening = np.zeros_like(mask)
    cv2.circle(opening, (200, 100), 25, 255, -1)
    picture[opening > 0] = empty[opening > 0]
    found = still_difference_mask(noisy(picture), noisy(empty, 2))
    assert found[100, 200] == 0
    assert intersection_over_union(found, np.where(opening > 0, 0, mask)) > 0.93


def test_nothing_there_gives_an_empty_mask():
    empty = scene()
    assert not still_difference_mask(noisy(empty), noisy(empty, 2)).any()


def test_gains():
    empty = scene().astype(np.uint8)
    brighter = np.clip(empty * np.array([1.2, 1.0, 0.9]), 0, 255).astype(np.uint8)
    assert channel_gains(brighter, empty) == pytest.approx([1.2, 1.0, 0.9], abs=0.01)
    assert channel_gains(np.full((9, 9, 3), 255, np.uint8), np.zeros((9, 9, 3), np.uint8)).tolist() == [1, 1, 1]


def test_images_of_two_sizes_are_refused():
    with pytest.raises(ValueError, match="one shape"):
        still_difference_mask(np.zeros((9, 9, 3), np.uint8), np.zeros((8, 9, 3), np.uint8))


def test_polygons_with_a_hole():
    outer, hole = np.array([[10, 10], [90, 10], [90, 90], [10, 90]]), np.array([[40, 40], [60, 40], [60, 60], [40, 60]])
    mask = polygon_mask([outer, hole], 100, 100)
    assert mask[20, 20] == 255 and mask[50, 50] == 0 and mask[5, 5] == 0
    assert np.count_nonzero(mask) == pytest.approx(81**2 - 19**2, abs=4)


def test_file_of_masks(tmp_path):
    path = tmp_path / "masks.json"
    outlines = [[10, 10, 30, 10, 30, 30]]
    cameras = {
        "a": {"image_size": [40, 50], "polygons": {"7": outlines, "3": outlines}},
        "b": {"image_size": [40, 50], "still": "b.png"},
        "c": {"image_size": [40, 50], "still": ""},
    }
    path.write_text(json.dumps({"cameras": cameras}))
    masks = load_reference_masks(path)
    assert masks["a"].image_numbers(100) == [3, 7] and masks["a"].image_numbers(5) == [3]
    assert masks["a"].mask(3).shape == (50, 40)
    assert masks["b"].image_numbers(3) == [0, 1, 2]
    assert masks["b"].still == str(tmp_path / "b.png") and masks["c"].still == ""


def test_runs_over_the_same_images_have_a_difference_made_once(monkeypatch):
    made = []

    def difference(image, still):
        made.append((image, still))
        mask = np.zeros(image.shape[:2], np.uint8)
        mask[2:4, 5:] = 255
        return mask

    monkeypatch.setattr(reference, "still_difference_mask", difference)
    masks, image, still = CameraMasks("a", 11, 6, still=""), np.zeros((6, 11, 3), np.uint8), np.ones((6, 11, 3), np.uint8)
    first, again = masks.mask(0, image, still), masks.mask(0, image.copy(), still)
    assert len(made) == 1 and (first == difference(image, still)).all() and (again == first).all()
    made.clear()
    masks.mask(0, image + 1, still)  # of another video
    masks.mask(0, image, still + 1)
    masks.mask(1, image, still)  # where nothing moves in the pixels that tell images apart
    assert len(made) == 3


@pytest.mark.parametrize(
    ("entry", "field"),
    [
        ({"image_size": [40], "still": ""}, "image_size"),
        ({"image_size": [40, 50]}, "cameras.a"),
        ({"image_size": [40, 50], "still": "", "polygons": {}}, "cameras.a"),
        ({"image_size": [40, 50], "still": 3}, "still"),
        ({"image_size": [40, 50], "polygons": {"x": []}}, "polygons"),
        ({"image_size": [40, 50], "polygons": {"1": [[1, 2, 3, 4]]}}, "polygons.1"),
        ({"image_size": [40, 50], "polygons": {"1": [[1, 2, 3, 4, 5]]}}, "polygons.1"),
        ({"image_size": [40, 50], "polygons": {"1": [["a", 2, 3, 4, 5, 6]]}}, "polygons.1"),
        ([], "cameras.a"),
    ],
)
def test_what_is_wrong_with_a_file_is_named(tmp_path, entry, field):
    path = tmp_path / "masks.json"
    path.write_text(json.dumps({"cameras": {"a": entry}}))
    with pytest.raises(FileFormatError, match=field) as error:
        load_reference_masks(path)
    assert "masks.json" in str(error.value)


@pytest.mark.parametrize("text", ["", "[]", '{"cameras": {}}', "no json"])
def test_files_of_another_kind(tmp_path, text):
    path = tmp_path / "masks.json"
    path.write_text(text)
    with pytest.raises(TrackerError):
        load_reference_masks(path)


def test_stills_of_another_size(tmp_path):
    cv2.imwrite(str(tmp_path / "still.png"), np.zeros((5, 6, 3), np.uint8))
    assert read_still(str(tmp_path / "still.png"), 6, 5).shape == (5, 6, 3)
    with pytest.raises(SourceError, match="expected a still of 7x5"):
        read_still(str(tmp_path / "still.png"), 7, 5)
    with pytest.raises(SourceError, match="cannot be read"):
        read_still(str(tmp_path / "other.png"), 6, 5)


def test_five_outlines_of_each_camera_come_with_the_package():
    masks = load_reference_masks(data_file(MASKS))
    for camera in ("cam01", "cam02"):
        numbers = masks[camera].image_numbers(100)
        assert len(numbers) >= 5
        for number in numbers:
            mask = masks[camera].mask(number)
            n, _, stats, _ = cv2.connectedComponentsWithStats(mask)
            assert n == 2  # one body
            assert 60_000 < stats[1, cv2.CC_STAT_AREA] < 200_000
            assert 700 < stats[1, cv2.CC_STAT_HEIGHT] < 1000


@pytest.mark.parametrize("camera", ["cam03", "cam04"])
def test_silhouettes_of_the_real_clip(shared_data, camera):
    clip = shared_data / "pose2sim_balancing"
    still = cv2.imread(str(clip / f"background_ext/{camera}_ext.png"))
    areas = []
    for _, image in open_source(clip / f"videos/{camera}.mp4", start=40, end=44):
        mask = still_difference_mask(image, still)
        _, _, stats, _ = cv2.connectedComponentsWithStats(mask)
        assert stats[1:, cv2.CC_STAT_AREA].max() / stats[1:, cv2.CC_STAT_AREA].sum() > 0.99
        areas.append(np.count_nonzero(mask))
    assert np.std(areas) / np.mean(areas) < 0.02  # one body, seen alike from image to image
