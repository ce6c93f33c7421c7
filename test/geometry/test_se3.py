import numpy as np
import pytest
from hypothesis import given
from scipy.linalg import expm

from helpers.numeric.finite_difference import assert_jacobian
from helpers.numeric.rotations import twists
from tracker_node.geometry import se3, so3


def hat(twist):
    matrix = np.zeros((4, 4))
    matrix[:3, :3], matrix[:3, 3] = so3.hat(twist[3:]), twist[:3]
    return matrix


@given(twists)
def test_exp_is_the_matrix_exponential(twist):
    transform = se3.exp(twist)
    assert se3.is_rigid(transform, 1e-12)
    assert np.allclose(transform, expm(hat(twist)), atol=1e-12)


@given(twists)
def test_log_inverts_exp(twist):
    back = se3.log(se3.exp(twist))
    if np.linalg.norm(twist[3:]) < np.pi - 1e-9:
        assert np.allclose(back, twist, rtol=1e-9, atol=1e-9)
    assert np.allclose(se3.exp(back), se3.exp(twist), atol=1e-8)


@given(twists, twists)
def test_group_laws(a, b):
    A, B = se3.exp(a), se3.exp(b)
    assert np.allclose(se3.inverse(A) @ A, np.eye(4), atol=1e-13)
    assert np.allclose(se3.inverse(A @ B), se3.inverse(B) @ se3.inverse(A), atol=1e-12)
    assert np.allclose(se3.exp(-a), se3.inverse(A), atol=1e-12)


@given(twists)
def test_a_twist_is_the_velocity_of_a_point(twist):
    transform, point = se3.exp(twist), np.array([0.3, -0.7, 1.1])
    moved = se3.apply(transform, point)
    analytic = np.hstack([np.eye(3), -so3.hat(moved)])  # v + omega x p
    assert_jacobian(analytic, lambda d: se3.apply(se3.exp(d) @ transform, point), step=1e-3)


def test_stacks_and_bad_matrices():
    transforms = np.array([se3.exp(np.arange(6) * 0.1), np.eye(4)])
    assert np.allclose(se3.inverse(transforms) @ transforms, np.eye(4))
    reflection = np.diag([1.0, 1.0, -1.0, 1.0])
    sheared = np.eye(4)
    sheared[0, 1] = 1e-3
    for bad in (reflection, sheared, np.full((4, 4), np.nan), np.eye(3)):
        assert not se3.is_rigid(bad)


@pytest.mark.parametrize("angle", [9.9e-5, 3e-5, 1e-6])
def test_small_turns_are_as_exact_as_large_ones(angle):
    """A turn about z on the way along x: sin(a) / a along it, 2 sin(a/2)^2 / a across it; and back by (a/2) / tan(a/2)."""
    moved = se3.exp(np.array([1.0, 0.0, 0.0, 0.0, 0.0, angle]))[:3, 3]
    assert moved[0] == pytest.approx(np.sin(angle) / angle, rel=1e-15, abs=0.0)
    assert moved[1] == pytest.approx(2.0 * np.sin(angle / 2.0) ** 2 / angle, rel=1e-14, abs=0.0)
    assert moved[2] == 0.0
    turn = se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, angle])), np.array([1.0, 0.0, 2.0]))
    v = se3.log(turn)[:3]
    assert v[0] == pytest.approx(0.5 * angle / np.tan(0.5 * angle), rel=1e-15, abs=0.0)
    assert v[1] == pytest.approx(-0.5 * angle, rel=1e-9) and v[2] == 2.0


def test_rigid_fit_is_the_best_rigid_transform_and_never_a_mirror():
    rng = np.random.default_rng(3)
    source, true = rng.normal(size=(6, 3)), se3.exp(rng.normal(size=6))
    target = se3.apply(true, source) + 0.05 * rng.normal(size=(6, 3))
    T = se3.rigid_fit(source, target)

    def cost(transform):
        return ((se3.apply(transform, source) - target) ** 2).sum()

    assert all(cost(T) <= cost(T @ se3.exp(0.02 * rng.normal(size=6))) for _ in range(50))
    flat = source * [1.0, 1.0, 0.0]
    np.testing.assert_allclose(se3.rigid_fit(flat, se3.apply(true, flat)), true, atol=1e-9)
    mirrored = se3.rigid_fit(source, source * [1.0, 1.0, -1.0])
    assert np.linalg.det(mirrored[:3, :3]) == pytest.approx(1.0)
    assert so3.log(T[:3, :3] @ true[:3, :3].T) == pytest.approx(np.zeros(3), abs=0.1)


@given(twists)
def test_rigid_fit_is_exact_and_proper(twist):
    T = se3.exp(twist)
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    assert np.allclose(se3.rigid_fit(points, se3.apply(T, points)), T, atol=1e-9)
    flat = points[:3]  # points in a plane also fit a reflection
    assert np.allclose(se3.rigid_fit(flat, se3.apply(T, flat)), T, atol=1e-9)


def test_points_of_no_weight_do_not_count():
    rng = np.random.default_rng(4)
    source, T = rng.normal(size=(6, 3)), se3.exp(rng.normal(size=6))
    target = se3.apply(T, source)
    target[5] += 3.0
    np.testing.assert_allclose(se3.rigid_fit(source, target, np.array([1.0, 2.0, 1.0, 3.0, 1.0, 0.0])), T, atol=1e-12)
