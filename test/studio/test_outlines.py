"""Outlines of parts are where the renderer has the parts, and handles where the points project."""

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at
from helpers.cameras.small_clip import body, motion
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.human import human_model
from tracker_node.render.raycast.raycaster import render_view
from tracker_node.studio.images import OutlineDrawer, handles_of, working_rig

LARGE = CameraModel(1080, 1920, np.array([[1500.0, 0.0, 520.0], [0.0, 1500.0, 990.0], [0.0, 0.0, 1.0]]))


@pytest.mark.parametrize(("lens", "least"), [(LENSES["radial"], 0.93), (LARGE, 0.97)], ids=["small", "large"])
def test_outlines_hold_the_parts(lens, least):
    model, state = body(), motion(3)[2]
    camera = look_at((1.2, 0.3, 0.6), (0.0, 0.05, 0.4), lens, "cam")
    drawn = OutlineDrawer(CameraRig((camera,)), model).drawn(state)["cam"]
    labels = render_view(Configuration(model, state), camera).labels
    for part in range(len(model.shapes)):
        picture = np.zeros(labels.shape, np.uint8)
        lines = [np.array(line).reshape(-1, 2) for index, line in drawn["parts"] if index == part]
        cv2.fillPoly(picture, [np.round(16 * line).astype(np.int32) for line in lines], 1, cv2.LINE_8, 4)
        both, either = ((picture > 0) & (labels == part + 1)).sum(), ((picture > 0) | (labels == part + 1)).sum()
        assert both / either > least, model.shapes[part].name
    found = Configuration(model, state).landmarks_world
    pixels = [drawn["handles"][i] for i in range(len(found))]
    np.testing.assert_allclose(pixels, camera.project(found)[0], atol=0.006)


def test_what_is_not_in_view_is_not_drawn():
    model, state = body(), motion(1)[0]
    away = look_at((1.6, 0.3, 0.6), (5.0, 0.0, 0.4), LENSES["plain"], "away")
    drawn = OutlineDrawer(CameraRig((away,)), model).drawn(state)["away"]
    assert drawn["parts"] == [] and set(map(type, drawn["handles"])) == {type(None)}


def test_every_link_can_be_taken():
    model = human_model()
    handles = handles_of(model)
    assert len(set(handles.names)) == len(handles.names)
    tied = {i for bone in handles.bones for i in bone}
    assert tied == set(range(len(handles.names)))


def test_large_images_are_worked_on_smaller():
    rig, factor = working_rig(CameraRig((look_at((1.6, 0.3, 0.6), (0.0, 0.0, 0.4), LARGE, "cam"),)))
    assert factor == 2 and (rig["cam"].model.width, rig["cam"].model.height) == (540, 960)
