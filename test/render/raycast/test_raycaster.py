"""The ray-caster against brute force, ray by ray."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at, scattered_scene, single_shape
from helpers.numeric import naive
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone
from tracker_node.render.raycast.raycaster import render_labels, render_mask, render_view

MUSTACHE = CameraModel(
    160, 120, np.array([[90.0, 0.0, 80.0], [0.0, 90.0, 60.0], [0.0, 0.0, 1.0]]), "plumb_bob", np.array([-0.25, 0.18, 0, 0, -0.02])
)  # fmt: skip


def assert_like_brute_force(configuration, camera, wrong=0.0005):
    """All labels but a few on outlines, and depth to the precision that packing leaves."""
    view = render_view(configuration, camera)
    labels, depth = naive.render(configuration, camera)
    differ = view.labels != labels
    assert differ.mean() <= wrong, f"{differ.sum()} labels differ"
    same = ~differ & (labels > 0)
    np.testing.assert_allclose(view.depth[same], depth[same], rtol=1e-4)
    assert np.isinf(view.depth[view.labels == 0]).all()
    return labels


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("seed", range(6))
def test_scattered_shapes(lens, seed):
    configuration = scattered_scene(seed)
    camera = look_at((0.0, -3.0, 0.3), (0.0, 0.0, 0.0), LENSES[lens])
    labels = assert_like_brute_force(configuration, camera)
    assert len(np.unique(labels)) > 6, "the scene shows too little to judge"


@pytest.mark.parametrize("seed", range(6))
def test_shapes_around_and_behind_the_camera(seed):
    configuration = scattered_scene(seed, spread=1.0)
    camera = look_at((0.1, -0.2, 0.0), (0.0, 1.0, 0.2), LENSES["wide"])
    view, labels = render_view(configuration, camera), naive.render(configuration, camera)[0]
    # Brute force also sees the inside of shapes that the camera is in
    inside = [i + 1 for i in range(len(configuration.model.shapes)) if _is_inside(configuration, i, camera)]
    keep = ~np.isin(labels, inside) if inside else np.ones_like(labels, dtype=bool)
    assert (view.labels != labels)[keep].mean() <= 0.001


def _is_inside(configuration, i, camera):
    T = np.linalg.inv(configuration.Ts_world_shape[i]) @ camera.T_world_cam
    rays = np.array([[0.3, 0.2, 1.0], [-0.3, -0.2, -1.0]])
    hits = naive.nearest_hit(configuration.model.shapes[i].primitive, T[:3, 3], rays)
    return bool(np.isfinite(hits).all())


CONE = TruncatedCone(0.3, 0.2, -0.8, -0.5, 0.6)


@pytest.mark.parametrize(
    "eye",
    [
        (0.05, 0.02, 2.0),  # over the narrow end, inside the infinite cone
        (0.02, 0.05, 1.2),  # almost at the apex
        (0.0, 0.0, 3.0),  # beyond the apex
        (0.05, 0.1, -2.0),  # under the wide end
        (1.5, 0.3, 0.1),  # from the side, between the planes of the caps
        (1.0, 1.0, 0.6),  # in the plane of a cap
        (0.16, 0.0, 1.0),  # close to the cone's surface extended
    ],
)
@pytest.mark.parametrize("primitive", [CONE, TruncatedCone(0.3, 0.2, 0.0, -0.5, 0.6), Box((0.6, 0.4, 1.1))])
def test_views_along_and_across(primitive, eye):
    camera = look_at(eye, (0.01, 0.0, 0.0), LENSES["plain"])
    labels = assert_like_brute_force(single_shape(primitive), camera)
    assert (labels > 0).sum() > 100


def test_a_shape_around_the_camera_is_not_drawn():
    for primitive in (Ellipsoid((1.0, 1.0, 1.0)), Box((1.0, 1.0, 1.0)), TruncatedCone(1.0, 1.0, 0.1, -1.0, 1.0)):
        assert not render_mask(single_shape(primitive), look_at((0.1, 0.1, 0.1), (2.0, 0.0, 0.0), LENSES["plain"])).any()


def test_a_region_is_the_same_as_that_part_of_the_image():
    configuration = scattered_scene(3)
    camera = look_at((0.0, -3.0, 0.3), (0.0, 0.0, 0.0), LENSES["radial"])
    whole, region = render_view(configuration, camera), (37, 21, 101, 90)
    part = render_view(configuration, camera, region)
    inside = slice(21, 90), slice(37, 101)
    assert part.region == region
    np.testing.assert_array_equal(part.labels, whole.labels[inside])
    np.testing.assert_array_equal(part.depth, whole.depth[inside])
    np.testing.assert_array_equal(render_mask(configuration, camera, region), whole.mask[inside])
    np.testing.assert_array_equal(render_mask(configuration, camera), whole.mask)


@pytest.mark.parametrize("lens", LENSES)
def test_any_region_of_any_scene(lens):
    """Shapes beside, above and below a region leave no traces in it."""
    rng = np.random.default_rng(0)
    for seed in range(8):
        configuration, camera = scattered_scene(seed), look_at((0.0, -2.0, 0.3), (0.0, 0.0, 0.0), LENSES[lens])
        whole = render_view(configuration, camera)
        for _ in range(10):
            (u0, u1), (v0, v1) = (sorted(rng.choice(size + 1, 2, replace=False).tolist()) for size in (160, 120))
            part = render_view(configuration, camera, (u0, v0, u1, v1))
            np.testing.assert_array_equal(part.labels, whole.labels[v0:v1, u0:u1])


@pytest.mark.parametrize("lens", [LENSES["fisheye"], LENSES["radial"], MUSTACHE], ids=["fisheye", "radial", "mustache"])
def test_large_triangles_whose_edges_bend(lens):
    rng, seen = np.random.default_rng(0), 0
    camera = look_at((0.0, -1.6, 0.1), (0.0, 0.0, 0.0), lens)
    for _ in range(12):
        triangle = Mesh(rng.uniform(-1.6, 1.6, (3, 3)) * (1.0, 0.5, 1.0), np.array([[0, 1, 2]]))
        labels = naive.render(single_shape(triangle), camera)[0]
        assert (render_view(single_shape(triangle), camera).labels != labels).sum() <= 1
        seen += (labels > 0).sum()
    assert seen > 10_000


@pytest.mark.parametrize("margin", [0, 7, 500])
def test_labels_around_the_body(margin):
    configuration, camera = scattered_scene(5, spread=0.2), look_at((0.0, -4.0, 0.3), (0.0, 0.0, 0.0), LENSES["radial"])
    labels = render_view(configuration, camera).labels
    (u0, v0, u1, v1), found = render_labels(configuration, camera, margin)
    np.testing.assert_array_equal(found, labels[v0:v1, u0:u1])
    assert (labels > 0).sum() == (found > 0).sum() > 400
    rows, columns = np.flatnonzero(labels.any(axis=1)), np.flatnonzero(labels.any(axis=0))
    tight = columns[0] - margin, rows[0] - margin, columns[-1] + 1 + margin, rows[-1] + 1 + margin
    image = np.array([0, 0, 163, 120])
    slack = np.abs(np.clip(tight, image[[0, 1, 0, 1]], image[[2, 3, 2, 3]]) - (u0, v0, u1, v1))
    assert slack.max() <= 6  # boxes are rather too large than too small


def test_an_image_without_the_body_is_empty():
    camera = look_at((0.0, -3.0, 0.0), (0.0, -6.0, 0.0), LENSES["plain"])
    view = render_view(scattered_scene(1), camera)
    assert not view.labels.any()
    assert np.isinf(view.depth).all()
    assert render_labels(single_shape(Ellipsoid((0.2, 0.2, 0.2))), camera, 10) is None


def test_mesh_that_reaches_behind_the_camera():
    floor = Mesh(np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    camera = look_at((0.0, 0.0, 1.0), (0.0, 3.0, 0.5), LENSES["plain"])
    labels = assert_like_brute_force(single_shape(floor), camera, wrong=0.002)
    assert 0.3 < (labels > 0).mean() < 0.9


def test_misuse_is_named():
    camera = look_at((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), LENSES["plain"])
    with pytest.raises(ValueError, match="expected a region"):
        render_mask(scattered_scene(0), camera, (0, 0, 10_000, 10))
    chain = KinematicChain(("base",), ())
    model = ArticulatedModel("many", chain, tuple(Shape(f"s{i}", "base", Ellipsoid((1, 1, 1))) for i in range(256)))
    with pytest.raises(ValueError, match="at most 255 shapes"):
        render_mask(Configuration(model, State.neutral(model)), camera)


def test_results_do_not_depend_on_what_was_rendered_before():
    """Tables are kept per lens and per model: another one must not get them, also when its memory is reused."""
    for width in (64, 80, 96):
        model = CameraModel(width, 48, np.array([[50.0, 0, width / 2], [0, 50.0, 24], [0, 0, 1]]))
        camera = Camera("c", model, np.eye(4))
        assert render_mask(single_shape(Ellipsoid((0.1, 0.1, 0.1))), camera).shape == (48, width)
        del model, camera
