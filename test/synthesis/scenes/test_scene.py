"""Pictures agree with cameras: what is rendered lies where the rig says, through the lens, in crops, with its shadow."""

import cv2
import numpy as np
import pytest

from tracker_node.model.shapes.primitives import Box, Ellipsoid, TruncatedCone
from tracker_node.synthesis.scenes.rasterizer import ColoredMesh, Rasterizer, light_coordinates
from tracker_node.synthesis.scenes.scene import CameraImaging, SceneConfig, Studio, make_rig
from tracker_node.synthesis.subjects.cones import tessellate

POINTS = np.array([[0.0, 0.0, 0.9], [0.7, -0.5, 1.8], [-0.8, 0.6, 0.1], [0.2, 1.1, 1.2]])
CLEAN = SceneConfig(n_cameras=3, noise_levels=0.0, blur_px=0.0, shadow=False)


def sphere(center: np.ndarray, radius: float = 0.03) -> ColoredMesh:
    vertices, normals, faces = tessellate(Ellipsoid((radius, radius, radius)))
    return ColoredMesh(vertices + center, faces, np.full(vertices.shape, 255, np.uint8), normals)


def centroid(weight: np.ndarray) -> np.ndarray:
    v, u = np.indices(weight.shape)
    return np.array([(weight * u).sum(), (weight * v).sum()]) / weight.sum()


@pytest.mark.parametrize("distortion", [(), (-0.11, 0.045, 0.0006, -0.0004), (-0.3, 0.1, 0.002, 0.001)])
def test_spheres_are_seen_where_the_cameras_project_them(distortion):
    """Half a pixel of principal point, an axis the wrong way, or the lens left out would all show here."""
    config = SceneConfig(n_cameras=3, noise_levels=0.0, blur_px=0.0, distortion=distortion)
    rig = make_rig(config)
    rng = np.random.default_rng(0)
    worst = 0.0
    with Rasterizer() as rasterizer:
        for camera in rig:
            imaging = CameraImaging(camera, config)
            for point in POINTS:
                rasterizer.show(sphere(point))
                color, _, window = rasterizer.render_region(imaging.pinhole, point + 0.03 * np.vstack([np.eye(3), -np.eye(3)]))
                view = np.zeros((imaging.pinhole.model.height, imaging.pinhole.model.width, 3), np.float32)
                view[window] = color[:, :, 3:]  # coverage, so that shading does not pull the centroid
                seen = centroid(imaging.expose(view, rng)[:, :, 0].astype(float))
                expected, valid = camera.project(point)
                assert valid
                worst = max(worst, float(np.abs(seen - expected).max()))
    assert worst < 0.1


def test_a_crop_shows_the_same_pixels_as_the_whole_view():
    rig = make_rig(CLEAN)
    with Rasterizer() as rasterizer:
        imaging = CameraImaging(rig.cameras[1], CLEAN)
        mesh = sphere(POINTS[0], 0.2)
        rasterizer.show(mesh)
        whole, depth = rasterizer.render(imaging.pinhole)
        part, part_depth, window = rasterizer.render_region(imaging.pinhole, mesh.vertices)
    assert np.count_nonzero(whole[:, :, 3]) == np.count_nonzero(part[:, :, 3]) > 1000
    np.testing.assert_array_less(np.abs(whole[window].astype(int) - part), 3)
    inside = part_depth > 0.0
    distance = np.linalg.norm(rig.cameras[1].center - POINTS[0])
    assert np.abs(depth[window][inside] - part_depth[inside]).max() < 1e-3
    assert part_depth[inside].min() == pytest.approx(distance - 0.2, abs=0.01)


def test_the_shadow_map_lies_under_the_light():
    with Rasterizer() as rasterizer:
        for point in POINTS:
            rasterizer.show(sphere(point, 0.1))
            cover = rasterizer.render_from_light(np.zeros(3), 3.2, 512)
            np.testing.assert_allclose(centroid(cover), light_coordinates(point, np.zeros(3), 3.2, 512), atol=0.05)


def test_a_subject_changes_its_own_pixels_and_its_shadow_only():
    config = SceneConfig(n_cameras=2, noise_levels=0.0, blur_px=0.0)
    rig = make_rig(config)
    with Studio(rig, config) as studio:
        empty = [studio.empty_image(i, 0).astype(int) for i in range(2)]
        seen = studio.images(sphere(np.array([0.0, 0.0, 0.8]), 0.25), 0)
    for camera, before, after in zip(rig, empty, seen, strict=True):
        changed = np.abs(after - before).max(axis=2) > 6
        uv, _ = camera.project(np.array([0.0, 0.0, 0.8]))
        radius = camera.model.K[0, 0] * 0.25 / np.linalg.norm(camera.center - [0.0, 0.0, 0.8])
        v, u = np.indices(changed.shape)
        body = np.hypot(u - uv[0], v - uv[1]) < radius - 3.0
        near = np.hypot(u - uv[0], v - uv[1]) < radius + 6.0
        assert changed[body].mean() > 0.95
        shadow = changed & ~near
        assert 200 < shadow.sum() < 20000
        assert (after[shadow] <= before[shadow]).all()  # a shadow only darkens
        assert not changed[:60].any() and not changed[:, :60].any()


def test_noise_is_repeatable_and_of_the_size_asked_for():
    config = SceneConfig(n_cameras=1, noise_levels=4.0)
    with Studio(make_rig(config), config) as studio:
        a, again, other = (studio.empty_image(0, i) for i in (0, 0, 1))
    np.testing.assert_array_equal(a, again)
    difference = a.astype(float) - other
    assert difference.std() / np.sqrt(2.0) == pytest.approx(4.0, rel=0.25)
    assert abs(cv2.blur(difference, (31, 31)).mean()) < 0.1


def test_cameras_stand_around_and_see_the_middle():
    config = SceneConfig(n_cameras=6)
    rig = make_rig(config)
    angles = np.sort([np.arctan2(*camera.center[1::-1]) for camera in rig])
    assert np.diff(angles).min() > np.radians(45.0)
    for camera in rig:
        pixel, valid = camera.project(np.array([0.0, 0.0, config.target_height]))
        assert valid and np.abs(pixel - [319.5, 239.5]).max() < 20.0
        assert camera.T_world_cam[:3, 1] @ [0.0, 0.0, -1.0] > 0.8  # upright: image rows run downward


@pytest.mark.parametrize(
    "primitive", [TruncatedCone(0.1, 0.06, -0.8, -0.05, 0.4), Ellipsoid((0.1, 0.2, 0.05)), Box((0.1, 0.2, 0.4))]
)
def test_meshes_are_closed_outward_and_of_the_right_volume(primitive):
    vertices, normals, faces = tessellate(primitive)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    if isinstance(primitive, TruncatedCone):
        z = np.linspace(primitive.z1, primitive.z2, 20001)
        expected = np.trapezoid(np.pi * primitive.a * primitive.b * (1.0 + primitive.k * z) ** 2, z)
    elif isinstance(primitive, Ellipsoid):
        expected = 4.0 / 3.0 * np.pi * np.prod(primitive.radii)
    else:
        expected = np.prod(primitive.size)
    assert volume == pytest.approx(expected, rel=3e-3)
    face_normals = np.cross(b - a, c - a)
    area = np.linalg.norm(face_normals, axis=1)
    real = area > 1e-12  # at the poles of an ellipsoid triangles have no area
    alignment = np.einsum("ij,ij->i", face_normals[real] / area[real, None], normals[faces[real, 0]])
    assert alignment.min() > 0.97
