"""Detected points as a modality: what is taken of people, where points are expected, cameras that are late, what is learned."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from helpers.bodies.detected_people import HUMAN, NAMES, POINTS, places, posed, seen_by, with_skeletons, without
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE, GUESSED_BONES
from tracker_node.model.humans.measures import HumanMeasures
from tracker_node.objective.keypoints.kernels import N_COLUMNS, OUTLIER, S_UU, S_UV, S_VV, U, V
from tracker_node.tracking.config import KeypointConfig
from tracker_node.tracking.keypoints.modality import KeypointModality, points_of
from tracker_node.tracking.motion.model import ExposureDelays, Prediction

RIG = circle_rig(3)
TRUE = posed(3)
CONFIG = KeypointConfig(covariance_scale=2.0, sigma_fraction=0.01, outlier_fraction=0.05)


def modality(config: KeypointConfig = CONFIG) -> KeypointModality:
    return KeypointModality(RIG, HUMAN, config, BLAZEPOSE)


def in_order(made: KeypointModality, of_points: np.ndarray) -> np.ndarray:
    """From the order of `POINTS` to that of the modality."""
    return of_points[[POINTS.index(name) for name in made.names]]


def test_the_points_of_a_table_have_the_offsets_of_a_body_of_this_size():
    large = human_model(HumanMeasures.of_stature(1.5 * HumanMeasures().stature))
    names, body = points_of(large, BLAZEPOSE, 2.0)
    assert set(names) == set(POINTS)
    for k, name in enumerate(names):
        point, row = BLAZEPOSE[name], large.landmark_index(BLAZEPOSE[name].landmark)
        np.testing.assert_allclose(body.means[k], 1.5 * np.array(point.offset), atol=1e-12)
        np.testing.assert_allclose(body.covariances[k], np.diag((3.0 * np.array(point.sigma)) ** 2), atol=1e-15)
        assert body.links[k] == large.landmark_links[row]
        np.testing.assert_array_equal(body.positions[k], large.landmark_positions[row])
        np.testing.assert_allclose(body.priors[k] @ body.covariances[k], np.eye(3), atol=1e-9)


def test_depths_of_bones_and_the_distance_are_those_of_a_skeleton_that_is_right():
    made = modality()
    people = with_skeletons(RIG, seen_by(RIG, TRUE), TRUE)
    people[1] = replace(people[1], skeleton=None)
    made.set_images((), TRUE, None, people)
    depths, at = made.correspond(TRUE, 1.0)._depths, in_order(made, places(TRUE))
    assert depths.depths.shape == (3, len(GUESSED_BONES)) and np.isnan(depths.depths[1]).all() and np.isnan(depths.distances[1])
    for i in (0, 2):
        camera = RIG.cameras[i]
        forward = camera.T_world_cam[:3, 2]
        for k, bone in enumerate(GUESSED_BONES):
            near, far = (np.mean([at[made.names.index(name)] for name in part], axis=0) for part in (bone.near, bone.far))
            assert depths.depths[i, k] == pytest.approx(float((far - near) @ forward), abs=1e-9)
        away = np.linalg.norm(at.mean(axis=0) - camera.center)
        assert depths.distances[i] == pytest.approx(away, rel=0.05)
        np.testing.assert_allclose(depths.rays[i], (at.mean(axis=0) - camera.center) / away, atol=0.03)


def test_one_camera_knows_by_a_skeleton_how_far_the_body_is_and_not_without():
    sigmas = []
    for people in (seen_by(RIG, TRUE), with_skeletons(RIG, seen_by(RIG, TRUE), TRUE)):
        made = modality()
        made.set_images((), TRUE, None, [people[0], None, None])
        H = made.correspond(TRUE, 1.0).linearize(TRUE).H + 1e-3 * np.eye(HUMAN.n_dof)
        ray = made._rig.cameras[0].T_world_cam[:3, 2]
        sigmas.append(float(np.sqrt(ray @ np.linalg.inv(H)[:3, :3] @ ray)))
    assert sigmas[1] < 0.8 * sigmas[0]


def test_guesses_have_no_say_where_they_have_no_weight():
    made = modality(replace(CONFIG, depth_weight=0.0))
    made.set_images((), TRUE, None, with_skeletons(RIG, seen_by(RIG, TRUE), TRUE))
    assert made.correspond(TRUE, 1.0)._depths is None


def test_points_without_a_landmark_are_left_out():
    names, body = points_of(crane(), BLAZEPOSE)
    assert names == () and len(body) == 0 and body.means.shape == (0, 3)


def test_points_are_expected_where_the_landmarks_with_their_offsets_are():
    made = modality()
    np.testing.assert_allclose(made.places(TRUE), in_order(made, places(TRUE)), atol=1e-12)


def test_what_is_taken_of_a_person():
    """Pixels, covariances with the least error that goes with the person's size, outliers by the score."""
    made, people = modality(), seen_by(RIG, TRUE)
    rng = np.random.default_rng(0)
    half = rng.normal(size=(len(NAMES), 2, 2))
    scores = rng.uniform(0.1, 1.0, len(NAMES))
    given = replace(
        people[1], covariances=half @ np.swapaxes(half, 1, 2) + np.eye(2), scores=scores, box=(10.0, 20.0, 90.0, 220.0)
    )
    made.set_images((), TRUE, None, [None, given, None])
    observed = made.correspond(TRUE, 1.0).observed
    assert made.has_points and observed.shape[:2] == (len(made.names), 3)
    assert not observed[:, [0, 2]].any()
    for k, name in enumerate(made.names):
        row, own = NAMES.index(name), observed[k, 1]
        S = 2.0 * given.covariances[row] + (0.01 * 200.0) ** 2 * np.eye(2)
        W, q = np.linalg.inv(S), 0.05 + 0.4 * (1.0 - scores[row])
        np.testing.assert_allclose(own[[U, V]], given.pixels[row])
        np.testing.assert_allclose(own[[S_UU, S_UV, S_VV]], [W[0, 0], W[0, 1], W[1, 1]])
        assert own[OUTLIER] == pytest.approx(q / (1.0 - q) * 2.0 * np.pi * np.sqrt(np.linalg.det(S)) / 200.0**2)


