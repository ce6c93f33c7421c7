"""``calibrate body --from-points``: from a rig, its images and points to a file."""

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.bodies.detected_people import POINTS, ROWS, places
from helpers.cameras.person_clip import make_person_clip
from helpers.cameras.small_clip import Clip
from helpers.sources import point_files as files
from helpers.sources.weights import weights_or_skip
from tracker_node.calibration.body import model_stature
from tracker_node.cli.main import main
from tracker_node.loaders.keypoints.table import dump_keypoint_table
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.rig.rig_yaml import read_rig_file, write_rig_file
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE, LandmarkPoint
from tracker_node.model.humans.measures import HumanMeasures
from tracker_node.model.shape_parameters import ShapeSpace, expected_lengths
from tracker_node.observation.keypoints.blazepose import NAMES

N_IMAGES = 5
HUMAN = human_model()
SPACE = ShapeSpace(HUMAN, True, ("size", "length", "breadth"))
CHILD = SPACE.body(expected_lengths(SPACE)[0] + np.where(np.array(SPACE.names) == "size", -0.2, 0.0))


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    """With a folder ``mediapipe``: a child moves as the person in the images does, and is in no image of the second set."""
    clip, rng = make_person_clip(tmp_path_factory.mktemp("clip") / "person", N_IMAGES), np.random.default_rng(1)
    (clip.folder / "mediapipe").mkdir()
    for camera in clip.rig:
        images = []
        for i, state in enumerate(clip.states):
            pixels, seen = camera.project(places(state, CHILD))
            points = np.zeros((int(i != 1), len(NAMES), 3))
            points[:, ROWS] = np.column_stack([pixels + rng.normal(0.0, 0.3, pixels.shape), 0.9 * seen])
            images.append(points)
        files.write_mediapipe_json(clip.folder / "mediapipe" / f"{camera.name}.json", images, 200, 200)
    return clip


def calibrate(clip: Clip, output: Path, *more: str | Path) -> int:
    arguments = ["--from-points", clip.rig_file, "--keypoints", clip.folder / "mediapipe", "-o", output]
    return main(["calibrate", "body", *map(str, [*arguments, *more])])


