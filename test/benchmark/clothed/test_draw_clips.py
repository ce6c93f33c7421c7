"""Clips of clothed people are the same for a seed, are read by the loaders, and their truth lies within the person."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmark.clothed import draw_clips
from benchmark.clothed._clip import joints_inside, write_clip
from benchmark.clothed._recording import load_clip
from benchmark.clothed._staging import Sources, set_stage
from benchmark.clothed.person._body import MARKERS, load_body, mannequin_body
from benchmark.clothed.person._motions import PROCEDURAL, MotionChoice, bend_hands, draw_motion, mirrored
from benchmark.clothed.person._posing import POSED, Poser, lowest
from benchmark.clothed.render._raster import project
from tracker_node.errors import SourceError
from tracker_node.evaluation.motion.isb_angles import angles_of_segments
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.rig_yaml import load_rig

SEED = 4  # a second person walks by
SOURCES = Sources(Path("none"), None, body="mannequin", motion="guard")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Folders of two drawings of one clip, and what it was drawn from."""
    folders = [tmp_path_factory.mktemp(name) for name in ("first", "second")]
    for folder in folders:
        stage = set_stage(SEED, SOURCES, n_images=1, scale=0.25)
        write_clip(stage, folder)
    return (*folders, stage)


def test_a_seed_gives_the_same_files(drawn):
    first, second, _ = drawn
    files = sorted(path.relative_to(first) for path in first.rglob("*") if path.is_file())
    assert len(files) == 13  # four images, four stills, rig, two TRC files, rotations, description
    for file in files:
        assert (first / file).read_bytes() == (second / file).read_bytes(), file


def test_loaders_read_a_clip(drawn):
    folder, _, stage = drawn
    rig = load_rig(folder / "rig.yaml")
    truth, static = load_trc(folder / "truth.trc"), load_trc(folder / "static.trc")
    assert truth.names == static.names == MARKERS and truth.valid.all() and len(truth) == 1 and len(static) == 10
    for camera, view in zip(rig, stage.views, strict=True):
        T = camera.T_world_cam
        pixels, _ = camera.model.project((truth.positions_m[0] - T[:3, 3]) @ T[:3, :3])
        np.testing.assert_allclose(pixels, project(view.matrix, stage.truth[0])[:, :2], atol=1e-6)
        for image in (folder / camera.name / "0000.jpg", folder / "stills" / f"{camera.name}.jpg"):
            assert cv2.imread(str(image)).shape == (120, 160, 3)


def test_rotations_are_those_of_the_segments(drawn):
    """A limb's own axis, down from its joint, leads to the next joint of the truth, but for what a straight leg bends."""
    folder, _, stage = drawn
    clip = load_clip(folder)
    assert set(clip.rotations) == set(POSED) and stage.rotations.shape == (1, len(POSED), 3, 3)
    for segment, start, end in (("upper_arm", "shoulder", "elbow"), ("forearm", "elbow", "wrist"), ("thigh", "hip", "knee")):
        for side in ("left", "right"):
            along = clip.targets[0][f"{side}_{end}"] - clip.targets[0][f"{side}_{start}"]
            cosine = -clip.rotations[f"{side}_{segment}"][0, :, 2] @ along / np.linalg.norm(along)
            assert cosine > np.cos(np.radians(8.5 if segment == "thigh" else 1.0)), segment


def test_hands_bend_where_that_is_asked():
    stage = set_stage(SEED, Sources(Path("none"), None, body="mannequin", motion="guard", hands=True), n_images=25, scale=0.25)
    turns = dict(zip(POSED, stage.rotations.swapaxes(0, 1), strict=True))
    angles = angles_of_segments(turns)
    asked = bend_hands(25, np.random.default_rng([10, SEED]))
    for k, side in enumerate(("left", "right")):
        np.testing.assert_allclose(angles[f"{side}_wrist_flexion"], asked[:, k, 0], atol=1e-9)
        np.testing.assert_allclose(angles[f"{side}_wrist_ulnar_deviation"], asked[:, k, 1], atol=1e-9)
    assert np.ptp(asked) > 1.0


def test_truth_lies_within_the_person_who_is_seen(drawn):
    folder, _, stage = drawn
    assert joints_inside(stage, every=1) == 1.0
    assert json.loads((folder / "clip.json").read_text())["second_person"] == "mannequin"
    view = stage.views[0]
    image, still = (cv2.imread(str(folder / name)).astype(float) for name in (f"{view.name}/0000.jpg", f"stills/{view.name}.jpg"))
    u, v = np.round(project(view.matrix, stage.truth[0])[:, :2]).astype(int).T
    changes = np.abs(image - still).mean(axis=2)
    assert changes[v, u].mean() > 2.0 * np.median(changes)


def test_the_t_pose_is_symmetric_with_level_arms(drawn):
    static = load_trc(drawn[0] / "static.trc")
    at = dict(zip(static.names, static.positions_m[0], strict=True))
    for side in "LR":
        assert np.ptp([at[f"{side}{name}"][2] for name in ("Shoulder", "Elbow", "Wrist")]) < 1e-6
    assert at["LWrist"][0] > 0.5 and at["Nose"][1] < at["Neck"][1]  # faces -y
    for name in ("Elbow", "Hip", "Ankle", "BigToe"):
        np.testing.assert_allclose(at[f"R{name}"] * [-1.0, 1.0, 1.0], at[f"L{name}"], atol=0.02)  # the mannequin is not quite


@pytest.mark.parametrize("name", PROCEDURAL)
def test_procedural_motions_stand_on_the_floor_and_move(name):
    body = mannequin_body()
    motion = draw_motion(MotionChoice(name), 40, np.random.default_rng(1), None)
    poses = Poser(body).follow(motion, planted=True)
    assert max(abs(lowest(body, pose)) for pose in poses) < 1e-6
    markers = np.array([pose.markers for pose in poses])
    assert np.ptp(markers, axis=0).max() > 0.1
    assert np.linalg.norm(np.diff(markers, axis=0), axis=2).max() < 0.25  # per image, at 30 Hz
    thigh = np.linalg.norm(markers[:, MARKERS.index("LHip")] - markers[:, MARKERS.index("LKnee")], axis=1)
    assert np.ptp(thigh) < 1e-9


def test_mirroring_twice_changes_nothing():
    motion = draw_motion(MotionChoice("wave_and_turn"), 20, np.random.default_rng(3), None)
    again = mirrored(mirrored(motion))
    np.testing.assert_allclose(again.rotations, motion.rotations, atol=1e-12)
    assert not np.allclose(mirrored(motion).rotations, motion.rotations, atol=1e-3)


def test_a_missing_body_says_how_to_write_it(tmp_path):
    with pytest.raises(SourceError, match="_write_bodies"):
        load_body("child", tmp_path)


@pytest.mark.long
def test_the_quick_run_prints_its_metrics(tmp_path, capsys):
    assert draw_clips.main(["--quick", "--json", str(tmp_path / "metrics.json")]) == 0
    assert json.loads((tmp_path / "metrics.json").read_text())["metrics"]["clothed_clips.joints_inside_min"] == 1.0
    assert "clothed_clips.sets" in capsys.readouterr().out
