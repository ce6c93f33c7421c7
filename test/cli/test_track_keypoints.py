"""``track`` with points of people: what is missing is said in one line before anything is tracked."""

import json
import sys
from pathlib import Path

import pytest

from helpers.cameras.person_clip import make_person_clip
from helpers.cameras.small_clip import Clip
from helpers.sources.weights import weights_or_skip
from tracker_node.cli.main import main


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    return make_person_clip(tmp_path_factory.mktemp("clip") / "person", 2)


def said(capsys: pytest.CaptureFixture[str]) -> str:
    error = capsys.readouterr().err
    assert "Traceback" not in error and error.count("\n") == 1, error
    return error


def test_missing_weights(no_index: None, clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("ai_edge_litert")
    assert main(["track", *clip.arguments(), "--rate", "30", "--output", str(tmp_path / "run")]) == 2
    error = said(capsys)
    assert "mediapipe==0.10.9 could not be fetched" in error and f"{tmp_path}/cache/tracker_node/files/" in error
    assert not (tmp_path / "run").exists()


def test_missing_package(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ai_edge_litert", None)
    assert main(["track", *clip.arguments(), "--rate", "30", "--output", str(tmp_path / "run")]) == 2
    assert "ai_edge_litert is not installed; pip install 'tracker_node[keypoints]' brings it" in said(capsys)


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [("--keypoints-weights", "none.tflite", "none.tflite: field '(file)': expected weights of a network"),
     ("--keypoints-every", "0", "'--keypoints-every': expected a whole number, 1 or more, got 0")],
)  # fmt: skip
def test_options_that_cannot_be(
    clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, value: str, words: str
) -> None:
    pytest.importorskip("ai_edge_litert")
    assert main(["track", *clip.arguments(), "--rate", "30", "--output", str(tmp_path / "run"), option, value]) == 2
    assert words in said(capsys)


def test_a_run_with_the_network(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cones without a face are nobody, so contours go on alone; the file of the weights is in run.json."""
    files = weights_or_skip()
    own = tmp_path / "own.tflite"
    own.symlink_to(files.points)
    options = ["--keypoints-weights", str(own), "--keypoints-every", "2", "--quiet"]
    assert main(["track", *clip.arguments(), "--output", str(tmp_path / "run"), *options]) == 0, capsys.readouterr().err
    info = json.loads((tmp_path / "run/run.json").read_text())
    assert (info["image_sets"], info["detection"]["images"], info["detection"]["detector"]) == (2, 3, "BlazePose own")
    assert info["options"]["keypoints_weights"].endswith(files.points.name) and info["options"]["keypoints_every"] == 2


def test_places_where_no_person_can_be_looked_for(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["track", *clip.arguments(), "--rate", "30", "--output", str(tmp_path / "run"), "--person"]
    assert main([*arguments, "nan", "0", "1"]) == 2
    assert "'--person': expected a place in meters, got [nan, 0.0, 1.0]" in said(capsys)
    assert main([*arguments, "0", "0", "1"]) == 2
    assert "expected a place to search a person at (--person) or an initial state, got both" in said(capsys)


def test_a_recording_says_where_points_come_from(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``track`` looks there, options given beside it go before; ``pipeline`` refuses what its graph does not have."""
    given = dict(zip(clip.arguments()[::2], clip.arguments()[1::2], strict=True))
    lines = [f"{name.removeprefix('--').replace('-', '_')}: {value}" for name, value in given.items()]
    (tmp_path / "points").mkdir()
    file = tmp_path / "recording.yaml"
    file.write_text("\n".join([*lines, "output: run", "keypoints: {files: points}"]))
    assert main(["track", str(file)]) == 2
    assert f"{tmp_path}/points" in said(capsys)
    assert main(["track", str(file), "--keypoints", str(tmp_path / "others")]) == 2
    assert f"{tmp_path}/others" in said(capsys)
    assert main(["pipeline", str(file)]) == 2
    assert "recording.yaml: field 'keypoints.files': expected nothing: it is for tracker_node track" in said(capsys)
