"""One camera's lines in one call: the steps, one after another, say the same."""

import numpy as np

from test.objective.lines.test_correspondences import at, disk, drawing_of, rig
from tracker_node.model.configuration import Configuration
from tracker_node.objective.lines.camera import correspond_camera, sum_camera
from tracker_node.objective.lines.correspondence import line_arrays
from tracker_node.objective.lines.correspondences import LineSums
from tracker_node.objective.per_camera import camera_constants
from tracker_node.render.contour.generators import world_spheres
from tracker_node.render.contour.samples import collect_samples, keep_inside, most_samples

N_SAMPLES, OUTWARD_PX = 20, 3.0


def test_lines_lie_where_the_samples_that_are_seen_do_and_sums_are_overwritten():
    image, radius_px = disk(0.25)
    drawing, state = drawing_of(0.25, image, radius_px=radius_px), at(x=0.55)  # half beyond the image
    body, view, camera = Configuration(drawing.model, state), drawing.view, camera_constants(rig().cameras[0])
    packed, bounds, Ts = drawing.arrays.packed, drawing.arrays.bounds, body.Ts_world_shape
    work = drawn_rows, drawn_pixels, drawn_info, lines = line_arrays(most_samples(packed, N_SAMPLES))
    options = drawing.options.packed(1.0, 0.5)
    sums = tuple(np.full_like(a, 7.0) for a in LineSums.empty(state, [body], 1).of_camera(0))
    n = correspond_camera(
        view.packed, np.empty((0, 0), np.float32), drawing.classes, packed, bounds, Ts,
        body.Ts_world_link, camera, N_SAMPLES, OUTWARD_PX, options, np.zeros((0, 4)), work, sums,
    )  # fmt: skip

    rows, pixels, info, _ = line_arrays(len(drawn_rows))
    spheres = np.empty((1, 4))
    world_spheres(Ts, bounds, spheres)
    seen = collect_samples(packed, Ts, spheres, camera, N_SAMPLES, OUTWARD_PX, rows, pixels, info)
    assert 0 < n < seen
    assert n == keep_inside(rows, pixels, info, seen, image.shape[1], image.shape[0])
    np.testing.assert_array_equal(drawn_pixels[:n], pixels[:n])

    again = tuple(np.zeros_like(a) for a in sums)
    sum_camera(lines, drawn_info, n, body.Ts_world_link, camera, options, again)
    for first, second in zip(sums, again, strict=True):
        np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(sums[0], np.swapaxes(sums[0], 1, 2))
    assert sums[0].any()
