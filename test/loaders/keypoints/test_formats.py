"""Points of each format there and back; the format is known by the content."""

import json
import zipfile

import numpy as np
import pytest

from helpers.sources import point_files as files
from tracker_node.errors import FileFormatError, MissingExtraError
from tracker_node.loaders.keypoints import files as camera_files
from tracker_node.loaders.keypoints import formats
from tracker_node.loaders.keypoints.formats import detect, load_points

PARTS = ("nose", "left_paw", "right_paw", "tail")
WIDTH, HEIGHT = 640, 480


@pytest.mark.parametrize("order", ["coco_17", "coco_18", "halpe_26", "coco_wholebody_133"])
def test_openpose(tmp_path, order):
    images = files.some_people(len(camera_files.ORDERS[order]))
    for camera in ("cam1_json", "cam2_json"):
        files.write_openpose(tmp_path / "pose" / camera, images, first=7)
    assert detect(tmp_path / "pose") == formats.OPENPOSE
    points = load_points(tmp_path)  # the folder of the project
    assert sorted(points) == ["cam1_json", "cam2_json"]
    assert points["cam1_json"].names == camera_files.ORDERS[order]
    files.same_people(points["cam2_json"], images)


def standing(order) -> np.ndarray:
    """(1, n, 3) A person whose points are where a body has them."""
    heights = {"head": 0.0, "nose": 0.1, "eye": 0.08, "ear": 0.09, "neck": 0.18, "shoulder": 0.2, "elbow": 0.35, "wrist": 0.5,
               "hip": 0.5, "knee": 0.75, "ankle": 0.95, "heel": 0.99, "big_toe": 1.0, "small_toe": 0.99}  # fmt: skip
    rows = []
    for name in camera_files.ORDERS[order]:
        side = {"left": 40.0, "right": -40.0}.get(name.partition("_")[0], 0.0)
        part = name.removeprefix("left_").removeprefix("right_").removeprefix("mid_")
        rows.append([300.0 + side, 50.0 + 380.0 * heights[part], 0.9])
    return np.array([rows])


@pytest.mark.parametrize("order", ["body_25", "body_25b"])
def test_the_two_orders_of_25_points_are_told_apart(tmp_path, order):
    files.write_openpose(tmp_path / "cam1", [standing(order)] * 3)
    assert load_points(tmp_path)["cam1"].names == camera_files.ORDERS[order]


def test_missing_files_of_images_leave_the_others_their_numbers(tmp_path):
    images = files.some_people(17, n_images=5)
    files.write_openpose(tmp_path / "cam1", images)
    sorted((tmp_path / "cam1").iterdir())[3].unlink()
    people = load_points(tmp_path / "cam1")["cam1"]
    assert list(people) == [0, 1, 2, 4]
    np.testing.assert_allclose(people[4][1].pixels, images[4][1, :, :2])


@pytest.mark.parametrize("order", ["coco_17", "halpe_26", "coco_wholebody_133"])
def test_mmpose(tmp_path, order):
    images = files.some_people(len(camera_files.ORDERS[order]))
    files.write_mmpose_images(tmp_path / "predictions" / "left", images)
    assert detect(tmp_path / "predictions") == formats.MMPOSE
    files.same_people(load_points(tmp_path / "predictions")["left"], images)
    file = files.write_mmpose_video(tmp_path / "right.json", images)
    people = load_points(file)["right"]
    assert people.names == camera_files.ORDERS[order] and people[0][0].score == 0.9
    files.same_people(people, images)


def test_mmpose_says_names_itself(tmp_path):
    images = files.some_people(4)
    people = load_points(files.write_mmpose_video(tmp_path / "results_cam1.json", images, PARTS))["results_cam1"]
    assert people.names == PARTS
    files.same_people(people, images)


@pytest.mark.parametrize("wholebody", [False, True])
def test_coco(tmp_path, wholebody):
    images = files.some_people(133 if wholebody else 17)
    file = files.write_coco(tmp_path / "cam1.json", images, wholebody)
    assert detect(file) == formats.COCO
    people = load_points(file)["cam1"]
    files.same_people(people, images)
    assert people[0][0].score == 0.8 and len(people.names) == (133 if wholebody else 17)
    file.write_text(file.read_text().replace('"image_id": 3', '"image_id": "frames/00003.jpg"'))
    files.same_people(load_points(file)["cam1"], images)


def test_mediapipe(tmp_path):
    images = files.some_people(33)
    file = files.write_mediapipe_json(tmp_path / "cam1.json", images, WIDTH, HEIGHT)
    assert detect(file) == formats.MEDIAPIPE
    people = load_points(file)["cam1"]
    with pytest.raises(ValueError, match="for_images"):
        people[0]
    assert people.names == camera_files.BLAZEPOSE_33
    files.same_people(people.for_images(WIDTH, HEIGHT), images)
    file = files.write_mediapipe_csv(tmp_path / "cam2.csv", images, WIDTH, HEIGHT)
    assert detect(file) == formats.MEDIAPIPE
    files.same_people(load_points(file)["cam2"].for_images(WIDTH, HEIGHT), images, first_only=True)


