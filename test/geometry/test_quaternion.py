import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from helpers.numeric.rotations import rotation_vectors
from tracker_node.geometry import so3


@given(rotation_vectors)
def test_there_and_back(w):
    rotation = so3.exp(w)
    xyzw = so3.xyzw_from_matrix(rotation)
    assert xyzw[3] >= 0.0
    assert np.isclose(np.linalg.norm(xyzw), 1.0)
    assert np.allclose(so3.matrix_from_xyzw(xyzw), rotation, atol=1e-14)


@given(rotation_vectors)
def test_order_agrees_with_scipy(w):
    expected = Rotation.from_rotvec(w).as_quat()  # scipy's order is x, y, z, w
    got = so3.xyzw_from_matrix(so3.exp(w))
    assert min(np.abs(got - expected).max(), np.abs(got + expected).max()) < 1e-12


def test_length_does_not_matter_but_zero_is_refused():
    q = np.array([0.1, 0.2, -0.3, 0.9])
    assert np.allclose(so3.matrix_from_xyzw(q), so3.matrix_from_xyzw(7 * q))
    for bad in (np.zeros(4), np.full(4, np.nan)):
        with pytest.raises(ValueError, match="non-zero"):
            so3.matrix_from_xyzw(bad)
