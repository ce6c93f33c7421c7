import numpy as np
import pytest

from tracker_node.calibration.body import (
    ScalingOptions,
    error_of_lengths,
    model_stature,
    place_by_states,
    place_landmarks,
    pose_trial,
    robust_mean,
    scale_to_trial,
    targets_of,
)
from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.geometry import se3
from tracker_node.loaders.motion.trajectory_file import StateRow, StateTrajectory, write_states
from tracker_node.loaders.motion.trc import MarkerTrajectories, load_trc
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.measures import MARKER_OF_LANDMARK, HumanMeasures
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.model.variants import LinkScale, scaled_by_link, scaled_uniformly

HUMAN = human_model()
EVALUATED = (
    "neck",
    "head",
    *(f"{s}_{j}" for s in ("left", "right") for j in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")),
)
T_POSE = {"shoulder_elevation_front": np.pi / 2, "shoulder_elevation_back": np.pi / 4}


def trial(model: ArticulatedModel, n: int = 12, noise_m: float = 0.0, outlier_row: int | None = None) -> MarkerTrajectories:
    """Markers of ``model`` in a T-pose that sways a little."""
    rng = np.random.default_rng(4)
    rows = []
    for i in range(n):
        state = State.neutral(model, se3.exp(np.array([1.0, 2.0, 0.9, 0.0, 0.0, 0.5 + 0.01 * i])))
        for name, angle in T_POSE.items():
            for side in ("left", "right"):
                state.joint_positions[model.chain.axis_index(f"{side}_{name}")] = angle
        rows.append(Configuration(model, state).landmarks_world + rng.normal(scale=noise_m, size=(len(model.landmarks), 3)))
    positions = np.array(rows)
    if outlier_row is not None:
        positions[outlier_row] += rng.normal(scale=0.5, size=positions[0].shape)
    names = tuple(MARKER_OF_LANDMARK[name] for name in model.landmark_names)
    return MarkerTrajectories(names, np.arange(n) / 60.0, positions, 60.0, np.ones(positions.shape[:2], dtype=bool))


def length(model, link):
    """Of a limb's link: distance of its child's joint."""
    children = [joint for joint in model.chain.joints if joint.parent == link]
    return np.linalg.norm(children[0].T_parent_joint[:3, 3])


def test_the_body_of_18_segments_is_scaled_by_a_trial_too():
    """Its trunk and shoulders have other links than the human's."""
    body = ellipsoid_human()
    stretch = LinkScale((1.0, 1.0, 1.1), (1.0, 1.0, 1.1))
    wider = LinkScale((1.0, 1.05, 1.0), (1.0, 1.05, 1.0))
    person = scaled_by_link(body, dict.fromkeys(("pelvis", "torso", "chest", "left_thigh", "right_thigh"), stretch))
    person = scaled_by_link(person, dict.fromkeys(("left_shoulder", "right_shoulder"), wider))
    fit = scale_to_trial(body, trial(person), ScalingOptions(joint_sigma_m=0.0))
    for link in ("torso", "left_thigh", "right_shank", "left_forearm"):
        assert np.isclose(length(fit.model, link), length(person, link), rtol=0.02), link
    assert fit.residual_m < 0.005


@pytest.mark.parametrize("stature", [1.5, 1.81, 2.0])
def test_stature_alone(stature):
    scaled = scaled_uniformly(HUMAN, stature / model_stature(HUMAN))
    assert np.isclose(model_stature(scaled), stature)
    assert np.isclose(length(scaled, "left_thigh"), length(HUMAN, "left_thigh") * stature / model_stature(HUMAN))


def test_a_person_of_other_size_and_proportions_is_found():
    """Noise-free markers of a known body: its lengths come back, and its landmarks where they were."""
    long_legs = {
        f"{side}_{link}": LinkScale((1, 1, 1.06), (1, 1, 1.06)) for side in ("left", "right") for link in ("thigh", "shank")
    }
    person = scaled_by_link(human_model(HumanMeasures.of_stature(1.9)), long_legs)
    fit = scale_to_trial(HUMAN, trial(person), ScalingOptions(joint_sigma_m=0.0))
    for link in ("left_thigh", "right_shank", "left_upper_arm", "right_forearm"):
        assert np.isclose(length(fit.model, link), length(person, link), rtol=1e-3)
    for segment in fit.segments:
        assert np.isclose(segment.used_m, segment.measured_m)
    assert fit.residual_m < 2e-3
    assert 1.86 < model_stature(fit.model) < 2.0


def test_lengths_that_are_not_trusted_stay_as_expected():
    person = scaled_by_link(HUMAN, {f"{side}_forearm": LinkScale((1, 1, 1.2), (1, 1, 1.2)) for side in ("left", "right")})
    sigmas = {sigma: scale_to_trial(HUMAN, trial(person), ScalingOptions(joint_sigma_m=sigma)) for sigma in (0.0, 0.015, 10.0)}
    lengths = {sigma: length(fit.model, "left_forearm") for sigma, fit in sigmas.items()}
    nominal = length(HUMAN, "left_forearm")
    assert np.isclose(lengths[0.0], 1.2 * nominal, rtol=2e-3)
    assert np.isclose(lengths[10.0], nominal, rtol=2e-3)
    assert 1.02 * nominal < lengths[0.015] < 1.18 * nominal
    # Whatever the body, the landmark goes where the trial has it
    wrist = HUMAN.landmark_index("left_wrist")
    assert sigmas[10.0].model.landmark_positions[wrist][2] < HUMAN.landmark_positions[wrist][2] - 0.01


def test_an_image_gone_wrong_does_no_harm():
    person = human_model(HumanMeasures.of_stature(1.8))
    clean = scale_to_trial(HUMAN, trial(person, noise_m=0.002))
    hit = scale_to_trial(HUMAN, trial(person, noise_m=0.002, outlier_row=5))
    assert abs(hit.size - clean.size) < 2e-3
    assert np.abs(hit.model.landmark_positions - clean.model.landmark_positions).max() < 5e-3


def test_sides_are_made_equal_unless_asked_otherwise():
    person = scaled_by_link(HUMAN, {"left_thigh": LinkScale((1, 1, 1.1), (1, 1, 1.1))})
    even = scale_to_trial(HUMAN, trial(person), ScalingOptions(joint_sigma_m=0.0)).model
    uneven = scale_to_trial(HUMAN, trial(person), ScalingOptions(joint_sigma_m=0.0, symmetric=False)).model
    assert np.isclose(length(even, "left_thigh"), length(even, "right_thigh"))
    assert length(uneven, "left_thigh") > 1.08 * length(uneven, "right_thigh")
    left, right = even.landmark_index("left_heel"), even.landmark_index("right_heel")
    assert np.allclose(even.landmark_positions[left] * [1, -1, 1], even.landmark_positions[right])


def test_a_known_stature_fixes_the_girths():
    person = human_model(HumanMeasures.of_stature(1.8))
    fit = scale_to_trial(HUMAN, trial(person), ScalingOptions(stature_m=1.6))
    thigh = next(shape.primitive for shape in fit.model.shapes if shape.name == "left_thigh")
    nominal = next(shape.primitive for shape in HUMAN.shapes if shape.name == "left_thigh")
    assert np.isclose(thigh.a / nominal.a, 1.6 / model_stature(HUMAN))


def test_gaps_are_passed_over_and_too_little_is_said():
    markers = trial(human_model(HumanMeasures.of_stature(1.8)))
    valid = markers.valid.copy()
    valid[0, markers.index("LKnee")] = False
    valid[:, markers.index("Nose")] = False
    some = MarkerTrajectories(markers.names, markers.times_s, markers.positions_m, 60.0, valid)
    fit = scale_to_trial(HUMAN, some)
    assert np.isclose(fit.size, 1.8 / 1.75, atol=2e-3)
    none = MarkerTrajectories(markers.names, markers.times_s, markers.positions_m, 60.0, np.zeros_like(valid))
    with pytest.raises(TrackerError, match="no length to scale by"):
        scale_to_trial(HUMAN, none)


def test_landmarks_on_a_limbs_axis_stay_on_it():
    state = State.neutral(HUMAN)
    points = dict(zip(HUMAN.landmark_names, Configuration(HUMAN, state).landmarks_world, strict=True))
    elbow, hip = points["left_elbow"] + [0.02, 0.0, 0.03], points["left_hip"] + [0.02, 0.01, 0.03]
    placed = place_landmarks(HUMAN, [state], [{"left_elbow": elbow, "left_hip": hip}], ScalingOptions(symmetric=False))
    moved = placed.landmark_positions - HUMAN.landmark_positions
    assert np.allclose(moved[HUMAN.landmark_index("left_elbow")], [0.0, 0.0, 0.03])
    assert np.allclose(moved[HUMAN.landmark_index("left_hip")], [0.02, 0.01, 0.03])


def test_states_belong_to_the_markers_of_their_time(tmp_path):
    """Rows are at 5, 5.1 and 5.2 s; the second, lost state has no part: landmarks go up by the mean of 0 and 2 cm."""
    pose = State.neutral(HUMAN, se3.exp(np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])))
    landmarks = Configuration(HUMAN, pose).landmarks_world
    points = np.array([landmarks + np.array([0.0, 0.0, up_m]) for up_m in (0.0, 0.05, 0.02)])
    names = tuple(MARKER_OF_LANDMARK[name] for name in HUMAN.landmark_names)
    markers = MarkerTrajectories(names, np.array([5.0, 5.1, 5.2]), points, 10.0, np.ones(points.shape[:2], bool))
    statuses = ("TRACKING", "LOST", "DEGRADED")
    rows = tuple(StateRow((70 + i) * 10**8, status, "", pose.to_values()) for i, status in enumerate(statuses))
    write_states(tmp_path / "states.csv", StateTrajectory(HUMAN.chain.dof_names, rows))
    placed = place_by_states(HUMAN, markers, tmp_path / "states.csv", ScalingOptions(0.015))
    moved = placed.landmark_positions - HUMAN.landmark_positions
    np.testing.assert_allclose(moved[:, 2], 0.01, atol=1e-3)


