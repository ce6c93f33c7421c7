"""Bodies in clothes: surfaces outside of shapes, all else where it was."""

import numpy as np
import pytest

from helpers.bodies.bodies import assert_same_body
from helpers.bodies.mesh_solids import box, joined
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.clothes import with_surfaces
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.segments18 import ellipsoid_human, nurbs_human
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone

TURNED = se3.from_rotation_translation(so3.exp(np.array([0.3, -0.8, 1.1])), np.array([0.1, 0.2, -0.3]))
CONE = TruncatedCone(0.06, 0.04, -0.5, 0.05, 0.35)
MESH = joined(box((0.1, 0.2, 0.3), (0.02, -0.05, 0.4)))


def clothed(primitive: Primitive, outside: float, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Shape:
    model = ArticulatedModel("thing", KinematicChain(("thing",), ()), (Shape("thing", "thing", primitive, TURNED),), ())
    return with_surfaces(model, np.array([[outside, *shift]])).shapes[0]


def radii_at(cone: TruncatedCone, z: float) -> np.ndarray:
    return np.array([cone.a, cone.b]) * (1.0 + cone.k * z)


@pytest.mark.parametrize("outside", [0.02, -0.01])
def test_a_cone(outside: float) -> None:
    """As much thicker in the middle as is said, in both directions; as long as before, its ends as different."""
    thicker = clothed(CONE, outside).primitive
    assert isinstance(thicker, TruncatedCone) and (thicker.z1, thicker.z2) == (CONE.z1, CONE.z2)
    middle = 0.5 * (CONE.z1 + CONE.z2)
    np.testing.assert_allclose(radii_at(thicker, middle), radii_at(CONE, middle) + outside, rtol=1e-12)
    widths = [np.mean(radii_at(cone, cone.z2) - radii_at(cone, cone.z1)) for cone in (CONE, thicker)]
    assert widths[1] == pytest.approx(widths[0])
    np.testing.assert_allclose(clothed(CONE, outside).T_link_shape, TURNED, atol=1e-15)


def test_an_ellipsoid_and_a_box() -> None:
    ellipsoid, cuboid = clothed(Ellipsoid((0.1, 0.08, 0.2)), 0.015).primitive, clothed(Box((0.1, 0.2, 0.3)), 0.015).primitive
    assert isinstance(ellipsoid, Ellipsoid) and isinstance(cuboid, Box)
    np.testing.assert_allclose(ellipsoid.radii, (0.115, 0.095, 0.215))
    np.testing.assert_allclose(cuboid.size, (0.13, 0.23, 0.33))


def test_a_mesh_beside_its_frame() -> None:
    """It grows to all sides, and its middle stays."""
    shape = clothed(MESH, 0.015)
    assert isinstance(shape.primitive, Mesh)
    vertices, before = (se3.apply(se3.inverse(TURNED) @ T, mesh.vertices) for T, mesh in (
        (shape.T_link_shape, shape.primitive), (TURNED, MESH),
    ))  # fmt: skip
    np.testing.assert_allclose(vertices.min(axis=0), before.min(axis=0) - 0.015, atol=1e-12)
    np.testing.assert_allclose(vertices.max(axis=0), before.max(axis=0) + 0.015, atol=1e-12)


@pytest.mark.parametrize("primitive", [CONE, Ellipsoid((0.1, 0.08, 0.2)), MESH])
def test_a_shift_is_in_the_axes_of_the_link(primitive: Primitive) -> None:
    moved, still = clothed(primitive, 0.01, (0.01, -0.02, 0.03)), clothed(primitive, 0.01)
    np.testing.assert_allclose(moved.T_link_shape[:3, 3] - still.T_link_shape[:3, 3], (0.01, -0.02, 0.03), atol=1e-12)
    np.testing.assert_array_equal(moved.T_link_shape[:3, :3], TURNED[:3, :3])


def test_nothing_is_thinner_than_a_third() -> None:
    ellipsoid, cone = clothed(Ellipsoid((0.03, 0.09, 0.3)), -0.06).primitive, clothed(CONE, -1.0).primitive
    assert isinstance(ellipsoid, Ellipsoid) and isinstance(cone, TruncatedCone)
    np.testing.assert_allclose(ellipsoid.radii, (0.01, 0.03, 0.24))
    np.testing.assert_allclose(radii_at(cone, 0.2), radii_at(CONE, 0.2) / 3.0)
    assert min(*radii_at(cone, cone.z1), *radii_at(cone, cone.z2)) > 0.0


@pytest.mark.parametrize("cone", [TruncatedCone(0.1, 0.1, -2.6, 0.0, 0.35), TruncatedCone(0.02, 0.03, 4.0, 1.0, 1.3)])
def test_a_steep_cone_that_gets_thin_stays_a_cone(cone: TruncatedCone) -> None:
    """With the same difference one of its ends, or its radius at z = 0, would be negative."""
    thin, middle = clothed(cone, -0.03).primitive, 0.5 * (cone.z1 + cone.z2)
    assert isinstance(thin, TruncatedCone)
    np.testing.assert_allclose(radii_at(thin, middle), radii_at(cone, middle) - 0.03)
    assert min(*radii_at(thin, thin.z1), *radii_at(thin, thin.z2)) > 0.0


@pytest.mark.parametrize("model", [human_model(), ellipsoid_human(), nurbs_human()])
def test_joints_and_landmarks_stay(model: ArticulatedModel) -> None:
    surfaces = np.random.default_rng(3).normal(0.0, 0.01, (len(model.shapes), 4))
    seen = with_surfaces(model, surfaces)
    assert seen.chain is model.chain and seen.landmarks == model.landmarks
    assert [(s.name, s.link, s.color_rgb) for s in seen.shapes] == [(s.name, s.link, s.color_rgb) for s in model.shapes]
    assert_same_body(model, with_surfaces(model, np.zeros((len(model.shapes), 4))))
    with pytest.raises(ValueError, match="shorter"):
        with_surfaces(model, surfaces[:-1])
