"""The figure of ten cones, its motion, and the room of strong colors."""

import cv2
import numpy as np

from tracker_node.loaders.images.source import list_images
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.motion.trajectory_file import read_joints, read_states
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.shapes.primitives import TruncatedCone
from tracker_node.synthesis.recording import Request, produce
from tracker_node.synthesis.scenes.scene import SceneConfig, patches
from tracker_node.synthesis.subjects.figure import figure_model, figure_motion, speeds


def test_it_has_22_degrees_of_freedom_and_10_cones():
    model = figure_model()
    assert model.n_dof == 22 and len(model.shapes) == 10
    assert all(isinstance(shape.primitive, TruncatedCone) for shape in model.shapes)
    assert len({shape.color_rgb for shape in model.shapes}) == 10


def test_sides_mirror_each_other():
    model = figure_model()
    state = State(np.eye(4), np.array([0.1 * (1 + len(a.name.partition("_")[2])) for a in model.chain.axes]))
    points = dict(zip(model.landmark_names, Configuration(model, state).landmarks_world, strict=True))
    for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle"):
        np.testing.assert_allclose(points[f"left_{name}"] * (1, -1, 1), points[f"right_{name}"], atol=1e-12)


def test_the_motion_is_as_fast_as_it_should_be_and_inside_the_limits():
    model, states = figure_model(), figure_motion(30.0, 100)
    moved_m, turned = speeds(model, states)
    assert 0.040 < moved_m <= 0.042 and 7.3 < np.degrees(turned) <= 7.5
    joints = np.array([state.joint_positions for state in states])
    assert (joints > model.chain.lower + np.radians(10.0)).all() and (joints < model.chain.upper - np.radians(10.0)).all()


def test_speeds_of_a_known_motion():
    model = figure_model()
    start = State.neutral(model)
    tangent = np.zeros(model.n_dof)
    tangent[0], tangent[5] = 0.03, 0.2
    states = [start, start.retract(tangent)]
    moved_m, turned = speeds(model, states)
    points = [Configuration(model, s).landmarks_world for s in states]
    assert abs(turned - 0.2) < 1e-9
    assert abs(moved_m - np.linalg.norm(points[1] - points[0], axis=1).max()) < 1e-12


def test_a_recording_of_it_has_true_states_no_backgrounds_and_exact_images(tmp_path):
    scene = SceneConfig(
        n_cameras=2, width=160, height=120, focal_px=140.0, radius=3.2, distortion=(), noise_levels=0.0, shadow=False,
        surroundings="clutter", backgrounds=False, lossless=True,
    )  # fmt: skip
    produce(Request(subject="figure", n_images=2, scene=scene), tmp_path)
    rig, model = load_rig(tmp_path / "rig.yaml"), load_model(tmp_path / "person.yaml")
    assert not any(camera.background for camera in rig) and not (tmp_path / "backgrounds").exists()
    truth, states = read_joints(tmp_path / "truth.csv"), read_states(tmp_path / "true_states.csv")
    assert states.dof_names == model.chain.dof_names
    np.testing.assert_array_equal(states.stamps_ns, truth.stamps_ns)
    for values, points in zip(states.values, truth.positions_m, strict=True):
        np.testing.assert_allclose(Configuration(model, State.from_values(values)).landmarks_world, points, atol=1e-9)
    images = list_images(str(tmp_path / "cam01"))
    assert [name.endswith(".png") for name in images] == [True, True]
    # The red of the trunk where the middle of the trunk is.
    camera = rig.cameras[0]
    middle = State.from_values(states.values[0]).T_world_root @ np.array([0.0, 0.0, 0.2, 1.0])
    local = (np.linalg.inv(camera.T_world_cam) @ middle)[:3]
    u, v = np.rint((camera.model.K @ local)[:2] / local[2]).astype(int)
    blue, green, red = cv2.imread(images[0])[v, u].astype(int)
    assert red > 2 * max(blue, green)


def test_clutter_is_colorful_and_patterned():
    picture = patches(np.random.default_rng(0), 6.0, 3.0)
    hsv = cv2.cvtColor(picture, cv2.COLOR_RGB2HSV)
    strong = hsv[:, :, 1] > 110
    assert 0.25 < strong.mean() < 0.75
    hues = np.histogram(hsv[:, :, 0][strong], bins=6, range=(0, 180))[0] / strong.sum()
    assert hues.min() > 0.03
    assert np.abs(np.diff(picture.astype(int), axis=1)).max() > 150
