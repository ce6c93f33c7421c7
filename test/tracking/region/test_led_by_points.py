"""Regions with the points and silhouettes of a detector: what points lead, what silhouettes and surfaces add."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import off_m, seen_by, standing, with_mask
from helpers.studio.small_studio import Recording, recording
from tracker_node.camera.rig import CameraRig
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.constraints.prior import Prior
from tracker_node.observation.image_set import ImageSet
from tracker_node.observation.keypoints.people import Silhouette
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.engine import Engine
from tracker_node.tracking.engines import make_engine
from tracker_node.tracking.estimate import LimbStatus, Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker
from tracker_node.tracking.uncertainty.covariance import fit_covariance

BOTH = {"modalities": ["region", "keypoints"]}


@pytest.fixture(scope="module")
def clip() -> Recording:
    return recording()


def seen(clip: Recording, i: int, rig: CameraRig | None = None) -> list:
    rng = np.random.default_rng(i)
    people = seen_by(clip.rig, clip.states[i], rng, 0.7)
    return [with_mask(person, camera, clip.states[i]) for person, camera in zip(people, clip.rig, strict=True)]


def with_people(clip: Recording, i: int, people: list | None = None) -> ImageSet:
    people = seen(clip, i) if people is None else people
    images = zip(clip.sets[i].images, people, strict=True)
    return replace(clip.sets[i], images=tuple(replace(image, people=None if p is None else (p,)) for image, p in images))


def tracked(clip: Recording, start: State | None = None, n: int = 6, sets=None, **more) -> list[TrackEstimate]:
    made = Tracker(clip.rig, clip.model, from_dict({**BOTH, **more}), None, start)
    return [made.step(image_set) for image_set in (sets or [with_people(clip, i) for i in range(n)])]


@pytest.fixture(scope="module")
def followed(clip: Recording) -> list[TrackEstimate]:
    return tracked(clip)


def test_a_body_that_nobody_has_told_anything_of_is_tracked_from_the_first_set_on(clip, followed):
    assert [estimate.status for estimate in followed] == [Status.TRACKING] * 6
    assert all(limb.status is LimbStatus.TRACKING for estimate in followed for limb in estimate.limbs)
    assert clip.errors_mm(followed).mean() < 20.0
    assert all(camera.samples > 100 for camera in followed[0].cameras)  # lines, not points


def test_a_body_that_is_drawn_from_the_model_has_no_clothes_around_it(clip, followed):
    """Its points are those of a person in clothes; lines know better from the second set on."""
    assert clip.errors_mm(followed)[1:].mean() < 5.0
    surfaces = make_engine(clip.rig, clip.model, from_dict(BOTH), {}).surfaces
    assert surfaces is not None and np.abs(surfaces).max() > 0.03  # what is expected of others


def mistaken(clip: Recording, i: int) -> list:
    """The left arm is seen hanging in all cameras but one, where it is not."""
    hanging = State(clip.states[i].T_world_root, clip.states[i].joint_positions.copy())
    for name in ("elevation_front", "elevation_back"):
        hanging.joint_positions[clip.model.chain.axis_index(f"left_shoulder_{name}")] -= np.radians(50.0)
    right, wrong = seen(clip, i), seen_by(clip.rig, hanging, np.random.default_rng(i), 0.7)
    return [replace(one, silhouette=both.silhouette) for one, both in zip([*wrong[:3], right[3]], right, strict=True)]


@pytest.mark.parametrize("clothed", (False, True))
def test_points_that_err_do_not_take_a_limb_from_contours_on_the_shapes_of_a_clothed_body(clip, clothed):
    made = Tracker(clip.rig, replace(clip.model, clothed=clothed), from_dict(BOTH), None, clip.states[0])
    if not clothed:
        made._track.engine.modalities[0].surface_filter._n_left = 0  # it is taken for somebody in clothes
    estimates = [made.step(with_people(clip, i, None if i < 3 else mistaken(clip, i))) for i in range(7)]
    off = clip.errors_mm(estimates)[:, clip.model.landmark_index("left_wrist")]
    assert (off[1:] < 10.0).all() if clothed else off.max() > 100.0
    limb = {limb.name: limb.status for limb in estimates[-1].limbs}["left_hand"]
    assert limb is not LimbStatus.TRACKING  # two see it in two places


def test_a_limb_that_is_elsewhere_at_first_is_where_its_points_are(clip):
    """Too far for lines, and nothing is searched."""
    start = State(clip.states[0].T_world_root.copy(), clip.states[0].joint_positions.copy())
    start.joint_positions[clip.model.chain.axis_index("left_shoulder_elevation_front")] += np.radians(60.0)
    start.T_world_root[:3, 3] += (0.15, -0.1, 0.02)
    estimates = tracked(clip, start, 2)
    assert clip.errors_mm(estimates).mean() < 25.0 and estimates[0].status is Status.TRACKING


def test_a_lost_limb_is_brought_back_by_its_points_at_once(clip):
    """From where the prediction, which is sure, would hold it."""
    made = Tracker(clip.rig, clip.model, from_dict(BOTH), None, clip.states[0])
    for i in range(2):
        made.step(with_people(clip, i))
    track = made._track
    judge, arm = track.engine.judge.limbs, clip.model.chain.axis_index("left_shoulder_elevation_front")
    i = [limb.name for limb in judge.limbs].index("left_hand")
    wrong = State(track.start.T_world_root.copy(), track.start.joint_positions.copy())
    wrong.joint_positions[arm] += np.radians(100.0)
    track.engine.observe([image.pixels for image in clip.sets[2].images], wrong, people=[(p,) for p in seen(clip, 2)])
    sure = Prior(wrong, np.full(clip.model.n_dof, 1e6))
    assert off_m(track.engine.fit(wrong, False, sure).state, wrong).max() < 0.02
    judge.probabilities[i] = 0.9
    fit = track.engine.fit(wrong, False, sure)
    assert fit.jumped and off_m(fit.state, clip.states[2]).max() < 0.1 < off_m(wrong, clip.states[2]).max()


def test_without_people_lines_alone_follow(clip):
    made = Tracker(clip.rig, clip.model, from_dict(BOTH), None, clip.states[0])
    estimates = [made.step(image_set) for image_set in clip.sets[:5]]
    assert {estimate.status for estimate in estimates} <= {Status.TRACKING, Status.DEGRADED}
    assert clip.errors_mm(estimates).mean() < 25.0


def test_silhouettes_have_a_say_where_they_are_used(clip):
    """One that shows everything but the body misleads; with a share of 0 it is as if there were none."""
    sets = []
    for i in range(2):
        people = [replace(p, silhouette=Silhouette(255 - p.silhouette.probabilities, p.silhouette.origin)) for p in seen(clip, i)]
        sets.append(with_people(clip, i, people))
    bare = [with_people(clip, i, [replace(person, silhouette=None) for person in seen(clip, i)]) for i in range(2)]
    start, none = clip.states[0], {"keypoints.silhouette_weight": 0.0}
    misled, unused, without, right = (
        tracked(clip, start, sets=sets), tracked(clip, start, sets=sets, **none), tracked(clip, start, sets=bare),
        tracked(clip, start, 2),
    )  # fmt: skip
    np.testing.assert_array_equal(unused[1].state.to_values(), without[1].state.to_values())
    assert not np.array_equal(right[1].state.to_values(), without[1].state.to_values())
    found = [sum(camera.residual for camera in estimates[1].cameras) for estimates in (misled, right)]
    assert clip.errors_mm(misled).mean() > clip.errors_mm(right).mean() and found[0] > found[1]


def test_a_camera_in_which_others_alone_are_found_has_no_lines(clip):
    people = seen(clip, 1)
    people[2] = seen_by(clip.rig, standing(1.3, 1.0, 1.0))[2]
    made = Tracker(clip.rig, clip.model, from_dict(BOTH), None, clip.states[0])
    made.step(with_people(clip, 0))
    assert [camera.samples > 50 for camera in made.step(with_people(clip, 1, people)).cameras] == [True, True, False, True]
    alone = [people[0], None, None, None]  # one camera that finds the body does not tell of the others
    again = Tracker(clip.rig, clip.model, from_dict(BOTH), None, clip.states[0])
    again.step(with_people(clip, 0))
    assert all(camera.samples > 50 for camera in again.step(with_people(clip, 1, alone)).cameras)


@pytest.fixture
def engine(clip: Recording) -> Engine:
    """Has learned and fitted the first set, and looks at the second."""
    made = make_engine(clip.rig, clip.model, from_dict(BOTH), {})
    images = [image.pixels for image in clip.sets[0].images]
    made.begin(images, clip.states[0], people=[(person,) for person in seen(clip, 0)])
    made.observe(images, clip.states[0], people=[(person,) for person in seen(clip, 0)])
    made.assess(made.fit(clip.states[0], first=True), clip.sets[0])
    made.observe([image.pixels for image in clip.sets[1].images], clip.states[1], people=[(p,) for p in seen(clip, 1)])
    return made


def test_lines_begin_where_points_have_led_and_are_drawn_about_the_fit(clip, engine):
    delta = np.zeros(clip.model.n_dof)
    delta[:2], delta[6 + clip.model.chain.axis_index("right_elbow_flexion")] = (0.4, -0.3), -0.8
    start = clip.states[1].retract(delta)
    fit = engine.fit(start, first=False)
    assert not fit.jumped and off_m(fit.state, clip.states[1]).mean() < 0.03
    again = engine.solver._fitting.redrawn(fit)
    np.testing.assert_allclose(fit.equations.H, again.equations.H)
    assert off_m(engine.solver._fitting.fit(start, (2.0, 1.0), None, fit.model_sigma_px).state, clip.states[1]).max() > 0.05


def test_searches_for_limbs_rest_while_points_come(clip, engine, monkeypatch):
    solver, images, searched = engine.solver, [image.pixels for image in clip.sets[1].images], []
    monkeypatch.setattr(solver, "_doubtful", lambda fit: {1: 3.0})
    monkeypatch.setattr(solver._search, "recover", lambda *_: searched.append(True))
    engine.fit(clip.states[1], first=False)
    counts = []
    for _ in range(35):
        engine.observe(images, clip.states[1])
        engine.fit(clip.states[1], first=False)
        counts.append(len(searched))
    assert [1 + int(k) for k in np.flatnonzero(np.diff(counts, prepend=0))] == [*range(3, 30, 3), *range(30, 36)]


def test_points_count_in_full_beside_lines(clip, engine):
    fit = engine.fit(clip.states[1], first=False)
    _, points = engine.modalities
    lines, own = fit.correspondences.linearize(fit.state), points.correspond(fit.state, 1.0).linearize(fit.state)
    rest = fit.equations.H - lines.H - own.H
    assert np.linalg.eigvalsh(rest)[0] > -1e-6 * np.abs(fit.equations.H).max()  # priors and constraints are left
    assert np.trace(rest[:3, :3]) < 1e-3 * np.trace(own.H[:3, :3])
    (at,) = engine.solver._fitting.points_at(fit.state)
    np.testing.assert_allclose(at.linearize(fit.state).H, own.H)


def test_lines_of_one_camera_count_little_beside_points(clip, engine):
    fitting, images = engine.solver._fitting, [image.pixels for image in clip.sets[1].images]
    assert fitting.share == 1.0
    alone = [(people,) if i == 1 else None for i, people in enumerate(seen(clip, 1))]
    engine.observe([image if i == 1 else None for i, image in enumerate(images)], clip.states[1], people=alone)
    assert 0.0 < fitting.share < 0.1
    fit = engine.fit(clip.states[1], first=False)
    lines, (points,) = fit.correspondences.linearize(fit.state), fitting.points_at(fit.state)
    rest = fit.equations.H - fitting.share * lines.H - points.linearize(fit.state).H
    assert np.abs(rest[:3, :3]).max() < 1e-3 * np.abs(lines.H[:3, :3]).max()
    engine.observe([image if i == 1 else None for i, image in enumerate(images)], clip.states[1])
    assert fitting.share == 1.0  # nothing else holds the body


def test_surfaces_and_offsets_are_followed_once_a_set(clip, engine):
    region, points = engine.modalities
    region.surface_filter.reset()
    while region.surface_filter.rival is not None:
        region.surface_filter.compare(0.02)  # it is taken for somebody in clothes
    fit = engine.fit(clip.states[1], first=False)
    engine.assess(fit, clip.sets[1])
    before = region._surfaces.surfaces, points.offsets.body
    engine.learn([image.pixels for image in clip.sets[1].images], fit.state)
    after = region._surfaces.surfaces, points.offsets.body
    assert np.trace(after[0].covariances.sum(axis=0)) < np.trace(before[0].covariances.sum(axis=0))
    assert np.trace(after[1].covariances.sum(axis=0)) < np.trace(before[1].covariances.sum(axis=0))
    assert after[0].means[:, 0].mean() < before[0].means[:, 0].mean()  # nobody here wears anything
    engine.reset()
    assert region._surfaces.surfaces is not after[0] and points.offsets.body is not after[1]
    assert not engine.solver._fitting.points_at(fit.state)


def test_what_lines_say_loses_by_surfaces_in_the_covariance_too(clip, engine):
    """The evidence of lines is that of their equations, and its scatter positive: never less than what is lost by surfaces."""
    fit = engine.fit(clip.states[1], first=False)
    errors = engine.judge._errors
    evidence = errors.evidence(fit.correspondences, fit.state)
    np.testing.assert_array_equal(evidence.information, fit.correspondences.linearize(fit.state).H)
    values = np.linalg.eigvalsh(evidence.scatter)
    assert values[0] > -1e-9 * values[-1]
    body = Configuration(clip.model, fit.state)
    J = clip.model.chain.link_moved_by[:, :, None] * body.twists[None]
    summed = np.einsum("lia,lab,ljb->ij", J, evidence.normal, J)
    np.testing.assert_allclose(summed, evidence.information, rtol=1e-6, atol=1e-6 * np.abs(summed).max())
    half = errors.evidence(fit.correspondences, fit.state, 0.5)
    assert half.gradient is None and np.array_equal(evidence.gradient, fit.correspondences.linearize(fit.state).g)
    np.testing.assert_allclose([half.information, half.scatter], [0.5 * evidence.information, 0.25 * evidence.scatter])
    covariance, _ = fit_covariance(fit.equations.H, evidence, body)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0


def test_limbs_are_lost_by_their_points(clip, engine):
    """The left hand's points are all elsewhere: it is likelier lost than with points in place."""
    found = []
    for by_px in (0.0, 60.0):
        people = seen(clip, 1)
        for k, person in enumerate(people):
            pixels = person.pixels.copy()
            rows = [person.names.index(name) for name in ("left_elbow", "left_wrist")]
            pixels[rows] += by_px * np.array([(-1.0) ** k, 1.0])
            people[k] = replace(person, pixels=pixels)
        engine.observe([image.pixels for image in clip.sets[1].images], clip.states[1], people=[(p,) for p in people])
        fit = engine.solver._fitting.redrawn(engine.fit(clip.states[1], first=False))
        (points,) = engine.solver._fitting.points_at(fit.state)
        odds = engine.judge._by_points(points, fit.state)
        found.append(dict(zip([limb.name for limb in engine.judge.limbs.limbs], odds, strict=True)))
    assert found[0]["left_hand"] < -1.0 and found[1]["left_hand"] > found[0]["left_hand"] + 2.0
    assert found[1]["right_foot"] == pytest.approx(found[0]["right_foot"], abs=1.0)
    engine.observe([image.pixels for image in clip.sets[1].images], clip.states[1])
    assert engine.solver._fitting.points_at(fit.state) == []
