"""The analytic gradient of the contour cost against finite differences, through the whole chain of derivatives."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.two_links import cameras, two_links
from tracker_node.geometry import se3
from tracker_node.model.configuration import State
from tracker_node.objective.chamfer.correspondences import (
    ON_BOUNDARY,
    ContourBody,
    ContourCorrespondences,
    ContourOptions,
    EvidenceMaps,
)
from tracker_node.objective.constraints.prior import Prior, SumObjective
from tracker_node.parallel import serial


def smooth_maps(seed: int, offset: float = 0.0) -> EvidenceMaps:
    """Ramps: bilinear interpolation is exact on them, so finite differences are too."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:480, 0:640].astype(np.float64)

    def ramp():
        slope = rng.uniform(0.4, 1.0, 2) * rng.choice([-1, 1], 2)
        return ((u - 320) * slope[0] + (v - 240) * slope[1] + offset).astype(np.float32)

    return EvidenceMaps((0, 0), ramp(), ramp(), np.zeros((0, 4), dtype=np.float32))


STATE = State(se3.exp([0.02, 0.05, -0.1, 0.1, 0.2, 0.3]), np.array([0.6, 0.4]))
PRIOR = Prior(State(np.eye(4), np.zeros(2)), np.linspace(1.0, 8.0, 8) * 100)


def both_maps(offset: float = 0.0) -> list[EvidenceMaps | None]:
    return [smooth_maps(1, offset), smooth_maps(2, offset)]


def contours_of(
    options: ContourOptions, hand=True, offset=0.0, maps=None, state=STATE, offsets=None, parallel=serial
) -> ContourCorrespondences:
    body = ContourBody.of(two_links(hand), cameras(), parallel=parallel)
    return ContourCorrespondences(body, both_maps(offset) if maps is None else maps, options, state, offsets)


def slope(objective, state: State) -> np.ndarray:
    """(n_dof,) of the cost, by finite differences."""
    steps = np.eye(8) * 1e-6
    return np.array([
        (objective.linearize(state.retract(d)).cost - objective.linearize(state.retract(-d)).cost) / 2e-6 for d in steps
    ])  # fmt: skip


@pytest.mark.parametrize("distances", ["split", "sum", "silhouette", "edges"])
@pytest.mark.parametrize("robust_scale_px", [30.0, 1e4])
def test_gradient_matches_finite_differences(distances, robust_scale_px):
    options = ContourOptions(robust_scale_px=robust_scale_px, distances=distances, alignment=-2.0, inner_weight=0.5)
    # Without the ellipsoid, whose sample points also turn along their contour; an offset keeps the sum's kink at zero away
    contours = contours_of(options, hand=False, offset=0.0 if distances == "split" else 400.0)
    objective = SumObjective([contours], priors=[PRIOR])
    equations, numeric = objective.linearize(STATE), slope(objective, STATE)
    assert equations.count > 100
    # float32 maps limit the accuracy of the cost
    np.testing.assert_allclose(2 * equations.g, numeric, rtol=2e-3, atol=2e-4 * np.abs(numeric).max())


def test_sliding_term_changes_only_the_motion_along_the_contour():
    """Where the map's gradient is normal to the contour, the term has no effect (it slides along it)."""
    with_sliding = contours_of(ContourOptions(alignment=0.999999, sliding=True, samples_per_line=400))
    without = contours_of(ContourOptions(alignment=0.999999, sliding=False, samples_per_line=400))
    a, b = with_sliding.linearize(STATE), without.linearize(STATE)
    assert a.count == b.count
    if a.count:
        np.testing.assert_allclose(a.g, b.g, atol=2e-2 * np.abs(a.g).max())


def test_matrix_is_symmetric_and_positive():
    H = contours_of(ContourOptions(alignment=-2.0)).linearize(STATE).H
    np.testing.assert_allclose(H, H.T)
    assert np.linalg.eigvalsh(H).min() > -1e-6 * np.abs(H).max()


def test_threads_give_the_same_bits():
    options = ContourOptions(alignment=-2.0)
    with ThreadPoolExecutor(2) as executor:
        parallel = contours_of(options, parallel=lambda function, items: list(executor.map(function, items)))
        a, b = contours_of(options).linearize(STATE), parallel.linearize(STATE)
    assert np.array_equal(a.H, b.H) and np.array_equal(a.g, b.g) and a.cost == b.cost


def test_the_gradient_of_contours_seen_at_two_instants_matches_finite_differences():
    options = ContourOptions(robust_scale_px=30.0, alignment=-2.0, inner_weight=0.5)
    offset = np.array([0.03, -0.02, 0.05, 0.2, -0.1, 0.3, 0.15, -0.2])
    contours = contours_of(options, hand=False, offsets=[None, offset])
    equations, together = contours.linearize(STATE), contours_of(options, hand=False)
    assert abs(equations.cost - together.linearize(STATE).cost) > 1e-3 * equations.cost
    numeric = slope(contours, STATE)
    np.testing.assert_allclose(2 * equations.g, numeric, rtol=2e-3, atol=2e-4 * np.abs(numeric).max())


