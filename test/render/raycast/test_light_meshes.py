"""Labels of meshes of many triangles are drawn with few of them, and are the same to a pixel."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from benchmark.world._shapes import knot
from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Mesh, is_closed
from tracker_node.render.raycast.raycaster import render_labels, render_view
from tracker_node.render.solids import box_mesh, light_mesh


def with_corners_of_their_own(mesh: Mesh) -> Mesh:
    """As files have them."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3))


def test_a_light_mesh_is_closed_and_a_small_one_stays():
    light = light_mesh(with_corners_of_their_own(knot(1)))
    assert len(light.faces) <= 3000 and len(light.vertices) < len(light.faces) and is_closed(light)
    box = box_mesh(Box((0.1, 0.2, 0.3)))
    assert light_mesh(box) is box


def test_labels_are_those_of_the_whole_mesh_but_for_their_rim():
    mesh = with_corners_of_their_own(knot(1))
    model = ArticulatedModel("knot", KinematicChain(("knot",), ()), (Shape("knot", "knot", mesh),))
    lens = CameraModel(320, 240, np.array([[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]]))
    camera = look_at((0.5, 0.2, 0.3), (0.0, 0.0, 0.0), lens, "cam")
    body = Configuration(model, State.neutral(model))
    (u0, v0, u1, v1), labels = render_labels(body, camera)
    whole = render_view(body, camera).labels
    found = np.zeros_like(whole)
    found[v0:v1, u0:u1] = labels
    assert (whole > 0).sum() > 5000 and (found != whole).sum() < 0.03 * (whole > 0).sum()
    other = Configuration(replace(model, shapes=(Shape("knot", "knot", mesh, color_rgb=(1, 2, 3)),)), State.neutral(model))
    np.testing.assert_array_equal(render_labels(other, camera)[1], labels)


def test_meshes_that_are_simplified_at_the_same_time_are_those_of_one_after_the_other():
    meshes = [with_corners_of_their_own(knot(seed)) for seed in (1, 2)]
    alone = [light_mesh(mesh) for mesh in meshes]
    with ThreadPoolExecutor(2) as threads:
        together = list(threads.map(light_mesh, 4 * meshes))
    for found, expected in zip(together, 4 * alone, strict=True):
        np.testing.assert_array_equal(found.faces, expected.faces)
        np.testing.assert_array_equal(found.vertices, expected.vertices)
