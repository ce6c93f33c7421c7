"""Angles after the ISB: poses whose angles one can see, and the joint coordinate system's own formulas."""

import numpy as np
import pytest

from helpers.bodies.moving_person import moving
from helpers.bodies.two_links import two_links
from tracker_node.errors import ModelError
from tracker_node.evaluation.motion.isb_angles import angles_of_segments, isb_angles
from tracker_node.loaders.fetched_files import data_file
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import gait_human, human_model
from tracker_node.runs.motion import RunMotion

HUMAN, GAIT = human_model(), gait_human()


def posed(model=HUMAN, **degrees):
    joints = np.zeros(model.chain.n_axes)
    for name, angle in degrees.items():
        joints[model.chain.axis_index(name)] = np.deg2rad(angle)
    values = State(np.eye(4), joints).to_values()
    return RunMotion(model, np.array([0]), values[None], np.array([True]), 1e9)


def angles_deg(motion):
    found = isb_angles(motion)
    return {name: np.rad2deg(found.radians[0, j, k]) for j, names in enumerate(found.names) for k, name in enumerate(names)}


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(("pose", "expected"), [
    ({"hip_flexion": 30}, {"hip_flexion": 30, "hip_adduction": 0, "hip_internal_rotation": 0}),
    ({"hip_abduction": 20}, {"hip_flexion": 0, "hip_adduction": -20, "hip_internal_rotation": 0}),
    ({"hip_internal_rotation": 15}, {"hip_internal_rotation": 15, "hip_flexion": 0}),
    ({"knee_flexion": 80}, {"knee_flexion": 80, "knee_adduction": 0, "knee_internal_rotation": 0}),
    ({"knee_flexion": 40, "knee_internal_rotation": 12}, {"knee_flexion": 40, "knee_internal_rotation": 12}),
    ({"elbow_flexion": 100}, {"elbow_flexion": 100, "elbow_pronation": 90}),
    ({"elbow_flexion": 90, "elbow_pronation": -90}, {"elbow_flexion": 90, "elbow_pronation": 0}),  # palm up
    ({"elbow_pronation": 90}, {"elbow_pronation": 180}),
    ({"clavicle_elevation": 10}, {"clavicle_elevation": 10, "clavicle_protraction": 0}),
    ({"clavicle_protraction": 10}, {"clavicle_elevation": 0, "clavicle_protraction": 10}),
    ({"clavicle_axial_rotation": 10}, {"clavicle_backward_rotation": -10}),
    # T-pose, and arms forward (docs/formats.md)
    ({"shoulder_elevation_front": 90, "shoulder_elevation_back": 45},
     {"shoulder_plane_of_elevation": 0, "shoulder_elevation": 90}),
    ({"shoulder_elevation_front": 90, "shoulder_elevation_back": -45},
     {"shoulder_plane_of_elevation": 90, "shoulder_elevation": 90}),
    ({"shoulder_elevation_front": 180}, {"shoulder_elevation": 180}),
    ({"shoulder_internal_rotation": 35}, {"shoulder_elevation": 0, "shoulder_plane_of_elevation": 0,
                                          "shoulder_internal_rotation": 35}),
])  # fmt: skip
def test_poses_that_one_can_see(side, pose, expected):
    found = angles_deg(posed(**{f"{side}_{name}": angle for name, angle in pose.items()}))
    for name, angle in expected.items():
        assert found[f"{side}_{name}"] == pytest.approx(angle, abs=1e-6), name


