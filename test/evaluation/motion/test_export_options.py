"""What goes into a file for another program: axes, units, names."""

import numpy as np
import pytest

from helpers.bodies.moving_person import moving
from tracker_node.errors import FileFormatError, UnknownNameError
from tracker_node.evaluation.motion.export import ExportOptions

MODEL = moving(1).model


def test_defaults_are_metres_degrees_and_all_landmarks():
    options = ExportOptions(y_up=False)
    assert (options.unit, options.degrees, options.landmarks, options.link) == ("m", True, (), "")
    assert not options.openpose_names and not options.opensim and not options.isb_angles
    assert options.columns(MODEL) == list(range(len(MODEL.landmarks)))
    assert options.labels(MODEL) == MODEL.landmark_names


def test_axes_of_the_file():
    point = np.array([1.0, 2.0, 3.0])
    assert (ExportOptions(y_up=True).axes @ point).tolist() == [2.0, 3.0, 1.0]  # (y, z, x) of the world
    assert (ExportOptions(y_up=False).axes @ point).tolist() == [1.0, 2.0, 3.0]


def test_unit_of_angles():
    assert ExportOptions(True).angle_unit == "deg"
    assert ExportOptions(True, degrees=False).angle_unit == "rad"


def test_chosen_landmarks_keep_their_order():
    options = ExportOptions(True, landmarks=("right_knee", "left_hip"))
    assert [MODEL.landmark_names[i] for i in options.columns(MODEL)] == ["right_knee", "left_hip"]
    assert options.labels(MODEL) == ("right_knee", "left_hip")
    with pytest.raises(UnknownNameError, match="knie"):
        ExportOptions(True, landmarks=("knie",)).columns(MODEL)


def test_names_of_openpose_where_there_are_any():
    model = moving(1).model
    others = [name for name in model.landmark_names if name not in ("right_knee", "neck")]
    labels = dict(zip(model.landmark_names, ExportOptions(True, openpose_names=True).labels(model), strict=True))
    assert (labels["right_knee"], labels["neck"]) == ("RKnee", "Neck")
    assert len(set(labels.values())) == len(others) + 2


def test_a_landmark_given_twice_is_refused():
    with pytest.raises(FileFormatError, match="each name once") as told:
        ExportOptions(True, landmarks=("neck", "left_hip", "neck", "left_hip", "head_top"))
    assert told.value.field == "landmarks" and "left_hip, neck" in str(told.value) and "head_top" not in str(told.value)
