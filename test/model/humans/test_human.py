"""The human: its parts and angles are those of the paper, it stands, it is symmetric, and angles do what their names say."""

import numpy as np
import pytest

from helpers.bodies.bodies import mirrored_states, random_state
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.geometry import se3
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.measures import LANDMARK_OF_MARKER, HumanMeasures, mirrored_name
from tracker_node.model.shapes.primitives import Ellipsoid, TruncatedCone

MODEL = human_model()


def posed(**angles_deg) -> dict[str, np.ndarray]:
    state = State.neutral(MODEL)
    for name, angle in angles_deg.items():
        state.joint_positions[MODEL.chain.axis_index(name)] = np.deg2rad(angle)
    return dict(zip(MODEL.landmark_names, Configuration(MODEL, state).landmarks_world, strict=True))


NEUTRAL = posed()


def surface(shape, T_world_shape, n=24):
    """Points on a shape, in the world."""
    t = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    if isinstance(shape.primitive, Ellipsoid):
        u = np.linspace(0.0, np.pi, n)[:, None]
        points = np.stack([np.sin(u) * np.cos(t), np.sin(u) * np.sin(t), np.cos(u) + 0 * t], axis=-1) * shape.primitive.radii
    else:
        cone: TruncatedCone = shape.primitive
        z = np.linspace(cone.z1, cone.z2, n)[:, None]
        scale = 1.0 + cone.k * z
        points = np.stack([cone.a * scale * np.cos(t), cone.b * scale * np.sin(t), z + 0 * t], axis=-1)
    return se3.apply(T_world_shape, points.reshape(-1, 3))


def inside(shape, T_world_shape, points):
    p = se3.apply(se3.inverse(T_world_shape), points)
    if isinstance(shape.primitive, Ellipsoid):
        return np.sum((p / shape.primitive.radii) ** 2, axis=1) <= 1.0
    cone = shape.primitive
    scale = 1.0 + cone.k * p[:, 2]
    return ((p[:, 0] / cone.a) ** 2 + (p[:, 1] / cone.b) ** 2 <= scale**2) & (cone.z1 <= p[:, 2]) & (p[:, 2] <= cone.z2)


def overlap(one, other):
    return inside(*one, surface(*other)).any() or inside(*other, surface(*one)).any()


def test_parts_and_degrees_of_freedom_are_those_of_the_paper():
    assert len(MODEL.chain.links) == 18
    assert MODEL.n_dof == 40
    axes_of = {joint.name: len(joint.axes) for joint in MODEL.chain.joints}
    sided = {"clavicle": 3, "shoulder": 3, "elbow": 2, "wrist": 0, "hip": 3, "knee": 2, "ankle": 0}
    expected = {f"{side}_{name}": n for side in ("left", "right") for name, n in sided.items()}
    assert axes_of == {"neck": 2, "torso": 3, "abdomen": 3, **expected}


def test_with_ankles_each_foot_bends_up_and_nothing_else_moves():
    feet = human_model(ankles=True)
    added = set(feet.chain.dof_names) - set(MODEL.chain.dof_names)
    assert added == {"left_ankle_dorsiflexion", "right_ankle_dorsiflexion"} and feet.n_dof == MODEL.n_dof + 2
    stands, bent = State.neutral(feet), State.neutral(feet)
    for name in added:
        bent.joint_positions[feet.chain.axis_index(name)] = np.radians(30.0)
    moved = Configuration(feet, bent).landmarks_world - Configuration(feet, stands).landmarks_world
    for name, move in zip(feet.landmark_names, moved, strict=True):
        if name.endswith("_toe"):
            assert move[2] > 0.05
        elif not name.endswith("heel"):
            assert np.allclose(move, 0.0)


