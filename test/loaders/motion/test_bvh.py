"""Hierarchies of animation programs, put together again by a reader of theirs."""

from dataclasses import replace
from pathlib import Path

import bvhio
import numpy as np
import pytest

from helpers.bodies.moving_person import moving
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.motion.bvh import dump_bvh
from tracker_node.model.humans.human import human_model

ROBOT = Path(__file__).resolve().parents[3] / "config" / "models" / "robot_arm.urdf"


def places(path, n):
    """Of every joint, (n, 3) by name, as bvhio's forward kinematics has them."""
    root = bvhio.readAsHierarchy(str(path))
    found = {joint.Name: [] for joint, _, _ in root.layout()}
    for frame in range(n):
        root.loadPose(frame)
        for joint, _, _ in root.layout():
            found[joint.Name].append(np.array(joint.PositionWorld))
    return {name: np.array(rows) for name, rows in found.items()}


@pytest.mark.parametrize("y_up", [True, False])
@pytest.mark.parametrize(("unit", "scale"), [("m", 1.0), ("cm", 100.0)])
@pytest.mark.parametrize("model", [human_model(), load_model(ROBOT)], ids=lambda model: model.name)
def test_another_reader_finds_every_link_where_it_is(tmp_path, model, y_up, unit, scale):
    motion = moving(5, model)
    Ts = motion.Ts_world_link()
    dump_bvh(model, Ts, 1.0 / 60.0, tmp_path / "a.bvh", y_up, unit)
    found = places(tmp_path / "a.bvh", 5)
    assert set(found) == set(model.chain.links)
    for i, link in enumerate(model.chain.links):
        position = found[link][:, [2, 0, 1]] if y_up else found[link]
        assert position == pytest.approx(scale * Ts[:, i, :3, 3], abs=scale * 2e-6), link


def test_frames_ends_and_landmarks(tmp_path):
    model = human_model()
    motion = moving(3, model)
    dump_bvh(model, motion.Ts_world_link(), 1.0 / 50.0, tmp_path / "a.bvh", y_up=False)
    file = bvhio.readAsBvh(str(tmp_path / "a.bvh"))
    assert file.FrameCount == 3 and file.FrameTime == pytest.approx(0.02)
    joints = {joint.Name: joint for joint, _, _ in file.Root.layout()}
    toe = model.landmark_positions[model.landmark_index("left_big_toe")]
    assert list(joints["left_foot"].EndSite) == pytest.approx(toe, abs=1e-6)
    knees = places(tmp_path / "a.bvh", 3)["left_shank"]
    assert knees == pytest.approx(motion.landmarks_m()[:, model.landmark_index("left_knee")], abs=2e-6)


def test_landmarks_become_joints_where_asked_for(tmp_path):
    model = human_model()
    moved = tuple(replace(mark, position=tuple(np.add(mark.position, 0.01))) for mark in model.landmarks)  # as a person's are
    model = replace(model, landmarks=moved)
    motion = moving(4, model)
    dump_bvh(model, motion.Ts_world_link(), 0.02, tmp_path / "a.bvh", landmarks=model.landmark_names)
    found = places(tmp_path / "a.bvh", 4)
    for i, name in enumerate(model.landmark_names):
        assert found[f"landmark_{name}"][:, [2, 0, 1]] == pytest.approx(motion.landmarks_m()[:, i], abs=2e-6), name


def test_the_pose_of_zeros_stands_upright_and_looks_along_z(tmp_path):
    model = human_model()
    Ts = moving(1, model).Ts_world_link()
    dump_bvh(model, Ts, 0.1, tmp_path / "a.bvh")
    rest = {joint.Name: joint for joint, _, _ in bvhio.readAsBvh(str(tmp_path / "a.bvh")).Root.layout()}
    assert rest["left_shank"].Offset.y < -0.3  # the knee hangs below the hip
    assert rest["left_thigh"].Offset.x > 0.05  # left is x where the body looks along z and y is up
