"""Packed shapes: nothing of a shape sticks out of its bounding sphere, and the sphere is not much too large."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from helpers.cameras.render_scenes import single_shape, tetrahedron
from tracker_node.model.humans.human import human_model
from tracker_node.model.shapes.primitives import Box, Ellipsoid, TruncatedCone
from tracker_node.render.shape_arrays import CONE, ELLIPSOID, OTHER, ShapeArrays
from tracker_node.synthesis.subjects.cones import tessellate

PRIMITIVES = [
    TruncatedCone(0.05, 0.2, -0.5, -0.1, 0.6), TruncatedCone(0.3, 0.1, 1.5, 0.2, 0.4), TruncatedCone(0.1, 0.1, 0.0, 0.0, 0.01),
    Ellipsoid((0.1, 0.3, 0.2)), Box((0.5, 0.1, 0.3)), tetrahedron(0.2),
]  # fmt: skip


@pytest.mark.parametrize("primitive", PRIMITIVES, ids=lambda p: type(p).__name__)
def test_the_sphere_encloses_the_shape(primitive):
    bounds = ShapeArrays.from_model(single_shape(primitive).model).bounds[0]
    distance = np.linalg.norm(tessellate(primitive)[0] - bounds[:3], axis=1)
    assert distance.max() <= bounds[3] * (1.0 + 1e-9)
    assert distance.max() > 0.7 * bounds[3]


def test_kinds_dimensions_and_links():
    model = crane()
    arrays = ShapeArrays.from_model(model)
    assert arrays.kinds.tolist() == [OTHER, CONE, ELLIPSOID, CONE, OTHER]
    assert arrays.dims[1].tolist() == [0.06, 0.05, -0.5, -0.05, 0.5]
    assert arrays.dims[2].tolist() == [0.1, 0.2, 0.15, 0.0, 0.0]
    assert not arrays.dims[[0, 4]].any()
    assert [model.chain.links[i] for i in arrays.links] == ["base", "arm", "arm", "forearm", "flag"]


def test_the_human_is_all_closed_forms():
    assert set(ShapeArrays.from_model(human_model()).kinds) <= {CONE, ELLIPSOID}
