"""Which commands of the documentation no walkthrough runs, and which are run with something changed; and how commands parse.

Both tables are short, and each line of them has a reason. What is in neither is run as it stands (`helpers.docs.walkthrough.py`).
"""

import argparse
import importlib
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from helpers.docs.pages import ROOT, Command
from helpers.ros.launch_stand_ins import declared_names
from tracker_node.cli import main
from tracker_node.cli.main import verbs


def parser_of(verb: str) -> argparse.ArgumentParser:
    """The real parser of a verb."""
    assert verb in verbs(), verb
    return main.parser_of(verb, importlib.import_module(main.module_of(verb)))


def parsed(arguments: list[str]) -> argparse.Namespace:
    """What the real parser makes of a whole command behind ``tracker_node``; empty where help is asked for."""
    verb, *rest = arguments
    if verb in ("--help", "--version"):
        return argparse.Namespace()
    split = rest.index("--ros-args") if "--ros-args" in rest else len(rest)
    assert split == len(rest) or verb in main.NODES
    try:
        return parser_of(verb).parse_args(rest[:split])
    except SystemExit as leaving:
        assert leaving.code == 0, arguments  # --help
        return argparse.Namespace()


def names_files(command: Command) -> None:
    """Bash can read it, and files of this repository that it names are there."""
    subprocess.run(["bash", "-n", "-c", command.text], check=True)
    for word in command.words:
        if re.match(r"(requirements|config|\.)/", word):
            assert (ROOT / word).exists(), word
    if command.words[:2] == ["ros2", "run"]:
        assert command.words[3] in main.NODES
        parsed(command.words[3:])


def make_would_do(command: Command) -> None:
    """The target is there, and the commands of ours that it would call parse."""
    planned = subprocess.run(["make", "--dry-run", *command.words[1:]], cwd=ROOT, capture_output=True, text=True, check=True)
    for line in planned.stdout.splitlines():
        if "-m tracker_node.cli.main " in line:
            parsed(line.split("-m tracker_node.cli.main ")[1].split())


def launch_file_takes(command: Command) -> None:
    """The launch file is there and declares the arguments that are given."""
    package, file, *given = command.words[2:]
    assert package == "tracker_node" and {argument.split(":=")[0] for argument in given} <= declared_names(file)


def program_parses(command: Command) -> None:
    """The program's own parser takes the arguments; nothing is measured."""

    class Taken(Exception):
        pass

    def take(parser, arguments=None, namespace=None):
        parse(parser, arguments, namespace)
        raise Taken

    parse, program = argparse.ArgumentParser.parse_args, ROOT / command.words[1]
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(program.parent))
        patch.setattr(sys, "argv", command.words[1:])
        patch.setattr(argparse.ArgumentParser, "parse_args", take)
        with pytest.raises(Taken):
            importlib.import_module(program.stem).main()
        del sys.modules[program.stem]  # whoever looks for a library of that name finds it


def verb_parses(command: Command) -> None:
    parsed(command.words[1:])


def cluster_command_is_known(command: Command) -> None:
    """Our verb parses; Dask's programs have the options."""
    program, *rest = command.words
    if program == "tracker_node":
        return parsed(rest)
    said = subprocess.run([sys.executable, "-m", program, rest[0], "--help"], capture_output=True, text=True, check=True).stdout
    assert all(word in said for word in rest[1:] if word.startswith("--")), command


@dataclass(frozen=True)
class NotRun:
    """Commands that no walkthrough runs, why, the check in its place, and the tests that do as much of it as can be done."""

    pattern: str
    why: str
    check: Callable[[Command], None]
    tests: str

    def fits(self, command: Command) -> bool:
        return re.match(self.pattern, command.text) is not None


NOT_RUN = (
    NotRun(
        r"(source (/opt/ros|env|install)/|rosdep |colcon |ros2 run |export AMENT|pip |env/bin/pip |python3\S* -m venv )",
        "installs, from the network, as root or into a full ROS 2",
        names_files,
        "test/full/test_installation.py",
    ),
    NotRun(
        r"make ", "installs or takes half an hour; some of it would run the tests from within a test", make_would_do,
        "test/test_packaging.py",
    ),
    NotRun(r"ros2 launch ", "launch is not on PyPI", launch_file_takes, "test/launch/test_launch_files.py"),
    NotRun(r"plotjuggler ", "a program with windows, not on PyPI", names_files, "test/ros/live/test_layouts.py"),
    NotRun(r"tracker_node reproduce ", "minutes; with --quick the tests run it", verb_parses,
           "test/cli/reproduce/test_experiments.py"),
    NotRun(r"tracker_node calibrate body --from-points (?!rig_timed)", "fetches the weights of a network from the package index",
           verb_parses, "test/cli/calibrate/test_body_from_points.py"),
    NotRun(r"tracker_node keypoints ", "fetches the weights of a network from the package index", verb_parses,
           "test/ros/keypoints/test_process.py"),
    NotRun(r"dask |tracker_node batch .*--scheduler ", "waits for other machines; with workers on the loopback it is a test",
           cluster_command_is_known, "test/batch/test_dask.py"),
    NotRun(r"python benchmark/ros/soak.py ", "an hour; two minutes of it are a test", program_parses, "test/faults/test_soak.py"),
    NotRun(r"python benchmark/(contour|trust)/\w+.py ", "an hour", program_parses, "test/benchmark/trust/test_lost_events.py"),
)  # fmt: skip


@dataclass(frozen=True)
class Changed:
    """What a walkthrough puts in the place of ``pattern``, and why; names in braces are values of that walkthrough."""

    pattern: str
    instead: str
    why: str


CHANGED = (
    Changed(r"^source \.venv", "source {venv}", "the environment in which the tests run"),
    Changed(r"^ROS_DOMAIN_ID=7 ", "ROS_DOMAIN_ID={domain} ", "tests keep to their own ROS graph"),
    Changed(r"^(tracker_node synthesize .*)$", r"\1 --images 6 --cameras 3 --size 320x240", "drawing sixty sets takes a minute"),
    Changed(r"--first-image 120", "--first-image 0", "the recording begins where the run does"),
    Changed(r"(faults\.py --only drills)", r"\1 --drills 'image doubled'", "all drills take ten minutes; most are tests"),
    Changed(r"(faults\.py .*)--files 10000", r"\1--files 40", "10 000 files take half an hour"),
    Changed(r"rtsp://10\.0\.0\.2/h264|v4l2:/dev/video2", "{rtsp}", "there is no camera: a stream of this machine"),
    Changed(r"v4l2:/dev/(v4l/by-id/usb-A_B-video-index0|video0)", "v4l2:{v4l2}", "there is no camera: its driver is played"),
)


def why_not_run(command: Command) -> NotRun | None:
    """The entry of the table for a command, or None: it has to be run."""
    return next((entry for entry in NOT_RUN if entry.fits(command)), None)


def as_run(command: Command, values: dict[str, str]) -> str:
    """The command line with what is changed for tests; ``values`` by name."""
    text = command.text
    for change in CHANGED:
        text = re.sub(change.pattern, lambda match: match.expand(change.instead.format_map(values)), text)  # noqa: B023
    return text


PROGRAMS = ("cd", "source", "python", "ros2", "tracker_node")


def is_run(command: Command) -> bool:
    """Whether a walkthrough knows how to run the program."""
    words = as_run(command, dict.fromkeys(("venv", "domain", "rtsp", "v4l2"), "x")).split()
    program = next(word for word in words if "=" not in word)
    return program in PROGRAMS and why_not_run(command) is None
