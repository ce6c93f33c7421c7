"""The analytic gradient of the contour cost against finite differences, through the whole chain of derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.two_links import cameras, two_links
from tracker_node.geometry import se3
from tracker_node.model.configuration import State
from tracker_node.objective.chamfer.agreement import ON_BOUNDARY
from tracker_node.objective.chamfer.objective import CameraSlot, ContourObjective, ContourOptions, EvidenceMaps
from tracker_node.objective.constraints.prior import Prior
from tracker_node.render.shape_arrays import ShapeArrays


def smooth_maps(seed: int, offset: float = 0.0) -> EvidenceMaps:
    """Ramps: bilinear interpolation is exact on them, so finite differences are too."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0:480, 0:640].astype(np.float64)

    def ramp():
        slope = rng.uniform(0.4, 1.0, 2) * rng.choice([-1, 1], 2)
        return ((u - 320) * slope[0] + (v - 240) * slope[1] + offset).astype(np.float32)

    return EvidenceMaps((0, 0), ramp(), ramp(), np.zeros((0, 4), dtype=np.float32))


def objective_for(options: ContourOptions, priors=(), hand=True, offset=0.0) -> tuple[ContourObjective, State]:
    model = two_links(hand)
    slots = [CameraSlot(camera, model, options.samples_per_line) for camera in cameras()]
    maps = [smooth_maps(1, offset), smooth_maps(2, offset)]
    state = State(se3.exp([0.02, 0.05, -0.1, 0.1, 0.2, 0.3]), np.array([0.6, 0.4]))
    return ContourObjective(model, ShapeArrays.from_model(model), slots, maps, options, priors), state


@pytest.mark.parametrize("distances", ["split", "sum", "silhouette", "edges"])
@pytest.mark.parametrize("robust_scale_px", [30.0, 1e4])
def test_gradient_matches_finite_differences(distances, robust_scale_px):
    options = ContourOptions(robust_scale_px=robust_scale_px, distances=distances, alignment=-2.0, inner_weight=0.5)
    prior = Prior(State(np.eye(4), np.zeros(2)), np.linspace(1.0, 8.0, 8) * 100)
    # Without the ellipsoid, whose sample points also turn along their contour; an offset keeps the sum's kink at zero away
    objective, state = objective_for(options, (prior,), hand=False, offset=0.0 if distances == "split" else 400.0)
    equations = objective.linearize(state)
    assert equations.count > 100
    step = 1e-6
    numeric = np.array([
        (objective.linearize(state.retract(d)).cost - objective.linearize(state.retract(-d)).cost) / (2 * step)
        for d in np.eye(8) * step
    ])  # fmt: skip
    # float32 maps limit the accuracy of the cost
    np.testing.assert_allclose(2 * equations.g, numeric, rtol=2e-3, atol=2e-4 * np.abs(numeric).max())


def test_sliding_term_changes_only_the_motion_along_the_contour():
    """Where the map's gradient is normal to the contour, the term has no effect (it slides along it)."""
    with_sliding, state = objective_for(ContourOptions(alignment=0.999999, sliding=True, samples_per_line=400))
    without, _ = objective_for(ContourOptions(alignment=0.999999, sliding=False, samples_per_line=400))
    a, b = with_sliding.linearize(state), without.linearize(state)
    assert a.count == b.count
    if a.count:
        np.testing.assert_allclose(a.g, b.g, atol=2e-2 * np.abs(a.g).max())


def test_matrix_is_symmetric_and_positive():
    objective, state = objective_for(ContourOptions(alignment=-2.0))
    H = objective.linearize(state).H
    np.testing.assert_allclose(H, H.T)
    assert np.linalg.eigvalsh(H).min() > -1e-6 * np.abs(H).max()


def test_threads_give_the_same_bits():
    from concurrent.futures import ThreadPoolExecutor

    options = ContourOptions(alignment=-2.0)
    serial, state = objective_for(options)
    with ThreadPoolExecutor(2) as executor:
        parallel, _ = objective_for(options)
        parallel._map = lambda function, items: list(executor.map(function, items))
        a, b = serial.linearize(state), parallel.linearize(state)
    assert np.array_equal(a.H, b.H) and np.array_equal(a.g, b.g) and a.cost == b.cost


def test_the_gradient_of_contours_seen_at_two_instants_matches_finite_differences():
    options = ContourOptions(robust_scale_px=30.0, alignment=-2.0, inner_weight=0.5)
    objective, state = objective_for(options, hand=False)
    offset = np.array([0.03, -0.02, 0.05, 0.2, -0.1, 0.3, 0.15, -0.2])
    objective.restart(options, [None, offset])
    equations = objective.linearize(state)
    together, _ = objective_for(options, hand=False)
    assert abs(equations.cost - together.linearize(state).cost) > 1e-3 * equations.cost
    step = 1e-6
    numeric = np.array([
        (objective.linearize(state.retract(d)).cost - objective.linearize(state.retract(-d)).cost) / (2 * step)
        for d in np.eye(8) * step
    ])  # fmt: skip
    np.testing.assert_allclose(2 * equations.g, numeric, rtol=2e-3, atol=2e-4 * np.abs(numeric).max())


