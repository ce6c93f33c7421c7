"""Weights of the networks: where they come from, and what is said where they are missing or other ones."""

from pathlib import Path

import pytest

from helpers.sources.weights import weights_or_skip
from tracker_node.errors import FileFormatError
from tracker_node.loaders.fetched_files import DETECTOR, POINTS, MissingWeightsError, detector_name, pose_weights


@pytest.fixture
def no_index(monkeypatch: pytest.MonkeyPatch) -> None:
    """A package index that has nothing."""
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)


def test_without_network_it_is_said_where_to_put_them(no_index: None, tmp_path: Path) -> None:
    with pytest.raises(MissingWeightsError) as caught:
        pose_weights(cache=tmp_path)
    said = str(caught.value)
    assert "mediapipe==0.10.9 could not be fetched from the package index" in said and "\n" not in said
    assert f"{DETECTOR} as {tmp_path}/files/9ba9dd3d42efaaba-{DETECTOR}" in said
    assert f"{POINTS} as {tmp_path}/files/e9a5c5cb17f736fa-{POINTS}" in said


def test_those_in_the_cache_are_checked_and_used_without_network(tmp_path: Path, no_index: None) -> None:
    files = weights_or_skip()
    (tmp_path / "files").mkdir()
    for path in (files.detector, files.points):
        (tmp_path / "files" / path.name).symlink_to(path)
    found = pose_weights(cache=tmp_path)
    assert (found.detector.name, found.points.name) == (files.detector.name, files.points.name)
    (tmp_path / "files" / files.points.name).unlink()
    (tmp_path / "files" / files.points.name).write_bytes(files.points.read_bytes()[:-1])
    with pytest.raises(MissingWeightsError):
        pose_weights(cache=tmp_path)


def test_another_file_of_points(tmp_path: Path, no_index: None) -> None:
    files = weights_or_skip()
    own = tmp_path / "own.tflite"
    own.symlink_to(files.points)
    assert pose_weights(own).points == own
    assert (detector_name(), detector_name(own)) == ("BlazePose full", "BlazePose own")
    assert detector_name(Path("/x/pose_landmark_heavy.tflite")) == "BlazePose heavy"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("none.tflite", None, "expected weights of a network that finds points of people, got 'No such file or directory'"),
        ("text.tflite", b"no weights at all", r"expected a file of TensorFlow Lite, got '17 bytes that are none'"),
        ("pose_landmark_heavy.tflite", b"    TFL3 cut off", r"'\(SHA-256\)': expected 59e42d71\w+ for a file of this name, got"),
    ],
)  # fmt: skip
def test_a_file_that_is_none_is_named(tmp_path: Path, name: str, content: bytes | None, said: str) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(FileFormatError, match=rf"{name}: .*{said}"):
        pose_weights(tmp_path / name, tmp_path)
