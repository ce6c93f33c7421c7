"""Points on pictured faces: where they are, and which color the picture has there."""

import cv2
import numpy as np
import pytest

from tracker_node.errors import ModelError
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.kinematic_chain import Joint, KinematicChain
from tracker_node.model.shapes.primitives import BOX_FACES, Box, Ellipsoid
from tracker_node.objective.points.texture import surface_points, textured_extent

CHAIN = KinematicChain(("base", "arm"), (Joint("weld", "base", "arm", np.eye(4)),))
SIZE = np.array([0.2, 0.3, 0.5])
PLACE = se3.exp(np.array([0.1, -0.2, 0.3, 0.4, 0.5, -0.6]))


def boxes(textures, size=SIZE, place=PLACE) -> ArticulatedModel:
    plain = (Shape("ball", "base", Ellipsoid((0.1, 0.1, 0.1))), Shape("plain", "base", Box((9.0, 9.0, 9.0))))
    return ArticulatedModel("boxes", CHAIN, (*plain, Shape("box", "arm", Box(tuple(size), textures=textures), place)))


def on_face(face, picture):
    return tuple(picture if name == face else None for name in BOX_FACES)


def ramp(height=20, width=30) -> np.ndarray:
    """Red rises by 8 a column, green by 10 a row, blue stays."""
    rows, columns = np.indices((height, width))
    return np.stack([8 * columns, 10 * rows, np.full((height, width), 77)], axis=-1).astype(np.uint8)


@pytest.mark.parametrize("face", BOX_FACES)
def test_a_face_is_covered_from_its_upper_left_corner(face):
    """Upper and left are those of a viewer from outside, for whom z points up; on the faces +z and -z: y."""
    axis, sign = "xyz".index(face[1]), 1.0 if face[0] == "+" else -1.0
    normal, up = sign * np.eye(3)[axis], np.eye(3)[1 if axis == 2 else 2]
    right = np.cross(-normal, up)
    found = surface_points(boxes(on_face(face, ramp())), 0.05)
    local = (found.positions - PLACE[:3, 3]) @ PLACE[:3, :3]
    np.testing.assert_allclose(local @ normal, SIZE[axis] / 2.0)
    np.testing.assert_allclose(found.normals @ PLACE[:3, :3], np.tile(normal, (len(local), 1)), atol=1e-12)
    width, height = abs(right @ SIZE), abs(up @ SIZE)
    n_columns, n_rows = round(width / 0.05), round(height / 0.05)
    assert len(local) == n_columns * n_rows and set(found.links) == {1} and found.spacing_m == 0.05
    u, v = local @ right / width + 0.5, 0.5 - local @ up / height
    np.testing.assert_allclose(np.unique(u.round(9)), (np.arange(n_columns) + 0.5) / n_columns)
    np.testing.assert_allclose(np.unique(v.round(9)), (np.arange(n_rows) + 0.5) / n_rows)
    inner = (abs(u - 0.5) < 0.35) & (abs(v - 0.5) < 0.35)  # a blur leaves a ramp as it is, but for its ends
    assert inner.sum() >= 4
    np.testing.assert_allclose(found.colors[inner, 0], 8.0 * (30 * u - 0.5)[inner], atol=1.5)
    np.testing.assert_allclose(found.colors[inner, 1], 10.0 * (20 * v - 0.5)[inner], atol=1.5)
    np.testing.assert_allclose(found.colors[:, 2], 77.0, atol=1e-3)
    assert found.colors.dtype == np.float32


def test_a_face_has_two_points_each_way_at_least():
    assert len(surface_points(boxes(on_face("+z", ramp())), 5.0).positions) == 4
    assert len(surface_points(boxes(on_face("+z", ramp())), 0.1).positions) == 2 * 3


