"""OpenPose's JSON files, in folders and in a zip file."""

import json
import zipfile

import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.keypoints.openpose import read


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
    groups = read(source(folder))
    assert sorted(groups) == ["cam1_json", "cam2_json"]
    found = groups["cam1_json"].found
    assert {image: len(people) for image, people in found.items()} == {0: 0, 1: 1, 2: 2}
    np.testing.assert_array_equal(found[1][0].points, [[10.0, 11.0, 0.5]] * 3)


def test_images_without_numbers_of_their_own_are_in_the_order_of_all_numbers(tmp_path):
    for i in (2, 10, 1):
        (tmp_path / f"image_{i}_of_10.json").write_text(json.dumps({"people": [person(i)]}))
    found = read(tmp_path)[tmp_path.name].found
    assert [found[image][0].points[0, 0] for image in (0, 1, 2)] == [1.0, 2.0, 10.0]


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
        read(folder)
    assert caught.value.field == field
    assert "cam2_10_keypoints.json" in caught.value.file


def test_nothing_there(tmp_path):
    with pytest.raises(FileFormatError, match="one folder a camera"):
        read(tmp_path)
    (tmp_path / "x.zip").write_text("no zip")
    with pytest.raises(FileFormatError, match="a folder or a zip file"):
        read(tmp_path / "x.zip")