def test_a_child_by_the_points_of_another_program(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "child.yaml"
    assert calibrate(clip, output) == 0
    told = capsys.readouterr()
    found = load_model(output)
    assert model_stature(found) == pytest.approx(model_stature(CHILD), rel=0.05)
    assert "left_ankle_dorsiflexion" in found.chain.dof_names
    assert model_stature(CHILD) < 0.85 * model_stature(HUMAN)
    assert f"stature {model_stature(found):.3f} m; wrote {output}" in told.out
    size = next(line.split() for line in told.out.splitlines() if line.startswith("size"))
    assert abs(float(size[1]) + 20.0) < 3.0 * float(size[2]) < 15.0  # percent, with its sigma
    assert f"points of {N_IMAGES - 1} of {N_IMAGES} image sets" in told.out and "people" in told.err
    assert "from points of 4 image sets of rig.yaml" in output.read_text().splitlines()[0]
    assert calibrate(clip, output) == 2
    assert "is there already" in capsys.readouterr().err


def test_few_sets_of_another_body_by_a_table(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``--model``, ``--keypoints-table``, ``--config`` and ``--quiet``."""
    tall, table, config = tmp_path / "tall.yaml", tmp_path / "keypoints.yaml", tmp_path / "config.yaml"
    dump_model(replace(human_model(HumanMeasures.of_stature(2.0)), name="anna"), tall)
    limbs = {name: LandmarkPoint(BLAZEPOSE[name].landmark, BLAZEPOSE[name].offset) for name in POINTS if name != "nose"}
    dump_keypoint_table(limbs, table, NAMES)
    config.write_text("modalities: [region, keypoints]\nkeypoints: {sigma_fraction: 0.01}\n")
    more = ("--sets", "2", "--model", tall, "--keypoints-table", table, "--config", config, "--person", "0", "0", "1", "--quiet")
    assert calibrate(clip, tmp_path / "child.yaml", *more) == 0, capsys.readouterr().err
    told, found = capsys.readouterr(), load_model(tmp_path / "child.yaml")
    assert found.name == "anna" and told.err == "" and "points of 2 of 2 image sets" in told.out
    assert model_stature(found) == pytest.approx(model_stature(CHILD), rel=0.08)


def test_a_camera_that_is_gone_is_named(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = with_sources(clip, tmp_path, cam02="gone.mp4")
    assert calibrate(clip, tmp_path / "child.yaml", "--from-points", rig) == 0
    error = capsys.readouterr().err
    assert "gone.mp4" in error and "this camera is left out" in error
    assert model_stature(load_model(tmp_path / "child.yaml")) == pytest.approx(model_stature(CHILD), rel=0.1)


@pytest.mark.parametrize(("factor", "unit"), [(100.0, "centimeters"), (1000.0, "millimeters")])
def test_a_rig_in_another_unit_is_named(
    clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str], factor: float, unit: str
) -> None:
    rig = read_rig_file(clip.rig_file)
    poses = {camera.name: camera.T_world_cam.copy() for camera in clip.rig}
    for T in poses.values():
        T[:3, 3] *= factor
    write_rig_file(rig.with_extrinsics(poses), tmp_path / "rig.yaml", base_dir=clip.folder)
    assert calibrate(clip, tmp_path / "child.yaml", "--from-points", tmp_path / "rig.yaml") == 2
    error = said(capsys)
    assert f"seems to be in {unit}" in error and f"Divide it by {factor:.0f}." in error and "people" not in error


def with_sources(clip: Clip, folder: Path, **sources: str | None) -> Path:
    """A rig.yaml in ``folder`` of the clip's cameras with other sources."""
    rig = read_rig_file(clip.rig_file)
    changes = {name: {"source": sources.get(name, str(clip.folder / name)), "background": None} for name in rig.cameras}
    write_rig_file(rig.with_cameras(changes), folder / "rig.yaml")
    return folder / "rig.yaml"


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--trc", "static.trc"], "'--from-points': expected no --trc, --stature"),
        (["--stature", "1.7"], "'--from-points': expected no --trc, --stature"),
        (["--from-run", "out/run"], "'--from-run': expected no --trc, --stature, --states or --from-points beside it"),
        (["--sets", "0"], "'--sets': expected a number of at least 1, got 0"),
        (["--person", "1", "nan", "0"], "'--person': expected a place in meters"),
        (["--from-points", "none.yaml"], "none.yaml"),
        (["--keypoints", "nowhere"], "nowhere"),
        (["--keypoints-table", "none.yaml"], "none.yaml"),
        (["--joint-sigma-mm", "2"], "'--joint-sigma-mm': expected --trc beside it, got 2.0"),
        (["--only", "girth"], "'--only': expected --from-run beside it, got ['girth']"),
        (["--keypoints-weights", "own.tflite"], "'--keypoints-weights': expected no --keypoints beside it"),
        (["--model", "none.yaml"], "none.yaml"),
        (["--config", "none.yaml"], "none.yaml"),
        (["-o", "."], "expected a file to write, got a folder"),
    ],
)
def test_mistakes_are_one_line(
    clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, more: list[str], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert calibrate(clip, tmp_path / "child.yaml", "--quiet", *more) == 2
    assert message in said(capsys) and not (tmp_path / "child.yaml").exists()


def said(capsys: pytest.CaptureFixture[str]) -> str:
    error = capsys.readouterr().err
    assert "Traceback" not in error and error.count("\n") == 1, error
    return error


def test_options_of_points_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = ["calibrate", "body", "-o", str(tmp_path / "x.yaml"), "--stature", "1.7"]
    for option in ("--keypoints", "--keypoints-table", "--keypoints-weights"):
        assert main([*body, option, "file"]) == 2
        assert f"'{option}': expected --from-points beside it, got 'file'" in said(capsys)
    assert main([*body[:4], "--from-points", "rig.yaml", "--keypoints-table", "t.yaml"]) == 2
    assert "rig.yaml" in said(capsys)


def test_nobody_in_two_cameras(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    alone = tmp_path / "alone"
    alone.mkdir()
    (alone / "cam01.json").write_bytes((clip.folder / "mediapipe" / "cam01.json").read_bytes())
    assert calibrate(clip, tmp_path / "child.yaml", "--quiet", "--keypoints", alone) == 2
    error = said(capsys)
    assert "rig.yaml: field '(images)': expected a person in two cameras at once" in error and "in 5 image sets" in error


def test_a_rig_without_images(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = with_sources(clip, tmp_path, **dict.fromkeys(clip.rig.names))
    assert calibrate(clip, tmp_path / "child.yaml", "--from-points", rig) == 2
    named = f"image source '{rig}': no camera has a source that can be used: the rig names no source for this camera: cam01, "
    assert named in said(capsys)


def test_a_body_without_the_points(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str], repository: Path) -> None:
    stick = repository / "config/models/yellow_stick.yaml"
    assert calibrate(clip, tmp_path / "child.yaml", "--model", stick) == 2
    assert "no point that yellow_stick has a landmark for" in said(capsys)


def test_the_network_is_not_installed(
    clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ai_edge_litert", None)
    assert main(["calibrate", "body", "--from-points", str(clip.rig_file), "-o", str(tmp_path / "x.yaml")]) == 2
    assert "pip install 'tracker_node[keypoints]' brings it" in said(capsys)


def test_the_network_finds_nobody(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In images that are gray."""
    weights = weights_or_skip()
    for name in clip.rig.names:
        (tmp_path / name).mkdir()
        cv2.imwrite(str(tmp_path / name / "0.png"), np.full((200, 200, 3), 90, np.uint8))
    rig = with_sources(clip, tmp_path, **{name: name for name in clip.rig.names})
    arguments = ["calibrate", "body", "--from-points", str(rig), "-o", str(tmp_path / "x.yaml"), "--quiet"]
    assert main([*arguments, "--keypoints-weights", str(weights.points)]) == 2
    assert "rig.yaml: field '(images)': expected a person in two cameras at once" in said(capsys)


def test_help_names_it_first(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["calibrate", "body", "--help"])
    told = capsys.readouterr().out
    assert "--from-points RIG" in told and "tracker_node calibrate body --from-points rig.yaml -o person.yaml" in told
