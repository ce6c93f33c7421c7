"""A body from the points of people whose lengths are known, with the faults that detectors have."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, POINTS, posed, seen_by, standing, swapped, without
from helpers.cameras.camera_rigs import circle_rig
from helpers.cameras.small_clip import body as arm_and_trunk
from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.calibration.body import targets_of
from tracker_node.errors import TrackerError
from tracker_node.geometry import se3
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.calibration_toml import load_pose2sim
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.keypoints import BLAZEPOSE, LandmarkPoint, relative_size
from tracker_node.model.shape_parameters import ShapeSpace, expected_lengths
from tracker_node.observation.keypoints.blazepose import NAMES
from tracker_node.observation.keypoints.people import People, Person
from tracker_node.runs.people.recorded import PointFiles, open_recorded_people
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.keypoints import body_from_points as module
from tracker_node.tracking.keypoints.body_from_points import BodyFromPoints, body_from_points

RIG = circle_rig(4)
SPACE = ShapeSpace(HUMAN, True, ("size", "length", "breadth"))
BONES = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
CHILD = {"size": -0.25, "length thigh": 0.05, "length forearm": -0.04}


def parameters(changes: Mapping[str, float]) -> np.ndarray:
    """Those that are expected of a person of the size in ``changes``, and the other changes added to them."""
    mean, information = expected_lengths(SPACE)
    size, s = SPACE.names.index("size"), mean.copy()
    others = np.arange(len(s)) != size
    pulled = information[others, size] * changes.get("size", 0.0)
    s[others] -= np.linalg.solve(information[np.ix_(others, others)], pulled)
    for name, value in changes.items():
        s[SPACE.names.index(name)] += value
    return s


def person(changes: Mapping[str, float]) -> ArticulatedModel:
    return SPACE.body(parameters(changes))


def images_of(body: ArticulatedModel, states: list[State], seed: int = 0) -> list[list[People]]:
    """Where the detector's points are on average on such a body, 1 px off, by image set and camera."""
    rng, size = np.random.default_rng(seed), relative_size(body)
    offsets = {name: size * np.array(BLAZEPOSE[name].offset) for name in POINTS}
    return [[(found,) for found in seen_by(RIG, state, rng, 1.0, offsets, body)] for state in states]


def poses(body: ArticulatedModel, n: int) -> list[State]:
    return [posed(20 + i, 0.5, 0.15, body) for i in range(n)]


def bone_mm(model: ArticulatedModel, one: str, other: str) -> float:
    places = Configuration(model, State.neutral(model)).landmarks_world
    return 1e3 * float(np.linalg.norm(np.subtract(*places[[model.landmark_index(f"left_{joint}") for joint in (one, other)]])))


def bone_errors_mm(found: ArticulatedModel, true: ArticulatedModel) -> np.ndarray:
    return np.array([abs(bone_mm(found, *bone) - bone_mm(true, *bone)) for bone in BONES])


def errors_in_sigmas(found: BodyFromPoints, changes: Mapping[str, float]) -> np.ndarray:
    assert [length.name for length in found.lengths] == list(SPACE.names)
    errors = np.array([length.value for length in found.lengths]) - parameters(changes)
    return errors / [length.sigma for length in found.lengths]


@pytest.fixture(scope="module")
def child() -> tuple[ArticulatedModel, list[State], list[list[People]]]:
    """In four image sets with two faults: sides exchanged in one image, and a wrist far away in another."""
    body = person(CHILD)
    states = poses(body, 4)
    seen = images_of(body, states)
    seen[0][1] = (swapped(seen[0][1][0]),)
    pixels = seen[1][2][0].pixels.copy()
    pixels[NAMES.index("left_wrist")] += (80.0, -60.0)
    seen[1][2] = (replace(seen[1][2][0], pixels=pixels),)
    return body, states, seen


@pytest.fixture(scope="module")
def found(child) -> BodyFromPoints:
    return body_from_points(HUMAN, RIG, child[2])