def test_toes_pull_the_knees_of_somebody_who_squats_off_unless_the_ankles_bend():
    feet = human_model(ankles=True)
    squats, degrees = State.neutral(feet), {"hip_flexion": 100.0, "knee_flexion": 110.0, "ankle_dorsiflexion": 40.0}
    for side in ("left", "right"):
        for name, angle in degrees.items():
            squats.joint_positions[feet.chain.axis_index(f"{side}_{name}")] = np.radians(angle)
    targets = dict(zip(feet.landmark_names, Configuration(feet, squats).landmarks_world, strict=True))
    off = {body.n_dof: fit_state_to_landmarks(body, targets).residuals_m["left_knee"] for body in (MODEL, feet)}
    assert off[MODEL.n_dof] > 0.02 > 0.01 > off[feet.n_dof]


def test_the_file_that_comes_with_the_package_is_this_body(repository):
    shipped = load_model(repository / "config" / "models" / "human.yaml")
    assert shipped.landmark_names == MODEL.landmark_names
    assert shipped.chain.dof_names == MODEL.chain.dof_names
    assert np.allclose(shipped.chain.offsets, MODEL.chain.offsets)
    assert np.allclose(shipped.landmark_positions, MODEL.landmark_positions)
    assert np.allclose(shipped.Ts_link_shape, MODEL.Ts_link_shape)
    assert np.allclose(shipped.chain.lower, MODEL.chain.lower)
    assert [axis.stiffness for axis in shipped.chain.axes] == [axis.stiffness for axis in MODEL.chain.axes]
    for a, b in zip(shipped.shapes, MODEL.shapes, strict=True):
        assert (a.name, a.link, a.color_rgb) == (b.name, b.link, b.color_rgb)
        assert np.allclose(list(vars(a.primitive).values()), list(vars(b.primitive).values()))


def test_stands_as_tall_as_its_stature_with_feet_on_one_floor():
    configuration = Configuration(MODEL, State.neutral(MODEL))
    points = {s.name: surface(s, T) for s, T in zip(MODEL.shapes, configuration.Ts_world_shape, strict=True)}
    top, floor = points["head"][:, 2].max(), points["left_foot"][:, 2].min()
    assert np.isclose(top - floor, 1.75, atol=2e-3)
    assert min(p[:, 2].min() for p in points.values()) >= floor - 1e-9
    assert points["left_foot"][:, 0].max() > 0.15  # toes forward
    assert points["left_hand"][:, 1].mean() > 0.1  # left is +y


@pytest.mark.parametrize("stature", [1.5, 1.95])
def test_stature_scales_everything(stature):
    scaled = human_model(HumanMeasures.of_stature(stature))
    assert np.allclose(scaled.chain.offsets[:, :3, 3], MODEL.chain.offsets[:, :3, 3] * stature / 1.75)
    with pytest.raises(ValueError, match=r"0\.4 to 3"):
        HumanMeasures.of_stature(17.5)


@pytest.mark.parametrize("seed", range(5))
def test_equal_angles_on_both_sides_are_a_mirrored_pose(seed):
    state, mirrored = mirrored_states(MODEL, seed)
    points = dict(zip(MODEL.landmark_names, Configuration(MODEL, state).landmarks_world, strict=True))
    reflected = dict(zip(MODEL.landmark_names, Configuration(MODEL, mirrored).landmarks_world, strict=True))
    for name, point in points.items():
        assert np.allclose(reflected[mirrored_name(name)], point * [1, -1, 1], atol=1e-12)