def test_no_offset_is_no_change():
    options = ContourOptions(alignment=-2.0)
    objective, state = objective_for(options)
    plain = objective.linearize(state)
    objective.restart(options, [np.zeros(8), None])
    moved = objective.linearize(state)
    np.testing.assert_allclose(moved.H, plain.H, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(moved.g, plain.g, rtol=1e-12, atol=1e-9)


def test_information_is_squared_pixels_over_their_variance():
    """Cost, gradient and matrix alike, of all cameras and of each; what priors add is in those units already."""
    prior = Prior(State(np.eye(4), np.zeros(2)), np.linspace(1.0, 8.0, 8) * 100)
    one, state = objective_for(ContourOptions(alignment=-2.0, variance_px2=1.0))
    four, _ = objective_for(ContourOptions(alignment=-2.0, variance_px2=4.0))
    held, _ = objective_for(ContourOptions(alignment=-2.0, variance_px2=4.0), (prior,))
    a, b, c = one.linearize(state), four.linearize(state), held.linearize(state)
    assert a.cost > 0.0 and a.count == b.count == c.count
    for x, y in ((a.H, b.H), (a.g, b.g), (a.cost, b.cost)):
        np.testing.assert_allclose(y, x / 4.0, rtol=1e-12)
    H, g = b.H.copy(), b.g.copy()
    cost = b.cost + prior.add_to(H, g, state)
    np.testing.assert_allclose(c.H, H, rtol=1e-12)
    np.testing.assert_allclose(c.g, g, rtol=1e-12)
    assert c.cost == pytest.approx(cost, rel=1e-12)
    for x, y in zip(one.camera_equations(), four.camera_equations(), strict=True):
        np.testing.assert_allclose(y.normal, x.normal / 4.0, rtol=1e-12)
        np.testing.assert_allclose(y.gradient, x.gradient / 4.0, rtol=1e-12)


def test_the_whole_is_the_sum_of_what_each_camera_says():
    objective, state = objective_for(ContourOptions(alignment=-2.0))
    both = objective.linearize(state)
    maps, alone = list(objective.maps), []
    for kept in range(2):
        single, _ = objective_for(ContourOptions(alignment=-2.0))
        single.maps = [m if i == kept else None for i, m in enumerate(maps)]
        alone.append(single.linearize(state))
        assert [e is None for e in single.camera_equations()] == [kept == 1, kept == 0]
    assert both.count == sum(e.count for e in alone) and both.cost == pytest.approx(sum(e.cost for e in alone))
    np.testing.assert_allclose(both.H, sum(e.H for e in alone), rtol=1e-9, atol=1e-9 * np.abs(both.H).max())
    np.testing.assert_allclose(both.g, sum(e.g for e in alone), rtol=1e-9, atol=1e-9 * np.abs(both.g).max())


def test_what_is_seen_is_decided_once_and_anew_after_a_restart():
    objective, state = objective_for(ContourOptions(alignment=-2.0))
    objective.linearize(state)
    flags = [slot.flags.copy() for slot in objective.slots]
    turned = state.retract(np.array([0.0, 0.0, 0.0, 1.2, 0.8, -0.7, 0.9, -0.9]))
    objective.linearize(turned)
    assert all(np.array_equal(slot.flags, before) for slot, before in zip(objective.slots, flags, strict=True))
    objective.restart(objective.options)
    objective.linearize(turned)
    assert not all(np.array_equal(slot.flags, before) for slot, before in zip(objective.slots, flags, strict=True))


def test_how_close_is_close_grows_as_the_body_is_nearer():
    """``close_m`` metres at the body are that times the focal length over its depth, pixels."""
    options = ContourOptions(alignment=-2.0)
    objective, state = objective_for(options)
    boundary = np.column_stack([np.random.default_rng(1).uniform([0, 0], [640, 480], (4000, 2)), np.ones(4000), np.zeros(4000)])
    objective.maps = [replace(m, boundary=boundary.astype(np.float32)) for m in objective.maps]
    objective.linearize(state)

    def counted(close_px: float, close_m: float) -> list[np.ndarray]:
        objective.count_agreement(state, close_px, close_m)
        return [slot.agreement.copy() for slot in objective.slots]

    wide, narrow = counted(40.0, 0.0), counted(4.0, 0.0)
    assert all(a[ON_BOUNDARY] > b[ON_BOUNDARY] for a, b in zip(wide, narrow, strict=True))
    for i, camera in enumerate(cameras()):
        depth = se3.apply(camera.T_cam_world, state.T_world_root[:3, 3][None])[0, 2]
        px = 0.05 * camera.model.K[0, 0] / depth
        np.testing.assert_array_equal(counted(5.0, 0.05)[i], counted(5.0 + px, 0.0)[i])
        assert not np.array_equal(counted(5.0, 0.05)[i], counted(5.0, 0.0)[i])