def test_a_wide_person_is_as_large_as_they_are_wide():
    made = modality()
    given = replace(seen_by(RIG, TRUE)[0], box=(10.0, 20.0, 410.0, 220.0))
    made.set_images((), TRUE, None, [given, None, None])
    W = made.correspond(TRUE, 1.0).observed[:, 0, S_UU]
    np.testing.assert_allclose(1.0 / W, 2.0 * 1.0 + (0.01 * 400.0) ** 2)


def test_points_that_were_not_found_say_nothing_wherever_they_are():
    made, people = modality(), seen_by(RIG, TRUE)
    given = without(people[0], ("left_wrist", "nose"))
    negative = replace(people[1], scores=np.where(np.array(NAMES) == "right_knee", -0.1, people[1].scores))
    infinite = people[2].pixels.copy()
    infinite[NAMES.index("left_heel"), 1] = np.inf
    made.set_images((), TRUE, None, [given, negative, replace(people[2], pixels=infinite)])
    points = made.correspond(TRUE, 1.0).at(TRUE)
    unseen = {(made.names[k], i) for k, i in np.argwhere(points.weights < 0.0)}
    assert unseen == {("left_wrist", 0), ("nose", 0), ("right_knee", 1), ("left_heel", 2)}
    assert np.isfinite(points.equations.H).all() and np.isfinite(points.equations.cost)


def test_exact_points_at_the_true_state_cost_nothing():
    made = modality()
    made.set_images((), TRUE, None, seen_by(RIG, TRUE))
    found = made.correspond(TRUE, 1.0).linearize(TRUE)
    assert found.cost == pytest.approx(0.0, abs=1e-9) and np.abs(found.g).max() < 1e-5
    assert found.count == 3 * len(POINTS)


