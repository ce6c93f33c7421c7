"""keypoints.yaml there and back, and what is refused."""

import pytest

from helpers.bodies.bodies import crane
from tracker_node.errors import FileFormatError, WrongKindOfFileError
from tracker_node.loaders.keypoints.table import dump_keypoint_table, load_keypoint_table, load_point_names
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import TABLES, LandmarkPoint


@pytest.mark.parametrize("name", TABLES)
def test_there_and_back(tmp_path, name):
    dump_keypoint_table(TABLES[name], tmp_path / "keypoints.yaml")
    assert load_keypoint_table(tmp_path / "keypoints.yaml", human_model()) == TABLES[name]
    assert load_point_names(tmp_path / "keypoints.yaml") == ()


def test_short_forms(tmp_path):
    path, landmark = tmp_path / "keypoints.yaml", crane().landmark_names[0]
    path.write_text(
        f"points:\n  hook: {{landmark: {landmark}, sigma: 0.02}}\n  eye: {{landmark: {landmark}}}\nnames: [hook, eye, x]\n"
    )
    table = load_keypoint_table(path, crane())
    assert table["hook"] == LandmarkPoint(landmark, (0.0, 0.0, 0.0), (0.02, 0.02, 0.02))
    assert table["eye"] == LandmarkPoint(landmark)
    assert load_point_names(path) == ("hook", "eye", "x")


WRONG = {
    "points: {a: {landmark: snout}}": r"points.a.landmark': expected a landmark of human: neck, head, nose, .*got 'snout'",
    "points: {a: {landmark: nose, sigma: 0}}": r"points.a.sigma': expected a positive number of meters, or three",
    "points: {a: {landmark: nose, sigma: [1, 2, -3]}}": r"points.a.sigma",
    "points: {a: {landmark: nose, offset: [1, 2]}}": r"points.a.offset': expected 3 finite numbers",
    "points: {a: {landmark: nose, offset: .nan}}": r"points.a.offset",
    "points: {a: {landmarks: nose}}": r"points.a.landmarks': expected 'landmark', or another",
    "points: {a: {}}": r"points.a.landmark': expected a value",
    "points: {}": r"points': expected at least one point",
    "points: {a: {landmark: nose}}\nnames: [a, a]": r"names': expected each name once",
    "points: {a: {landmark: nose}}\nnames: [b]": r"points.a': expected a point among 'names': b",
    "points: [a]": "points",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_named(tmp_path, text):
    path = tmp_path / "keypoints.yaml"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=WRONG[text]):
        load_keypoint_table(path, human_model())


def test_other_files(tmp_path):
    path = tmp_path / "keypoints.yaml"
    path.write_text("points: {a: {landmark: nose}}")
    with pytest.raises(WrongKindOfFileError, match="this is a table of keypoints, not a rig"):
        load_rig(path)
    with pytest.raises(WrongKindOfFileError, match="this is a table of keypoints, not a body"):
        load_model(path)
    path.write_text("cameras: {}\nlinks: [a]")
    with pytest.raises(WrongKindOfFileError, match="not a table of keypoints"):
        load_keypoint_table(path, human_model())


def test_a_table_of_somebody_else_is_refused(tmp_path):
    """Single points that this body lacks are no mistake."""
    path, landmark = tmp_path / "keypoints.yaml", crane().landmark_names[0]
    path.write_text("points: {a: {landmark: nose}, b: {landmark: neck}}")
    with pytest.raises(FileFormatError, match=rf"keypoints.yaml: field 'points.a.landmark': expected .* {landmark}.*got 'nose'"):
        load_keypoint_table(path, crane())
    path.write_text(f"points: {{a: {{landmark: nose}}, b: {{landmark: {landmark}}}}}")
    assert set(load_keypoint_table(path, crane())) == {"a", "b"}