def test_mediapipe_by_landmark_and_by_name(tmp_path):
    (tmp_path / "a.csv").write_text(
        "frame,landmark,x,y,z,visibility\n0,nose,0.5,0.25,0,0.9\n0,left_hip,0.5,0.5,0,0.8\n2,nose,,,,\n"
    )
    (tmp_path / "b.csv").write_text("frame,nose_x,nose_y,nose_visibility\n5,0.5,0.25,0.7\n")
    (tmp_path / "c.json").write_text(json.dumps([[[0.5, 0.25, 0.0, 0.7]] * 33, None, []]))
    people = load_points(tmp_path / "a.csv")["a"].for_images(100, 100)
    assert people.names == ("nose", "left_hip") and people[2] == ()
    np.testing.assert_allclose(people[0][0].pixels, [[49.5, 24.5], [49.5, 49.5]])
    assert list(load_points(tmp_path / "b.csv")["b"]) == [5]
    assert [len(found) for found in load_points(tmp_path / "c.json")["c"].for_images(9, 9).values()] == [1, 0, 0]


@pytest.mark.parametrize("individuals", [("",), ("mouse1", "mouse2")])
def test_deeplabcut(tmp_path, individuals):
    images = files.some_people(4, n_people=len(individuals))
    folder = tmp_path / "session/pose-2d"
    folder.mkdir(parents=True)
    files.write_deeplabcut_h5(folder / "cam1DLC_resnet50_mayshuffle1_1000.h5", images, PARTS, individuals)
    files.write_deeplabcut_csv(folder / "cam1DLC_resnet50_mayshuffle1_1000.csv", images, PARTS, individuals)
    for path in (tmp_path / "session", next(folder.glob("*.csv"))):
        assert detect(formats.points_folder(path)) == formats.DEEPLABCUT
        people = load_points(path)["cam1"]
        assert people.names == PARTS
        files.same_people(people, images)


def test_deeplabcut_labeled_images(tmp_path):
    """Labels have no likelihood, and names of images in several columns."""
    (tmp_path / "c.csv").write_text(
        "scorer,,,me,me\nbodyparts,,,nose,nose\ncoords,,,x,y\nlabeled-data,cam1,img004.png,10.5,20.5\nlabeled-data,cam1,img007.png,,\n"
    )
    people = load_points(tmp_path / "c.csv")["c"]
    assert list(people) == [4, 7] and people[7] == () and people[4][0].scores.tolist() == [1.0]


def test_sleap(tmp_path):
    images = files.some_people(4)
    h5 = files.write_sleap_h5(tmp_path / "cam1.analysis.h5", images, PARTS)
    table = files.write_sleap_csv(tmp_path / "cam2.csv", images, PARTS)
    for path, key in ((h5, "cam1"), (table, "cam2")):
        assert detect(path) == formats.SLEAP
        people = load_points(path)[key]
        assert people.names == PARTS
        files.same_people(people, images)


def test_h5_takes_an_extra(tmp_path, monkeypatch):
    path = files.write_sleap_h5(tmp_path / "a.h5", files.some_people(4), PARTS)
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(MissingExtraError, match=r"h5py is not installed; pip install 'tracker_node\[h5\]'"):
        load_points(path)


def test_names_of_the_user(tmp_path):
    images = files.some_people(4)
    file = files.write_coco(tmp_path / "cam1.json", images)
    with pytest.raises(FileFormatError, match=r"17 \(coco_17\).*or a keypoint table with 'names', got '4 points'"):
        load_points(file)
    assert load_points(file, PARTS)["cam1"].names == PARTS
    assert load_points(file, None)["cam1"].names == ("0", "1", "2", "3")
    with pytest.raises(FileFormatError, match="3 points, for which the table has names"):
        load_points(file, PARTS[:3])


def test_what_is_none(tmp_path):
    for name, text in (("a.json", '{"x": 1}'), ("b.csv", "a,b\n1,2\n"), ("c.txt", "x")):
        (tmp_path / name).write_text(text)
        with pytest.raises(FileFormatError, match=r"points of OpenPose or Pose2Sim"):
            load_points(tmp_path / name)
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileFormatError, match=r"\*\.h5, \*\.csv, \*\.json"):
        load_points(tmp_path / "empty")


def test_the_real_clip(shared_data, tmp_path):
    path = shared_data / "pose2sim_balancing/openpose_body25b_json.zip"
    points = load_points(path)
    assert {key: len(people) for key, people in points.items()} == {f"cam{i}_json": 100 for i in (1, 2, 3, 4)}
    assert all(people.names == camera_files.BODY_25B for people in points.values())
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "pose")
    unpacked = load_points(tmp_path)
    one, other = points["cam3_json"][40][0], unpacked["cam3_json"][40][0]
    np.testing.assert_array_equal(one.pixels, other.pixels)
    size = one.box[3] - one.box[1]
    sigmas = np.sqrt(one.covariances[one.scores > 0.0, 0, 0])
    assert 0.005 * size < sigmas.min() < sigmas.max() < 0.06 * size
