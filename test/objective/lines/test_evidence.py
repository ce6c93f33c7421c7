"""The evidence of lines, counted by kernels, against sums written out in numpy."""

import numpy as np

from helpers.bodies.two_links import cameras, two_links
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.lines import correspondence as kernel
from tracker_node.objective.lines.correspondences import LineDrawer, LineOptions, View
from tracker_node.observation.region.colors import N_COLORS
from tracker_node.render.contour.generators import OUTER
from tracker_node.render.contour.samples import CLASS, LINK, SHAPE
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.render.shape_arrays import ShapeArrays

CLOSE_PX = 1.0


def test_evidence_is_what_the_lines_say():
    model, rig = two_links(), CameraRig(tuple(cameras()))
    drawn = State(se3.exp([0.02, 0.05, -0.1, 0.1, 0.2, 0.3]), np.array([0.6, 0.4]))
    state = drawn.retract(np.array([0.004, -0.003, 0.002, 0.02, 0.01, -0.02, 0.03, 0.02]))
    body, scene = np.full((1, N_COLORS), 1e-6, dtype=np.float32), np.full(N_COLORS, 1e-6, dtype=np.float32)
    body[0, -1], scene[0] = 1.0, 1.0
    options, model_sigma_px = LineOptions(), 0.5
    drawer = LineDrawer(rig, model, ShapeArrays.from_model(model), np.zeros(3, dtype=np.int32), options)
    masks = [render_mask(Configuration(model, drawn), camera) > 0 for camera in rig]
    views = [View(np.repeat(255 * m[:, :, None].astype(np.uint8), 3, axis=2), (body, scene)) for m in masks]
    found = drawer.draw(views, drawn, 1.0, model_sigma_px)
    evidence = found.at(state).part_evidence(CLOSE_PX)
    there = Configuration(model, state)
    for i, camera in enumerate(rig):
        lines, info = found.cameras[i].lines, found.cameras[i].info
        T = there.Ts_world_link[info[:, LINK]]
        points = np.einsum("nij,nj->ni", T[:, :3, :3], lines[:, :3]) + T[:, :3, 3]
        pixels, valid = camera.model.project(se3.apply(camera.T_cam_world, points))
        assert valid.all()
        normals, told = lines[:, kernel.LINE_NU : kernel.LINE_NV + 1], lines[:, kernel.PRECISION] > 0.0
        r = np.einsum("nj,nj->n", normals, pixels - lines[:, kernel.LINE_U : kernel.LINE_V + 1]) - lines[:, kernel.MEAN]
        for shape in range(3):
            mine = (info[:, CLASS] == OUTER) & (info[:, SHAPE] == shape)
            model_variance = options.packed(1.0, model_sigma_px)[kernel.MODEL_VARIANCE]
            assert evidence.expected[i, shape] == mine.sum()
            assert evidence.found[i, shape] == (mine & told).sum()
            assert evidence.close[i, shape] == (mine & told & (np.abs(r) < CLOSE_PX)).sum()
            reach_px = options.half_length
            out = (r < -0.6 * reach_px) & (lines[:, kernel.MEAN] > 0.6 * reach_px)
            filled = told & (lines[:, kernel.PRECISION] < 1.0) & (np.abs(r) >= CLOSE_PX) & out
            assert evidence.filled[i, shape] == (mine & filled).sum()
            empty = told & (np.abs(r) >= CLOSE_PX) & (r > 0.6 * reach_px) & (lines[:, kernel.MEAN] < -0.6 * reach_px)
            assert evidence.empty[i, shape] == (mine & empty).sum()
            used = mine & told
            chi2 = (r[used] ** 2 / (1.0 / lines[used, kernel.PRECISION] + model_variance)).sum()
            np.testing.assert_allclose(evidence.chi2[i, shape], chi2, rtol=1e-9)
            np.testing.assert_allclose(evidence.log_ratio[i, shape], lines[mine, kernel.LOG_RATIO].sum(), rtol=1e-9)
    assert 0.0 < evidence.close.sum() < evidence.found.sum() <= evidence.expected.sum()