@pytest.mark.parametrize("status", ["LOST", "INITIALIZING"])
def test_states_that_are_all_lost_are_refused(tmp_path, status):
    rows = (StateRow(0, status, "", State.neutral(HUMAN).to_values()),)
    write_states(tmp_path / "states.csv", StateTrajectory(HUMAN.chain.dof_names, rows))
    markers = MarkerTrajectories((), np.zeros(1), np.zeros((1, 0, 3)), 10.0, np.zeros((1, 0), bool))
    with pytest.raises(FileFormatError, match=r"at least one state that is not lost.*none in 1 rows"):
        place_by_states(HUMAN, markers, tmp_path / "states.csv")


def test_robust_mean_leaves_outliers_out():
    values = np.array([[1.0, 2.0], [1.1, 2.1], [0.9, 1.9], [50.0, 2.0]])
    assert np.allclose(robust_mean(values), [1.0, 2.0])
    assert robust_mean(np.array([3.0, 3.0, 3.0, 9.0])) == 3.0
    assert robust_mean(np.array([5.0])) == 5.0


def test_a_real_person(shared_data):
    """A static trial, then the same person elsewhere and in motion: joints of a detector, +- 3 to 5 cm."""
    folder = shared_data / "pose2sim_balancing"
    fit = scale_to_trial(HUMAN, load_trc(folder / "static_tpose" / "Standing_for_Scaling.trc"))
    assert fit.residual_m < 0.018
    assert 1.66 < model_stature(fit.model) < 1.76
    motion = load_trc(folder / "Pose2Sim_markers.trc")
    states = pose_trial(fit.model, motion)
    rows = [fit.model.landmark_index(name) for name in EVALUATED]
    errors = []
    for row, state in enumerate(states):
        truth = targets_of(fit.model, motion, row)
        found = Configuration(fit.model, state).landmarks_world
        errors.append(np.linalg.norm(found[rows] - np.array([truth[name] for name in EVALUATED]), axis=1))
    assert np.mean(errors[0]) < 0.022
    assert np.mean(errors) < 0.020
    assert np.max(np.mean(errors, axis=1)) < 0.030


