"""An offline run whose rig is wrong about a camera says so, and so does its report."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from helpers.cameras.small_clip import make_clip
from helpers.one_run import run_offline
from tracker_node.cli.main import main
from tracker_node.geometry import so3
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.model.configuration import Configuration
from tracker_node.runs.config_file import load_parameters
from tracker_node.runs.offline import OfflineRun
from tracker_node.tracking.config import from_dict

N = 45


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return make_clip(tmp_path_factory.mktemp("contradicted") / "clip", N)


def run(clip, rig_file, output):
    config = from_dict({**load_parameters(clip.config_file), "self_check": {"angle_deg": 0.5}})
    return run_offline(OfflineRun(load_rig(rig_file), clip.model, config, clip.states[0]), output)


def test_a_sound_rig_is_not_blamed(clip, tmp_path):
    assert run(clip, clip.rig_file, tmp_path / "run")["contradicted_cameras"] == []


def test_a_turned_camera_is_told_by_the_command_in_run_json_and_in_the_report(clip, tmp_path, capsys):
    rig = load_rig(clip.rig_file)
    T = rig["cam02"].T_world_cam.copy()
    T[:3, :3] = T[:3, :3] @ so3.exp(np.radians([1.5, 0.0, 0.0]))
    wrong = clip.folder / "wrong.yaml"
    cameras = tuple(replace(camera, T_world_cam=T) if camera.name == "cam02" else camera for camera in rig)
    write_rig_file(rig_file_of(replace(rig, cameras=cameras)), wrong)
    found = run(clip, wrong, tmp_path / "run")["contradicted_cameras"]
    assert found and all("cam02" in entry["said"] for entry in found)
    assert {entry["kind"] for entry in found} == {"turned"}
    parameters = tmp_path / "tracker.yaml"
    parameters.write_text(yaml.safe_dump({**load_parameters(clip.config_file), "self_check": {"angle_deg": 0.5}}))
    start = ["--initial-state", str(clip.state_file), "--config", str(parameters), "--output", str(tmp_path / "by_command")]
    assert main(["track", "--rig", str(wrong), "--model", str(clip.model_file), *start]) == 0
    assert f"track: {found[0]['said']}, in {found[0]['sets']} image sets (tracker_node rig check RIG)" in capsys.readouterr().err
    truth = tmp_path / "truth.csv"
    lines = ["stamp_ns,landmark,x,y,z"]
    for i, state in enumerate(clip.states):
        points = Configuration(clip.model, state).landmarks_world
        named = zip(clip.model.landmark_names, points, strict=True)
        lines += [f"{round(i * 1e9 / 30)},{name},{x},{y},{z}" for name, (x, y, z) in named]
    truth.write_text("\n".join(lines) + "\n")
    files = ["--truth", str(truth), "--model", str(clip.model_file), "--rig", str(clip.rig_file), "--pictures", "0"]
    assert main(["evaluate", str(tmp_path / "run"), *files, "--align", "first"]) == 0
    assert "is turned by" in (tmp_path / "run/report.html").read_text()
