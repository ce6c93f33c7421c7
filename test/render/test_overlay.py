"""Overlays: what is drawn where, and what is left alone."""

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at, scattered_scene, single_shape
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid
from tracker_node.render.overlay import draw_overlay, masked_image, part_colors
from tracker_node.render.raycast.raycaster import render_mask

CAMERA = look_at((0.0, -3.0, 0.3), (0.0, 0.0, 0.0), LENSES["radial"])
GRAY = np.full((120, 163, 3), 90, dtype=np.uint8)


def test_the_image_itself_is_left_alone():
    image = GRAY.copy()
    image.setflags(write=False)
    drawn = draw_overlay(image, scattered_scene(2), CAMERA)
    assert (image == 90).all()
    assert drawn.flags.writeable
    assert (drawn != image).any()


def test_tint_covers_the_mask_and_nothing_else():
    configuration = scattered_scene(2)
    drawn = draw_overlay(GRAY, configuration, CAMERA, outline=False, skeleton=False)
    changed = (drawn != GRAY).any(axis=2)
    np.testing.assert_array_equal(changed, render_mask(configuration, CAMERA) > 0)


def test_outline_runs_along_the_silhouette():
    configuration = single_shape(Ellipsoid((0.5, 0.5, 0.4)))
    drawn = draw_overlay(GRAY, configuration, CAMERA, alpha=0.0, skeleton=False)
    changed = (drawn != GRAY).any(axis=2)
    mask = render_mask(configuration, CAMERA)
    rim = (cv2.dilate(mask, np.ones((3, 3), np.uint8)) > 0) & (mask == 0)
    assert changed[rim].mean() > 0.95
    assert not changed[mask > 0].any()  # thin limbs are not hidden by it
    assert not changed[cv2.dilate(mask, np.ones((9, 9), np.uint8)) == 0].any()


def test_landmarks_are_dots_and_rigid_objects_have_axes():
    shapes = (Shape("box", "base", Box((0.3, 0.3, 0.3))),)
    model = ArticulatedModel("box", KinematicChain(("base",), ()), shapes, (Landmark("tip", "base", (0.4, 0.0, 0.3)),))
    configuration = Configuration(model, State.neutral(model))
    drawn = draw_overlay(GRAY, configuration, CAMERA, alpha=0.0, outline=False)
    (u, v), _ = CAMERA.project(configuration.landmarks_world[0])
    assert (drawn[round(v), round(u)] > 200).all()
    axes = draw_overlay(GRAY, single_shape(Box((0.3, 0.3, 0.3))), CAMERA, alpha=0.0, outline=False)
    colors = {tuple(color) for color in axes.reshape(-1, 3)[(axes != GRAY).any(axis=2).ravel()].tolist()}
    assert (0, 0, 255) in colors


def test_sides_differ_in_hue():
    shapes = tuple(Shape(f"{side}_{i}", f"{side}_{i}", Box((1, 1, 1))) for side in ("left", "right") for i in range(7))
    chain = KinematicChain(("base",), ())
    model = ArticulatedModel("sides", chain, tuple(Shape(s.name, "base", s.primitive) for s in shapes))
    colors = part_colors(model).astype(int)
    assert (colors[1:8, 0] > colors[1:8, 2]).all()  # left: more blue than red
    assert (colors[8:, 2] > colors[8:, 0]).all()  # right: the other way round


def test_a_body_out_of_sight_changes_nothing():
    away = look_at((0.0, -3.0, 0.0), (0.0, -6.0, 0.0), LENSES["radial"])
    np.testing.assert_array_equal(draw_overlay(GRAY, scattered_scene(1), away), GRAY)


def test_misuse_is_named():
    with pytest.raises(ValueError, match=r"\(120, 163, 3\) for camera 'camera', got uint8 \(50, 50, 3\)"):
        draw_overlay(GRAY[:50, :50], scattered_scene(1), CAMERA)


CAMERA = look_at((0.0, -1.5, 0.3), (0.0, 0.0, 0.0), LENSES["radial"])


def test_the_image_is_kept_within_the_outline_and_black_outside():
    """The outline of a sphere in front of a pinhole, from its tangent cone."""
    rng = np.random.default_rng(1)
    image = rng.integers(1, 255, (CAMERA.model.height, CAMERA.model.width, 3)).astype(np.uint8)
    configuration = single_shape(Ellipsoid((0.2, 0.2, 0.2)))
    seen = masked_image(image, configuration, CAMERA)
    center = CAMERA.T_cam_world[:3] @ np.append(configuration.Ts_world_shape[0][:3, 3], 1.0)
    v, u = np.mgrid[: CAMERA.model.height, : CAMERA.model.width]
    rays, _ = CAMERA.model.rays(np.stack([u, v], axis=-1).astype(float))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    inside = rays @ center > np.sqrt(center @ center - 0.2**2)
    assert 100 < inside.sum() < inside.size // 2
    np.testing.assert_array_equal(seen, np.where(inside[:, :, None], image, 0))


def test_another_image_size_is_refused():
    configuration = single_shape(Ellipsoid((0.2, 0.2, 0.2)))
    with pytest.raises(ValueError, match=f"camera '{CAMERA.name}', got uint8 \\(4, 4, 3\\)"):
        masked_image(np.zeros((4, 4, 3), np.uint8), configuration, CAMERA)