def test_the_extent_is_the_longest_edge_of_pictured_faces_only():
    assert textured_extent(boxes(on_face("+z", ramp()))) == pytest.approx(0.3)
    assert textured_extent(boxes(on_face("-x", ramp()))) == pytest.approx(0.5)
    assert textured_extent(boxes(on_face("+x", ramp()), size=(0.1, 0.7, 0.5))) == pytest.approx(0.7)


def test_no_picture_is_said():
    for call in (textured_extent, lambda model: surface_points(model, 0.05)):
        with pytest.raises(ModelError, match="'boxes' has no box with a texture"):
            call(boxes(None))


def test_points_of_all_faces_one_after_the_other():
    found = surface_points(boxes((ramp(), None, None, ramp(), None, None)), 0.1)
    local = found.normals @ PLACE[:3, :3]
    np.testing.assert_allclose(local, [[1, 0, 0]] * 3 * 5 + [[0, -1, 0]] * 2 * 5, atol=1e-12)
    assert len(found.positions) == len(found.links) == len(found.colors) == 25


FLAT = np.array([0.2, 0.1, 0.05])  # +z: 0.2 wide, 0.1 high


def test_the_picture_is_blurred_as_wide_as_points_are_apart():
    """Half a spacing, by the size of texels across and down: with 10 by 10 of them, half a texel and a whole one."""
    line = np.zeros((10, 10, 3), np.uint8)
    line[:, 5] = 200
    across = surface_points(boxes(on_face("+z", line), FLAT), 0.02).colors[:, 0].reshape(5, 10)
    np.testing.assert_allclose(across[2, [4, 6]] / across[2, 5], np.exp(-0.5 / 0.5**2), rtol=0.02)
    line = line.transpose(1, 0, 2).copy()
    down = surface_points(boxes(on_face("+z", line), FLAT), 0.02).colors[:, 0].reshape(5, 10)
    k = np.exp(-0.5 * np.arange(6.0) ** 2)  # points lie between texels: 0.5, 2.5, 4.5 ...
    np.testing.assert_allclose(
        down[[1, 3], 3] / down[2, 3], [(k[2] + k[3]) / (k[0] + k[1]), (k[1] + k[2]) / (k[0] + k[1])], rtol=0.02
    )


def test_points_as_close_as_texels_are_not_blurred():
    noise = np.random.default_rng(1).integers(0, 255, (10, 10, 3), dtype=np.uint8)
    colors = surface_points(boxes(on_face("+z", noise), (0.1, 0.1, 0.1)), 0.005).colors.reshape(20, 20, 3)
    x = ((np.arange(20) + 0.5) / 2.0 - 0.5).astype(np.float32)
    expected = cv2.remap(noise.astype(np.float32), *np.meshgrid(x, x), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    np.testing.assert_allclose(colors, expected, atol=1e-3)


def test_a_blur_in_one_direction_leaves_the_other():
    """Texels twenty times as wide as high: across they are larger than the spacing, down much smaller."""
    picture = np.zeros((100, 5, 3), np.uint8)
    picture[:, 2] = 200
    colors = surface_points(boxes(on_face("+z", picture), (0.1, 0.1, 0.1)), 0.01).colors[:, 0].reshape(10, 10)
    np.testing.assert_allclose(colors[5, [0, 1, 8, 9]], 0.0, atol=0.02)
    assert colors[5, 4] == pytest.approx(150.0, abs=1.0)  # a quarter of a texel off its center


def test_more_points_than_opencv_takes_at_once():
    colors = surface_points(boxes(on_face("+z", ramp(20, 20)), (0.2, 0.2, 0.2)), 0.001).colors.reshape(200, 200, 3)
    np.testing.assert_allclose(colors[100, 5:195, 0], 8.0 * ((np.arange(5, 195) + 0.5) / 10.0 - 0.5), atol=0.3)
    np.testing.assert_allclose(colors[5:195, 100, 1], 10.0 * ((np.arange(5, 195) + 0.5) / 10.0 - 0.5), atol=0.3)
