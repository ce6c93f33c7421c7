"""What is said of an estimate, by how far outline and silhouette agree in each camera."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tracker_node.model.configuration import State
from tracker_node.objective import contour_residual as kernel
from tracker_node.objective.chamfer.correspondences import (
    BOUNDARY,
    N_AGREEMENT,
    ON_BOUNDARY,
    ON_OUTLINE,
    OUTLINE,
    CameraResiduals,
    ContourCorrespondences,
)
from tracker_node.objective.constraints.prior import SumObjective
from tracker_node.objective.normal_equations import NormalEquations
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.optimize.fitter import Fit
from tracker_node.tracking.assessment import Assessment, Report
from tracker_node.tracking.chamfer.judge import ChamferJudge, agreement_of
from tracker_node.tracking.config import ChamferConfig
from tracker_node.tracking.estimate import CameraReport, Status

CONFIG = ChamferConfig(degraded_agreement=0.6, lost_agreement=0.4, degraded_residual_px=5.0, lost_residual_px=12.0)
ABSENT, ELSEWHERE, EMPTY = "absent", "elsewhere", "empty"
STATE = State(np.eye(4), np.zeros(0))


class Contours(ContourCorrespondences):
    """What contours say, as it is given: counts (n_cameras, N_AGREEMENT), and statistics of each camera, None without maps."""

    def __init__(self, counts, stats):
        self._given = np.array(counts), [None if own is None else CameraResiduals(None, None, own) for own in stats]

    def agreement(self, state, close_px, close_m=0.0):
        return self._given[0]

    def residuals(self, state):
        return self._given[1]


def fit_of(contours: Contours, H=None) -> Fit:
    equations = NormalEquations(np.eye(6) if H is None else H, np.zeros(6), 1.0, 10)
    return Fit(STATE, equations, 1, 1, True, contours, SumObjective([contours]))


def statistics(count=0.0, weight=0.0, squares=0.0) -> np.ndarray:
    stats = np.zeros(kernel.N_STATISTICS)
    stats[kernel.COUNT], stats[kernel.WEIGHT], stats[kernel.SQUARES] = count, weight, squares
    return stats


def seen(name: str, empty: bool = False):
    return SimpleNamespace(camera=name, empty=empty)


class Judging:
    """A judge of image sets of which the agreement in each camera is given, or why there is none."""

    def __init__(self, config: ChamferConfig = CONFIG):
        self._config, self._modality = config, SimpleNamespace(observations=[])
        self._judge: ChamferJudge | None = None

    def assess(self, *cameras, residual_px: float = 1.0, samples: float = 100.0) -> Assessment:
        rows, stats, observations, images = [], [], [], []
        for i, share in enumerate(cameras):
            name, counts = f"cam{i}", np.zeros(N_AGREEMENT)
            if isinstance(share, float):
                counts[[OUTLINE, BOUNDARY]] = 200.0, 50.0
                counts[[ON_BOUNDARY, ON_OUTLINE]] = 200.0 * share, 50.0 * share
            rows.append(counts)
            stats.append(statistics(samples, samples, samples * residual_px**2) if isinstance(share, float) else None)
            observations.append(seen(name, share == EMPTY) if share not in (ABSENT, ELSEWHERE) else None)
            if share != ABSENT:
                images.append(CameraImage(name, 7, np.zeros((2, 2, 3), np.uint8)))
        self._modality.observations = observations
        if self._judge is None:
            self._judge = ChamferJudge([None] * len(cameras), self._config, self._modality)
        return self._judge.assess(fit_of(Contours(rows, stats)), ImageSet(7, tuple(images)))

    def told(self, *agreements: float) -> list[Status]:
        """What is said of sets in which all of three cameras agree so far."""
        return [self.assess(share, share, share).status for share in agreements]

    def restart(self) -> None:
        self._judge.restart()


def assessed(*cameras, config: ChamferConfig = CONFIG, **more) -> Assessment:
    return Judging(config).assess(*cameras, **more)


def said(*cameras, **more) -> tuple[Status, str]:
    found = assessed(*cameras, **more)
    return found.status, found.reason


@pytest.mark.parametrize(
    ("cameras", "status", "words"),
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
def test_the_median_camera_decides(cameras, status, words):
    found, reason = said(*cameras)
    assert found is status
    assert words in reason and bool(reason) == bool(words)


def test_residuals_and_few_samples_count_too():
    assert said(0.9, 0.9, residual_px=5.5)[0] is Status.DEGRADED
    assert said(0.9, 0.9, residual_px=13.0) == (Status.LOST, "residual 13.0 px, outline and silhouette agree to 90 %")
    assert said(0.9, 0.9, samples=5.0) == (Status.LOST, "only 10 contour samples find a boundary")


def test_the_agreement_tells_noise_from_a_body_that_is_off():
    assert assessed(EMPTY, EMPTY).noise
    assert assessed(0.05, 0.1, 0.0).noise and not assessed(0.3, 0.3, 0.2).noise
    assert "agree to 80 %" in assessed(0.7, 0.9, 0.8, config=replace(CONFIG, degraded_agreement=0.85)).reason


def test_a_body_that_was_lost_is_not_trusted_until_it_agrees_as_before():
    judging = Judging()
    assert set(judging.told(*[0.92] * 10)) == {Status.TRACKING}
    assert judging.told(0.1, 0.7, 0.75, 0.8) == [Status.LOST] + [Status.DEGRADED] * 3  # beside its place
    found = judging.assess(0.7, 0.7, 0.7)
    assert found.status is Status.DEGRADED and "was lost" in found.reason and "70 %, before to 92 %" in found.reason
    assert judging.told(0.9, 0.9, 0.9, 0.7) == [Status.DEGRADED] * 2 + [Status.TRACKING] * 2


def test_a_state_that_is_handed_over_owes_nothing_to_a_loss_before():
    judging = Judging()
    judging.told(*[0.92] * 10, 0.1)
    judging.restart()
    assert judging.told(0.7, 0.7) == [Status.TRACKING] * 2


def test_agreement_after_a_loss_has_to_last():
    judging = Judging()
    judging.told(*[0.9] * 5)
    assert judging.told(0.0, 0.9, 0.7, 0.9, 0.9, 0.9)[1:] == [Status.DEGRADED] * 4 + [Status.TRACKING]


def test_of_a_body_that_was_never_well_no_more_is_asked():
    assert Judging().told(0.1, 0.7, 0.7) == [Status.LOST, Status.TRACKING, Status.TRACKING]


def test_what_is_usual_follows_slowly():
    judging = Judging()
    judging.told(*[0.95] * 5, *[0.7] * 60)
    assert judging.told(0.1, 0.7, 0.7, 0.7)[-1] is Status.TRACKING


def test_images_that_stay_worse_after_a_loss_are_usual_in_the_end():
    judging = Judging()
    judging.told(*[0.92] * 5, 0.1)
    statuses = judging.told(*[0.8] * 600)
    assert statuses[30] is Status.DEGRADED and statuses[-1] is Status.TRACKING


def test_a_cameras_agreement_is_the_harmonic_mean_of_both_shares():
    counts = np.zeros(N_AGREEMENT)
    counts[[OUTLINE, ON_BOUNDARY, BOUNDARY, ON_OUTLINE]] = 80.0, 60.0, 40.0, 10.0
    assert agreement_of(counts) == pytest.approx(2.0 * 0.75 * 0.25 / (0.75 + 0.25))


def test_twenty_samples_in_all_are_enough():
    assert said(0.9, 0.9, samples=10.0)[0] is Status.TRACKING
    assert said(0.9, 0.9, samples=9.5) == (Status.LOST, "only 19 contour samples find a boundary")


def test_limits_themselves_are_in_order():
    assert said(0.9, 0.9, residual_px=5.0)[0] is Status.TRACKING
    assert said(0.9, 0.9, residual_px=12.0)[0] is Status.DEGRADED
    assert said(0.5, 0.5)[0] is Status.DEGRADED and said(0.75, 0.625)[0] is Status.TRACKING


def report_of(names, stats, images=None, H=None, config: ChamferConfig = CONFIG) -> Report:
    rig = [SimpleNamespace(name=name) for name in names]
    contours = Contours(np.zeros((len(names), N_AGREEMENT)), stats)
    return ChamferJudge(rig, config, SimpleNamespace(observations=[])).report(fit_of(contours, H), images or ImageSet(7, ()))


def test_reports_have_what_each_camera_saw_and_the_sum_of_all():
    names = ("a", "b", "c", "d")
    images = ImageSet(7, tuple(CameraImage(name, 7 + i, np.zeros((2, 2, 3), np.uint8)) for i, name in enumerate(names[:3])))
    found = report_of(names, [statistics(30.0, 10.0, 40.0), statistics(20.0, 5.0, 125.0), None, None], images)
    assert found.cameras == (
        CameraReport("a", 7, 2.0, 30), CameraReport("b", 8, 5.0, 20), CameraReport("c", 9, 0.0, 0), CameraReport("d", 0, 0.0, 0),
    )  # fmt: skip
    assert found.residual == pytest.approx(np.sqrt((40.0 + 125.0) / 15.0))


@pytest.mark.parametrize(("rms_px", "factor"), [(0.5, 1.0), (1.5, 1.0), (4.5, 9.0)])
def test_the_covariance_grows_with_residuals_beyond_those_expected(rms_px, factor):
    config = ChamferConfig(residual_sigma_px=1.5)
    root = np.random.default_rng(3).normal(size=(4, 4))
    H = root @ root.T + 3.0 * np.eye(4)
    before = H.copy()
    found = report_of(["a"], [statistics(10.0, 10.0, 10.0 * rms_px**2)], H=H, config=config).covariance
    np.testing.assert_allclose(found, factor * np.linalg.inv(H), rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(found, found.T)
    np.testing.assert_array_equal(H, before)  # not written to


def test_what_nothing_is_known_of_has_a_large_variance():
    H = np.diag([1e4, 0.0])
    found = report_of(["a"], [statistics()], H=H, config=ChamferConfig()).covariance
    np.testing.assert_allclose(np.diag(found), [1e-4, 100.0], rtol=1e-5)
    tiny = report_of(["a"], [statistics()], H=0.0 * H, config=ChamferConfig()).covariance
    np.testing.assert_allclose(np.diag(tiny), 1e6)
