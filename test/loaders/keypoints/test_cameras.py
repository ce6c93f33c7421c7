"""Files of points find their cameras by name or number."""

import pytest

from tracker_node.errors import FileFormatError, UnknownNameError
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
    (["cam1", "cam3"], ["cam_01", "cam_02", "cam_03"], [0, None, 1]),
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


def test_numbers_that_begin_at_0_and_at_1_pair_nothing(tmp_path, capsys):
    """The videos 1 to 3 went to the cameras 1 to 3, whose neighbors they are; video 0 and camera 4 were left out."""
    videos, cameras = [f"video_{i}" for i in range(4)], [f"cam_0{i + 1}" for i in range(4)]
    trial = ProjectTrial("", "", tmp_path, (), {key: tmp_path / f"{key}.mp4" for key in videos})
    assert [path.stem for path in videos_by_camera(trial, cameras, print).values()] == videos
    assert "are paired in their order: cam_01: video_0.mp4" in capsys.readouterr().out
    with pytest.raises(FileFormatError, match="a video for each of the cameras"):
        videos_by_camera(ProjectTrial("", "", tmp_path, (), dict(list(trial.videos.items())[:3])), cameras, print)
    with pytest.raises(UnknownNameError, match="'cam_01, "):
        match_files(videos, cameras)


def test_videos_of_two_trials_are_refused(tmp_path):
    videos = {name: tmp_path / f"{name}.mp4" for name in ("walk_27040", "run_27040", "walk_27041", "run_27041")}
    with pytest.raises(FileFormatError, match=r"one for cam_27040 \(`rig import .* got 'walk_27040.mp4, run_27040"):
        videos_by_camera(ProjectTrial("", "", tmp_path, (), videos), ["cam_27040", "cam_27041"], print)
    del videos["run_27041"]
    with pytest.raises(FileFormatError, match="one for cam_27040"):
        videos_by_camera(ProjectTrial("", "", tmp_path, (), videos), ["cam_27040", "cam_27041"], print)


def test_none_belongs_to_a_camera():
    with pytest.raises(UnknownNameError, match="'left, right'; valid: cam1, cam2"):
        match_files(["cam1", "cam2"], ["left", "right"])
    with pytest.raises(UnknownNameError):
        match_files(["cam1", "x"], ["cam1", "cam_1"])  # both the same
