"""``track --smooth`` on a small clip with the real tracker."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.cameras.small_clip import RATE_HZ, Clip, make_clip
from helpers.sources.tables import read_numbers
from tracker_node.cli.main import main
from tracker_node.loaders.motion.trajectory_file import read_covariances, read_joints, read_states
from tracker_node.model.configuration import Configuration, State
from tracker_node.runs.load import load_run

N_IMAGES = 12


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    return make_clip(tmp_path_factory.mktemp("clip"), N_IMAGES)


def tracked(clip: Clip, output: Path, *options: str) -> int:
    return main(["track", *clip.arguments(), "--output", str(output), "--quiet", *options])


def errors_m(clip: Clip, values: np.ndarray) -> np.ndarray:
    """(n, n_landmarks) distances from where landmarks are."""
    found = np.array([Configuration(clip.model, State.from_values(v)).landmarks_world for v in values])
    truth = np.array([Configuration(clip.model, state).landmarks_world for state in clip.states])
    return np.linalg.norm(found - truth, axis=-1)


def test_smoothed_files_stand_beside_those_of_the_tracker(clip, tmp_path):
    assert tracked(clip, tmp_path / "run", "--smooth") == 0
    run, smoothed = tmp_path / "run", tmp_path / "run" / "smoothed"
    filtered, states = read_states(run / "states.csv"), read_states(smoothed / "states.csv")
    assert states.stamps_ns.tolist() == filtered.stamps_ns.tolist()
    assert states.status == filtered.status
    assert not np.array_equal(states.values, filtered.values)
    np.testing.assert_allclose(states.values[-1], filtered.values[-1], atol=5e-3)  # nothing came after: only motion is calmer
    assert errors_m(clip, states.values).mean() < errors_m(clip, filtered.values).mean()

    configurations = [Configuration(clip.model, State.from_values(v)) for v in states.values]
    joints = read_joints(smoothed / "joints.csv")
    np.testing.assert_allclose(joints.positions_m, [c.landmarks_world for c in configurations], atol=1e-9)
    _, poses = read_numbers(smoothed / "poses.csv")
    roots = [c.state.T_world_root for c in configurations]
    np.testing.assert_allclose(poses[:, :3], [T[:3, 3] for T in roots], atol=1e-9)
    np.testing.assert_allclose(Rotation.from_quat(poses[:, 3:]).as_matrix(), [T[:3, :3] for T in roots], atol=1e-9)
    covariances = read_covariances(smoothed / "covariances.csv")
    stamps_ns, velocities = read_numbers(smoothed / "velocities.csv")
    assert stamps_ns.tolist() == states.stamps_ns.tolist() == covariances.stamps_ns.tolist()
    truth = [b.difference(a) * RATE_HZ / 2 for a, b in zip(clip.states[:-2], clip.states[2:], strict=True)]
    off = np.abs(velocities[1:-1] - truth)
    assert off[3:-3].mean() < 0.25
    sigmas = np.sqrt(np.diagonal(covariances.velocity, axis1=1, axis2=2))[1:-1]
    assert (off < 4.0 * sigmas).mean() > 0.95
    assert len(load_run(smoothed)) == N_IMAGES  # what `evaluate` reads
    assert json.loads((run / "run.json").read_text())["options"]["smooth"] == "all"


def test_a_fixed_lag_looks_only_so_far_ahead(clip, tmp_path):
    """The end of the clip is changed; what is older than the lag is as it was."""
    other = shutil.copytree(clip.folder, tmp_path / "clip")
    for folder in (other / "cam01", other / "cam02", other / "cam03"):
        last = sorted(folder.glob("*.png"))
        shutil.copy(last[-3], last[-1])
    rows = {}
    for name, folder in (("a", clip.folder), ("b", other)):
        paths = {"--rig": "rig.yaml", "--model": "model.yaml", "--config": "config.yaml", "--initial-state": "start.yaml"}
        files = [text for option, file in paths.items() for text in (option, str(folder / file))]
        output = tmp_path / name
        assert main(["track", *files, "--output", str(output), "--quiet", "--smooth", "0.09"]) == 0
        rows[name] = read_states(output / "smoothed/states.csv").values
    same = (rows["a"] == rows["b"]).all(axis=1)
    assert same[: N_IMAGES - 4].all() and not same[-3:].any()


def test_what_cannot_be_smoothed_is_said(clip, tmp_path, capsys):
    assert tracked(clip, tmp_path / "run", "--smooth", "0") == 2
    assert "--smooth" in capsys.readouterr().err
    config = tmp_path / "color.yaml"
    config.write_text("/**:\n  ros__parameters:\n    modalities: [color]\n")
    assert tracked(clip, tmp_path / "run", "--smooth", "--config", str(config)) == 2
    assert "takes contours" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
