"""``calibrate robot`` on a small arm on a trunk that stands still, as a user runs it."""

import json

import numpy as np
import pytest

from helpers.cameras.small_clip import RATE_HZ, make_clip, swinging
from tracker_node.cli.main import main
from tracker_node.loaders.model.state_yaml import dump_state, load_state
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import State

N = 10
ZERO_RAD = 0.02  # what the robot says of its elbow is less by so much
OFF = np.array([0.02, -0.015, 0.01, 0.03, -0.04, 0.06, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """The clip, with what the robot says of its joints, and about where it is."""
    clip = make_clip(tmp_path_factory.mktemp("robot"), N, states=swinging(N))
    rows = [",".join(["stamp_ns", *(axis.name for axis in clip.model.chain.axes)])]
    for k, state in enumerate(clip.states):
        said = state.joint_positions - [0.0, 0.0, ZERO_RAD]
        rows.append(",".join([str(round(k * 1e9 / RATE_HZ)), *(f"{value:.9f}" for value in said)]))
    (clip.folder / "said.csv").write_text("\n".join(rows) + "\n")
    dump_state(State(clip.states[0].retract(OFF).T_world_root, np.zeros(3)), clip.model, clip.folder / "about.yaml")
    return clip


def calibrate(clip, output, *more) -> int:
    files = {
        "--rig": clip.rig_file, "--model": clip.model_file, "--initial-state": clip.folder / "about.yaml",
        "--joint-states": clip.folder / "said.csv", "-o": output,
    }  # fmt: skip
    return main(["calibrate", "robot", *(str(text) for pair in files.items() for text in pair), *map(str, more)])


def test_the_place_the_zeros_and_the_rig_on_the_base(robot, tmp_path, capsys):
    output, rig = tmp_path / "base.yaml", tmp_path / "rig/on_base.yaml"
    rig.parent.mkdir()
    assert calibrate(robot, output, "--rig-output", rig, "--zeros-sigma-deg", 2.0) == 0
    found, true = load_state(output, robot.model), robot.states[0]
    off = found.difference(true)
    assert np.linalg.norm(off[:3]) < 0.004 and np.degrees(np.linalg.norm(off[3:6])) < 1.5  # of pixels of a centimeter
    metrics = json.loads(output.with_suffix(".json").read_text())["metrics"]
    assert metrics["robot.sets"] == N and metrics["robot.median_after_px"] < metrics["robot.median_before_px"]
    zero, sigma = (metrics[f"robot.elbow_flexion.offset_{what}deg"] for what in ("", "sigma_"))
    assert abs(zero - np.degrees(ZERO_RAD)) < 3.0 * sigma + 0.5 and 0.0 < sigma < 2.0
    assert "zero of elbow_flexion" in capsys.readouterr().out
    assert "data:image/png" in output.with_suffix(".html").read_text()
    placed = load_rig(rig)
    assert placed.world_frame == "trunk"
    for camera in robot.rig:
        expected = np.linalg.inv(found.T_world_root) @ camera.T_world_cam
        np.testing.assert_allclose(placed[camera.name].T_world_cam, expected, atol=1e-6)
    assert calibrate(robot, output) == 2 and "is there already" in capsys.readouterr().err


def test_a_joint_of_which_nothing_is_said_is_as_in_the_state(robot, tmp_path, capsys):
    table = [line.split(",") for line in (robot.folder / "said.csv").read_text().splitlines()]
    said = tmp_path / "said.csv"
    said.write_text("\n".join(",".join([row[0], *row[2:]]) for row in table) + "\n")
    assert calibrate(robot, tmp_path / "base.yaml", "--joint-states", said, "--sets", 2) == 0
    assert "nothing is said of shoulder_x: as in" in capsys.readouterr().out
    assert load_state(tmp_path / "base.yaml", robot.model).joint_positions[0] == pytest.approx(0.0, abs=0.05)


def test_what_is_missing_is_named(robot, tmp_path, capsys):
    late = tmp_path / "late.csv"
    late.write_text("stamp_ns,shoulder_x,shoulder_y,elbow_flexion\n9000000000,0,0,0\n")
    assert calibrate(robot, tmp_path / "base.yaml", "--joint-states", late) == 2
    assert "nothing is said of the joints at the time of any image" in capsys.readouterr().err
    assert calibrate(robot, tmp_path / "base.yaml", "--sets", 1) == 2 and "--sets" in capsys.readouterr().err
    assert main(["calibrate", "robot", "--rig", str(robot.rig_file), "--model", str(robot.model_file)]) == 2
    assert "--initial-state" in capsys.readouterr().err
