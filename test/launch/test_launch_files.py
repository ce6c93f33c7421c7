"""Launch files name executables that exist and options that those take.

Where the launch packages are not installed (they are not on PyPI), stand-ins that only keep their arguments take their place.
"""

import argparse
import importlib
import importlib.util
import sys
import types
from pathlib import Path

import pytest

FILES = ["camera_ingest.launch.py", "pipeline.launch.py", "tracker.launch.py"]
CHOICES = {"calibration": "rig", "rate": "30"}


class Kept:
    """Anything of launch: its arguments, by position and name."""

    def __init__(self, *args, **kwargs):
        self.args, self.kwargs = args, kwargs


STAND_INS = {
    "launch": ["LaunchDescription"],
    "launch.actions": ["DeclareLaunchArgument", "EmitEvent", "RegisterEventHandler"],
    "launch.conditions": ["IfCondition"],
    "launch.event_handlers": ["OnProcessExit"],
    "launch.events": ["Shutdown"],
    "launch.substitutions": ["LaunchConfiguration"],
    "launch_ros": [],
    "launch_ros.actions": ["Node"],
}


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    for module_name, names in STAND_INS.items():
        module = types.ModuleType(module_name)
        for name in names:
            setattr(module, name, type(name, (Kept,), {}))
        monkeypatch.setitem(sys.modules, module_name, module)


def description_of(path: Path):
    spec = importlib.util.spec_from_file_location(path.name.replace(".", "_"), path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description()


def test_all_files_are_tested(repository: Path):
    assert sorted(path.name for path in (repository / "launch").glob("*.py")) == FILES


@pytest.mark.parametrize("name", FILES)
def test_executables_and_options_exist(repository: Path, stand_ins: None, name: str):
    actions = description_of(repository / "launch" / name).args[0]
    declared = {action.args[0] for action in actions if type(action).__name__ == "DeclareLaunchArgument"}
    nodes = [action.kwargs for action in actions if type(action).__name__ == "Node"]
    ours = [node for node in nodes if node["package"] == "tracker_node"]
    assert ours
    for node in ours:
        executable = node["executable"]
        assert (repository / "resource" / "executables" / executable).is_file()
        given = []
        for argument in node["arguments"]:
            if isinstance(argument, str):
                given.append(argument)
            else:
                assert argument.args[0] in declared
                given.append(CHOICES.get(argument.args[0], "file"))
        parser = argparse.ArgumentParser(exit_on_error=False)
        importlib.import_module(f"tracker_node.cli.{executable}").add_arguments(parser)
        parser.parse_args(given)


@pytest.mark.full
@pytest.mark.parametrize("name", FILES)
def test_launch_itself_reads_them(repository: Path, name: str):
    pytest.importorskip("launch_ros", reason="launch is not installed")
    assert description_of(repository / "launch" / name).entities
