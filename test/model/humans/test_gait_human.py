"""The fuller human: the joints that gait laboratories ask for, hands and feet that are seen, and else the human itself."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.bodies import mirrored_states, random_state
from tracker_node.calibration.body import model_stature
from tracker_node.geometry import se3
from tracker_node.loaders.model.model_yaml import HUMANS, dump_model, load_model
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import gait_human, human_model
from tracker_node.model.humans.measures import HumanMeasures, mirrored_name
from tracker_node.objective.constraints.collision import CollisionObjective
from tracker_node.tracking.config import MotionConfig
from tracker_node.tracking.constraints import neutral_information
from tracker_node.tracking.limbs.tree import limbs_of

MODEL, PLAIN = gait_human(), human_model()


def posed(**angles_deg) -> dict[str, np.ndarray]:
    state = State.neutral(MODEL)
    for name, angle in angles_deg.items():
        i = MODEL.chain.axis_index(name)
        assert MODEL.chain.lower[i] <= np.deg2rad(angle) <= MODEL.chain.upper[i]
        state.joint_positions[i] = np.deg2rad(angle)
    return dict(zip(MODEL.landmark_names, Configuration(MODEL, state).landmarks_world, strict=True))


NEUTRAL = posed()


def test_it_has_the_joints_that_the_plain_human_lacks():
    axes_of = {joint.name: len(joint.axes) for joint in MODEL.chain.joints}
    sided = {"clavicle": 3, "shoulder": 3, "elbow": 2, "wrist": 2, "hip": 3, "knee": 2, "ankle": 2, "toes": 1}
    expected = {f"{side}_{name}": n for side in ("left", "right") for name, n in sided.items()}
    assert axes_of == {"neck": 3, "torso": 3, "abdomen": 3, **expected} and MODEL.n_dof == 51


def test_in_the_neutral_pose_it_is_the_plain_human():
    """Same joints, same landmarks, same stature: what knows the one knows the other."""
    assert set(PLAIN.chain.dof_names) < set(MODEL.chain.dof_names)
    places = dict(zip(PLAIN.landmark_names, Configuration(PLAIN, State.neutral(PLAIN)).landmarks_world, strict=True))
    for name, place in places.items():
        assert NEUTRAL[name] == pytest.approx(place, abs=1e-12), name
    assert model_stature(MODEL) == pytest.approx(model_stature(PLAIN), abs=1e-6)
    for name in PLAIN.chain.dof_names[6:]:
        one, other = (body.chain.axes[body.chain.axis_index(name)] for body in (PLAIN, MODEL))
        assert one == replace(other, stiffness=one.stiffness)


def test_the_prior_of_an_axis_is_the_spread_that_its_table_says():
    information = neutral_information(MODEL.chain, MotionConfig())
    sigmas = {name: np.degrees(value**-0.5) for name, value in zip(MODEL.chain.dof_names, information, strict=True) if value}
    assert (sigmas["torso_flexion"], sigmas["left_toes_extension"]) == pytest.approx((9.0, 15.0), rel=0.01)
    assert sigmas["right_hip_flexion"] > 200.0  # nothing is said of large joints


@pytest.mark.parametrize(("angle", "degrees", "landmark", "origin", "direction"), [
    ("left_wrist_flexion", 60, "left_index", "left_wrist", (0, -1, 0)),  # the palm faces inward
    ("right_wrist_flexion", 60, "right_index", "right_wrist", (0, 1, 0)),
    ("left_wrist_ulnar_deviation", 30, "left_pinky", "left_wrist", (-1, 0, 0)),  # away from the thumb, which is in front
    ("right_wrist_ulnar_deviation", 30, "right_index", "right_wrist", (-1, 0, 0)),
    ("left_ankle_dorsiflexion", 30, "left_big_toe", "left_ankle", (0, 0, 1)),
    ("left_ankle_inversion", 30, "left_big_toe", "left_small_toe", (0, 0, 1)),  # the sole is turned inward
    ("right_ankle_inversion", 30, "right_big_toe", "right_small_toe", (0, 0, 1)),
    ("right_toes_extension", 60, "right_big_toe", "right_ankle", (0, 0, 1)),
    ("head_turn_left", 60, "nose", "neck", (0, 1, 0)),
])  # fmt: skip
def test_angles_do_what_their_names_say(angle, degrees, landmark, origin, direction):
    moved = posed(**{angle: degrees})
    change = (moved[landmark] - moved[origin]) - (NEUTRAL[landmark] - NEUTRAL[origin])
    assert change @ np.array(direction) > 0.8 * np.linalg.norm(change) > 0.01


def test_toes_move_no_other_point_of_the_foot():
    moved = posed(left_toes_extension=50)
    assert {name for name in moved if not np.allclose(moved[name], NEUTRAL[name])} == {"left_big_toe"}


@pytest.mark.parametrize("seed", range(3))
def test_equal_angles_on_both_sides_are_a_mirrored_pose(seed):
    state, mirrored = mirrored_states(MODEL, seed)
    here, there = Configuration(MODEL, state), Configuration(MODEL, mirrored)
    points = dict(zip(MODEL.landmark_names, here.landmarks_world, strict=True))
    reflected = dict(zip(MODEL.landmark_names, there.landmarks_world, strict=True))
    for name, point in points.items():
        assert np.allclose(reflected[mirrored_name(name)], point * [1, -1, 1], atol=1e-12)
    centers = {shape.name: T[:3, 3] for shape, T in zip(MODEL.shapes, here.Ts_world_shape, strict=True)}
    for shape, T in zip(MODEL.shapes, there.Ts_world_shape, strict=True):
        assert np.allclose(centers[mirrored_name(shape.name)], T[:3, 3] * [1, -1, 1], atol=1e-12)


def outline(shape, T_world_shape, n=30):
    t, u = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False), np.linspace(0.0, 1.0, n)[:, None]
    if hasattr(shape.primitive, "radii"):
        ring = np.stack([np.sin(np.pi * u) * np.cos(t), np.sin(np.pi * u) * np.sin(t), np.cos(np.pi * u) + 0 * t], axis=-1)
        points = ring * shape.primitive.radii
    else:
        cone, z = shape.primitive, shape.primitive.z1 + (shape.primitive.z2 - shape.primitive.z1) * u
        wide = 1.0 + cone.k * z
        points = np.stack([cone.a * wide * np.cos(t), cone.b * wide * np.sin(t), z + 0 * t], axis=-1)
    return se3.apply(T_world_shape, points.reshape(-1, 3))


def test_hands_and_feet_measure_what_they_should():
    measures, configuration = HumanMeasures(), Configuration(MODEL, State.neutral(MODEL))
    placed = {s.name: outline(s, T) for s, T in zip(MODEL.shapes, configuration.Ts_world_shape, strict=True)}
    foot = np.concatenate([placed[f"left_{name}"] for name in ("heel", "midfoot", "toes")])
    assert np.ptp(foot, axis=0)[:2] == pytest.approx(2.0 * np.array(measures.foot_radii[:2]), rel=0.02)
    soles = [placed[f"left_{name}"][:, 2].min() for name in ("heel", "midfoot", "toes")]
    assert np.ptp(soles) < 0.004  # on one floor
    hand = np.concatenate([placed[f"left_{name}"] for name in ("palm", "fingers")])
    assert NEUTRAL["left_wrist"][2] - hand[:, 2].min() == pytest.approx(2.0 * measures.hand_radii[2], rel=0.02)
    assert np.ptp(hand[:, 0]) == pytest.approx(2.0 * measures.hand_radii[0], rel=0.05)
    assert placed["left_thumb"][:, 0].max() > hand[:, 0].max() + 0.01  # seen beside the palm


def test_parts_may_touch_where_they_hang_together():
    """Neither in the neutral pose nor with hands and feet turned does the body push itself apart; hands are off the thighs."""
    collision, rng = CollisionObjective(MODEL), np.random.default_rng(3)
    assert collision.linearize(State.neutral(MODEL)).cost == 0.0
    for _ in range(5):
        state = State.neutral(MODEL)
        for side in ("left", "right"):
            state.joint_positions[MODEL.chain.axis_index(f"{side}_shoulder_elevation_front")] = np.deg2rad(40.0)
        for name in ("wrist_flexion", "toes_extension", "ankle_inversion", "wrist_ulnar_deviation"):
            for side in ("left", "right"):
                state.joint_positions[MODEL.chain.axis_index(f"{side}_{name}")] = rng.uniform(-0.3, 0.5)
        assert collision.linearize(state).cost == 0.0


def test_its_limbs_are_arms_and_legs_with_hands_and_toes():
    limbs = limbs_of(MODEL)
    assert [limb.name for limb in limbs[1:]] == ["head", "left_toes", "right_toes", "left_hand", "right_hand"]
    toes = next(limb for limb in limbs if limb.name == "left_toes")
    assert MODEL.chain.links[toes.end] == "left_toes" and toes.dofs.sum() == 8


@pytest.mark.parametrize("name", HUMANS)
def test_humans_are_called_by_name_wherever_a_model_is(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert load_model(name).chain.dof_names == HUMANS[name]().chain.dof_names
    assert load_model(tmp_path / name).name == HUMANS[name]().name  # as a run notes it
    dump_model(PLAIN, tmp_path / name)  # a file of that name comes first
    assert load_model(name).name == "human"


def test_what_is_written_is_read_again(tmp_path):
    dump_model(MODEL, tmp_path / "person.yaml")
    read = load_model(tmp_path / "person.yaml")
    state = random_state(MODEL, np.random.default_rng(2))
    assert read.chain.dof_names == MODEL.chain.dof_names
    assert Configuration(read, state).Ts_world_shape == pytest.approx(Configuration(MODEL, state).Ts_world_shape, abs=1e-6)
