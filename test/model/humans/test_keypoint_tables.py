"""Built-in tables: landmarks that humans have, and which one belongs to a detector."""

import pytest

from tracker_node.errors import UnknownNameError
from tracker_node.loaders.keypoints import files
from tracker_node.model.humans.human import gait_human, human_model
from tracker_node.model.humans.keypoints import TABLES, table_of
from tracker_node.model.humans.measures import mirrored_name
from tracker_node.model.humans.segments18 import body_landmarks

ORDERS = {
    "blazepose_33": "blazepose", "coco_17": "coco_17", "coco_18": "coco_17", "body_25": "body_25", "body_25b": "body_25b",
    "halpe_26": "halpe_26", "coco_wholebody_133": "coco_wholebody",
}  # fmt: skip


@pytest.mark.parametrize("order", ORDERS)
def test_the_table_of_a_detector(order):
    assert table_of(files.ORDERS[order]) == TABLES[ORDERS[order]]


@pytest.mark.parametrize("name", TABLES)
def test_humans_have_the_landmarks(name):
    """Knuckles those whose hands turn, and have parts."""
    landmarks = {point.landmark for point in TABLES[name].values()}
    assert landmarks <= set(gait_human().landmark_names)
    landmarks = {landmark for landmark in landmarks if not landmark.endswith(("index", "pinky", "thumb"))}
    assert landmarks <= set(human_model().landmark_names)
    assert landmarks <= {landmark.name for landmark in body_landmarks()}


@pytest.mark.parametrize("name", TABLES)
def test_left_is_right_in_the_mirror(name):
    for point, place in TABLES[name].items():
        other = TABLES[name][mirrored_name(point)]
        x, y, z = place.offset
        if mirrored_name(point) != point:
            assert other.offset == (x, -y, z) and other.sigma == place.sigma


def test_other_detectors_need_a_table():
    with pytest.raises(UnknownNameError, match=r"a keypoint table is needed, with the points 'left_paw, nose"):
        table_of(("nose", "left_paw"))


def test_each_point_has_one_name():
    for order in files.ORDERS.values():
        assert len(set(order)) == len(order)
