import numpy as np
import pytest

from helpers.bodies.bodies import crane, random_state
from tracker_node.errors import UnknownNameError
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.segments18 import nurbs_human
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.nurbs import Loft, LoftedSolid, Section, loft_mesh
from tracker_node.model.shapes.primitives import Box, Mesh
from tracker_node.model.variants import LinkScale, scaled_by_link, scaled_uniformly, with_landmarks


def test_uniform_scaling_scales_the_posed_body():
    model = crane()
    state = random_state(model, np.random.default_rng(1))
    state.T_world_root[:3, 3] = 0.0
    before, after = Configuration(model, state), Configuration(scaled_uniformly(model, 1.3), state)
    assert np.allclose(after.landmarks_world, 1.3 * before.landmarks_world)
    assert np.allclose(after.Ts_world_shape[:, :3, 3], 1.3 * before.Ts_world_shape[:, :3, 3])
    boom, scaled = model.shapes[1].primitive, scaled_uniformly(model, 1.3).shapes[1].primitive
    for z in (boom.z1, boom.z2):  # a cone's section at the scaled height is the scaled section
        assert np.isclose(scaled.a * (1 + scaled.k * 1.3 * z), 1.3 * boom.a * (1 + boom.k * z))
    assert np.allclose(scaled_uniformly(model, 2.0).shapes[4].primitive.vertices, 2 * model.shapes[4].primitive.vertices)


def test_one_link_longer_moves_only_what_hangs_on_it():
    model = crane()
    longer = scaled_by_link(model, {"arm": LinkScale((1.0, 1.0, 2.0), (1.0, 1.0, 2.0))})
    index = model.landmark_index
    assert np.allclose(longer.landmark_positions[index("elbow")], (0.0, 0.0, 1.0))
    assert np.allclose(longer.chain.offsets[longer.chain.link_index("forearm")][2, 3], 1.0, atol=0.01)
    assert longer.shapes[0].primitive == model.shapes[0].primitive
    assert longer.shapes[2].primitive.radii == (0.1, 0.2, 0.3)
    assert np.array_equal(longer.landmark_positions[index("end")], model.landmark_positions[index("end")])


def test_sizes_and_places_are_apart():
    model = crane()
    wider = scaled_by_link(model, {"arm": LinkScale(places=(1.0, 3.0, 1.0))})
    assert np.allclose(wider.shapes[2].T_link_shape[:3, 3], (0.0, -0.3, 0.0))
    assert wider.shapes[2].primitive == model.shapes[2].primitive


def test_landmarks_are_moved_by_name():
    model = with_landmarks(crane(), {"end": np.array([1.0, 2.0, 3.0])})
    assert model.landmarks[1].position == (1.0, 2.0, 3.0)
    with pytest.raises(UnknownNameError, match="landmark 'nose'"):
        with_landmarks(model, {"nose": np.zeros(3)})


def test_bad_scales_are_refused():
    with pytest.raises(UnknownNameError, match="link 'leg'"):
        scaled_by_link(crane(), {"leg": LinkScale()})
    with pytest.raises(ValueError, match="positive"):
        scaled_by_link(crane(), {"arm": LinkScale((1.0, 0.0, 1.0))})


def test_surfaces_keep_their_colors_and_normals_stand_on_them():
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 256, (2, 3, 3), dtype=np.uint8)
    sphere = loft_mesh(Loft((Section(-0.01, 0.1, 0.1), Section(0.01, 0.1, 0.1)), (0.1, 0.1)))
    mesh = Mesh(sphere.vertices, sphere.faces, rng.integers(0, 256, (len(sphere.faces), 3)), normals=sphere.normals)
    box = Box((1.0, 2.0, 3.0), rng.integers(0, 256, (6, 3)), (picture, None, None, None, None, None))
    shapes = tuple(Shape(f"{i}", "base", primitive) for i, primitive in enumerate((mesh, box)))
    model = ArticulatedModel("thing", KinematicChain(("base",), ()), shapes)
    scaled = scaled_by_link(model, {"base": LinkScale(sizes=(1.0, 2.0, 3.0))})
    mesh_after, box_after = (shape.primitive for shape in scaled.shapes)
    assert np.array_equal(mesh_after.face_colors_rgb, mesh.face_colors_rgb)
    assert np.array_equal(box_after.face_colors_rgb, box.face_colors_rgb)
    assert box_after.size == (1.0, 4.0, 9.0)
    assert np.array_equal(box_after.textures[0], picture)
    corners = mesh_after.vertices[mesh_after.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.einsum("ij,ikj->ik", flat, mesh_after.normals[mesh_after.faces]).min() > 0.8


def test_a_scaled_loft_is_the_loft_of_the_scaled_sections():
    model = nurbs_human(16, 0.05)
    larger = scaled_uniformly(model, 1.25)
    for before, after in zip(model.shapes, larger.shapes, strict=True):
        assert isinstance(after.primitive, LoftedSolid)
        extent = np.ptp(before.primitive.vertices, axis=0)
        assert np.allclose(np.ptp(after.primitive.vertices, axis=0), 1.25 * extent, rtol=0.01)
        assert np.isclose(after.primitive.loft.domes[0], 1.25 * before.primitive.loft.domes[0])
