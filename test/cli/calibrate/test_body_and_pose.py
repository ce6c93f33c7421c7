"""The commands ``calibrate body`` and ``calibrate pose``, from files to files."""

from dataclasses import replace

import numpy as np
import pytest

from tracker_node.calibration.body import model_stature
from tracker_node.cli.main import main
from tracker_node.geometry import se3
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.motion.c3d_file import dump_c3d
from tracker_node.loaders.motion.trajectory_file import StateRow, StateTrajectory, write_states
from tracker_node.loaders.motion.trc import MarkerTrajectories, dump_trc, load_trc
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.measures import MARKER_OF_LANDMARK, HumanMeasures

PERSON = human_model(HumanMeasures.of_stature(1.82))
STATE = State.neutral(PERSON, se3.exp(np.array([1.0, 0.5, 0.95, 0.0, 0.0, 1.0])))


@pytest.fixture
def trc_path(tmp_path):
    points = np.array([Configuration(PERSON, STATE).landmarks_world] * 3)
    names = tuple(MARKER_OF_LANDMARK[name] for name in PERSON.landmark_names)
    dump_trc(MarkerTrajectories(names, np.arange(3) / 60, points, 60.0, np.ones(points.shape[:2], bool)), tmp_path / "static.trc")
    return tmp_path / "static.trc"


def test_body_then_pose(trc_path, tmp_path, capsys):
    subject, start = tmp_path / "subject.yaml", tmp_path / "start.yaml"
    assert main(["calibrate", "body", "--trc", str(trc_path), "--y-up", "-o", str(subject)]) == 0
    said = capsys.readouterr().out
    assert "left_thigh" in said and "stature 1.8" in said
    model = load_model(subject)
    assert np.isclose(model_stature(model), 1.82, atol=0.01)
    assert main(["calibrate", "pose", "--model", str(subject), "--trc", str(trc_path), "--row", "2", "-o", str(start)]) == 0
    assert "21 landmarks" in capsys.readouterr().out
    state = load_state(start, model)
    assert np.allclose(Configuration(model, state).landmarks_world, Configuration(PERSON, STATE).landmarks_world, atol=0.01)


def test_body_from_stature(tmp_path):
    subject = tmp_path / "subject.yaml"
    assert main(["calibrate", "body", "--stature", "1.6", "-o", str(subject)]) == 0
    assert np.isclose(model_stature(load_model(subject)), 1.6)


def test_ankles_bend_unless_they_are_to_be_stiff(trc_path, tmp_path):
    for i, source in enumerate((["--stature", "1.6"], ["--trc", str(trc_path)])):
        bare, ankles = tmp_path / f"bare{i}.yaml", tmp_path / f"ankles{i}.yaml"
        assert main(["calibrate", "body", *source, "--stiff-ankles", "-o", str(bare)]) == 0
        assert main(["calibrate", "body", *source, "-o", str(ankles)]) == 0
        added = set(load_model(ankles).chain.dof_names) - set(load_model(bare).chain.dof_names)
        assert added == {"left_ankle_dorsiflexion", "right_ankle_dorsiflexion"}


def test_what_is_there_stays_unless_forced(trc_path, tmp_path, capsys):
    subject, start = tmp_path / "subject.yaml", tmp_path / "start.yaml"
    body = ["calibrate", "body", "--stature", "1.6", "-o", str(subject)]
    pose = ["calibrate", "pose", "--model", str(subject), "--trc", str(trc_path), "-o", str(start)]
    for command, output in ((body, subject), (pose, start)):
        assert main(command) == 0
        written = output.read_text()
        output.write_text("mine")
        capsys.readouterr()
        assert main(command) == 2
        assert f"{output} is there already" in capsys.readouterr().err and output.read_text() == "mine"
        assert main([*command, "--force"]) == 0 and output.read_text() == written


def test_landmarks_from_a_tracked_trial(trc_path, tmp_path):
    """The body was seen 3 cm below the joints: its landmarks go up by 3 cm, its size stays."""
    base, states, placed = (tmp_path / name for name in ("base.yaml", "states.csv", "placed.yaml"))
    main(["calibrate", "body", "--stature", "1.82", "--stiff-ankles", "-o", str(base)])
    model = load_model(base)
    lower = STATE.retract(np.array([0, 0, -0.03] + [0.0] * 37))
    rows = tuple(StateRow(int(i * 1e9 / 60), "TRACKING", "", lower.to_values()) for i in range(3))
    write_states(states, StateTrajectory(model.chain.dof_names, rows))
    arguments = ["--model", str(base), "--trc", str(trc_path), "--states", str(states), "-o", str(placed)]
    assert main(["calibrate", "body", *arguments]) == 0
    moved = load_model(placed).landmark_positions - model.landmark_positions
    assert np.allclose(moved[:, 2], 0.03, atol=1e-3)
    assert np.allclose(load_model(placed).chain.offsets, model.chain.offsets)


