import numpy as np
import pytest

from tracker_node.errors import UnknownNameError
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone


@pytest.mark.parametrize(("make", "message"), [
    (lambda: TruncatedCone(0.0, 0.1, 0.0, 0.0, 1.0), "a, b > 0"),
    (lambda: TruncatedCone(0.1, 0.1, 0.0, 1.0, 1.0), "z1 < z2"),
    (lambda: TruncatedCone(0.1, 0.1, -2.0, 0.0, 1.0), "1 \\+ k z > 0"),
    (lambda: Ellipsoid((0.1, 0.1, 0.0)), "positive radii"),
    (lambda: Box((0.1, -0.1, 0.1)), "positive edge"),
    (lambda: Mesh(np.zeros((3, 3)), [[0, 1, 3]]), "face indices"),
    (lambda: Mesh(np.zeros((3, 2)), [[0, 1, 2]]), "vertices"),
    (lambda: Shape("s", "l", Box((1, 1, 1)), np.diag([2.0, 1, 1, 1])), "rigid"),
])  # fmt: skip
def test_impossible_shapes_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_body_refers_to_links_that_it_has():
    chain = KinematicChain(("base",), ())
    with pytest.raises(UnknownNameError, match="'arm'; valid: base"):
        ArticulatedModel("m", chain, (Shape("s", "arm", Box((1, 1, 1))),))
    with pytest.raises(UnknownNameError, match="'arm'"):
        ArticulatedModel("m", chain, (), (Landmark("l", "arm", (0.0, 0.0, 0.0)),))
    rigid = ArticulatedModel("m", chain, (Shape("s", "base", Box((1, 1, 1))),))
    assert rigid.n_dof == 6
    with pytest.raises(UnknownNameError, match="landmark"):
        rigid.landmark_index("nose")
