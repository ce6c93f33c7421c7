"""What is said of an estimate, by how far outline and silhouette agree in each camera."""

from types import SimpleNamespace

import numpy as np
import pytest

from tracker_node.objective import contour_residual as kernel
from tracker_node.objective.chamfer.agreement import BOUNDARY, N_AGREEMENT, ON_BOUNDARY, ON_OUTLINE, OUTLINE
from tracker_node.objective.normal_equations import NormalEquations
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.chamfer.judge import NOTHING, Recovery, covariance_of, judge, reports_of
from tracker_node.tracking.config import ChamferConfig
from tracker_node.tracking.estimate import CameraReport, Status

CONFIG = ChamferConfig(degraded_agreement=0.6, lost_agreement=0.4, degraded_residual_px=5.0, lost_residual_px=12.0)
ABSENT, ELSEWHERE, EMPTY = "absent", "elsewhere", "empty"


def verdict(*cameras, residual_px: float = 1.0, samples: float = 100.0):
    """``cameras``: the agreement in each, or why there is none."""
    slots, observations, images = [], [], []
    for i, share in enumerate(cameras):
        name, stats, agreement = f"cam{i}", np.zeros(kernel.N_STATISTICS), np.zeros(N_AGREEMENT)
        stats[kernel.COUNT], stats[kernel.WEIGHT], stats[kernel.SQUARES] = samples, samples, samples * residual_px**2
        if isinstance(share, float):
            agreement[[OUTLINE, BOUNDARY]] = 200.0, 50.0
            agreement[[ON_BOUNDARY, ON_OUTLINE]] = 200.0 * share, 50.0 * share
        slots.append(SimpleNamespace(stats=stats, agreement=agreement))
        seen = share not in (ABSENT, ELSEWHERE)
        observations.append(SimpleNamespace(camera=name, empty=share == EMPTY) if seen else None)
        if share != ABSENT:
            images.append(CameraImage(name, 7, np.zeros((2, 2, 3), np.uint8)))
    return judge(slots, observations, ImageSet(7, tuple(images)), CONFIG)


@pytest.mark.parametrize(
    ("cameras", "status", "said"),
    [
        ((0.9, 0.8, 0.85, 0.9), Status.TRACKING, ""),
        ((0.9, 0.8, ELSEWHERE, ELSEWHERE), Status.TRACKING, ""),
        ((0.9,), Status.TRACKING, ""),
        ((0.9, ELSEWHERE, ELSEWHERE), Status.DEGRADED, "only cam0 sees"),
        ((0.9, 0.8, ABSENT), Status.DEGRADED, "2 of 3 cameras"),
        ((0.9, 0.8, EMPTY), Status.DEGRADED, "do not agree in cam2 (0 %)"),
        ((0.9, 0.3, 0.8), Status.DEGRADED, "do not agree in cam1 (30 %)"),
        ((0.9, 0.9, 0.0, EMPTY), Status.DEGRADED, "cam2 (0 %), cam3 (0 %)"),
        ((0.9, 0.5, 0.55, 0.5), Status.DEGRADED, "agree to 55 %"),
        ((0.9, 0.1, 0.3, 0.2), Status.LOST, "agree to 30 %"),
        ((0.3, 0.3, 0.3), Status.LOST, "agree to 30 %"),
        ((EMPTY, EMPTY, EMPTY), Status.LOST, "no camera sees"),
        ((ELSEWHERE, ELSEWHERE), Status.LOST, "no camera sees"),
        ((ABSENT, ABSENT), Status.LOST, "no camera sees"),
    ],
)
def test_the_middle_camera_decides(cameras, status, said):
    found, reason, _ = verdict(*cameras)
    assert found is status
    assert said in reason and bool(reason) == bool(said)


def test_residuals_and_few_samples_count_too():
    assert verdict(0.9, 0.9, residual_px=5.5)[0] is Status.DEGRADED
    assert verdict(0.9, 0.9, residual_px=13.0)[:2] == (Status.LOST, "residual 13.0 px, outline and silhouette agree to 90 %")
    status, reason, _ = verdict(0.9, 0.9, samples=5.0)
    assert (status, reason) == (Status.LOST, "only 10 contour samples find a boundary")


def test_the_agreement_tells_noise_from_a_body_that_is_off():
    assert verdict(EMPTY, EMPTY)[2] < NOTHING
    assert verdict(0.05, 0.1, 0.0)[2] < NOTHING < verdict(0.3, 0.3, 0.2)[2]
    assert verdict(0.7, 0.9, 0.8)[2] == pytest.approx(0.8)


def told(recovery: Recovery, *agreements: float) -> list[Status]:
    """What is said of sets in which all cameras agree so far."""
    return [recovery.update(*verdict(share, share, share))[0] for share in agreements]


def test_a_body_that_was_lost_is_not_trusted_until_it_agrees_as_before():
    recovery = Recovery()
    assert set(told(recovery, *[0.92] * 10)) == {Status.TRACKING}
    assert told(recovery, 0.1, 0.7, 0.75, 0.8) == [Status.LOST] + [Status.DEGRADED] * 3  # beside its place
    status, reason = recovery.update(*verdict(0.7, 0.7, 0.7))
    assert status is Status.DEGRADED and "was lost" in reason and "70 %, before to 92 %" in reason
    assert told(recovery, 0.9, 0.9, 0.9, 0.7) == [Status.DEGRADED] * 2 + [Status.TRACKING] * 2


