"""``tracker_node synthesize``: complete folders, understandable refusals."""

import numpy as np
import pytest

from tracker_node.cli.main import main
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.motion.trajectory_file import read_joints
from tracker_node.model.configuration import Configuration
from tracker_node.synthesis.recording import Request, produce
from tracker_node.synthesis.scenes.scene import SceneConfig

TINY = SceneConfig(n_cameras=1, width=160, height=120, focal_px=145.0)


def test_the_mannequin_comes_with_a_model_that_fits_it(tmp_path, capsys):
    arguments = ["--images", "2", "--cameras", "1", "--size", "160x120", "--output", str(tmp_path)]
    assert main(["synthesize", *arguments]) == 0
    assert "wrote" in capsys.readouterr().out
    assert main(["synthesize", *arguments]) == 0
    assert "already there" in capsys.readouterr().out
    model = load_model(tmp_path / "person.yaml")
    landmarks = Configuration(model, load_state(tmp_path / "state.yaml", model)).landmarks_world
    truth = read_joints(tmp_path / "truth.csv")
    errors = [
        np.linalg.norm(landmarks[model.landmark_index(n)] - p) for n, p in zip(truth.names, truth.positions_m[0], strict=True)
    ]
    assert max(errors) < 0.03 and np.mean(errors) < 0.015
    legs = [np.linalg.norm(truth.positions_m[0][truth.names.index(a)] - truth.positions_m[0][truth.names.index(b)])
            for a, b in (("left_hip", "left_knee"), ("left_knee", "left_ankle"))]  # fmt: skip
    thigh = np.linalg.norm(model.landmark_positions[model.landmark_index("left_knee")])
    assert thigh == pytest.approx(legs[0], abs=0.004)


def test_the_trackers_own_model_starts_exactly_at_its_truth(tmp_path):
    assert produce(Request(subject="model", motion="waves", n_images=2, scene=TINY), tmp_path)
    assert not produce(Request(subject="model", motion="waves", n_images=2, scene=TINY), tmp_path)
    model = load_model(tmp_path / "person.yaml")
    landmarks = Configuration(model, load_state(tmp_path / "state.yaml", model)).landmarks_world
    np.testing.assert_allclose(landmarks, read_joints(tmp_path / "truth.csv").positions_m[0], atol=1e-9)


def test_the_model_can_do_what_the_mannequin_does(tmp_path):
    produce(Request(subject="model", motion="swing", n_images=3, scene=TINY), tmp_path / "model")
    produce(Request(subject="mannequin", motion="swing", n_images=3, scene=TINY), tmp_path / "mannequin")
    own, other = (read_joints(tmp_path / name / "truth.csv") for name in ("model", "mannequin"))
    columns = [own.names.index(name) for name in other.names]
    # They are of different build, but their joints are not far from each other.
    assert np.linalg.norm(own.positions_m[:, columns] - other.positions_m, axis=2).mean() < 0.06


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--size", "640"], "'--size': expected WIDTHxHEIGHT"),
        (["--cameras", "0"], "'--cameras': expected a number of at least 1, got 0"),
        (["--motion", "wlak", "--motions", "."], "no motion clips there"),
        (["--motion", "nowhere/walk.txt"], "no such motion file"),
        (["--subject", "model", "--model", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_mistakes_are_one_line(tmp_path, capsys, arguments, message):
    assert main(["synthesize", "--output", str(tmp_path / "out"), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()
