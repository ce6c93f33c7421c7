"""The pictures show what they are made of."""

import numpy as np

from helpers.bodies.wooden_cross import cross
from tracker_node.camera.rig import CameraRig
from tracker_node.experiments.cross import experiment as cross_plots
from tracker_node.experiments.cross.throw import cross_rig, twisting_somersault
from tracker_node.experiments.rigid_tracking import moved

MODEL = cross()
TRUTH = twisting_somersault(MODEL).states()


def test_masks_show_a_row_for_each_camera_and_a_column_for_each_field():
    rig = CameraRig(tuple(type(c)(c.name, c.model.resized(192, 144), c.T_world_cam) for c in cross_rig()))
    images = {field: [np.full((144, 192, 3), (30, 200, 220), np.uint8)] * 3 for field in (0, 9)}
    figure = cross_plots.through_mask_figure(MODEL, rig, images, {0: [TRUTH[0]] * 3, 9: [TRUTH[9]] * 3})
    axes = np.array(figure.axes).reshape(3, 2)
    assert [ax.get_title() for ax in axes[0]] == ["field 1", "field 10"]
    assert [ax.get_ylabel() for ax in axes[:, 0]] == ["left", "right", "top"]
    for ax in axes.ravel():
        picture = np.asarray(ax.images[0].get_array())
        share = (picture.max(axis=2) > 0).mean()
        assert 0.02 < share < 0.6 and picture.shape[0] == picture.shape[1]
        assert (picture[picture.max(axis=2) > 0] == [220, 200, 30]).all()
        assert (picture[[0, -1]] == 0).all() and (picture[:, [0, -1]] == 0).all()


def test_curves_go_on_through_full_turns_and_leave_gaps():
    off = [moved(state, np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])) for state in TRUTH]
    figure = cross_plots.pose_figure({"truth": TRUTH, "tracked": off, "digitizing": [None, *TRUTH[1:]]})
    offsets = []
    for ax in figure.axes:
        true, tracked, digitized = (np.asarray(line.get_ydata()) for line in ax.lines)
        assert np.abs(np.diff(true)).max() < 100.0 and np.isnan(digitized[0]) and not np.isnan(digitized[1:]).any()
        offsets.append((tracked - true).mean())
        np.testing.assert_allclose(digitized[1:], true[1:], atol=1e-9)
    np.testing.assert_allclose(offsets, [1.0, 2.0, 3.0, 0.1, 0.2, 0.3], atol=1e-6)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["truth", "tracked", "digitizing"]
    assert figure.axes[1].get_ylabel() == "A-P [mm]"


def test_errors_are_drawn_as_they_are():
    errors = np.random.default_rng(0).normal(size=(34, 6))
    figure = cross_plots.error_figure({"best": errors})
    for column, ax in enumerate(figure.axes):
        np.testing.assert_array_equal(ax.lines[-1].get_ydata(), errors[:, column])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["best"]
