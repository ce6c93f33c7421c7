"""Pictures of the tracked body: which are taken, how they are cut, and in which rows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.errors import TrackerError
from tracker_node.evaluation.masks import silhouettes as module
from tracker_node.evaluation.masks.silhouettes import Picture, contact_sheet, spread
from tracker_node.geometry import se3
from tracker_node.model.configuration import Configuration, State
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.synthesis.subjects.figure import figure_model


@pytest.mark.parametrize(
    ("n", "k", "chosen"),
    [(10, 3, [0, 4, 9]), (10, 2, [0, 9]), (10, 1, [0]), (3, 6, [0, 1, 2]), (0, 3, []), (5, 0, []), (5, -1, []), (1, 4, [0])],
)
def test_instants_are_spread_with_both_ends(n, k, chosen):
    assert spread(n, k) == chosen


def test_a_sheet_has_a_row_for_every_instant():
    def picture(camera, number):
        return Picture(camera, number, np.zeros((1, 1, 3), np.uint8))

    rows = contact_sheet([picture("b", 7), picture("a", 7), picture("b", 3), picture("c", 3), picture("c", 7)])
    assert [[(p.camera, p.number) for p in row] for row in rows] == [[("b", 3), ("c", 3)], [("b", 7), ("a", 7), ("c", 7)]]
    assert contact_sheet([]) == []


def test_pictures_have_the_height_asked_for():
    assert module._of_height(np.zeros((100, 50, 3), np.uint8), 40).shape == (40, 20, 3)
    assert module._of_height(np.zeros((1000, 1, 3), np.uint8), 40).shape == (40, 1, 3)


@pytest.mark.parametrize("landmarks", [True, False])
def test_all_of_the_body_is_in_the_box_with_a_margin(landmarks):
    """Also what reaches beyond the landmarks, as the links of robots do."""
    camera, model = circle_rig(1).cameras[0], figure_model()
    model = model if landmarks else replace(model, landmarks=())
    body = Configuration(model, State.neutral(model, se3.from_rotation_translation(np.eye(3), np.array([0.1, 0.2, 1.0]))))
    rows, columns = module._box([body], camera)
    v, u = np.nonzero(render_mask(body, camera))
    assert rows.start < v.min() and v.max() < rows.stop - 1 and columns.start < u.min() and u.max() < columns.stop - 1
    assert rows.stop - rows.start < 1.5 * np.ptp(v)
    away = Configuration(model, State.neutral(model, se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, 90.0]))))
    assert module._box([away], camera) == module._box([], camera) == (slice(None), slice(None))


def test_masks_are_brought_to_the_pixels_of_the_camera():
    camera = circle_rig(1).cameras[0]
    small = np.zeros((240, 320), np.uint8)
    small[:120] = 255
    fitted = module._fitted(small, camera)
    assert fitted.shape == (480, 640) and np.unique(fitted).tolist() == [0, 255] and (fitted[:240] == 255).all()


def test_a_difference_needs_a_still():
    camera = circle_rig(1).cameras[0]
    assert module._still(camera, SimpleNamespace(still=None)) is None
    with pytest.raises(TrackerError, match=r"camera 'cam01': .* the rig names no background image"):
        module._still(camera, SimpleNamespace(still=""))


def test_a_run_without_a_state_has_nothing_to_show():
    run = SimpleNamespace(has_state=np.zeros(3, bool))
    found = module.review_images(run, None, circle_rig(1), {}, 1e9)
    assert found.problems == ["There is no image set with a state, and so no silhouette and no picture."] and not found.pictures
