"""What is said of an estimate, by how far outline and silhouette agree in each camera."""

from types import SimpleNamespace

import numpy as np
import pytest

from tracker_node.objective import contour_residual as kernel
from tracker_node.objective.contour_agreement import BOUNDARY, N_AGREEMENT, ON_BOUNDARY, ON_OUTLINE, OUTLINE
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.config import StatusConfig
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.judge import NOTHING, Recovery, judge

CONFIG = StatusConfig(degraded_agreement=0.6, lost_agreement=0.4, degraded_residual_px=5.0, lost_residual_px=12.0)
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
