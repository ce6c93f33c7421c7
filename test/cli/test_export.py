"""``tracker_node export`` as people call it: what comes out, what is said, what is refused."""

import json

import numpy as np
import pytest

from helpers.bodies.moving_person import moving, write_run
from helpers.bodies.stick_person import motion as stick_motion
from helpers.bodies.stick_person import write_state_bag
from helpers.bodies.two_links import two_links
from helpers.sources.small_disk import limited_files
from tracker_node.cli.export import FORMATS
from tracker_node.cli.main import main
from tracker_node.evaluation.truth.files import load_truth
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.motion.c3d_file import load_c3d
from tracker_node.loaders.motion.trc import load_table, load_trc


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("export") / "run", moving(30, gaps=(4,)), missing=(9,))


@pytest.mark.parametrize("to", FORMATS)
def test_every_format_comes_out_and_says_what_is_in_it(run, tmp_path, capsys, to):
    output = tmp_path / "new" / f"a.{to}"
    assert main(["export", str(run), "--to", to, "-o", str(output)]) == 0
    said = capsys.readouterr()
    assert said.out.startswith(f"wrote {output}: ") and "without a state" in said.out and said.err.count("Traceback") == 0
    assert output.is_dir() if to == "csv" else output.stat().st_size > 1000
    assert ("y up" in said.out) == (to in ("trc", "mot", "sto", "bvh"))


def test_lost_and_missing_sets_are_gaps(run, tmp_path):
    main(["export", str(run), "--to", "trc", "-o", str(tmp_path / "a.trc")])
    assert np.flatnonzero(~load_trc(tmp_path / "a.trc").valid[:, 0]).tolist() == [4, 9]
    main(["export", str(run), "--to", "c3d", "--lost", "keep", "-o", str(tmp_path / "a.c3d")])
    assert np.flatnonzero(~load_c3d(tmp_path / "a.c3d").valid[:, 0]).tolist() == [9]


def test_what_is_exported_serves_as_truth(run, tmp_path):
    found = []
    for to in ("trc", "c3d"):
        main(["export", str(run), "--to", to, "-o", str(tmp_path / f"a.{to}")])
        found.append(load_truth(tmp_path / f"a.{to}"))
    expected = moving(30).landmarks_m()[5]
    for truth in found:
        assert truth.positions_m[5] == pytest.approx(expected, abs=1e-6)
        assert truth.stamps_ns == pytest.approx(found[0].stamps_ns, abs=50)


def test_a_run_agrees_with_its_own_exports(run, tmp_path):
    truths = []
    for to in ("mot", "c3d"):
        main(["export", str(run), "--to", to, "-o", str(tmp_path / f"a.{to}")])
        truths += ["--truth", str(tmp_path / f"a.{to}")]
    options = ("--pictures", "0", "--name", "own", "--lag", "0", "--no-pdf")
    assert main(["evaluate", str(run), *truths, *options, "--output", str(tmp_path / "report")]) == 0
    figures = json.loads((tmp_path / "report" / "report.json").read_text())["metrics"]
    assert figures["own.judged_sets"] >= 27 and figures["own.mpjpe_mm"] < 1e-3
    assert figures["own.dof_max.left_knee_flexion_deg"] < 1e-4 and figures["own.dof_max.vertical_mm"] < 1e-3


def test_rate_units_names_and_filter(run, tmp_path, capsys):
    options = ["--rate", "120", "--length", "mm", "--up", "z", "--landmarks", "left_knee", "--marker-names", "openpose"]
    assert main(["export", str(run), "--to", "trc", *options, "--filter", "auto", "-o", str(tmp_path / "a.trc")]) == 0
    said = capsys.readouterr().err
    assert "interpolated to 120 Hz" in said and "filtered at" in said
    text = (tmp_path / "a.trc").read_text().splitlines()
    assert text[2].split("\t")[0] == "120" and text[2].split("\t")[4] == "mm" and "LKnee" in text[3]
    read = load_trc(tmp_path / "a.trc", y_up=False)
    reference = moving(30).landmarks_m()[20, moving(1).model.landmark_index("left_knee")]
    assert read.positions_m[40, 0] == pytest.approx(reference, abs=0.02)


def test_a_recording_of_another_body_needs_its_model(tmp_path, capsys):
    tracked = stick_motion(12)
    bag, model = write_state_bag(tmp_path / "bag", tracked), tmp_path / "person.yaml"
    dump_model(tracked.model, model)
    assert main(["export", str(bag), "--to", "bvh", "-o", str(tmp_path / "a.bvh")]) == 2
    assert "--model" in capsys.readouterr().err
    assert main(["export", str(bag), "--to", "mot", "--angle", "rad", "--model", str(model), "-o", str(tmp_path / "a.mot")]) == 0
    table = load_table(tmp_path / "a.mot")
    assert not table.in_degrees and len(table.times_s) == 12
    expected = [state.joint_positions[0] for state in tracked.states]
    assert table.values[:, table.names.index(tracked.model.chain.dof_names[6])] == pytest.approx(expected)


