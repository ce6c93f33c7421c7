"""OpenPose's JSON files, in folders and in a zip file."""

import json
import zipfile

import numpy as np
import pytest

from tracker_node.errors import FileFormatError, UnknownNameError
from tracker_node.loaders.motion.openpose_json import load_openpose, match_cameras

BODY_25B = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
    "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "neck", "head",
    "left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe", "right_heel",
)  # fmt: skip

def person(value: float, n: int = 3) -> dict:
    return {"person_id": [-1], "pose_keypoints_2d": [value, value + 1.0, 0.5] * n}


@pytest.fixture
def folder(tmp_path):
    """Two cameras, images 9, 10 and 11, whose names do not sort as their numbers do."""
    for camera in ("cam1_json", "cam2_json"):
        (tmp_path / "pose" / camera).mkdir(parents=True)
        for i in (9, 10, 11):
            people = [person(i)] * (i - 9)
            (tmp_path / "pose" / camera / f"{camera[:4]}_{i}_keypoints.json").write_text(
                json.dumps({"version": 1.3, "people": people})
            )
    return tmp_path / "pose"


def zipped(folder):
    path = folder.with_suffix(".zip")
    with zipfile.ZipFile(path, "w") as archive:
        for file in folder.rglob("*.json"):
            archive.write(file, file.relative_to(folder.parent))
    return path


@pytest.mark.parametrize("source", [lambda folder: folder, zipped])
def test_images_are_in_the_order_of_their_numbers(folder, source):
    groups = load_openpose(source(folder))
    assert sorted(groups) == ["cam1_json", "cam2_json"]
    people = groups["cam1_json"].people
    assert [len(group) for group in people] == [0, 1, 2]
    np.testing.assert_array_equal(people[1][0], [[10.0, 11.0, 0.5]] * 3)


def test_cameras_find_their_folder_by_name_or_number(folder):
    groups = load_openpose(folder)
    assert match_cameras(groups, ("cam_02", "cam01"))["cam_02"] is groups["cam2_json"]
    assert match_cameras({"left_json": groups["cam1_json"], **groups}, ("left",))["left"] is groups["cam1_json"]
    with pytest.raises(UnknownNameError, match="camera 'cam3'; valid: cam1_json, cam2_json"):
        match_cameras(groups, ("cam1", "cam3"))


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("{", "(content)"),
        ("[]", "people"),
        ('{"people": [3]}', "people[0].pose_keypoints_2d"),
        ('{"people": [{"pose_keypoints_2d": [1, 2]}]}', "people[0].pose_keypoints_2d"),
        ('{"people": [{"pose_keypoints_2d": [1, 2, "x"]}]}', "people[0].pose_keypoints_2d"),
        (json.dumps({"people": [person(1.0), person(1.0, 4)]}), "people[1].pose_keypoints_2d"),
    ],
)
def test_what_is_wrong_is_named(folder, text, field):
    file = folder / "cam2_json" / "cam2_10_keypoints.json"
    file.write_text(text)
    with pytest.raises(FileFormatError) as caught:
        load_openpose(folder)
    assert caught.value.field == field
    assert "cam2_10_keypoints.json" in caught.value.file


def test_nothing_there(tmp_path):
    with pytest.raises(FileFormatError, match="one folder a camera"):
        load_openpose(tmp_path)
    (tmp_path / "x.zip").write_text("no zip")
    with pytest.raises(FileFormatError, match="a folder or a zip file"):
        load_openpose(tmp_path / "x.zip")


def test_the_real_clip(shared_data):
    groups = load_openpose(shared_data / "pose2sim_balancing/openpose_body25b_json.zip")
    assert [len(groups[f"cam{i}_json"].people) for i in (1, 2, 3, 4)] == [100] * 4
    first = groups["cam1_json"].people[0]
    assert first.shape[1:] == (len(BODY_25B), 3)
    # He stands upright in the first image: the ankles are below the head.
    assert first[0, BODY_25B.index("left_ankle"), 1] > first[0, BODY_25B.index("head"), 1] + 500
