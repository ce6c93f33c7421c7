"""`evaluate` and `export` give what the command line gives."""

import json

import pytest

from helpers.bodies.moving_person import moving, write_run
from tracker_node import TrackerError, evaluate, export, load_run
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError


@pytest.fixture(scope="module")
def run(folder):
    return load_run(folder / "by_command")


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    return load_run(write_run(tmp_path_factory.mktemp("person") / "run", moving(40, gaps=(4,))))


def test_metrics_are_those_of_the_report(run, folder, tmp_path):
    truth, given = folder / "truth.csv", ("--pictures", "0", "--no-pdf", "--output", str(tmp_path))
    assert main(["evaluate", str(run.path), "--truth", str(truth), *given]) == 0
    reported = json.loads((tmp_path / "report.json").read_text())["metrics"]
    metrics = evaluate(run, truth)
    assert metrics["mpjpe_mm"] > 0.0 and metrics["judged_sets"] == 6
    assert {f"run.{key}": value for key, value in metrics.items() if value == value} == {
        key: value for key, value in reported.items() if value is not None and not key.startswith("run.iou_")
    }


def test_without_truth_a_run_says_what_it_knows_itself(run):
    metrics = evaluate(run)
    assert metrics["image_sets"] == 6 and "mpjpe_mm" not in metrics and metrics["said_lost_sets"] == 0


def test_truth_of_two_kinds_and_its_lag(run, folder):
    both = evaluate(run, [folder / "truth.csv", folder / "by_command" / "states.csv"], lag_images=0.0)
    assert both["lag_images"] == 0.0 and both["dof_max.elbow_flexion_deg"] == 0.0
    with pytest.raises(TrackerError, match="expected one file with joints"):
        evaluate(run, [folder / "truth.csv", folder / "truth.csv"])
    for lag in ("auto", float("nan")):
        with pytest.raises(ValueError, match="lag_images: expected a number of images, or None to estimate it, got"):
            evaluate(run, folder / "truth.csv", lag_images=lag)
    with pytest.raises(ValueError, match="align: expected one of auto, first, stamp, got 'last'"):
        evaluate(run, folder / "truth.csv", align="last")


@pytest.mark.parametrize(("name", "arguments", "options"), [
    ("a.trc", ["--length", "mm", "--landmarks", "left_knee"], {"length": "mm", "landmarks": ["left_knee"]}),
    ("a.mot", ["--filter", "6"], {"filter_hz": 6.0}),
    ("a.bvh", ["--rate", "30"], {"rate_hz": 30.0}),
    ("a.sto", ["--coordinates", "opensim", "--angle", "rad"], {"coordinates": "opensim", "angle": "rad"}),
    ("a.tum", ["--link", "head", "--lost", "keep"], {"link": "head", "lost": "keep"}),
    ("a.c3d", ["--isb-angles", "--marker-names", "openpose"], {"isb_angles": True, "marker_names": "openpose"}),
])  # fmt: skip
def test_files_are_those_of_the_command_line(person, tmp_path, capsys, name, arguments, options):
    (tmp_path / "command").mkdir()
    assert main(["export", str(person.path), *arguments, "-o", str(tmp_path / "command" / name)]) == 0
    said = capsys.readouterr().err
    assert export(person, tmp_path / "new" / name, **options) == [line.strip() for line in said.splitlines()]
    assert (tmp_path / "new" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()


def test_csv_is_a_folder_of_tables(person, tmp_path):
    (note,) = export(person, tmp_path / "tables", "csv")
    assert note == "tables: landmarks.csv, center_of_mass.csv, coordinates.csv"
    assert {path.name for path in (tmp_path / "tables").iterdir()} == {"landmarks.csv", "center_of_mass.csv", "coordinates.csv"}


def test_nothing_is_overwritten_unless_asked(person, tmp_path):
    export(person, tmp_path / "a.trc")
    with pytest.raises(TrackerError, match="overwrite=True"):
        export(person, tmp_path / "a.trc")
    export(person, tmp_path / "a.trc", overwrite=True)


@pytest.mark.parametrize(("options", "complaint"), [
    ({"to": "xlsx"}, "field 'to'"),
    ({"to": "mot", "landmarks": ["neck"]}, "field 'landmarks'"),
    ({"to": "trc", "length": "inch"}, "field 'length': expected one of m, cm, mm"),
    ({"to": "trc", "lost": "hide"}, "field 'lost'"),
    ({"to": "csv", "filter_hz": "fast"}, "field 'filter_hz'"),
])  # fmt: skip
def test_what_cannot_be_is_named_and_leaves_nothing(person, tmp_path, options, complaint):
    with pytest.raises(FileFormatError, match=complaint):
        export(person, tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()
