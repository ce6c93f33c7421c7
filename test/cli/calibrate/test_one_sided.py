"""Bodies of people who lack a part, with a prosthesis or without, by the command that makes all bodies."""

import numpy as np
import pytest

from tracker_node.calibration.body import model_stature
from tracker_node.cli.main import main
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.motion.trc import MarkerTrajectories, dump_trc
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import gait_human
from tracker_node.model.humans.measures import MARKER_OF_LANDMARK, HumanMeasures
from tracker_node.model.variants import without_links

FOOT = """<robot name="prosthesis">
  <link name="left_foot">
    <visual><origin xyz="0.06 0 -0.04"/><geometry><box size="0.22 0.07 0.05"/></geometry></visual>
  </link>
</robot>
"""


@pytest.fixture
def foot(tmp_path):
    path = tmp_path / "foot.urdf"
    path.write_text(FOOT)
    return path


def test_by_stature(tmp_path, foot):
    out = tmp_path / "person.yaml"
    command = ["calibrate", "body", "--model", "gait_human", "--stature", "1.9", "-o", str(out), "--force"]
    assert main([*command, "--without", "right_hand", "left_toes", "--replace", f"left_foot={foot}"]) == 0
    body = load_model(out)
    assert not {"right_hand", "left_toes"} & set(body.chain.links) and "left_ankle_dorsiflexion" not in body.chain.dof_names
    assert {"right_wrist", "left_ankle"} <= set(body.landmark_names) and "left_heel" not in body.landmark_names
    box = next(shape for shape in body.shapes if shape.link == "left_foot").primitive
    assert box.size == pytest.approx((0.22, 0.07, 0.05))  # a prosthesis has the size that it has
    assert model_stature(body) == pytest.approx(1.9, abs=0.01)
    assert main([*command, "--without", "left_shank", "right_foot"]) == 0  # 1.9 m is what they would be with their feet
    assert load_model(out).chain.offsets[1] == pytest.approx(gait_human(HumanMeasures.of_stature(1.9)).chain.offsets[1], abs=1e-6)


@pytest.mark.parametrize("model", [["--model", "gait_human"], []])
def test_a_child(tmp_path, model):
    child, small = tmp_path / "child.yaml", tmp_path / "small.yaml"
    for path, options in ((child, ["--child"]), (small, [])):
        assert main(["calibrate", "body", *model, "--stature", "1.1", *options, "-o", str(path)]) == 0
    bodies = [load_model(path) for path in (child, small)]
    assert [model_stature(body) for body in bodies] == pytest.approx([1.1, 1.1], abs=1e-3)
    heads = [next(shape for shape in body.shapes if shape.name == "head").primitive.radii[2] for body in bodies]
    assert heads[0] / heads[1] == pytest.approx((1.1 / 1.75) ** -0.36, rel=0.01)
    assert bodies[0].chain.dof_names == bodies[1].chain.dof_names


def test_by_a_trial(tmp_path):
    """A trial of somebody with one shank: the other leg says how long both thighs are, toes stay where they are."""
    true = without_links(gait_human(HumanMeasures.of_stature(1.9)), ["left_shank"])
    names = [name for name in true.landmark_names if name in MARKER_OF_LANDMARK]
    places = Configuration(true, State.neutral(true)).landmarks_world[[true.landmark_index(name) for name in names]]
    markers = MarkerTrajectories(
        tuple(MARKER_OF_LANDMARK[name] for name in names), np.arange(3) / 60, np.tile(places, (3, 1, 1)), 60.0,
        np.ones((3, len(names)), bool),
    )  # fmt: skip
    dump_trc(markers, tmp_path / "static.trc")
    out = tmp_path / "person.yaml"
    command = ["calibrate", "body", "--model", "gait_human", "--trc", str(tmp_path / "static.trc"), "-o", str(out)]
    assert main([*command, "--without", "left_shank", "--joint-sigma-mm", "0"]) == 0
    body = load_model(out)
    assert body.chain.links == true.chain.links
    found = Configuration(body, State.neutral(body)).landmarks_world
    for name in names:
        assert found[body.landmark_index(name)] == pytest.approx(places[names.index(name)], abs=0.003), name


@pytest.mark.parametrize(("arguments", "message"), [
    (["--stature", "1.8", "--without", "left_wing"], "--without"),
    (["--stature", "1.8", "--child"], "0.8 to 1.75 meters of a child"),
    (["--trc", "a.trc", "--child"], "--stature alone"),
    (["--stature", "1.2", "--child", "--model", "nurbs_human"], "no --model but gait_human"),
    (["--stature", "1.8", "--without", "pelvis"], "--without"),
    (["--stature", "1.8", "--replace", "left_foot"], "LINK=FILE"),
    (["--stature", "1.8", "--replace", "pelvis=FOOT"], "--replace"),
    (["--stature", "1.8", "--replace", "left_foot=none.urdf"], "none.urdf"),
    (["--stature", "1.8", "--replace", "right_foot=FOOT"], "a link 'left_foot'"),
    (["--from-run", "out/run", "--without", "left_foot"], "--without, --replace"),
])  # fmt: skip
def test_mistakes_are_one_line(tmp_path, foot, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", "body", *(argument.replace("FOOT", str(foot)) for argument in arguments)]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
