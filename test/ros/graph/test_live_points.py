"""A clothed person tracked with points of the real detector, process by process; the bag gives the same states again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tracker_node.errors import TrackerError

pytest.importorskip("rclpy", reason="ROS is not installed")
pytest.importorskip("ai_edge_litert", reason="the extra keypoints is not installed")

from benchmark.clothed._clip import write_clip
from benchmark.clothed._staging import Sources, set_stage
from benchmark.clothed.person._body import MANNEQUIN
from benchmark.ros.points import clothed
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.cli.main import main
from tracker_node.loaders.bag.message_types import stamp_ns_of
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file

pytestmark = pytest.mark.long
N_IMAGES, N_ROUNDS = 10, 8


@pytest.fixture(scope="module")
def arguments(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Of commands that track the clip."""
    try:
        pose_weights()
    except TrackerError as error:
        pytest.skip(str(error))
    folder = tmp_path_factory.mktemp("clothed")
    write_clip(set_stage(1, Sources(folder, None, MANNEQUIN, "guard"), N_IMAGES), folder / "clip")
    clip = clothed(folder / "clip")
    cameras = tuple(replace(camera, source=str(there_and_back(folder, camera))) for camera in clip.rig)
    write_rig_file(rig_file_of(CameraRig(cameras)), folder / "rig.yaml")  # with its backgrounds: it tracks until points come
    dump_model(clip.model, folder / "person.yaml")
    dump_state(clip.start, clip.model, folder / "start.yaml")
    (folder / "config.yaml").write_text("modalities: [region, keypoints]\n")
    files = {"rig": "rig.yaml", "model": "person.yaml", "initial-state": "start.yaml", "config": "config.yaml"}
    return [text for option, name in files.items() for text in (f"--{option}", str(folder / name))]


def there_and_back(folder: Path, camera: Camera) -> Path:
    """Images of a camera as links, forward and backward, so often that points come before the end."""
    files, links = sorted(Path(camera.source).glob("[0-9]*.*")), folder / camera.name
    links.mkdir()
    for i, file in enumerate([*files, *reversed(files)] * N_ROUNDS):
        (links / f"{i:04d}{file.suffix}").symlink_to(file)
    return links


def states_of(bag: Path) -> list:
    with BagReader(bag) as reader:
        return [message for _, message in reader.decoded("/tracker/state")]


def used(state) -> list[tuple[str, int]]:
    """Cameras whose points were used, and by how much they came late [ns]."""
    stamps = map(stamp_ns_of, state.keypoint_stamps)
    return [(camera, stamp_ns_of(state.header.stamp) - ns) for camera, ns in zip(state.keypoint_cameras, stamps, strict=True)]


@pytest.mark.parametrize("pace", [[], ["--real-time"]])
def test_a_live_run_with_points_is_made_again_bit_for_bit(arguments: list[str], tmp_path: Path, start, pace: list[str]) -> None:
    arguments = [*arguments, *(["--rate", "6", "--end", "80"] if pace else [])]  # time for the detector, also on a busy machine
    pipeline = start("pipeline", *arguments, "--bag", str(tmp_path / "live/bag"), *pace)
    assert pipeline.process.wait(240) == 0, pipeline.text
    again = ["track", *arguments, "--from-run-bag", str(tmp_path / "live/bag"), "--output", str(tmp_path / "again"), "--quiet"]
    assert main(again) == 0
    before, after = states_of(tmp_path / "live/bag"), states_of(tmp_path / "again/bag")
    assert len(before) == len(after) >= 3
    for old, new in zip(before, after, strict=True):
        for name in ("values", "velocities", "score", "residual", "camera_residuals"):
            assert np.array(getattr(old, name)).tobytes() == np.array(getattr(new, name)).tobytes(), name
        assert (old.status, old.status_reason, used(old)) == (new.status, new.status_reason, used(new))
    late_ns = [late for state in before for _, late in used(state)]
    assert late_ns and min(late_ns) >= 0, pipeline.text
    if not pace:  # the tracker waits for points
        assert late_ns == [0] * 4 * len(before), pipeline.text
    seen, seen_again = ((tmp_path / run / "body.yaml").read_bytes() for run in ("live", "again"))
    assert seen == seen_again  # in its clothes
    with BagReader(tmp_path / "live/bag") as reader:
        assert all(reader.topics[f"/cam0{i}/keypoints"].message_count >= 1 for i in (1, 2, 3, 4))


def test_points_that_no_tracker_compares_are_recorded_all_the_same(arguments: list[str], tmp_path: Path, start) -> None:
    (tmp_path / "config.yaml").write_text("modalities: [region]\n")
    changed = [*arguments, "--config", str(tmp_path / "config.yaml"), "--keypoints", "on", "--rate", "8", "--real-time"]
    pipeline = start("pipeline", *changed, "--bag", str(tmp_path / "live"))
    assert pipeline.process.wait(240) == 0, pipeline.text
    with BagReader(tmp_path / "live") as reader:
        assert all(reader.topics[f"/cam0{i}/keypoints"].message_count >= 1 for i in (1, 2, 3, 4)), pipeline.text


def test_without_a_detector_the_pipeline_says_so_and_goes_on(arguments: list[str], tmp_path: Path, start, monkeypatch) -> None:
    (tmp_path / "ai_edge_litert.py").write_text("raise ModuleNotFoundError(name='ai_edge_litert')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    pipeline = start("pipeline", *arguments, "--end", "3", "--bag", str(tmp_path / "live"))
    assert pipeline.process.wait(240) in (0, 3), pipeline.text
    assert "without points of people" in pipeline.text and "pip install 'tracker_node[keypoints]'" in pipeline.text
    assert len(states_of(tmp_path / "live")) == 3
