"""Files of points find their cameras by name or number."""

import pytest

from tracker_node.errors import UnknownNameError
from tracker_node.loaders.keypoints.camera_people import match_files
from tracker_node.loaders.projects import ProjectTrial, videos_by_camera

CASES = [
    (["cam01", "cam02"], ["cam01", "cam02"], [0, 1]),
    (["cam01_json", "cam02_json", "cam01_video"], ["cam01", "cam02"], [0, 1]),
    (["trial2_left", "trial2_right"], ["left", "right"], [0, 1]),
    (["2019-08-02-vid01-camA", "2019-08-02-vid01-camB"], ["A", "B"], [0, 1]),
    (["cam1", "cam2", "cam11"], ["cam_01", "cam_11"], [0, 2]),
    (["whatever"], ["cam01"], [0]),
    (["cam1_json", "other"], ["cam1", "cam2"], [0, None]),
    (["Cam-left", "Cam-right"], ["cam_right", "cam_left"], [1, 0]),
    (["cam1", "cam12"], ["1", "2"], [0, None]),
    (["Miqus_22001003", "Miqus_120000003"], ["cam_120000003", "cam_22001003"], [1, 0]),
    (["1234567890012", "12"], ["cam_1234567890012", "cam_12"], [0, 1]),
]


@pytest.mark.parametrize(("keys", "cameras", "rows"), CASES)
def test_files_of_cameras(keys, cameras, rows):
    expected = {camera: keys[row] for camera, row in zip(cameras, rows, strict=True) if row is not None}
    assert match_files(keys, cameras) == expected


@pytest.mark.parametrize(("keys", "cameras", "rows"), [case for case in CASES if None not in case[2]])
def test_videos_go_by_the_same_rules_as_points(tmp_path, capsys, keys, cameras, rows):
    """They went by whole names or numbers, else in order: trial2_left went to the camera right."""
    trial = ProjectTrial("", "", tmp_path, (), {key: tmp_path / f"{key}.mp4" for key in keys})
    expected = {camera: trial.videos[keys[row]] for camera, row in zip(cameras, rows, strict=True)}
    assert videos_by_camera(trial, cameras[::-1], print) == expected
    assert "in their order" not in capsys.readouterr().out


def test_none_belongs_to_a_camera():
    with pytest.raises(UnknownNameError, match="'left, right'; valid: cam1, cam2"):
        match_files(["cam1", "cam2"], ["left", "right"])
    with pytest.raises(UnknownNameError):
        match_files(["cam1", "x"], ["cam1", "cam_1"])  # both the same
