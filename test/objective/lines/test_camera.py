"""One camera's lines in one call: the steps, one after another, say the same."""

import numpy as np

from test.objective.lines.test_objective import at, disk, objective_of
from tracker_node.model.configuration import Configuration
from tracker_node.objective.lines.camera import correspond_camera, sum_camera
from tracker_node.objective.lines.correspondence import line_arrays
from tracker_node.render.contour.generators import world_spheres
from tracker_node.render.contour.samples import collect_samples, keep_inside

N_SAMPLES, OUTWARD_PX = 20, 3.0


def test_lines_lie_where_the_samples_that_are_seen_do_and_sums_are_overwritten():
    image, radius_px = disk(0.25)
    objective, state = objective_of(0.25, image, radius_px=radius_px), at(x=0.55)  # half beyond the image
    body, slot, view = Configuration(objective.model, state), objective.slots[0], objective.views[0]
    packed, bounds, Ts = objective.arrays.packed, objective.arrays.bounds, body.Ts_world_shape
    sums, options = tuple(np.full_like(a, 7.0) for a in slot.sums), objective.options.packed(1.0, 0.5)
    n = correspond_camera(
        (view.bgr, view.densities, view.room), np.empty((0, 0), np.float32), objective.classes, packed, bounds, Ts,
        body.Ts_world_link, slot.camera, N_SAMPLES, OUTWARD_PX, options, slot.drawn, sums,
    )  # fmt: skip

    rows, pixels, info, _ = line_arrays(len(slot.rows))
    spheres = np.empty((1, 4))
    world_spheres(Ts, bounds, spheres)
    seen = collect_samples(packed, Ts, spheres, slot.camera, N_SAMPLES, OUTWARD_PX, rows, pixels, info)
    assert 0 < n < seen
    assert n == keep_inside(rows, pixels, info, seen, image.shape[1], image.shape[0])
    np.testing.assert_array_equal(slot.pixels[:n], pixels[:n])

    again = tuple(np.zeros_like(a) for a in sums)
    sum_camera(slot.lines, slot.info, n, body.Ts_world_link, slot.camera, options, again)
    for first, second in zip(sums, again, strict=True):
        np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(sums[0], np.swapaxes(sums[0], 1, 2))
    assert sums[0].any()