def test_lengths_of_a_child_with_its_poses(child, found) -> None:
    body, states, _ = child
    errors_mm = bone_errors_mm(found.model, body)
    assert errors_mm.max() < 20.0 and bone_errors_mm(HUMAN, body).mean() > 4.0 * errors_mm.mean()
    assert np.abs(errors_in_sigmas(found, CHILD)).max() < 2.5
    assert found.rows == (0, 1, 2, 3) and 0.5 < found.residual_px < 2.0
    for state, true in zip(found.states, states, strict=True):
        places = [Configuration(model, at).landmarks_world for model, at in ((found.model, state), (body, true))]
        assert np.linalg.norm(places[0] - places[1], axis=1).mean() < 0.03
    assert found.model.chain.dof_names == HUMAN.chain.dof_names


@pytest.mark.parametrize("changes", [{"size": 0.12, "length shank": 0.03}, {"size": -0.4}, {"length upper_arm": 0.03}])
def test_one_image_set_suffices(changes) -> None:
    body = person(changes)
    fit = body_from_points(HUMAN, RIG, images_of(body, poses(body, 1)))
    errors_mm = bone_errors_mm(fit.model, body)
    assert errors_mm.max() < 20.0 and errors_mm.mean() < 0.5 * bone_errors_mm(HUMAN, body).mean()
    assert np.abs(errors_in_sigmas(fit, changes)).max() < 2.5


def test_sigmas_say_how_far_off_lengths_are() -> None:
    """People drawn from what is expected, with offsets drawn from the table: squared errors are what sigmas say."""
    mean, information = expected_lengths(SPACE)
    rng, ratios = np.random.default_rng(7), []
    root = np.linalg.cholesky(np.linalg.inv(information))
    for i in range(8):
        s = mean + root @ rng.normal(size=len(mean))
        body = SPACE.body(s)
        table = {name: BLAZEPOSE[name] for name in POINTS}
        offsets = {name: np.array(point.offset) + np.array(point.sigma) * rng.normal(size=3) for name, point in table.items()}
        seen = [[(one,) for one in seen_by(RIG, posed(40 + i, 0.5, 0.15, body), rng, 1.0, offsets, body)]]
        fit = body_from_points(HUMAN, RIG, seen)
        ratios.append([(length.value - true) / length.sigma for length, true in zip(fit.lengths, s, strict=True)])
    squares = np.square(ratios)
    assert 0.5 < squares.mean() < 1.6 and np.sqrt(squares.max()) < 4.0


def test_more_image_sets_tell_more(found, child) -> None:
    alone = body_from_points(HUMAN, RIG, child[2][:1])
    size, thigh = SPACE.names.index("size"), SPACE.names.index("length thigh")
    _, information = expected_lengths(SPACE)
    prior = np.sqrt(np.diag(np.linalg.inv(information)))
    for k in (size, thigh):
        assert found.lengths[k].sigma < alone.lengths[k].sigma < prior[k]


def test_of_two_people_the_one_where_cameras_look_or_near_a_place() -> None:
    body, other = person({"size": -0.2}), person({"size": 0.1})
    both = zip(
        images_of(body, [standing(0.1, 0.0, 0.5, model=body)])[0],
        images_of(other, [standing(1.3, 0.6, 2.0, model=other)])[0], strict=True,
    )  # fmt: skip
    seen = [[beside + own for own, beside in both]]
    for near, own, foreign in ((None, body, other), (np.array([1.2, 0.5, 1.0]), other, body)):
        fit = body_from_points(HUMAN, RIG, seen, near=near)
        assert np.linalg.norm(fit.states[0].T_world_root[:2, 3] - ([0.1, 0.0] if near is None else [1.3, 0.6])) < 0.05
        assert bone_errors_mm(fit.model, own).max() < 20.0 < bone_errors_mm(fit.model, foreign).max()


def test_somebody_far_from_the_place_is_not_taken() -> None:
    body = person({"size": 0.1})
    here, away = (images_of(body, [standing(x, 0.0, model=body)])[0] for x in (0.2, -2.3))
    fit = body_from_points(HUMAN, RIG, [here, away], near=np.array([1.0, 0.0, 1.0]))
    assert fit.rows == (0,)
    told = r"within 2 m of \(30.0, 30.0, 1.0\) \(meters, world axes\); the nearest is at \(0.2, -?0.0, 0.9\), 42.\d m from it"
    with pytest.raises(TrackerError, match=told):
        body_from_points(HUMAN, RIG, [here, away], near=np.array([30.0, 30.0, 1.0]))


