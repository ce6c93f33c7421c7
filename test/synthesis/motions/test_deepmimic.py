"""Captured clips: resampling, repetition, files that are wrong."""

import json

import numpy as np
import pytest

from tracker_node.errors import FileFormatError, SourceError, UnknownNameError
from tracker_node.geometry import so3
from tracker_node.synthesis.motions import deepmimic as clips
from tracker_node.synthesis.motions.deepmimic import MotionClip, find_clip, load_motion, read_clip


def turning_clip(wraps: bool = True) -> MotionClip:
    """Walks 1 m along x (clip axes) in 1 s while it turns by 0.5 rad about the vertical; the right knee bends by 1 rad."""
    n = 11
    columns = np.zeros((n, clips.N_COLUMNS))
    columns[:, 0] = 0.1
    columns[:, 1], columns[:, 2] = np.linspace(0.0, 1.0, n), 0.9
    for start in (4, 8, 12, 16, 21, 25, 30, 35, 39):
        columns[:, start] = 1.0
    angle = np.linspace(0.0, 0.5, n)
    columns[:, 4], columns[:, 6] = np.cos(angle / 2), np.sin(angle / 2)
    columns[:, 20] = -np.linspace(0.0, 1.0, n)
    columns[:, 25:29] *= 1.1  # not normalized, as in real clips
    return MotionClip("turning", columns, wraps)


def test_clip_axes_become_forward_left_up():
    motion = turning_clip().resampled(10.0)
    assert len(motion) == 11
    np.testing.assert_allclose(motion.root_positions[-1], [1.0, 0.0, 0.9], atol=1e-12)
    # Y up becomes Z up: a turn about the clip's vertical is one about the world's.
    np.testing.assert_allclose(motion.of("pelvis")[-1], so3.exp([0.0, 0.0, 0.5]), atol=1e-12)
    # A negative knee angle takes the heel back: the shank's lower end moves to -x of the body.
    down = motion.of("pelvis")[-1].T @ motion.of("right_shank")[-1] @ [0.0, 0.0, -1.0]
    np.testing.assert_allclose(down, [-np.sin(1.0), 0.0, -np.cos(1.0)], atol=1e-12)


def test_every_rotation_is_proper_although_the_file_is_not_normalised():
    rotations = turning_clip().resampled(30.0).rotations.reshape(-1, 3, 3)
    np.testing.assert_allclose(rotations @ np.swapaxes(rotations, 1, 2), np.tile(np.eye(3), (len(rotations), 1, 1)), atol=1e-12)


def test_resampling_interpolates_on_the_sphere():
    motion = turning_clip().resampled(37.0)
    for t, rotation in zip(motion.times_s, motion.of("pelvis"), strict=True):
        np.testing.assert_allclose(so3.log(rotation), [0.0, 0.0, 0.5 * t], atol=1e-9)


def test_a_wrapping_clip_goes_on_with_travel_and_turn():
    motion = turning_clip().resampled(10.0, 26)
    np.testing.assert_allclose(so3.log(motion.of("pelvis")[25]), [0.0, 0.0, 0.5 + 0.5 + 0.25], atol=1e-9)
    # Second lap starts where the first ended and runs in its direction; the third likewise.
    np.testing.assert_allclose(motion.root_positions[15], [1.0 + 0.5 * np.cos(0.5), 0.5 * np.sin(0.5), 0.9], atol=1e-9)
    expected = np.array([1.0 + np.cos(0.5) + 0.5 * np.cos(1.0), np.sin(0.5) + 0.5 * np.sin(1.0), 0.9])
    np.testing.assert_allclose(motion.root_positions[25], expected, atol=1e-9)


def test_laps_join_without_a_jump(shared_data):
    motion = read_clip(find_clip("walk", shared_data / "bullet_motions")).resampled(60.0, 200)
    between = np.swapaxes(motion.rotations[:-1], 2, 3) @ motion.rotations[1:]
    angle = np.arccos(np.clip((np.trace(between, axis1=2, axis2=3) - 1.0) / 2.0, -1.0, 1.0)).max(axis=1)
    seams = np.flatnonzero(np.diff(np.floor(motion.times_s / (38 * 0.033332) + 1e-12)))
    assert len(seams) == 2
    assert angle[seams].max() < 1.2 * np.delete(angle, seams).max()
    assert np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=1).max() < 0.04


def test_a_clip_that_does_not_wrap_is_not_stretched():
    with pytest.raises(SourceError, match="gives 11 images at 10 Hz and does not wrap, got 12"):
        turning_clip(wraps=False).resampled(10.0, 12)


@pytest.mark.parametrize(
    ("content", "field"),
    [
        ({"Loop": "wrap"}, "Frames"),
        ({"Frames": [[0.1] * 44, [0.1] * 43]}, "Frames[1]"),
        ({"Frames": [[0.0] * 44, [0.1] * 44]}, "Frames"),
        ({"Frames": [[0.1] * 4 + [0.0] * 40] * 2}, "quaternion of pelvis"),
    ],
)
def test_wrong_files_are_named(tmp_path, content, field):
    path = tmp_path / "humanoid3d_bad.txt"
    path.write_text(json.dumps(content))
    with pytest.raises(FileFormatError) as caught:
        read_clip(path)
    assert field in caught.value.field and "humanoid3d_bad.txt" in str(caught.value)


def test_missing_motions_are_named(tmp_path):
    with pytest.raises(SourceError, match="no such motion file"):
        read_clip(tmp_path / "nothing.txt")
    with pytest.raises(SourceError, match="no motion clips there"):
        find_clip("walk", tmp_path)
    (tmp_path / "humanoid3d_walk.txt").write_text("{}")
    with pytest.raises(UnknownNameError, match="valid: swing, walk"):
        find_clip("wlak", tmp_path)
    with pytest.raises(SourceError, match="procedural motion 'swing'"):
        load_motion("walk", 30.0)


def test_all_captured_clips_load(shared_data):
    files = sorted((shared_data / "bullet_motions").glob("humanoid3d_*.txt"))
    assert len(files) == 15
    for file in files:
        motion = read_clip(file).resampled(30.0)
        assert len(motion) >= 20
        steps = np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=1)
        assert steps.max() < 0.35, file.name  # no faster than 10 m/s


def test_the_captured_walk_walks_forward(shared_data):
    motion = load_motion("walk", 30.0, folder=shared_data / "bullet_motions")
    travel = motion.root_positions[-1] - motion.root_positions[0]
    forward = motion.of("pelvis")[len(motion) // 2] @ [1.0, 0.0, 0.0]
    assert travel @ forward > 0.9 * np.linalg.norm(travel) > 0.9