def test_without_people_or_an_expectation_there_are_no_points():
    made, people = modality(), seen_by(RIG, TRUE)
    made.set_images((), TRUE, None, people)
    for expected, persons in ((None, people), (TRUE, ()), (TRUE, [None, None, None])):
        made.set_images((), TRUE, None, people)
        assert made.has_points
        made.set_images((), expected, None, persons)
        found = made.correspond(TRUE, 1.0).linearize(TRUE)
        assert made.correspond(TRUE, 1.0).observed.shape == (len(POINTS), 3, N_COLUMNS)
        assert not made.has_points and found.count == 0 and found.cost == 0.0 and not found.H.any() and not found.g.any()


def moving(velocity: np.ndarray, delays_s: tuple[float, ...]) -> ExposureDelays:
    return ExposureDelays(delays_s, Prediction(TRUE, velocity))


def test_points_of_late_cameras_are_brought_to_the_stamp_of_the_set():
    made, velocity = modality(), np.zeros(HUMAN.n_dof)
    velocity[:2], velocity[HUMAN.chain.axis_index("left_elbow_flexion") + 6] = (1.5, -0.8), 3.0
    delays_s = (0.0, 0.02, -0.01)
    people = [seen_by(RIG, TRUE.retract(delay * velocity))[i] for i, delay in enumerate(delays_s)]
    made.set_images((), TRUE, moving(velocity, delays_s), people)
    in_time = seen_by(RIG, TRUE)
    observed = made.correspond(TRUE, 1.0).observed
    for i, person in enumerate(in_time):
        rows = [NAMES.index(name) for name in made.names]
        np.testing.assert_allclose(observed[:, i, [U, V]], person.pixels[rows], atol=1e-9)
        moved = np.abs(people[i].pixels - person.pixels)[rows].max()
        assert moved > 2.0 or i == 0


def test_a_reset_forgets_points_and_offsets():
    made = modality()
    made.set_images((), TRUE, None, seen_by(RIG, TRUE, offsets={name: np.array([0.0, 0.02, 0.0]) for name in POINTS}))
    first = made.offsets.body
    made.learn((), TRUE, None)
    assert not np.allclose(made.offsets.body.means, first.means)
    made.reset()
    assert made.offsets.body is first and not made.has_points


def test_offsets_of_parts_that_are_elsewhere_are_not_learned():
    made = modality()
    off = {name: np.array(BLAZEPOSE[name].offset) + 0.01 for name in POINTS}
    made.set_images((), TRUE, None, seen_by(RIG, TRUE, offsets=off))
    before = made.offsets.body.means
    weights = np.ones(len(HUMAN.shapes))
    doubtful = [i for i, shape in enumerate(HUMAN.shapes) if shape.name.startswith("left_")]
    weights[doubtful] = 0.5
    made.learn((), TRUE, weights)
    moved = np.abs(made.offsets.body.means - before).max(axis=1) > 1e-6
    on_left = [HUMAN.chain.links[link].startswith("left_") for link in made.offsets.body.links]
    assert any(on_left) and moved.tolist() == [not left for left in on_left]
    made.learn((), TRUE, np.where(weights == 0.5, 0.51, weights))
    assert (np.abs(made.offsets.body.means - before).max(axis=1) > 1e-6).all()


def test_nothing_is_learned_without_points_nor_from_a_first_set():
    made = modality()
    first = made.offsets.body
    made.learn((), TRUE, None)
    assert made.offsets.body is first and list(made.lessons(True)) == list(made.lessons(False)) == []


def test_blunt_points_say_less_by_the_factor():
    made = modality()
    made.set_images((), TRUE, None, seen_by(RIG, TRUE))
    near = State(TRUE.T_world_root.copy(), TRUE.joint_positions)
    near.T_world_root[0, 3] += 1e-4
    sharp, blunt = (made.correspond(near, s).at(near) for s in (1.0, 0.01))
    np.testing.assert_allclose(blunt.information, 0.01 * sharp.information, rtol=0.01)
