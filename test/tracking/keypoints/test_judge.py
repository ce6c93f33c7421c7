"""Status, residuals and covariance of fits to points alone."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, NAMES, POINTS, image_set, seen_by, standing, without
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.observation.image_set import ImageSet
from tracker_node.optimize.fitter import Fit, Fitter, Stage
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.keypoints.judge import KeypointJudge
from tracker_node.tracking.keypoints.modality import KeypointModality

RIG, TRUE = circle_rig(3), standing(0.1, 0.0, 0.5, left_shoulder_elevation_front=40.0, right_hip_flexion=25.0)
CONFIG = from_dict({"modalities": ["keypoints"], "keypoints.offset_scale": 0.001, "keypoints.sigma_fraction": 0.01})
LOOKED = KeypointModality(RIG, HUMAN, CONFIG.keypoints, BLAZEPOSE)
LOOKED.set_images((), TRUE, None, [None] * 3)
JUDGE = KeypointJudge(RIG, HUMAN, LOOKED)
SETS = image_set(RIG, [None] * 3, 5)


def held(people: list) -> Fit:
    """At the true state: one step that is damped away."""
    made = KeypointModality(RIG, HUMAN, CONFIG.keypoints, BLAZEPOSE)
    made.set_images((), TRUE, None, people)
    fit = Fitter(HUMAN).fit(TRUE, made, [Stage(1.0, damping=1e12)])
    return replace(fit, state=TRUE, equations=fit.objective.linearize(TRUE))


def off(person, names, by_px: float):
    pixels = person.pixels.copy()
    pixels[[NAMES.index(name) for name in names], 0] += by_px
    return replace(person, pixels=pixels)


def test_points_in_place_are_a_tracked_body():
    fit = held(seen_by(RIG, TRUE))
    found = JUDGE.assess(fit, SETS)
    assert (found.status, found.reason, found.noise, found.limbs) == (Status.TRACKING, "", False, ())
    assert found.log_ratio == -fit.equations.cost
    worse = held([off(person, POINTS, 3.0) for person in seen_by(RIG, TRUE)])
    assert JUDGE.assess(worse, SETS).log_ratio < found.log_ratio - 1.0


@pytest.mark.parametrize(("known", "status"), [(6, Status.DEGRADED), (5, Status.LOST)])
def test_less_than_six_points_are_nobody(known, status):
    people = seen_by(RIG, TRUE)
    few = [without(people[0], POINTS[3:]), without(people[1], POINTS[known - 3 :]), without(people[2], POINTS)]
    found = JUDGE.assess(held(few), SETS)
    assert found.status is status and found.noise is (status is Status.LOST)
    assert found.reason.startswith("5 points of the body are found" if known == 5 else "its place is known to ")


@pytest.mark.parametrize(
    ("wrong", "status"), [(7, Status.TRACKING), (9, Status.DEGRADED), (13, Status.DEGRADED), (15, Status.LOST)]
)
def test_the_share_of_points_that_are_elsewhere_says_how_well_the_body_is_found(wrong, status):
    assert len(POINTS) == 19
    people = [off(person, POINTS[:wrong], 300.0) for person in seen_by(RIG, TRUE)]
    found = JUDGE.assess(held(people), SETS)
    assert found.status is status and found.noise is (status is Status.LOST)
    if status is not Status.TRACKING:
        assert found.reason == f"{100.0 * (19 - wrong) / 19:.0f} % of its points are where it is"
        assert found.log_ratio is None


def test_a_camera_whose_points_are_elsewhere_is_named():
    people = seen_by(RIG, TRUE)
    found = JUDGE.assess(held([people[0], off(people[1], POINTS, 300.0), people[2]]), SETS)
    assert found.status is Status.DEGRADED and "the body's points are elsewhere in cam02 (0 %)" in found.reason


def test_cameras_without_an_image_or_without_a_person_are_missed():
    people, two = seen_by(RIG, TRUE), ImageSet(5, SETS.images[:2])
    assert JUDGE.assess(held([people[0], people[1], None]), two).reason == "2 of 3 cameras"
    found = JUDGE.assess(held([people[0], None, None]), SETS)
    assert (found.status, found.reason) == (Status.DEGRADED, "only cam01 sees the body")


def test_residuals_are_distances_in_pixels_of_points_that_are_no_outliers():
    people = seen_by(RIG, TRUE)
    people = [off(people[0], POINTS, 2.0), off(off(people[1], POINTS, 1.0), ("nose",), 400.0), people[2]]
    report = JUDGE.report(held(people), SETS)
    assert [camera.camera for camera in report.cameras] == list(RIG.names) and {camera.stamp_ns for camera in report.cameras} == {
        5
    }
    assert [camera.residual for camera in report.cameras] == pytest.approx([2.0, 1.0, 0.0], abs=0.01)
    assert [camera.samples for camera in report.cameras] == [19, 18, 19]
    assert report.residual == pytest.approx(np.sqrt((19 * 4.0 + 18 * 1.0) / 56), rel=0.01)


def test_a_camera_without_an_image_has_no_stamp_and_no_residual():
    people = seen_by(RIG, TRUE)
    report = JUDGE.report(held([people[0], people[1], None]), ImageSet(5, SETS.images[:2]))
    last = report.cameras[2]
    assert (last.stamp_ns, last.residual, last.samples) == (0, 0.0, 0)


def test_the_covariance_is_the_inverse_of_the_equations():
    fit = held(seen_by(RIG, TRUE))
    fit = replace(fit, equations=replace(fit.equations, H=fit.equations.H + 50.0 * np.eye(HUMAN.n_dof)))
    covariance = JUDGE.report(fit, SETS).covariance
    product = covariance @ (fit.equations.H + 1e-6 * np.diag(fit.equations.H).max() * np.eye(HUMAN.n_dof))
    np.testing.assert_allclose(product, np.eye(HUMAN.n_dof), atol=1e-6)


def test_nothing_is_remembered():
    fit = held(seen_by(RIG, TRUE))
    before = JUDGE.assess(fit, SETS)
    JUDGE.restart()
    JUDGE.reset()
    assert JUDGE.assess(fit, SETS) == before
