"""Lines of several cameras as one."""

import numpy as np

from tracker_node.calibration.tracked_body.lines import joined
from tracker_node.objective.shape_jacobian import ContourLines


def lines(camera, *shapes):
    n = len(shapes)
    ones = np.ones((n, 2))
    return ContourLines(
        np.full(n, camera), np.array(shapes), np.ones((n, 3)), ones, ones, np.arange(float(n)), np.full(n, camera + 1.0)
    )


def test_lines_of_all_cameras_are_in_the_order_of_their_shapes():
    found = joined([lines(0, 2, 1), lines(1, 1, 0)])
    assert found.shape.tolist() == [0, 1, 1, 2] and found.camera.tolist() == [1, 0, 1, 0]
    assert found.means.tolist() == [1.0, 1.0, 0.0, 0.0] and found.variances.tolist() == [2.0, 1.0, 2.0, 1.0]


def test_no_lines_are_none_of_every_kind():
    none = joined([])
    assert len(none) == len(none.shape) == len(none.means) == 0
    assert none.points.shape == (0, 3) and none.centers.shape == none.normals.shape == (0, 2)
    assert len(joined([none, lines(0, 3)])) == 1