def test_the_trunk_bends_and_turns():
    found = angles_deg(posed(abdomen_flexion=20, torso_flexion=10))
    assert (found["spine_flexion"], found["spine_bend_right"]) == pytest.approx((30, 0), abs=1e-9)
    assert angles_deg(posed(abdomen_bend_right=15))["spine_bend_right"] == pytest.approx(15)
    assert angles_deg(posed(torso_turn_left=25))["spine_turn_left"] == pytest.approx(25)
    assert angles_deg(posed(head_flexion=12))["neck_flexion"] == pytest.approx(12)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(("pose", "expected"), [
    ({"ankle_dorsiflexion": 20, "ankle_inversion": 15}, {"ankle_dorsiflexion": 20, "ankle_inversion": 15}),
    ({"toes_extension": 30}, {"toes_extension": 30, "ankle_dorsiflexion": 0}),
    ({"wrist_flexion": 40, "wrist_ulnar_deviation": 20}, {"wrist_flexion": 40, "wrist_ulnar_deviation": 20}),
    ({"wrist_flexion": -30, "elbow_pronation": 50}, {"wrist_flexion": -30, "wrist_ulnar_deviation": 0, "elbow_pronation": 140}),
])  # fmt: skip
def test_hands_and_feet_of_the_fuller_human(side, pose, expected):
    found = angles_deg(posed(GAIT, **{f"{side}_{name}": angle for name, angle in pose.items()}))
    for name, angle in expected.items():
        assert found[f"{side}_{name}"] == pytest.approx(angle, abs=1e-6), name


def test_the_spine_is_lumbar_spine_and_thorax_and_the_head_turns():
    found = angles_deg(posed(GAIT, abdomen_flexion=20, torso_flexion=10, torso_turn_left=5, head_turn_left=40))
    assert (found["lumbar_flexion"], found["thorax_flexion"], found["spine_flexion"]) == pytest.approx((20, 10, 30), abs=0.3)
    assert (found["thorax_turn_left"], found["neck_turn_left"]) == pytest.approx((5, 40), abs=1e-6)
    segments = angles_deg(posed(load_model("ellipsoid_human"), torso_flexion=12, chest_flexion=7))
    assert (segments["lumbar_flexion"], segments["thorax_flexion"], segments["spine_flexion"]) == pytest.approx((12, 7, 19))


def test_angles_of_segments_are_those_of_the_body_that_has_them():
    motion = moving(8)
    turned = motion.Ts_world_link()[..., :3, :3]
    found, asked = isb_angles(motion), {link: turned[:, i] for i, link in enumerate(HUMAN.chain.links)}
    given = angles_of_segments(asked)
    for j, names in enumerate(found.names):
        for k, name in enumerate(names):
            assert given[name] == pytest.approx(found.radians[:, j, k], abs=1e-12)
    assert set(angles_of_segments({name: asked[name] for name in ("pelvis", "left_thigh")})) == {
        "left_hip_flexion", "left_hip_adduction", "left_hip_internal_rotation",
    }  # fmt: skip


def test_hip_agrees_with_grood_and_suntays_formulas():
    """Their equations, by the unit vectors of the segments: I along the proximal Z, k along the distal Y, e2 = k x I floating."""
    motion = moving(40)
    found = isb_angles(motion)
    hip = found.radians[:, found.joints.index("RightHip")]
    links = HUMAN.chain.links
    for i in range(0, 40, 3):
        Ts = motion.configuration(i).Ts_world_link
        pelvis, thigh = Ts[links.index("pelvis"), :3, :3], Ts[links.index("right_thigh"), :3, :3]
        right, forward = -pelvis[:, 1], pelvis[:, 0]
        along = thigh[:, 2]  # from knee to hip
        floating = np.cross(along, right)
        floating /= np.linalg.norm(floating)
        assert np.sin(hip[i, 0]) == pytest.approx(floating @ pelvis[:, 2], abs=1e-9)  # flexion
        assert np.cos(hip[i, 0]) == pytest.approx(floating @ forward, abs=1e-9)
        assert np.sin(hip[i, 1]) == pytest.approx(along @ right, abs=1e-9)  # adduction: the knee goes to the left
        assert np.sin(hip[i, 2]) == pytest.approx(floating @ thigh[:, 1] * -1.0, abs=1e-9)  # internal rotation