@pytest.mark.parametrize(("options", "complaint"), [
    (["--to", "trc", "--landmarks", "nose_tip"], "nose_tip"),
    (["--to", "trc", "--rate", "0"], "--rate"),
    (["--to", "trc", "--rate", "nan"], "--rate"),
    (["--to", "mot", "--length", "mm"], "--length"),
    (["--to", "bvh", "--angle", "rad"], "--angle"),
    (["--to", "mot", "--coordinates", "opensim", "--up", "z"], "--up"),
    (["--to", "tum", "--link", "tail"], "tail"),
    (["--to", "csv", "--filter", "fast"], "--filter"),
    (["--to", "csv", "--filter", "40"], "--filter"),
    (["--to", "mot", "--landmarks", "neck"], "--landmarks"),
    (["--to", "trc", "--isb-angles"], "--isb-angles"),
    (["--to", "bvh", "--link", "head"], "--link"),
    (["--to", "trc", "--landmarks", "neck", "nose", "neck"], "each name once, got 'neck'"),
    (["--to", "bvh", "--landmarks", "neck", "neck"], "landmarks"),
    (["--to", "mot", "--lost", "limbs"], "--lost"),
    (["--to", "bvh", "--lost", "limbs"], "--lost"),
])  # fmt: skip
def test_what_cannot_be_is_one_line_and_leaves_nothing(run, tmp_path, capsys, options, complaint):
    output = tmp_path / "out" / "a"
    assert main(["export", str(run), *options, "-o", str(output)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and complaint in said
    assert not output.exists()


@pytest.mark.parametrize("to", FORMATS)
def test_a_run_of_one_set_is_one_row_and_too_short_to_filter(tmp_path, capsys, to):
    folder = write_run(tmp_path / "run", moving(1))
    assert main(["export", str(folder), "--to", to, "-o", str(tmp_path / "a")]) == 0
    assert "1 time step," in capsys.readouterr().out
    assert main(["export", str(folder), "--to", to, "--filter", "auto", "-o", str(tmp_path / "b")]) == 2
    said = capsys.readouterr().err
    assert "--filter" in said and "at least 10 sets" in said and "Traceback" not in said and not (tmp_path / "b").exists()


def test_nothing_is_overwritten_unless_asked(run, tmp_path, capsys):
    kept, folder = tmp_path / "a.trc", tmp_path / "tables"
    kept.write_text("mine")
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    assert main(["export", str(run), "--to", "trc", "-o", str(kept)]) == 2
    assert main(["export", str(run), "--to", "csv", "-o", str(folder)]) == 2
    assert main(["export", str(run), "--to", "csv", "-o", str(kept)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 3 and kept.read_text() == "mine" and len(list(folder.iterdir())) == 1
    assert main(["export", str(run), "--to", "trc", "--force", "-o", str(kept)]) == 0
    assert kept.read_text().startswith("PathFileType")


def test_tables_of_an_earlier_export_do_not_stay_beside_the_new_ones(run, tmp_path):
    folder = tmp_path / "tables"
    assert main(["export", str(run), "--to", "csv", "--isb-angles", "--filter", "6", "-o", str(folder)]) == 0
    assert len(list(folder.iterdir())) == 12
    (folder / "notes.csv").write_text("mine")
    assert main(["export", str(run), "--to", "csv", "--force", "-o", str(folder)]) == 0
    assert {path.name for path in folder.iterdir()} == {"landmarks.csv", "center_of_mass.csv", "coordinates.csv", "notes.csv"}


def test_another_model_than_the_runs_is_refused(run, tmp_path, capsys):
    dump_model(two_links(), tmp_path / "arm.yaml")
    assert main(["export", str(run), "--to", "trc", "--model", str(tmp_path / "arm.yaml"), "-o", str(tmp_path / "a.trc")]) == 2
    assert "degrees of freedom" in capsys.readouterr().err


def test_angles_of_a_person_are_refused_for_a_body_that_is_none(tmp_path, capsys):
    folder = write_run(tmp_path / "run", moving(20, two_links()))
    assert main(["export", str(folder), "--to", "csv", "--isb-angles", "-o", str(tmp_path / "t")]) == 2
    assert main(["export", str(folder), "--to", "c3d", "-o", str(tmp_path / "a.c3d")]) == 2
    said = capsys.readouterr().err
    assert "segments of a person" in said and "landmarks" in said and said.count("\n") == 2 and "Traceback" not in said


@pytest.mark.parametrize("to", FORMATS)
def test_a_full_disk_spares_what_was_there(run, tmp_path, capsys, to):
    output = tmp_path / f"a.{to}"
    command = ["export", str(run), "--to", to, "-o", str(output), "--force"]

    def files() -> dict[str, bytes]:
        return {str(path.relative_to(tmp_path)): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    assert main(command) == 0
    before = files()
    capsys.readouterr()
    with limited_files(2000):  # what comes first fits, of a table too
        assert main([*command, "--rate", "120"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"a.{to}" in said and ("File too large" in said or "whole" in said)
    assert files() == before
    assert main([*command, "--rate", "120"]) == 0 and files().keys() == before.keys() and files() != before


@pytest.mark.parametrize("to", FORMATS)
def test_the_suffix_of_the_output_names_the_format(run, tmp_path, capsys, to):
    assert main(["export", str(run), "-o", str(tmp_path / f"a.{to.upper()}")]) == 0
    assert main(["export", str(run), "--to", to, "-o", str(tmp_path / "b.dat")]) == 0
    assert (tmp_path / f"a.{to.upper()}").is_dir() == (tmp_path / "b.dat").is_dir() == (to == "csv")


def test_a_format_and_a_suffix_that_contradict_each_other_are_refused(run, tmp_path, capsys):
    for arguments, words in (
        (["--to", "c3d", "-o", str(tmp_path / "x.trc")], ["--to", "trc", "--to c3d -o"]),
        (["-o", str(tmp_path / "x")], ["--to", "one of trc, mot, sto, c3d, bvh, tum, csv"]),
    ):
        assert main(["export", str(run), *arguments]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert all(word in line for word in words), line
    assert not list(tmp_path.iterdir())