def test_points_that_nobody_has_seen(child) -> None:
    """Forearms are in no image: their lengths are as expected, and the others are found."""
    body, _, seen = child
    hidden = ("left_elbow", "right_elbow", "left_wrist", "right_wrist")
    lacking = [[tuple(without(one, hidden) for one in people) for people in each] for each in seen]
    fit = body_from_points(HUMAN, RIG, lacking)
    forearm = SPACE.names.index("length forearm")
    assert fit.lengths[forearm].sigma > 0.04
    assert bone_errors_mm(fit.model, body)[2:].max() < 20.0
    assert all(np.isfinite([length.value, length.sigma]).all() for length in fit.lengths)


def test_sets_without_the_person_have_no_part(child) -> None:
    _, _, seen = child
    nobody: list[People] = [(), (), (), ()]
    one_camera: list[People] = [seen[2][0], (), (), ()]
    fit = body_from_points(HUMAN, RIG, [nobody, seen[2], one_camera, seen[3]])
    assert fit.rows == (1, 3) and len(fit.states) == 2
    with pytest.raises(TrackerError, match="one image set with a person in two cameras, got none in 2 image sets"):
        body_from_points(HUMAN, RIG, [nobody, one_camera])
    with pytest.raises(TrackerError, match="none in 0 image sets"):
        body_from_points(HUMAN, RIG, [])


def test_a_machine_by_its_table() -> None:
    """Another body than a person: its lengths are expected to be those that are given, give or take what people differ by."""
    given = arm_and_trunk()
    space = ShapeSpace(given, True, ("size", "length", "breadth"))
    true = space.body(np.where(np.array(space.names) == "length upper", 0.06, 0.0))
    places = {"shoulder": (0.0, 0.0, 0.0), "elbow": (0.0, 0.0, 0.0), "wrist": (0.0, 0.0, 0.0)}
    table = {name: LandmarkPoint(name, offset, (0.01,) * 3) for name, offset in places.items()}
    marked = replace(given, landmarks=(*given.landmarks, *_marks()))
    table |= {mark.name: LandmarkPoint(mark.name, sigma=(0.01,) * 3) for mark in _marks()}
    seen, true = [], replace(true, landmarks=(*true.landmarks, *_marks()))
    for angle in (-0.5, 0.4, 0.9):
        joints = np.array([0.3 * angle, angle, -1.0 - angle])
        state = State(se3.exp(np.array([0.0, 0.0, 1.0, 0.0, 0.0, angle])), joints)
        landmarks = Configuration(true, state).landmarks_world
        seen.append([(_named(true.landmark_names, camera.project(landmarks)[0]),) for camera in RIG])
    fit = body_from_points(marked, RIG, seen, table)
    assert [length.name for length in fit.lengths] == list(space.names)
    upper = fit.lengths[space.names.index("length upper")]
    assert abs(upper.value - 0.06) < 3.0 * upper.sigma and upper.value > 0.02 and upper.sigma < 0.05


def _marks():
    landmark = type(arm_and_trunk().landmarks[0])
    places = {"front": (0.1, 0.0, 0.2), "left": (0.0, 0.1, 0.2), "low": (0.0, 0.0, -0.25), "behind": (-0.1, 0.0, -0.2)}
    return tuple(landmark(name, "trunk", xyz) for name, xyz in places.items())


def _named(names: tuple[str, ...], pixels: np.ndarray) -> Person:
    n = len(names)
    (left, top), (right, bottom) = pixels.min(axis=0).tolist(), pixels.max(axis=0).tolist()
    return Person(names, pixels, np.tile(np.eye(2), (n, 1, 1)), np.ones(n), 1.0, (left, top, right, bottom))


