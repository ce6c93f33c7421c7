"""The one console command: which verb is run, and what its ends come to."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from tracker_node import __version__
from tracker_node.cli import main as module
from tracker_node.cli.main import main, module_of, verbs
from tracker_node.errors import TrackerError


def ending(monkeypatch, act, verb="layouts"):
    """Make a verb do this, and return what it was given."""
    given = []

    def run(args):
        given.append(args)
        return act()

    made = SimpleNamespace(SUMMARY="a summary", EXAMPLE="an example", add_arguments=lambda parser: None, run=run)
    real = module.importlib.import_module
    chosen = module_of(verb)
    monkeypatch.setattr(module, "importlib", SimpleNamespace(import_module=lambda name: made if name == chosen else real(name)))
    return given


def failing(error):
    def act():
        raise error

    return act


def test_verbs_are_the_modules_that_are_not_hidden():
    assert {"sample", "tracker", "bag", "evaluate"} <= set(verbs())
    assert "main" not in verbs() and not any(verb.startswith("_") for verb in verbs()) and verbs() == sorted(verbs())


def test_the_overview_names_every_verb(capsys):
    for argv in ([], ["-h"], ["--help"], ["help"], ["help", "me"]):
        assert main(argv) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == "usage: tracker_node <verb> [options]" and lines[2] == "verbs:"
        assert [line.split()[0] for line in lines[3 : 3 + len(verbs())]] == verbs()
        assert lines[-1] == "  tracker_node track --help"
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"tracker_node {__version__}\n"


def test_the_package_runs_as_a_module():
    command = [sys.executable, "-P", "-m", "tracker_node", "--version"]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == f"tracker_node {__version__}\n"


@pytest.mark.parametrize("verb", ["juggle", "--juggle", "_bag_info", "main"])
def test_unknown_verbs_are_refused(verb, capsys):
    assert main([verb]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err == f"tracker_node: unknown verb '{verb}'; valid: {', '.join(verbs())}\n"


@pytest.mark.parametrize(("returned", "status"), [(None, 0), (0, 0), (3, 3)])
def test_the_status_is_the_verbs(monkeypatch, returned, status):
    ending(monkeypatch, lambda: returned)
    assert main(["layouts"]) == status


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (TrackerError("no rig"), "no rig"),
        (OSError(28, "No space left on device", "out/run"), "out/run: No space left on device"),
        (OSError(28, "No space left on device"), "No space left on device"),
        (OSError("odd"), "odd"),
    ],
)
def test_mistakes_and_disks_are_said_in_a_line(monkeypatch, capsys, error, line):
    ending(monkeypatch, failing(error))
    assert main(["layouts"]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err == f"tracker_node layouts: error: {line}\n"


def test_other_ends_have_their_own_status(monkeypatch, capsys):
    ending(monkeypatch, failing(KeyboardInterrupt()))
    assert main(["layouts"]) == 130
    ending(monkeypatch, failing(RuntimeError("a fault")))
    assert main(["layouts"]) == 70
    assert "a fault" in capsys.readouterr().err
    ending(monkeypatch, failing(SystemExit(5)))
    with pytest.raises(SystemExit) as told:
        main(["layouts"])
    assert told.value.code == 5


def test_arguments_of_ros_are_kept_from_other_verbs_and_given_to_nodes(monkeypatch):
    given = ending(monkeypatch, lambda: 0)
    assert main(["layouts", "--ros-args", "-p", "a:=1"]) == 0
    assert not hasattr(given[0], "ros_args")
    given = ending(monkeypatch, lambda: 0, "tracker")
    assert main(["tracker", "--ros-args", "-p", "a:=1"]) == 0
    assert given[0].ros_args == ["--ros-args", "-p", "a:=1"]
    assert main(["tracker"]) == 0
    assert given[1].ros_args == []


def test_help_of_a_verb_has_its_summary_and_example(monkeypatch, capsys):
    ending(monkeypatch, lambda: 0)
    with pytest.raises(SystemExit) as told:
        main(["layouts", "--help"])
    out = capsys.readouterr().out
    assert told.value.code == 0 and "usage: tracker_node layouts" in out
    assert "a summary" in out and "example:\n  an example" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["calibrate", "body", "--stature", "1,8"], "argument --stature: expected a number, got '1,8'; with a point, 1.8"),
        (["track", "--rate", "fast"], "argument --rate: expected a number, got 'fast'"),
        (["calibrate", "body", "--person", "0", "0"], "argument --person: expected 3 arguments"),
        (["evaluate"], "the following arguments are required: run"),
    ],
)
def test_a_wrong_argument_is_a_line(capsys, arguments, said):
    """Of fifteen lines of usage before it the hint was the last."""
    with pytest.raises(SystemExit) as told:
        main(arguments)
    verb = "tracker_node calibrate body" if arguments[0] == "calibrate" else f"tracker_node {arguments[0]}"
    assert told.value.code == 2
    assert capsys.readouterr().err == f"{verb}: error: {said} ({verb} --help)\n"


def test_the_process_s_own_arguments_count_where_none_are_given(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["tracker_node", "--version"])
    assert main() == 0 and main([]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"tracker_node {__version__}\nusage:")


@pytest.mark.parametrize("verb", sorted(module.NODES))
def test_each_node_has_a_command_of_its_own(monkeypatch, verb):
    monkeypatch.setattr(sys, "argv", ["command", "--rig", "a"])
    seen = []
    monkeypatch.setattr(module, "main", lambda: seen.append(list(sys.argv)) or 4)
    assert module.node(verb) == 4
    assert seen == [["command", verb, "--rig", "a"]] and len(module.NODES) == 9
