"""Pictures with their levels, and what is packed of boxes and meshes."""

import cv2
import numpy as np

from helpers.cameras.render_scenes import single_shape
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh
from tracker_node.render.raycast.surface_arrays import N_LEVELS, NO_TEXTURE, surface_arrays

RNG = np.random.default_rng(3)
TEXTURES = [RNG.integers(0, 255, (h, w, 3), dtype=np.uint8) for h, w in ((8, 20), (5, 3))]
FACE_COLORS = np.arange(18, dtype=np.uint8).reshape(6, 3)
VERTICES = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3]])
UV = np.array([[[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]], [[0.0, 1.0], [1.0, 0.0], [0.25, 0.75]]])


def test_levels_halve_until_one_texel_is_left_and_repeat():
    arrays = surface_arrays(single_shape(Box((1.0, 1.0, 1.0), textures=(TEXTURES[0], None, None, None, None, TEXTURES[1]))).model)
    assert arrays.textures.tolist() == [[0, NO_TEXTURE, NO_TEXTURE, NO_TEXTURE, NO_TEXTURE, 1]]
    assert arrays.levels.shape == (2, N_LEVELS, 3)
    assert arrays.levels[0, :6, 1:].tolist() == [[20, 8], [10, 4], [5, 2], [2, 1], [1, 1], [1, 1]]
    assert arrays.levels[0, :6, 0].tolist() == [0, 160, 200, 210, 212, 212]
    assert arrays.levels[1, :4].tolist() == [[213, 3, 5], [228, 1, 2], [230, 1, 1], [230, 1, 1]]
    assert len(arrays.texels) == 231
    np.testing.assert_array_equal(arrays.texels[:160].reshape(8, 20, 3), TEXTURES[0])
    np.testing.assert_array_equal(arrays.texels[213:228].reshape(5, 3, 3), TEXTURES[1])
    half = cv2.resize(TEXTURES[0], (10, 4), interpolation=cv2.INTER_AREA)
    np.testing.assert_array_equal(arrays.texels[160:200].reshape(4, 10, 3), half)


def meshes(**looks) -> np.ndarray:
    return surface_arrays(single_shape(Mesh(VERTICES, FACES, **looks), color_rgb=(9, 8, 7)).model).corners


def test_colors_of_corners():
    np.testing.assert_array_equal(meshes()[..., 3:], np.tile([9, 8, 7], (2, 3, 1)))
    by_vertex = np.arange(12, dtype=np.uint8).reshape(4, 3)
    np.testing.assert_array_equal(meshes(vertex_colors_rgb=by_vertex)[..., 3:], by_vertex[FACES])
    by_face = np.array([[1, 2, 3], [4, 5, 6]], dtype=np.uint8)
    np.testing.assert_array_equal(meshes(face_colors_rgb=by_face)[..., 3:], np.stack([by_face] * 3, axis=1))


def test_places_on_a_picture_count_down():
    mesh = Mesh(VERTICES, FACES, uv=UV, texture=TEXTURES[1])
    arrays = surface_arrays(single_shape(mesh).model)
    assert arrays.textures.tolist() == [[0] * 6]
    np.testing.assert_allclose(arrays.corners[..., 3], UV[..., 0], atol=1e-6)
    np.testing.assert_allclose(arrays.corners[..., 4], 1.0 - UV[..., 1], atol=1e-6)
    assert not arrays.corners[..., 5].any()


def test_normals_of_corners():
    np.testing.assert_allclose(meshes()[..., :3], np.repeat([[[0, 0, -1]], [[0, -1, 0]]], 3, axis=1), atol=1e-6)
    normals = RNG.normal(size=(4, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(meshes(normals=normals)[..., :3], normals[FACES], atol=1e-6)


def test_shapes_of_every_kind_in_order():
    shapes = (
        Shape("ball", "base", Ellipsoid((1.0, 1.0, 1.0)), color_rgb=(1, 2, 3)),
        Shape("plain", "base", Box((1.0, 1.0, 1.0)), color_rgb=(4, 5, 6)),
        Shape("box", "base", Box((1.0, 1.0, 1.0), face_colors_rgb=FACE_COLORS)),
        Shape("mesh", "base", Mesh(VERTICES, FACES)),
        Shape("again", "base", Mesh(VERTICES, FACES[:1])),
    )
    arrays = surface_arrays(ArticulatedModel("all", KinematicChain(("base",), ()), shapes))
    np.testing.assert_array_equal(arrays.colors[:3], [[[1, 2, 3]] * 6, [[4, 5, 6]] * 6, FACE_COLORS])
    assert arrays.corners.shape == (3, 3, 6) and arrays.corners.dtype == np.float32
    assert np.all(arrays.textures == NO_TEXTURE) and arrays.levels.shape == (0, N_LEVELS, 3) and arrays.texels.shape == (0, 3)