def test_a_real_person(shared_data) -> None:
    """By the points of OpenPose in five images, whose offsets are not measured; beside the lengths of triangulated joints."""
    folder = shared_data / "pose2sim_balancing"
    rig = load_pose2sim(folder / "Pose2Sim_cameras.toml")
    recorded = open_recorded_people(PointFiles(folder / "openpose_body25b_json.zip"), HUMAN, rig, rig, {})
    seen = [[recorded.of(name, row) or () for name in rig.names] for row in range(0, 100, 20)]
    fit = body_from_points(HUMAN, rig, seen, recorded.table)
    markers = load_trc(folder / "Pose2Sim_markers.trc")
    joints = [targets_of(HUMAN, markers, row) for row in range(0, 100, 20)]
    errors_mm = []
    for one, other in BONES:
        ends = [(each[f"{side}_{one}"], each[f"{side}_{other}"]) for each in joints for side in ("left", "right")]
        errors_mm.append(bone_mm(fit.model, one, other) - 1e3 * np.median([np.linalg.norm(a - b) for a, b in ends]))
    assert fit.rows == (0, 1, 2, 3, 4)
    assert np.abs(errors_mm).max() < 35.0 and np.abs(errors_mm).mean() < 18.0


@pytest.fixture(scope="module")
def problem(child):
    """The equations of two image sets, off the minimum."""
    _, states, seen = child
    config = TrackerConfig()
    modality = module.KeypointModality(RIG, HUMAN, config.keypoints, BLAZEPOSE)
    observed = []
    for state, people in zip(states[2:], seen[2:], strict=True):
        modality.set_images((), state, None, [persons[0] for persons in people])
        observed.append(modality.correspond(state, 1.0).observed)
    rng = np.random.default_rng(2)
    made = module._Problem(RIG, HUMAN, BLAZEPOSE, config, observed)
    offsets = 0.002 * rng.normal(size=(len(made.names), 3))
    off = [state.retract(0.003 * rng.normal(size=HUMAN.n_dof)) for state in states[2:]]
    return made, module._Unknowns(tuple(off), parameters(CHILD) + 0.004 * rng.normal(size=len(SPACE)), offsets)


def moved(at: module._Unknowns, tangent: np.ndarray) -> module._Unknowns:
    n_shape, n_shared = len(at.s), len(at.s) + at.offsets.size
    tangents = tangent[n_shared:].reshape(len(at.states), -1)
    states = tuple(state.retract(each) for state, each in zip(at.states, tangents, strict=True))
    return module._Unknowns(states, at.s + tangent[:n_shape], at.offsets + tangent[n_shape:n_shared].reshape(-1, 3))


def test_equations_are_the_derivative_of_the_cost(problem) -> None:
    made, at = problem
    _, g = made.equations(at)
    assert_jacobian(2.0 * g[None], lambda tangent: np.array([made.cost(moved(at, tangent))]), 1e-6, 1e-6)


def test_the_matrix_is_that_of_residuals_where_nothing_is_an_outlier(problem, monkeypatch) -> None:
    """With weights of one the equations change along any small step as the matrix says, but for what bends."""
    made, at = problem
    sure = module._compared
    monkeypatch.setattr(module, "_compared", lambda seen, projected: _without_outliers(sure, seen, projected))
    best = made.fitted(at)
    H, g = made.equations(best)
    n = len(g)
    assert np.abs(H - H.T).max() < 1e-9 * np.abs(H).max() and np.linalg.eigvalsh(H)[0] > 0.0
    for direction in np.random.default_rng(4).normal(size=(5, n)):
        step = 1e-5 * direction
        change = (made.equations(moved(best, step))[1] - made.equations(moved(best, -step))[1]) / 2e-5
        assert np.linalg.norm(change - H @ direction) < 0.1 * np.linalg.norm(H @ direction)


def _without_outliers(compared, seen, projected):
    errors, _, _ = compared(seen, projected)
    has = projected[1] & (seen[:, module.S_UU] > 0.0)
    return errors, has.astype(float), float(np.einsum("ni,nij,nj->", errors[has], module._information(seen[has]), errors[has]))


def test_sigmas_without_anything_seen(problem) -> None:
    """A set of which no point is believed leaves matrices that can be inverted."""
    made, at = problem
    far = module._Unknowns(tuple(state.retract(np.r_[5.0, np.zeros(39)]) for state in at.states), at.s, at.offsets)
    _, information = expected_lengths(SPACE)
    assert np.allclose(made.sigmas(far), np.sqrt(np.diag(np.linalg.inv(information))), rtol=1e-3)