@pytest.mark.parametrize(("angles", "landmark", "origin", "direction"), [
    ({"left_elbow_flexion": 90}, "left_wrist", "left_elbow", (1, 0, 0)),
    ({"right_elbow_flexion": 90, "right_shoulder_internal_rotation": 90}, "right_wrist", "right_elbow", (0, 1, 0)),
    ({"left_hip_flexion": 90}, "left_knee", "left_hip", (1, 0, 0)),
    ({"left_hip_abduction": 80}, "left_ankle", "left_hip", (0, 0.985, -0.174)),
    ({"right_hip_abduction": 80}, "right_ankle", "right_hip", (0, -0.985, -0.174)),
    ({"right_knee_flexion": 90}, "right_ankle", "right_knee", (-1, 0, 0)),
    ({"left_shoulder_elevation_front": 90}, "left_wrist", "left_shoulder", (0.707, 0.707, 0)),
    ({"right_shoulder_elevation_back": 85}, "right_wrist", "right_shoulder", (-0.704, -0.704, -0.087)),
    ({"left_shoulder_elevation_front": 90, "left_shoulder_elevation_back": 45}, "left_wrist", "left_shoulder", (0, 1, 0)),
    ({"left_shoulder_elevation_front": 90, "left_shoulder_elevation_back": -45}, "left_wrist", "left_shoulder", (1, 0, 0)),
    ({"right_shoulder_elevation_front": 180}, "right_wrist", "right_shoulder", (0, 0, 1)),
    ({"left_shoulder_elevation_front": -90, "left_shoulder_elevation_back": 45}, "left_wrist", "left_shoulder", (-1, 0, 0)),
])  # fmt: skip
def test_limbs_go_where_the_names_say_within_the_limits(angles, landmark, origin, direction):
    for name, angle in angles.items():
        i = MODEL.chain.axis_index(name)
        assert MODEL.chain.lower[i] <= np.deg2rad(angle) <= MODEL.chain.upper[i]
    points = posed(**angles)
    ray = points[landmark] - points[origin]
    assert np.allclose(ray / np.linalg.norm(ray), direction, atol=2e-3)


@pytest.mark.parametrize(("angle", "landmark", "direction"), [
    ("abdomen_flexion", "neck", (1, 0, 0)),
    ("abdomen_bend_right", "neck", (0, -1, 0)),
    ("abdomen_turn_left", "left_shoulder", (-1, 0, 0)),
    ("torso_turn_left", "right_shoulder", (1, 0, 0)),
    ("head_flexion", "head", (1, 0, 0)),
    ("head_bend_right", "head", (0, -1, 0)),
    ("left_clavicle_elevation", "left_shoulder", (0, 0, 1)),
    ("right_clavicle_elevation", "right_shoulder", (0, 0, 1)),
    ("left_clavicle_protraction", "left_shoulder", (1, 0, 0)),
    ("right_clavicle_protraction", "right_shoulder", (1, 0, 0)),
    ("left_hip_internal_rotation", "left_big_toe", (0, -1, 0)),
    ("right_knee_internal_rotation", "right_big_toe", (0, 1, 0)),
])  # fmt: skip
def test_small_turns_go_where_the_names_say(angle, landmark, direction):
    motion = posed(**{angle: 1.0})[landmark] - NEUTRAL[landmark]
    assert motion @ np.array(direction) > 0.8 * np.linalg.norm(motion) > 0.0


@pytest.mark.parametrize("seed", range(4))
def test_every_part_overlaps_its_parent(seed):
    """No gap in the outline: each part reaches into the one that carries it, in any pose."""
    state = random_state(MODEL, np.random.default_rng(seed), 0.6) if seed else State.neutral(MODEL)
    configuration = Configuration(MODEL, state)
    placed = {s.name: (s, T) for s, T in zip(MODEL.shapes, configuration.Ts_world_shape, strict=True)}
    carriers = {joint.child: (joint.parent,) for joint in MODEL.chain.joints}
    carriers |= {"head": ("neck",), "neck": ("torso", "left_clavicle", "right_clavicle")}
    for child, parents in carriers.items():
        assert any(overlap(placed[child], placed[parent]) for parent in parents), f"{child} leaves {parents}"


def test_markers_of_openpose_name_landmarks_of_the_human():
    assert set(LANDMARK_OF_MARKER.values()) == set(MODEL.landmark_names)
    assert mirrored_name("left_knee") == "right_knee"
    assert mirrored_name("neck") == "neck"