def test_lengths_are_as_wrong_as_left_and_right_differ():
    """Each pair of sides counts once, and a quarter of one says 15 mm."""
    even = {"left_thigh": 0.4, "right_thigh": 0.4, "left_shank": 0.42, "right_shank": 0.42, "trunk": 0.5}
    assert error_of_lengths(even) == pytest.approx(0.015 * np.sqrt(0.25 / 2.25))
    uneven = {**even, "right_thigh": 0.43, "right_shank": 0.39}
    assert error_of_lengths(uneven) == pytest.approx(np.sqrt((0.25 * 0.015**2 + 2 * 0.5 * 0.03**2) / 2.25))
    assert error_of_lengths({**uneven, "left_forearm": 0.3, "right_upper_arm": 0.1}) == error_of_lengths(uneven)
    assert error_of_lengths({"trunk": 0.5}) == error_of_lengths({"left_thigh": 0.4, "right_shank": 0.9}) == pytest.approx(0.015)


def test_a_trial_whose_sides_agree_is_believed():
    """Forearms a fifth longer than expected: by how far left and right differ, their length is taken or not."""
    lengths = []
    for right in (1.2, 1.1):
        scales = {"left_forearm": LinkScale((1, 1, 1.2), (1, 1, 1.2)), "right_forearm": LinkScale((1, 1, right), (1, 1, right))}
        fit = scale_to_trial(HUMAN, trial(scaled_by_link(HUMAN, scales)))
        own = next(segment for segment in fit.segments if segment.name == "left_forearm")
        lengths.append((own.used_m - own.expected_m) / (own.measured_m - own.expected_m))
    assert lengths[0] > 0.9 and lengths[1] < lengths[0] - 0.1


