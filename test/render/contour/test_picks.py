"""Which edges and rims of a body are picked, where on them, and the samples that are made of picks."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import single_shape
from tracker_node.model.shapes.primitives import Box, TruncatedCone
from tracker_node.render.contour.picks import N_PICK_COLUMNS, cap_rows, edge_rows, has_caps, pick_caps, pick_edges
from tracker_node.render.shape_arrays import ShapeArrays

BOX = ShapeArrays.from_model(single_shape(Box((2.0, 2.0, 2.0))).model)
PLACE = np.array([[0.0, -1.0, 0.0, 0.3], [1.0, 0.0, 0.0, -0.2], [0.0, 0.0, 1.0, 0.1], [0.0, 0.0, 0.0, 1.0]])


def picked(eye, most=200):
    """Picks, points and normals in the box's own frame, for a camera at ``eye`` there."""
    picks, out = np.zeros((most, N_PICK_COLUMNS)), np.zeros((most, 12))
    center = PLACE[:3, :3] @ eye + PLACE[:3, 3]
    n = pick_edges(BOX.surfaces, 0, PLACE, center, most, picks)
    edge_rows(BOX.surfaces, PLACE, center, picks, n, out)
    return n, picks, (out[:n, :3] - PLACE[:3, 3]) @ PLACE[:3, :3], out[:n, 3:6] @ PLACE[:3, :3], out


@pytest.mark.parametrize(
    ("eye", "faces", "creases"), [((9.0, 0.1, 0.2), 1, 0), ((5.0, 6.0, 0.1), 2, 1), ((5.0, 6.0, -7.0), 3, 3)]
)
def test_outlines_and_creases_of_a_box(eye, faces, creases):
    eye = np.array(eye)
    n, picks, points, normals, out = picked(eye)
    assert n == 200
    seen = np.abs(eye) > 1.0
    assert seen.sum() == faces
    on = np.isclose(points, np.sign(eye))  # on which of the faces that are turned to the camera
    away = np.isclose(points, -np.sign(eye)) | (np.isclose(np.abs(points), 1.0) & ~seen)
    assert np.all((on & seen).sum(axis=1) >= 1)  # none behind
    crease = picks[:, 3] == 1.0
    np.testing.assert_array_equal(crease, (on & seen).sum(axis=1) == 2)
    np.testing.assert_array_equal(~crease, away.any(axis=1))
    assert len(set(picks[crease, 0])) == creases
    np.testing.assert_allclose(np.einsum("ij,ij->i", normals, points - eye), 0.0, atol=1e-9)  # across the line of sight
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert np.all(np.einsum("ij,ij->i", normals, points)[~crease] > 0.0)  # outward
    np.testing.assert_array_equal(out[:, 6:9], 0.0)
    np.testing.assert_array_equal(out[:, 9:12], out[:, 3:6])
    # As many on each edge as its length takes up in the image, and evenly on it
    for edge in set(picks[:, 0]):
        mine = picks[:, 0] == edge
        start, end = BOX.surfaces[1][int(edge), :3], BOX.surfaces[1][int(edge), 3:6]
        middle = eye - 0.5 * (start + end)
        share = np.linalg.norm(np.cross(end - start, middle)) / (middle @ middle)
        assert mine.sum() / share == pytest.approx(len(picks) / total_length(eye, set(picks[:, 0])), rel=0.1)
        places = np.sort(picks[mine, 1])
        assert 0.0 <= places[0] < 1.01 * np.diff(places).max() and 1.0 - 1.01 * np.diff(places).max() < places[-1] <= 1.0
        np.testing.assert_allclose(np.diff(places), np.diff(places)[0], rtol=1e-6)
        np.testing.assert_allclose(points[mine], start + picks[mine, 1:2] * (end - start), atol=1e-9)


def total_length(eye, edges):
    total = 0.0
    for edge in edges:
        start, end = BOX.surfaces[1][int(edge), :3], BOX.surfaces[1][int(edge), 3:6]
        middle = eye - 0.5 * (start + end)
        total += np.linalg.norm(np.cross(end - start, middle)) / (middle @ middle)
    return total


def test_nothing_is_picked_from_within():
    assert picked(np.array([0.1, 0.2, 0.3]))[0] == 0


CONE = np.array([0.5, 0.3, -0.25, -1.0, 2.0])


def caps(eye, n_samples=32):
    picks, out = np.zeros((200, N_PICK_COLUMNS)), np.zeros((200, 12))
    center = PLACE[:3, :3] @ np.array(eye) + PLACE[:3, 3]
    n = pick_caps(CONE, PLACE, center, n_samples, picks)
    cap_rows(CONE, PLACE, center, picks, n, out)
    return picks[:n], (out[:n, :3] - PLACE[:3, 3]) @ PLACE[:3, :3], out[:n, 3:6] @ PLACE[:3, :3]


def test_rims_of_a_cone():
    """Above its upper cap all of that rim is seen; of the lower one the side to the camera."""
    eye = np.array([6.0, 1.0, 5.0])
    picks, points, normals = caps(eye)
    upper = picks[:, 0] == 1.0
    z = np.where(upper, 2.0, -1.0)
    scale = 1.0 - 0.25 * z
    np.testing.assert_allclose(points[:, 2], z)
    np.testing.assert_allclose((points[:, 0] / 0.5) ** 2 + (points[:, 1] / 0.3) ** 2, scale**2)
    np.testing.assert_allclose(np.arctan2(points[:, 1] / 0.3, points[:, 0] / 0.5) % (2.0 * np.pi), picks[:, 1])
    np.testing.assert_allclose(np.einsum("ij,ij->i", normals, points - eye), 0.0, atol=1e-9)
    # Gradient of the side, at which the camera is before it
    gradient = np.stack([points[:, 0] / 0.25, points[:, 1] / 0.09, 0.25 * scale], axis=1)
    before = np.einsum("ij,ij->i", gradient, eye - points) > 0.0
    np.testing.assert_array_equal(picks[:, 3] == 1.0, upper & before)
    assert np.all(before[~upper]) and not np.all(before[upper])
    np.testing.assert_array_equal(picks[:, 2], 1.0)
    # About as far apart as 32 on three meters: around the mean radius; eight at least
    assert upper.sum() == 13 and (~upper).sum() in (14, 15, 16, 17)
    np.testing.assert_allclose(picks[upper, 1], 2.0 * np.pi * (np.arange(13) + 0.5) / 13)
    assert (caps(eye, 12)[0][:, 0] == 1.0).sum() == 8 and (caps(eye, 6)[0][:, 0] == 1.0).sum() == 6


def test_rims_from_below_and_beside():
    below, _, _ = caps((0.1, 0.2, -9.0))
    assert (below[:, 0] == 0.0).sum() == 32 and np.all(below[below[:, 0] == 0.0, 2] == -1.0)
    beside, points, _ = caps((8.0, 0.0, 0.5))
    assert not beside[:, 3].any() and np.all(points[:, 0] > 0.0)
    assert beside[beside[:, 0] == 0.0, 2].tolist() == [1.0] * (beside[:, 0] == 0.0).sum()
    assert np.all(beside[beside[:, 0] == 1.0, 2] == -1.0)


def test_which_shapes_have_caps():
    model = single_shape(TruncatedCone(0.5, 0.3, 0.1, 0.0, 1.0)).model
    assert has_caps(ShapeArrays.from_model(model).surfaces, 0)
    assert not has_caps(ShapeArrays.from_model(model, caps=False).surfaces, 0)
    assert not has_caps(BOX.surfaces, 0)
