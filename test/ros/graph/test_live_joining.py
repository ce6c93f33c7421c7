"""Somebody who comes into the images of a graph: found by the real detector, and described as the body that was found."""

from dataclasses import replace
from pathlib import Path

import pytest

from tracker_node.errors import TrackerError

pytest.importorskip("rclpy", reason="ROS is not installed")
pytest.importorskip("ai_edge_litert", reason="the extra keypoints is not installed")

from benchmark.clothed._clip import write_clip
from benchmark.clothed._staging import Sources, set_stage
from benchmark.clothed.person._body import MANNEQUIN
from benchmark.ros.points import clothed
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.humans.human import human_model
from tracker_node.tracking.estimate import Status

pytestmark = pytest.mark.long
N_EMPTY, N_IMAGES, N_ROUNDS = 4, 10, 2


def images(folder: Path, camera: Camera) -> Path:
    """The empty room, then somebody, forward and backward."""
    files, links = sorted(Path(camera.source).glob("[0-9]*.*")), folder / camera.name
    links.mkdir()
    empty = [Path(camera.background)] * N_EMPTY
    for i, file in enumerate([*empty, *[*files, *reversed(files)] * N_ROUNDS]):
        (links / f"{i:04d}{files[0].suffix}").symlink_to(file)
    return links


def test_who_comes_is_published_as_a_body_of_its_own(tmp_path: Path, start) -> None:
    try:
        pose_weights()
    except TrackerError as error:
        pytest.skip(str(error))
    write_clip(set_stage(1, Sources(tmp_path, None, MANNEQUIN, "guard"), N_IMAGES), tmp_path / "clip")
    rig = clothed(tmp_path / "clip").rig
    cameras = tuple(replace(camera, source=str(images(tmp_path, camera))) for camera in rig)
    write_rig_file(rig_file_of(CameraRig(cameras)), tmp_path / "rig.yaml")
    dump_model(human_model(), tmp_path / "human.yaml")
    recording = tmp_path / "recording.yaml"
    recording.write_text("rig: rig.yaml\noutput: out\nimages: {rate_hz: 30}\njoining: {model: human.yaml, most: 2}\n")
    pipeline = start("pipeline", str(recording))
    assert pipeline.process.wait(300) == 0, pipeline.text
    assert "person_1: " in pipeline.text and "person_2: " not in pipeline.text
    found = load_model(tmp_path / "out/person_1/model.yaml")
    assert not (tmp_path / "out/person_2").exists()
    with BagReader(tmp_path / "out/bag") as bag:
        of = {name: [m for _, m in bag.decoded(f"/tracker/{name}/state")] for name in ("person_1", "person_2")}
        together = [message for _, message in bag.decoded("/tracker/bodies")]
        described = [message.data for _, message in bag.decoded("/person_1/robot_description")]
        diagnosed = [s for _, m in bag.decoded("/diagnostics") for s in m.status if s.name == "tracker: person_2: status"]
    n = N_EMPTY + 2 * N_IMAGES * N_ROUNDS
    statuses = [Status(message.status) for message in of["person_1"]]
    assert len(statuses) == len(of["person_2"]) == len(together) == n
    came = statuses.index(Status.TRACKING)
    assert N_EMPTY + 3 <= came <= N_EMPTY + 20 and set(statuses[:came]) == {Status.INITIALIZING}
    assert Status.LOST not in statuses and statuses.count(Status.TRACKING) > n // 3
    assert {message.status_reason for message in of["person_2"]} == {"nobody has come yet"}
    assert {tuple(message.names) for message in together} == {("person_1", "person_2")}
    assert len(described) == 2 and described[0] != described[1]  # of whoever comes, and of who came
    assert found.landmark_names == human_model().landmark_names
    assert diagnosed and {int(status.level) for status in diagnosed} == {0}