def test_elevation_and_its_plane_are_those_of_the_humerus_in_the_thorax():
    motion = moving(60)
    found = isb_angles(motion)
    links = HUMAN.chain.links
    for side, out in (("Left", 1.0), ("Right", -1.0)):
        arm = found.radians[:, found.joints.index(f"{side}Shoulder")]
        for i in range(0, 60, 7):
            Ts = motion.configuration(i).Ts_world_link
            humerus = -Ts[links.index(f"{side.lower()}_upper_arm"), :3, 2]  # from shoulder to elbow
            thorax = Ts[links.index("torso"), :3, :3]
            assert np.cos(arm[i, 1]) == pytest.approx(-humerus @ thorax[:, 2], abs=1e-9)
            plane = np.arctan2(humerus @ thorax[:, 0], out * humerus @ thorax[:, 1])  # 0: to the side
            assert np.cos(arm[i, 0] - plane) == pytest.approx(1.0, abs=1e-9)


def test_both_sides_of_a_symmetric_pose_agree():
    pose = {
        "hip_flexion": 35, "hip_abduction": 12, "hip_internal_rotation": -20, "elbow_flexion": 50, "clavicle_elevation": 8,
        "shoulder_elevation_front": 70, "shoulder_elevation_back": 20, "shoulder_internal_rotation": 30,
    }  # fmt: skip
    found = angles_deg(posed(**{f"{side}_{name}": angle for side in ("left", "right") for name, angle in pose.items()}))
    for name in found:
        if name.startswith("left_"):
            assert found[name] == pytest.approx(found[name.replace("left", "right")], abs=1e-9), name


def test_joints_that_do_not_move_are_left_out_and_others_are_in():
    assert not {"LeftAnkle", "LeftWrist"} & set(isb_angles(posed()).joints)  # welds of this body
    segments = load_model(data_file("config/models/ellipsoid_human.yaml"))
    found = angles_deg(posed(segments, left_ankle_dorsiflexion=15, right_wrist_flexion=20, chest_flexion=10))
    assert found["left_ankle_dorsiflexion"] == pytest.approx(15)
    assert found["right_wrist_flexion"] == pytest.approx(20)
    assert found["spine_flexion"] == pytest.approx(10)


@pytest.mark.parametrize("model", [HUMAN, GAIT, human_model(ankles=True), load_model("ellipsoid_human")])
def test_columns_are_the_angles_that_the_body_has(model):
    """All others are the same in any pose; of those, none is."""
    rng = np.random.default_rng(7)
    values = np.array([State(np.eye(4), rng.uniform(-0.5, 0.5, model.chain.n_axes)).to_values() for _ in range(6)])
    found = isb_angles(RunMotion(model, np.arange(6), values, np.array([True] * 5 + [False]), 1.0))
    names, radians, valid = found.columns()
    moved = np.ptp(found.radians[:5], axis=0) > 1e-6
    assert names == [name for triple, turns in zip(found.names, moved, strict=True) for name in np.array(triple)[turns]]
    assert np.array_equal(radians, found.radians[:, moved]) and valid[:5].all() and not valid[5].any()
    assert ("neck_turn_left" in names) == ("head_turn_left" in model.chain.dof_names)
    assert {"left_hip_adduction", "right_knee_flexion"} <= set(names)


def test_angles_do_not_jump_by_full_turns():
    spun = np.linspace(0.0, 4.0 * np.pi, 200)
    values = np.zeros((200, HUMAN.chain.n_dof))
    values[:, HUMAN.chain.dof_names.index("left_hip_flexion")] = spun
    motion = RunMotion(HUMAN, np.arange(200), values, np.ones(200, dtype=bool), 1.0)
    found = isb_angles(motion)
    assert found.radians[:, found.joints.index("LeftHip"), 0] == pytest.approx(spun, abs=1e-9)


def test_gaps_hold_zeros():
    found = isb_angles(moving(10, gaps=(3,)))
    assert not found.radians[3].any() and found.radians[4].any()


def test_a_body_that_is_no_person_is_refused():
    with pytest.raises(ModelError, match="segments of a person"):
        isb_angles(moving(2, two_links()))