def test_what_differs_in_the_person_is_no_error_of_other_lengths():
    """With a shank 50 mm shorter, the upper arms were 38 mm off."""
    scales = {f"{side}_upper_arm": LinkScale((1, 1, 0.8), (1, 1, 0.8)) for side in ("left", "right")}
    short = 1.0 - 0.05 / length(HUMAN, "left_shank")
    markers = trial(scaled_by_link(HUMAN, scales | {"left_shank": LinkScale((1, 1, short), (1, 1, short))}))
    fits = [scale_to_trial(HUMAN, markers, ScalingOptions(symmetric=symmetric)) for symmetric in (False, True)]
    arms = [next(segment for segment in fit.segments if segment.name == "left_upper_arm") for fit in fits]
    off = [abs(arm.used_m - arm.measured_m) for arm in arms]
    assert off[0] < 0.004 and off[1] > 0.02
    for fit in fits:
        assert list(fit.differing) == ["left_shank"] and np.isclose(fit.differing["left_shank"], 0.05, atol=1e-3)
    uneven = {"left_thigh": 0.4, "right_thigh": 0.43, "left_shank": 0.42, "right_shank": 0.41}
    assert error_of_lengths(uneven, symmetric=False) == pytest.approx(np.sqrt((0.25 * 0.015**2 + 2 * 0.5 * 0.01**2) / 2.25))


def test_landmarks_that_are_no_joints_do_not_pull_the_trials_pose():
    """Toes, heels and nose are 5 cm off: joints stay where they are, and the landmarks go where the trial has them."""
    markers = trial(HUMAN)
    beside = [markers.index(name) for name in ("LBigToe", "RBigToe", "LHeel", "RHeel", "Nose", "Head")]
    positions = markers.positions_m.copy()
    positions[:, beside] += [0.03, 0.03, 0.03]
    fit = scale_to_trial(HUMAN, MarkerTrajectories(markers.names, markers.times_s, positions, 60.0, markers.valid))
    true = markers.positions_m[0]
    found = Configuration(fit.model, fit.states[0]).landmarks_world
    for joint in ("left_hip", "right_knee", "left_ankle", "right_shoulder", "left_wrist"):
        off = np.linalg.norm(found[HUMAN.landmark_index(joint)] - true[markers.index(MARKER_OF_LANDMARK[joint])])
        assert off < 0.006, joint
    state = pose_trial(HUMAN, markers, weights={"left_wrist": 0.0})[0]
    moved = pose_trial(HUMAN, _shifted(markers, "LWrist"), weights={"left_wrist": 0.0})[0]
    np.testing.assert_allclose(moved.to_values(), state.to_values(), atol=1e-6)


def _shifted(markers: MarkerTrajectories, name: str) -> MarkerTrajectories:
    positions = markers.positions_m.copy()
    positions[:, markers.index(name)] += 0.2
    return MarkerTrajectories(markers.names, markers.times_s, positions, 60.0, markers.valid)
