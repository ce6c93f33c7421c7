"""Pixels about where a body is taken to be: an upright ellipse, what moves in it, and what the cameras agree on."""

import numpy as np
import pytest

from helpers.cameras.start_scenes import scene, standing
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.model.configuration import Configuration
from tracker_node.synthesis.scenes.scene import looking_at
from tracker_node.tracking.initialization.evidence import StartEvidence
from tracker_node.tracking.initialization.segmentation import StartSegmentation

LENS = CameraModel(200, 150, np.array([[100.0, 0.0, 99.0], [0.0, 100.0, 74.0], [0.0, 0.0, 1.0]]))
MIDDLE = np.array([0.0, 0.0, 1.0])
LEVEL = Camera("level", LENS, looking_at(np.array([0.0, -4.0, 1.0]), MIDDLE))  # a meter is 25 pixels
SIZE_M = 2.0


class Evidence(StartEvidence):
    """Real evidence that says which maps there are."""

    def __init__(self, cameras, odds):
        super().__init__(cameras, {})
        self.odds = odds

    def maps(self):
        return self.odds


def segmentation(odds, cameras=(LEVEL,), size_m=SIZE_M):
    return StartSegmentation(Evidence(cameras, odds), cameras, size_m)


def test_the_ellipse_has_the_body_s_height_and_is_slim():
    """25 pixels up to its end; three tenths of that to its side."""
    along, across = segmentation([None])._ellipse(LEVEL, MIDDLE)
    assert along.shape == across.shape == (150, 200)
    assert along[74, 99] == pytest.approx(0.0, abs=1e-9)
    assert along[74 - 25, 99] == pytest.approx(1.0)  # rows count downwards
    assert along[74 + 50, 99] == pytest.approx(-2.0)
    assert across[74 - 25, 99] == pytest.approx(0.0, abs=1e-9)
    assert abs(across[74, 99 + 30]) == pytest.approx(30.0 / (0.3 * 25.0))
    assert across[74, 99 - 30] == -across[74, 99 + 30]


def test_a_body_seen_from_above_still_has_a_length_of_two_pixels():
    above = Camera("above", LENS, looking_at(np.array([1e-6, 0.0, 30.0]), MIDDLE))
    along, _ = segmentation([None])._ellipse(above, MIDDLE)
    assert np.abs(np.diff(along, axis=0)).max() <= 0.5 + 1e-9


def test_what_moves_within_the_ellipse_is_likely():
    moved = np.full((150, 200), -1.0)
    moved[60:90] = 1.0
    (inside,), (around,) = segmentation([moved])._likely(MIDDLE)
    assert inside[74, 99] == pytest.approx(1.0)
    assert inside[74 - 10, 99] == pytest.approx(np.exp(-0.5 * 0.4**2 / 0.36))
    assert inside[74 - 25, 99] == pytest.approx(0.05 * np.exp(-0.5 / 0.36))  # nothing moves there
    aside = 10.0 / 7.5
    assert inside[74, 99 + 10] == pytest.approx(np.exp(-0.5 * aside**2 / 0.36))
    assert set(np.unique(around)) == {0.0, 1.0}
    assert around[74, 99] == 0.0
    assert around[74, 99 + 10] == 1.0  # 1.33 squared is beyond 1.5
    assert around[74, 99 + 9] == 0.0
    assert around[74, 99 + 37] == 1.0  # 4.93 of 5
    assert around[74, 99 + 38] == 0.0
    assert around[74 - 39, 99] == 1.0  # 1.56 of 1.6
    assert around[74 - 40, 99] == 0.0


def test_without_anything_to_hold_it_against_all_of_the_ellipse_is_likely():
    (inside,), _ = segmentation([None])._likely(MIDDLE)
    assert inside[74 - 25, 99] == pytest.approx(np.exp(-0.5 / 0.36))


def test_once_there_are_colors_they_count_more_loosely_by_place():
    odds = np.full((150, 200), 0.5)
    odds[:74] = 1.5
    (inside,), (around,) = segmentation([odds])._segmented(MIDDLE)
    assert inside[74, 99] == pytest.approx(0.5)
    likely = 1.0 / (1.0 + np.exp(-4.0))
    near = np.exp(-0.5 * (10.0 / 25.0) ** 2 / 0.64)
    assert inside[64, 99] == pytest.approx(near * likely)
    near = np.exp(-0.5 * (0.5 * 15.0 / 7.5) ** 2 / 0.64)
    assert inside[74, 99 + 15] == pytest.approx(0.5 * near)
    assert around[74, 99 + 15] == pytest.approx(1.0 - 0.5 * near)
    assert around[74, 99 + 44] > 0.9  # 5.87 of 6
    assert around[74, 99 + 45] == 0.0
    assert around[74 - 49, 99] > 0.9  # 1.96 of 2
    assert around[74 - 50, 99] == 0.0


def test_a_camera_without_a_map_teaches_what_is_around_alone():
    (inside,), (around,) = segmentation([None])._segmented(MIDDLE)
    assert not inside.any()
    assert around[74, 99] == 1.0


def test_what_the_others_do_not_confirm_loses():
    """Two cameras at right angles take a ball for the body; one of them a second ball that the other does not see."""
    side = Camera("side", LENS, looking_at(np.array([4.0, 0.0, 1.0]), MIDDLE))
    cameras = (LEVEL, side)
    v, u = np.indices((150, 200))
    ball = np.where(np.hypot(u - 99, v - 74) < 10, 3.0, -3.0)
    two = np.where(np.hypot(u - 99, v - 74 + 25) < 6, 3.0, ball)
    looked = segmentation([two, ball], cameras)
    looked._agree(MIDDLE)
    first, second = looked._evidence.support
    assert first[74, 99] > 0.05
    assert second[74, 99] > 0.05
    assert first.max() <= 0.1
    assert first[74 - 25, 99] < -0.5
    assert first[10, 10] == -2.0


def test_a_camera_without_a_map_gets_no_support():
    side = Camera("side", LENS, looking_at(np.array([4.0, 0.0, 1.0]), MIDDLE))
    looked = segmentation([np.zeros((150, 200)), None], (LEVEL, side))
    looked._agree(MIDDLE)
    first, second = looked._evidence.support
    assert first.shape == (150, 200)
    assert second is None


def test_a_body_s_mask_is_eroded_and_its_ring_keeps_off():
    small = scene(1)
    camera = small.rig.cameras[0]
    looked = StartSegmentation(StartEvidence((camera,), {}), (camera,), SIZE_M)
    (inside,), (around,) = looked._covered(Configuration(small.model, standing(small.model, 0.0, 0.0, 0.0)))
    assert set(np.unique(inside)) == set(np.unique(around)) == {0.0, 1.0}
    rows, columns = np.nonzero(inside)
    ring_rows, ring_columns = np.nonzero(around)
    assert rows.min() - 1 - ring_rows.min() == 14  # above: a pixel eroded, and the ring
    assert ring_columns.max() - (columns.max() + 1) == 14
    assert not (inside.astype(bool) & around.astype(bool)).any()
    edge = rows.min() - 1  # the highest row of the body itself
    column = columns[np.argmin(rows)]
    assert not around[edge - 2 : edge + 1, column].any()
    assert around[edge - 3, column] == 1.0