def test_agreement_after_a_loss_has_to_last():
    recovery = Recovery()
    told(recovery, *[0.9] * 5)
    assert told(recovery, 0.0, 0.9, 0.7, 0.9, 0.9, 0.9)[1:] == [Status.DEGRADED] * 4 + [Status.TRACKING]


def test_of_a_body_that_was_never_well_no_more_is_asked():
    assert told(Recovery(), 0.1, 0.7, 0.7) == [Status.LOST, Status.TRACKING, Status.TRACKING]


def test_what_is_usual_follows_slowly():
    recovery = Recovery()
    told(recovery, *[0.95] * 5, *[0.7] * 60)
    assert told(recovery, 0.1, 0.7, 0.7, 0.7)[-1] is Status.TRACKING


def test_images_that_stay_worse_after_a_loss_are_usual_in_the_end():
    recovery = Recovery()
    told(recovery, *[0.92] * 5, 0.1)
    said = told(recovery, *[0.8] * 600)
    assert said[30] is Status.DEGRADED and said[-1] is Status.TRACKING


def slot(count=0.0, weight=0.0, squares=0.0, **agreement):
    stats, shares = np.zeros(kernel.N_STATISTICS), np.zeros(N_AGREEMENT)
    stats[kernel.COUNT], stats[kernel.WEIGHT], stats[kernel.SQUARES] = count, weight, squares
    for name, value in agreement.items():
        shares[{"outline": OUTLINE, "on_boundary": ON_BOUNDARY, "boundary": BOUNDARY, "on_outline": ON_OUTLINE}[name]] = value
    return SimpleNamespace(stats=stats, agreement=shares)


def seen(name: str, empty: bool = False):
    return SimpleNamespace(camera=name, empty=empty)


def test_a_cameras_agreement_is_the_harmonic_mean_of_both_shares():
    slots = [slot(100.0, 100.0, 100.0, outline=80.0, on_boundary=60.0, boundary=40.0, on_outline=10.0)]
    images = ImageSet(7, (CameraImage("a", 7, np.zeros((2, 2, 3), np.uint8)),))
    assert judge(slots, [seen("a")], images, CONFIG)[2] == pytest.approx(2.0 * 0.75 * 0.25 / (0.75 + 0.25))


def test_twenty_samples_in_all_are_enough():
    assert verdict(0.9, 0.9, samples=10.0)[0] is Status.TRACKING
    assert verdict(0.9, 0.9, samples=9.5)[:2] == (Status.LOST, "only 19 contour samples find a boundary")


def test_limits_themselves_are_in_order():
    assert verdict(0.9, 0.9, residual_px=5.0)[0] is Status.TRACKING
    assert verdict(0.9, 0.9, residual_px=12.0)[0] is Status.DEGRADED
    assert verdict(0.5, 0.5)[0] is Status.DEGRADED and verdict(0.75, 0.625)[0] is Status.TRACKING


def test_reports_have_what_each_camera_saw_and_the_sum_of_all():
    names = ("a", "b", "c", "d")
    rig = [SimpleNamespace(name=name) for name in names]
    slots = [slot(30.0, 10.0, 40.0), slot(20.0, 5.0, 125.0), slot(99.0, 99.0, 9900.0), slot(99.0, 99.0, 9900.0)]
    images = ImageSet(7, tuple(CameraImage(name, 7 + i, np.zeros((2, 2, 3), np.uint8)) for i, name in enumerate(names[:3])))
    reports, rms = reports_of(rig, slots, [seen("a"), seen("b"), seen("c", empty=True), None], images)
    assert reports == (
        CameraReport("a", 7, 2.0, 30), CameraReport("b", 8, 5.0, 20), CameraReport("c", 9, 0.0, 0), CameraReport("d", 0, 0.0, 0),
    )  # fmt: skip
    assert rms == pytest.approx(np.sqrt((40.0 + 125.0) / 15.0))


@pytest.mark.parametrize(("rms_px", "factor"), [(0.5, 1.0), (1.5, 1.0), (4.5, 9.0)])
def test_the_covariance_grows_with_residuals_beyond_those_expected(rms_px, factor):
    config = ChamferConfig(residual_sigma_px=1.5)
    root = np.random.default_rng(3).normal(size=(4, 4))
    H = root @ root.T + 3.0 * np.eye(4)
    equations = NormalEquations(H, np.zeros(4), 1.0, 10)
    found = covariance_of(equations, [slot(10.0, 10.0, 10.0 * rms_px**2)], [seen("a")], config)
    np.testing.assert_allclose(found, factor * np.linalg.inv(H), rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(found, found.T)
    np.testing.assert_array_equal(equations.H, H)  # not written to


def test_what_nothing_is_known_of_has_a_large_variance():
    H = np.diag([1e4, 0.0])
    found = covariance_of(NormalEquations(H, np.zeros(2), 1.0, 10), [slot()], [seen("a")], ChamferConfig())
    np.testing.assert_allclose(np.diag(found), [1e-4, 100.0], rtol=1e-5)
    tiny = covariance_of(NormalEquations(0.0 * H, np.zeros(2), 1.0, 0), [slot()], [seen("a")], ChamferConfig())
    np.testing.assert_allclose(np.diag(tiny), 1e6)
