"""``calibrate lights``: images and states of a body to a rig with its lights, and what is refused."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracker_node.cli.main import main
from tracker_node.loaders.model_yaml import dump_model
from tracker_node.loaders.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.loaders.state_yaml import dump_state
from tracker_node.model.configuration import Configuration
from tracker_node.model.yellow_stick import yellow_stick
from tracker_node.synthesis.cross import cross_rig, measured_lights, twisting_somersault
from tracker_node.synthesis.target_images import TargetStudio


@pytest.fixture
def folder(tmp_path):
    """Rig, model, two states, and images of two of the three cameras."""
    model, rig = yellow_stick(), cross_rig()
    rough = replace(rig, lights=measured_lights(rig.lights, np.random.default_rng(1)))
    write_rig_file(rig_file_of(rough), tmp_path / "rig.yaml")
    dump_model(model, tmp_path / "body.yaml")
    with TargetStudio(rig, "pyrender", supersampling=1, noise_levels=1.0) as studio:
        for k, field in enumerate((5, 25)):
            state = twisting_somersault(model).state(field)
            dump_state(state, model, tmp_path / f"pose{k}.yaml")
            (tmp_path / f"pose{k}").mkdir()
            for name, image in zip(rig.names[:2], studio.images(Configuration(model, state), None, k), strict=False):
                cv2.imwrite(str(tmp_path / f"pose{k}" / f"{name}.png"), image)
    return tmp_path


def arguments(folder, output="lit.yaml"):
    return [
        "calibrate", "lights", "--rig", f"{folder}/rig.yaml", "--model", f"{folder}/body.yaml",
        "--state", f"{folder}/pose0.yaml", f"{folder}/pose1.yaml",
        "--images", f"{folder}/pose0/{{name}}.png", f"{folder}/pose1/{{name}}.png", "-o", f"{folder}/{output}",
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

    (folder / "pose1" / "left.png").write_text("no picture")
    assert "left.png': cannot be read as an image" in said({})
    first, second = f"{folder}/pose0/{{name}}.png", f"{folder}/pose1/{{name}}.png"
    assert "there is no image of any camera" in said({first: "nowhere/{name}.png", second: "nowhere/{name}.png"})
    assert "expected a pattern with {name}" in said({second: "pose1/{camera}.png"})
    assert main([*arguments(folder), "--state", f"{folder}/pose0.yaml"]) == 2
    assert "one pattern for each of 1 states" in capsys.readouterr().err
    (folder / "lit.yaml").write_text("precious")
    assert main(arguments(folder)) == 2 and "is there already" in capsys.readouterr().err
    assert (folder / "lit.yaml").read_text() == "precious"
