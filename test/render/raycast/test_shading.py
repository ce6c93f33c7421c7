"""Light, pictures and surfaces at one pixel."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import LIGHTS, colored_scene, icosahedron, look_at, picture, single_shape, tetrahedron
from helpers.numeric import naive
from tracker_node.camera.light import Light, pack_lights
from tracker_node.camera.model import CameraModel
from tracker_node.geometry import se3, so3
from tracker_node.model.shapes.primitives import BOX_FACES, Box, Mesh, is_closed
from tracker_node.render.raycast.lighting import displayed, irradiance, lights_in_camera
from tracker_node.render.raycast.raycaster import cast, render_color
from tracker_node.render.raycast.shading import surface_at
from tracker_node.render.raycast.surface_arrays import sample, surface_arrays

LENS = CameraModel(160, 120, np.array([[150.0, 0.0, 80.0], [0.0, 150.0, 60.0], [0.0, 0.0, 1.0]]))
MANY = (*LIGHTS, Light("spot", (0.4, 0.1, 0.9), (0.0, 0.0, 3.0), (0.3, 0.0, -1.0), 1.9))


def test_light_in_the_camera_is_light_in_the_world():
    rng = np.random.default_rng(0)
    points, normals = rng.uniform(-2, 2, (200, 3)), rng.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    T_cam_world = se3.from_rotation_translation(so3.exp(np.array([0.4, -1.0, 2.0])), np.array([0.3, 0.1, 2.0]))
    expected = sum(naive.light_on(light, points, normals) for light in MANY)
    lights = lights_in_camera(pack_lights(MANY), T_cam_world)
    turned = np.concatenate([se3.apply(T_cam_world, points), normals @ T_cam_world[:3, :3].T], axis=1).astype(np.float32)
    found = np.array([irradiance(lights, *row) for row in turned])
    np.testing.assert_allclose(found, expected, atol=2e-5)
    assert expected.std() > 0.1


def test_a_light_in_the_surface_lights_nothing():
    lights = lights_in_camera(pack_lights((Light("point", position=(0.0, 0.0, 1.0)),)), np.eye(4))
    found = irradiance(lights, *np.array([0.0, 0.0, 1.0, 0.0, 0.0, -1.0], dtype=np.float32))
    assert np.isfinite(found).all()


@pytest.mark.parametrize(("light", "gain", "gamma", "expected"), [
    (1.0, 1.0, 1.0, 80.0), (0.0, 1.0, 2.2, 0.0), (0.5, 1.0, 2.0, 80 * 0.5**0.5), (0.5, 4.0, 1.0, 160.0), (10.0, 1.0, 1.0, 255.0),
])  # fmt: skip
def test_the_answer_of_a_camera(light, gain, gamma, expected):
    values = (np.float32(value) for value in (80.0, light, gain, 1.0 / gamma))
    assert displayed(*values) == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_pictures_between_texels():
    arrays = surface_arrays(single_shape(Box((1, 1, 1), None, (picture(3, 13, 7),) * 6)).model)
    rng = np.random.default_rng(1)
    where = rng.uniform(-0.2, 1.2, (300, 2)).astype(np.float32)
    found = [sample(arrays.levels, arrays.texels, 0, u, v, *np.zeros(4, dtype=np.float32)) for u, v in where]
    np.testing.assert_allclose(found, naive.bilinear(picture(3, 13, 7), *where.T.astype(float)), atol=0.02)


@pytest.mark.parametrize("primitive", ["box", "mesh"])
@pytest.mark.parametrize("distance", [3.0, 9.0])
def test_small_pictures_are_averaged(primitive, distance):
    """A checkerboard whose squares are far smaller than pixels is gray, not a random pattern of its colors."""
    checks = np.kron(np.indices((128, 128)).sum(axis=0) % 2, np.ones((2, 2)))[..., None] * np.array([240, 240, 240])
    checks = checks.astype(np.uint8)
    if primitive == "box":
        configuration = single_shape(Box((1.0, 1.0, 1.0), None, (checks,) * 6))
    else:
        square = np.array([[-0.5, 0, -0.5], [0.5, 0, -0.5], [0.5, 0, 0.5], [-0.5, 0, 0.5]])
        uv = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1.0]]])
        configuration = single_shape(Mesh(square, np.array([[0, 1, 2], [0, 2, 3]]), texture=checks, uv=uv))
    view = render_color(configuration, look_at((0.1, -distance, 0.2), (0.0, 0.0, 0.0), LENS))
    inside = view.labels > 0
    assert inside.sum() > 100
    assert np.abs(view.rgb[inside] - 120.0).max() < 30.0
    assert abs(view.rgb[inside].mean() - 120.0) < 2.0


def test_a_picture_of_the_size_of_pixels_is_like_the_average_over_each():
    """Against the same view nine times as large, averaged: what a camera with square pixels sees."""
    smooth = picture(5, 96, 96)
    configuration = single_shape(
        Box((1.0, 1.0, 1.0), None, (smooth,) * len(BOX_FACES)), se3.exp(np.array([0, 0, 0, 0.3, 0.2, 0.6]))
    )
    camera = look_at((0.1, -4.0, 0.2), (0.0, 0.0, 0.0), LENS)
    large = look_at((0.1, -4.0, 0.2), (0.0, 0.0, 0.0), LENS.resized(160 * 9, 120 * 9))
    view, fine = render_color(configuration, camera), render_color(configuration, large)
    covered = (fine.labels > 0).reshape(120, 9, 160, 9).all(axis=(1, 3))
    average = fine.rgb.reshape(120, 9, 160, 9, 3).mean(axis=(1, 3))
    assert covered.sum() > 1000
    difference = np.abs(view.rgb - average)[covered]
    assert difference.mean() < 2.0


def test_points_and_normals_of_a_cast():
    """The normal is across the surface through the points of neighboring pixels, whatever the shape is."""
    configuration, camera = colored_scene(7, spread=0.4), look_at((0.0, -1.5, 0.2), (0.0, 0.0, 0.0), LENS)
    found, arrays = cast(configuration, camera, (0, 0, 160, 120)), surface_arrays(configuration.model)
    u0, v0 = found.region[:2]
    labels = found.buffer & 255

    def at(row, column):
        x, y = found.table.xs[v0 + row, u0 + column - found.column], found.table.ys[v0 + row, u0 + column - found.column]
        shape, number = int(labels[row, column] - 1), int(found.numbers[row, column])
        posed = found.coefficients, found.frames, found.triangles
        return np.array(surface_at(*posed, arrays.corners, arrays.levels, arrays.texels, shape, number, x, y))

    checked = set()
    for row, column in np.argwhere(labels[:-1, :-1] > 0)[::7]:
        shape = configuration.model.shapes[labels[row, column] - 1]
        around = labels[row : row + 2, column : column + 2], found.numbers[row : row + 2, column : column + 2]
        smooth = getattr(shape.primitive, "normals", None) is not None
        if smooth or any((part != part[0, 0]).any() for part in around):
            continue
        here, right, down = at(row, column), at(row, column + 1), at(row + 1, column)
        across = np.cross(down[:3] - here[:3], right[:3] - here[:3])
        across /= np.linalg.norm(across)
        others = np.array([right[3:6], down[3:6]])
        if (others @ here[3:6]).min() > 0.99:  # one face, or not too curved
            assert across @ here[3:6] > 0.98
            checked.add(shape.name)
    assert len(checked) >= 7, checked


def test_closed_meshes_are_known():
    closed = icosahedron(0.3)
    assert is_closed(closed)
    assert is_closed(tetrahedron(0.2)) == (np.linalg.det(tetrahedron(0.2).vertices[:3]) > 0)
    assert not is_closed(Mesh(closed.vertices, closed.faces[1:]))
    assert not is_closed(Mesh(closed.vertices, closed.faces[:, ::-1]))
    assert not is_closed(Mesh(closed.vertices, np.vstack([closed.faces[:-1], closed.faces[-1:, ::-1]])))
    # Every face with vertices of its own, as mesh files have them
    assert is_closed(Mesh(closed.vertices[closed.faces].reshape(-1, 3), np.arange(60).reshape(-1, 3)))
    assert not is_closed(Mesh(np.zeros((0, 3)), np.zeros((0, 3))))