def test_no_offset_is_no_change():
    options = ContourOptions(alignment=-2.0)
    plain = contours_of(options).linearize(STATE)
    moved = contours_of(options, offsets=[np.zeros(8), None]).linearize(STATE)
    np.testing.assert_allclose(moved.H, plain.H, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(moved.g, plain.g, rtol=1e-12, atol=1e-9)


def test_information_is_squared_pixels_over_their_variance():
    """Cost, gradient and matrix alike, of all cameras and of each; what priors add is in those units already."""
    one, four = (contours_of(ContourOptions(alignment=-2.0, variance_px2=variance)) for variance in (1.0, 4.0))
    a, b, c = one.linearize(STATE), four.linearize(STATE), SumObjective([four], priors=[PRIOR]).linearize(STATE)
    assert a.cost > 0.0 and a.count == b.count == c.count
    for x, y in ((a.H, b.H), (a.g, b.g), (a.cost, b.cost)):
        np.testing.assert_allclose(y, x / 4.0, rtol=1e-12)
    H, g = b.H.copy(), b.g.copy()
    cost = b.cost + PRIOR.add_to(H, g, STATE)
    np.testing.assert_allclose(c.H, H, rtol=1e-12)
    np.testing.assert_allclose(c.g, g, rtol=1e-12)
    assert c.cost == pytest.approx(cost, rel=1e-12)
    for x, y in zip(one.camera_equations(STATE), four.camera_equations(STATE), strict=True):
        np.testing.assert_allclose(y.normal, x.normal / 4.0, rtol=1e-12)
        np.testing.assert_allclose(y.gradient, x.gradient / 4.0, rtol=1e-12)


def test_the_whole_is_the_sum_of_what_each_camera_says():
    both, alone = contours_of(ContourOptions(alignment=-2.0)).linearize(STATE), []
    for kept in range(2):
        maps = [m if i == kept else None for i, m in enumerate(both_maps())]
        single = contours_of(ContourOptions(alignment=-2.0), maps=maps)
        alone.append(single.linearize(STATE))
        assert [e is None for e in single.camera_equations(STATE)] == [kept == 1, kept == 0]
    assert both.count == sum(e.count for e in alone) and both.cost == pytest.approx(sum(e.cost for e in alone))
    np.testing.assert_allclose(both.H, sum(e.H for e in alone), rtol=1e-9, atol=1e-9 * np.abs(both.H).max())
    np.testing.assert_allclose(both.g, sum(e.g for e in alone), rtol=1e-9, atol=1e-9 * np.abs(both.g).max())


def test_what_is_seen_is_decided_once_and_anew_by_other_correspondences():
    """Turned far, a body shows other contours; those seen at first are compared, until others are found there."""
    options, turned = ContourOptions(alignment=-2.0), STATE.retract(np.array([0.0, 0.0, 0.0, 1.2, 0.8, -0.7, 0.9, -0.9]))
    contours, there = contours_of(options), contours_of(options, state=turned)
    first = contours.linearize(STATE)
    assert there.linearize(turned).count != contours.linearize(turned).count
    again = contours.linearize(State(STATE.T_world_root.copy(), STATE.joint_positions.copy()))  # what is seen is as before
    assert (again.cost, again.count) == (first.cost, first.count)
    np.testing.assert_array_equal(again.H, first.H)


def test_contours_do_not_change_when_others_are_found():
    """Nor what has been said of a state, when another state is compared."""
    body, maps, options = ContourBody.of(two_links(), cameras()), both_maps(), ContourOptions(alignment=-2.0)
    contours, moved = ContourCorrespondences(body, maps, options, STATE), STATE.retract(np.full(8, 0.02))
    found, residuals = contours.linearize(STATE), contours.residuals(STATE)[0].normal.copy()
    H, agreement = found.H.copy(), contours.agreement(STATE, 3.0)
    ContourCorrespondences(body, maps[::-1], options, moved).linearize(moved)
    assert contours.linearize(moved).cost != found.cost
    np.testing.assert_array_equal(found.H, H)
    np.testing.assert_array_equal(contours.linearize(STATE).H, H)
    np.testing.assert_array_equal(contours.residuals(STATE)[0].normal, residuals)
    np.testing.assert_array_equal(contours.agreement(STATE, 3.0), agreement)


def test_how_close_is_close_grows_as_the_body_is_nearer():
    """``close_m`` meters at the body are that times the focal length over its depth, pixels."""
    boundary = np.column_stack([np.random.default_rng(1).uniform([0, 0], [640, 480], (4000, 2)), np.ones(4000), np.zeros(4000)])
    maps = [replace(m, boundary=boundary.astype(np.float32)) for m in both_maps()]
    contours = contours_of(ContourOptions(alignment=-2.0), maps=maps)

    def counted(close_px: float, close_m: float) -> np.ndarray:
        return contours.agreement(STATE, close_px, close_m)

    wide, narrow = counted(40.0, 0.0), counted(4.0, 0.0)
    assert all(a[ON_BOUNDARY] > b[ON_BOUNDARY] for a, b in zip(wide, narrow, strict=True))
    for i, camera in enumerate(cameras()):
        depth = se3.apply(camera.T_cam_world, STATE.T_world_root[:3, 3][None])[0, 2]
        px = 0.05 * camera.model.K[0, 0] / depth
        np.testing.assert_array_equal(counted(5.0, 0.05)[i], counted(5.0 + px, 0.0)[i])
        assert not np.array_equal(counted(5.0, 0.05)[i], counted(5.0, 0.0)[i])
