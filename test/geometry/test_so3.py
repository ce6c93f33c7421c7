import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from helpers.numeric.rotations import directions, rotation_vectors
from tracker_node.geometry import so3

angles = st.floats(-3.1, 3.1)


@given(rotation_vectors)
def test_exp_is_a_rotation_and_agrees_with_scipy(w):
    rotation = so3.exp(w)
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.isclose(np.linalg.det(rotation), 1.0, atol=1e-14)
    assert np.allclose(rotation, Rotation.from_rotvec(w).as_matrix(), atol=1e-14)


@given(rotation_vectors)
def test_log_inverts_exp(w):
    back = so3.log(so3.exp(w))
    # At pi itself the axis may turn round; the rotation is the same.
    left = np.pi - np.linalg.norm(w)
    if left > 1e-9:
        # Near pi the rounding of the matrix over the sine is all that is lost, down to a sine of 1e-5.
        assert np.allclose(back, w, rtol=1e-12, atol=2e-15 / min(1.0, max(left, 1e-5)))
    assert np.allclose(so3.exp(back), so3.exp(w), atol=1e-10)


@given(rotation_vectors, rotation_vectors)
def test_group_laws(a, b):
    A, B = so3.exp(a), so3.exp(b)
    assert np.allclose(so3.exp(-a), A.T, atol=1e-14)
    assert np.allclose(so3.exp(A @ b), A @ B @ A.T, atol=1e-13)  # the adjoint of SO(3)
    assert np.allclose(so3.exp(so3.log(A @ B)), A @ B, atol=1e-10)


@given(rotation_vectors, rotation_vectors)
def test_hat_is_the_cross_product(v, w):
    assert np.allclose(so3.hat(v) @ w, np.cross(v, w), atol=1e-14)


@given(directions, angles, angles)
def test_turns_about_one_axis_add(axis, a, b):
    both = so3.exp(a * axis) @ so3.exp(b * axis)
    assert np.allclose(so3.exp((a + b) * axis), both, atol=1e-14)


@given(angles, st.floats(-np.pi / 2, np.pi / 2), angles)
def test_somersault_tilt_twist_come_back(somersault, tilt, twist):
    rotation = so3.from_somersault_tilt_twist(somersault, tilt, twist)
    angles_again = so3.to_somersault_tilt_twist(rotation)
    assert np.allclose(so3.from_somersault_tilt_twist(*angles_again), rotation, atol=1e-7)
    assume(abs(tilt) < 1.5)
    assert np.allclose(angles_again, (somersault, tilt, twist), atol=1e-12)


@pytest.mark.parametrize(("angles", "point", "moved"), [
    ((np.pi / 2, 0, 0), [0, 0, 1], [1, 0, 0]),  # a forward somersault moves the head forward
    ((0, np.pi / 2, 0), [0, 0, 1], [0, -1, 0]),  # tilt to the right
    ((0, 0, np.pi / 2), [1, 0, 0], [0, 1, 0]),  # twist to the left
])  # fmt: skip
def test_signs_of_somersault_tilt_twist(angles, point, moved):
    assert np.allclose(so3.from_somersault_tilt_twist(*angles) @ point, moved, atol=1e-15)
