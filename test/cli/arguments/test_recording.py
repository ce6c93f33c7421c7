"""``recording.yaml`` on the command line: what ``evaluate`` is asked for."""

import argparse
from pathlib import Path
from types import SimpleNamespace

import pytest

from tracker_node.cli.arguments.recording import add_recording_argument, evaluate_recording, evaluation_of, fill_in
from tracker_node.errors import TrackerError


def recording(**evaluate):
    entry = {
        "name": "walk",
        "align": "stamp",
        "lag": 0.5,
        "image_sets": 90,
        "truth": [],
        "y_up": None,
        "masks": None,
        "targets": [],
    }
    return SimpleNamespace(evaluate=SimpleNamespace(**{**entry, **evaluate}), images=SimpleNamespace(start=3, end=9))


def args(**given):
    return argparse.Namespace(**{"model": Path("m.yaml"), "rig": Path("r.yaml"), "start": 3, "end": 9, **given})


PLAIN = [
    *("evaluate", "out/run", "--rig", "r.yaml", "--name", "walk", "--align", "stamp", "--lag", "0.5"),
    *("--first-image", "3", "--output", "out/report"),
]


def asked(entry, **given):
    return evaluation_of(entry, args(**given), {"": Path("out/run")}, Path("out/report"))


def test_a_run_of_the_whole_recording_has_its_number_of_sets():
    assert asked(recording()) == [*PLAIN, "--image-sets", "90"]
    assert asked(recording(), max_sets=None) == [*PLAIN, "--image-sets", "90"]
    assert asked(recording(), max_sets=5) == PLAIN and asked(recording(), end=8) == PLAIN
    elsewhere = asked(recording(), start=4)
    assert "--image-sets" not in elsewhere and elsewhere[elsewhere.index("--first-image") + 1] == "4"


def test_truth_masks_and_targets():
    entry = recording(truth=["a.trc", "b.mot"], masks="masks.json", targets=["x<=1", "y>=2"], y_up=True)
    rest = ["--truth", "a.trc", "--truth", "b.mot", "--y-up", "--masks", "masks.json", "--target", "x<=1", "--target", "y>=2"]
    assert asked(entry) == [*PLAIN, "--image-sets", "90", *rest]
    assert asked(recording(y_up=False))[-1] == "--no-y-up"


def test_several_runs_are_compared():
    found = evaluation_of(recording(), args(), {"_a": Path("out/a"), "": Path("out/b")}, Path("out/report"))
    assert found[:3] == ["evaluate", "out/a", "out/b"] and found[5:9] == ["--name", "walk_a", "--name", "walk"]
    assert found[9:] == [*PLAIN[6:], "--image-sets", "90"]


def test_nothing_is_evaluated_where_nothing_is_named():
    entry = SimpleNamespace(evaluate=None)
    assert asked(entry) == [] and evaluate_recording(entry, args(), Path("run"), Path("out")) == 0


def test_the_status_is_that_of_evaluate(tmp_path, capsys):
    given = args(model=tmp_path / "m.yaml", rig=tmp_path / "r.yaml")
    assert evaluate_recording(recording(), given, tmp_path / "run", tmp_path / "out") == 2
    said = capsys.readouterr()
    assert said.out.startswith(f"$ tracker_node evaluate {tmp_path}/run --rig ") and "tracker_node evaluate: error" in said.err


def parsed(*argv):
    parser = argparse.ArgumentParser()
    for name in ("rig", "model", "start"):
        parser.add_argument(f"--{name}", default="of the parser")
    add_recording_argument(parser, {"rig": None, "model": None, "start": 0})
    return parser.parse_args(argv)


def test_what_is_not_given_is_built_in():
    given = parsed("--rig", "r.yaml", "--model", "m.yaml")
    assert given.recording is None and given.start is None
    assert fill_in(given, {"start": 7, "unknown": 1}) is None
    assert (given.start, given.rig) == (7, "r.yaml") and not hasattr(given, "unknown")
    given = parsed("--rig", "r.yaml", "--model", "m.yaml", "--start", "2")
    fill_in(given, {"start": 7})
    assert given.start == "2"


@pytest.mark.parametrize("asked", [(), ("--no-evaluate",)])
def test_an_evaluation_can_be_left_out(tmp_path, asked):
    for name in ("r.yaml", "m.yaml"):
        (tmp_path / name).touch()
    (tmp_path / "recording.yaml").write_text("{rig: r.yaml, model: m.yaml, output: run, evaluate: {name: walk}}")
    parser = argparse.ArgumentParser()
    add_recording_argument(parser, {"rig": None, "model": None})
    given = parser.parse_args([str(tmp_path / "recording.yaml"), *asked])
    found = fill_in(given, {"rig": None, "model": None})
    assert (found.evaluate is None) == bool(asked) and given.rig == tmp_path / "r.yaml"


@pytest.mark.parametrize("given", [(), ("--rig", "r.yaml"), ("--model", "m.yaml")])
def test_rig_and_model_are_needed(given):
    with pytest.raises(TrackerError, match=r"give a recording.yaml, or --rig and --model"):
        fill_in(parsed(*given), {"start": 0})
