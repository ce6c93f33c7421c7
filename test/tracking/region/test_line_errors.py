"""Shifts of contours by a pixel as motions of links."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.model.configuration import Configuration, State
from tracker_node.tracking.config import RegionConfig
from tracker_node.tracking.region.judge import LineErrors, sums_of_errors

MODEL = crane()
RIG = circle_rig(3, distortion=(0.0, 0.0, 0.0, 0.0))
ERRORS = LineErrors(RIG, MODEL, RegionConfig(least_sigma_px=0.5))


def middle_of(body, link):
    own = np.flatnonzero(MODEL.shape_links == link)
    return body.Ts_world_shape[own, :3, 3].mean(axis=0)


def shift(camera, link, body):
    """(6, 2) what a shift of all contours does to a link on which one camera says as much of each component of its twist."""
    n_links = len(MODEL.chain.links)
    normal, correlated = np.zeros((len(RIG), n_links, 6, 6)), np.zeros((len(RIG), n_links, 2))
    normal[camera, link], correlated[camera, link] = np.eye(6), (3.0, 2.0)
    moved = np.ones((n_links, 6), dtype=np.bool_)
    information, scatter, shifted = sums_of_errors(
        normal, correlated, ERRORS._cameras, ERRORS._middles, body.Ts_world_link, moved, np.eye(6)
    )
    np.testing.assert_array_equal(information, normal.sum(axis=0))
    np.testing.assert_allclose(scatter, 1.5 * information)
    return shifted


@pytest.mark.parametrize("camera", [0, 2])
@pytest.mark.parametrize("link", [0, 1, 2])
def test_a_shift_moves_the_middle_of_a_link_by_a_pixel(camera, link):
    pose = State.neutral(MODEL).retract(np.array([0.1, 0.2, 1.0, 0.1, -0.2, 0.3] + [0.0] * (MODEL.n_dof - 6)))
    body = Configuration(MODEL, pose)
    twists = shift(camera, link, body)
    assert not twists[3:].any()
    place = middle_of(body, link)
    before = RIG.cameras[camera].project(place)[0]
    for axis in range(2):
        after = RIG.cameras[camera].project(place + twists[:3, axis])[0]
        np.testing.assert_allclose(after - before, np.eye(2)[axis], atol=1e-9)


def test_a_link_without_shapes_counts_at_its_origin():
    body = Configuration(MODEL, State.neutral(MODEL))
    hook = MODEL.chain.links.index("hook")
    assert not np.any(MODEL.shape_links == hook)
    camera = RIG.cameras[1]
    depth = (camera.T_cam_world @ body.Ts_world_link[hook])[2, 3]
    lengths = np.linalg.norm(shift(1, hook, body)[:3], axis=0)
    np.testing.assert_allclose(lengths, [depth / 600.0, depth / 605.0])


def test_the_least_spread_is_a_little_less_than_stated():
    assert pytest.approx(0.85 * 0.5) == ERRORS._least_px
