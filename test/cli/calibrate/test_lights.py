"""``calibrate lights``: images and states of a body to a rig with its lights, and what is refused."""

import numpy as np
import pytest

from helpers.cameras.cross_files import write_lit_cross
from tracker_node.cli.main import main
from tracker_node.experiments.cross.throw import cross_rig
from tracker_node.loaders.rig.rig_yaml import load_rig


@pytest.fixture
def folder(tmp_path):
    """Rig, model, two states, and images of two of the three cameras."""
    write_lit_cross(tmp_path)
    return tmp_path


def arguments(folder, output="lit.yaml"):
    return [
        "calibrate", "lights", "--rig", f"{folder}/rig.yaml", "--model", f"{folder}/body.yaml",
        "--state", f"{folder}/pose1.yaml", f"{folder}/pose2.yaml",
        "--images", f"{folder}/pose1/{{name}}.png", f"{folder}/pose2/{{name}}.png", "-o", f"{folder}/{output}",
    ]  # fmt: skip


def test_a_rig_with_its_lights(folder, capsys):
    assert main(arguments(folder)) == 0
    said, found, true = capsys.readouterr().out, load_rig(folder / "lit.yaml"), cross_rig()
    assert "no images of top" in said and "known to" in said
    assert [light.kind for light in found.lights] == ["ambient", "spot", "spot"]
    before = load_rig(folder / "rig.yaml")
    assert found["top"].gain == true["top"].gain and found["left"].gain == true["left"].gain
    assert found["right"].gamma == pytest.approx(2.2, rel=0.2)
    np.testing.assert_allclose(found["right"].T_world_cam, before["right"].T_world_cam)
    rows = {line.split()[0]: line.split() for line in said.splitlines()}
    assert all(float(rows[name][4]) < 2.0 < float(rows[name][2]) for name in ("left", "right"))


def test_lights_alone(folder):
    assert main([*arguments(folder), "--keep-cameras"]) == 0
    found, before, true = load_rig(folder / "lit.yaml"), load_rig(folder / "rig.yaml"), cross_rig()
    assert [c.gamma for c in found] == [c.gamma for c in true]
    intensities = [np.array([light.intensity for light in rig.lights]) for rig in (found, before, true)]
    assert np.abs(intensities[0] - intensities[2]).max() < 0.5 * np.abs(intensities[1] - intensities[2]).max()


def test_bad_input_is_named_and_nothing_written(folder, capsys):
    def said(changes):
        command = [changes.get(argument, argument) for argument in arguments(folder)]
        assert main(command) == 2 and not (folder / "lit.yaml").exists()
        message = capsys.readouterr().err
        assert message.count("\n") == 1
        return message

    (folder / "pose2" / "left.png").write_text("no picture")
    assert "left.png': cannot be read as an image" in said({})
    first, second = f"{folder}/pose1/{{name}}.png", f"{folder}/pose2/{{name}}.png"
    assert "there is no image of any camera" in said({first: "nowhere/{name}.png", second: "nowhere/{name}.png"})
    assert "expected a pattern with {name}" in said({second: "pose2/{camera}.png"})
    assert main([*arguments(folder), "--state", f"{folder}/pose1.yaml"]) == 2
    assert "one pattern for each of 1 states" in capsys.readouterr().err
    (folder / "lit.yaml").write_text("precious")
    assert main(arguments(folder)) == 2 and "is there already" in capsys.readouterr().err
    assert (folder / "lit.yaml").read_text() == "precious"