@pytest.mark.parametrize(("arguments", "message"), [
    (["body"], "--trc"),
    (["body", "--stature", "18"], "0.4 to 3 meters"),
    (["body", "--stature", "1.8", "--joint-sigma-mm", "-1"], "--joint-sigma-mm"),
    (["body", "--stature", "1.8", "--stiff-ankles", "--model", "MODEL"], "--stiff-ankles"),
    (["body", "--from-run", "out/run", "--stiff-ankles"], "--stiff-ankles"),
    (["body", "--from-points", "rig.yaml", "--stiff-ankles", "--model", "MODEL"], "--stiff-ankles"),
    (["body", "--trc", "none.trc"], "none.trc"),
    (["body", "--trc", "TRC", "--states", "s.csv"], "--states"),
    (["pose", "--model", "none.yaml", "--trc", "TRC"], "none.yaml"),
    (["pose", "--model", "MODEL", "--trc", "TRC", "--row", "9"], "0 to 2"),
])  # fmt: skip
def test_mistakes_are_one_line_and_status_two(trc_path, tmp_path, repository, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    places = {"TRC": str(trc_path), "MODEL": str(repository / "config" / "models" / "human.yaml")}
    assert main(["calibrate", *(places.get(argument, argument) for argument in arguments)]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1


def test_markers_that_are_not_the_bodys_are_named(tmp_path, capsys):
    points = np.ones((2, 2, 3))
    dump_trc(MarkerTrajectories(("A", "B"), np.arange(2) / 60, points, 60.0, np.ones((2, 2), bool)), tmp_path / "x.trc")
    assert main(["calibrate", "body", "--trc", str(tmp_path / "x.trc")]) == 2
    assert "x.trc" in capsys.readouterr().err


def test_a_c3d_is_as_good_as_a_trc_and_its_subject_no_matter(trc_path, tmp_path, capsys):
    """Every C3D was refused, and markers named Anna:LKnee were none."""
    markers = load_trc(trc_path)
    dump_c3d(replace(markers, names=tuple(f"Anna:{name}" for name in markers.names)), tmp_path / "static.c3d")
    subject = tmp_path / "subject.yaml"
    for file in (trc_path, tmp_path / "static.c3d"):
        assert main(["calibrate", "body", "--trc", str(file), "-o", str(subject), "--force"]) == 0
        assert "stature 1.820 m" in capsys.readouterr().out
    assert main(["calibrate", "pose", "--model", str(subject), "--trc", str(file), "-o", str(tmp_path / "start.yaml")]) == 0
    assert "21 landmarks" in capsys.readouterr().out
    assert main(["calibrate", "body", "--trc", str(tmp_path / "none.c3d"), "-o", str(subject), "--force"]) == 2
    assert "expected a readable TRC or C3D file" in capsys.readouterr().err


def test_markers_that_are_not_understood_are_named(trc_path, tmp_path, capsys):
    """Joint centers of Plug-in Gait are known; its markers on the skin are not, and were left out without a word."""
    text = trc_path.read_text().replace("LHip", "LHJC").replace("RHip", "RHJC").replace("LKnee", "LKNE")
    trc_path.write_text(text)
    assert main(["calibrate", "body", "--trc", str(trc_path), "-o", str(tmp_path / "a.yaml")]) == 0
    said = capsys.readouterr().out
    assert "note: 1 of 21 markers are no landmarks of the body: LKNE\n" in said and "right_thigh" in said
    trc_path.write_text(text.replace("HJC", "ASI").replace("Head", "FHD").replace("Knee", "KNE"))
    assert main(["calibrate", "body", "--trc", str(trc_path), "-o", str(tmp_path / "a.yaml"), "--force"]) == 0
    assert "the person's size is a guess (--stature)" in capsys.readouterr().out


@pytest.mark.parametrize(("says", "has"), [("m", "mm"), ("mm", "m"), ("cm", "mm")])
def test_a_trial_in_another_unit_is_no_person(trc_path, tmp_path, capsys, says, has):
    """It made a body of 1810 m, or of 2 mm."""
    markers = load_trc(trc_path)
    dump_trc(markers, trc_path, unit=has)
    trc_path.write_text(trc_path.read_text().replace(f"\t{has}\t", f"\t{says}\t", 1))
    assert main(["calibrate", "body", "--trc", str(trc_path), "-o", str(tmp_path / "a.yaml")]) == 2
    assert f"the file says {says}, its lengths look like those of {has}'" in capsys.readouterr().err
    assert not (tmp_path / "a.yaml").exists()


@pytest.mark.parametrize(("stature", "is_said"), [("1.2", True), ("1.78", False)])
def test_a_stature_that_the_trial_contradicts_is_said(trc_path, tmp_path, capsys, stature, is_said):
    assert main(["calibrate", "body", "--trc", str(trc_path), "--stature", stature, "-o", str(tmp_path / "a.yaml")]) == 0
    assert ("the lengths of the trial are those of a person of 1.8" in capsys.readouterr().out) == is_said


def test_help_has_an_example(capsys):
    for verb in (["calibrate"], ["calibrate", "body"], ["calibrate", "pose"]):
        with pytest.raises(SystemExit) as exit_:
            main([*verb, "--help"])
        assert exit_.value.code == 0
        assert "example:" in capsys.readouterr().out
