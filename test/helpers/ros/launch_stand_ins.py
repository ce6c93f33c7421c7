"""Launch files read without launch: stand-ins keep their arguments, and resolve substitutions as launch does.

A cheap check of names, options and arguments; test/full runs the files with the real launch, which is not on PyPI.
"""

import importlib.util
import sys
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

import pytest

ROOT = Path(__file__).resolve().parents[3]
SHARED = "tracker_node.ros.launch_files"


class Kept:
    """Anything of launch: its arguments, by position and name."""

    def __init__(self, *args, **kwargs):
        self.args, self.kwargs = args, kwargs


class Arguments(dict[str, str]):
    """What a launch file is given, and which of it was asked for."""

    def __init__(self, given: dict[str, str]):
        super().__init__(given)
        self.used: set[str] = set()

    def __getitem__(self, name: str) -> str:
        self.used.add(name)
        return super().__getitem__(name)


class LaunchConfiguration(Kept):
    def perform(self, context: dict[str, str]) -> str:
        return context[self.args[0]]


class FindPackageShare(Kept):
    def perform(self, context: dict[str, str]) -> str:
        assert self.args[0] == "tracker_node"
        return str(ROOT)  # config/ and launch/ lie there as in share/tracker_node


class ExecutableInPackage(Kept):
    def perform(self, context: dict[str, str]) -> str:
        assert self.kwargs["package"] == "tracker_node"
        return str(ROOT / "resource" / "executables" / self.kwargs["executable"])


class OnShutdown(Kept):
    """Keeps what is to be done at the end, as launch does."""

    waiting: ClassVar[list[Callable]] = []

    def __init__(self, *, on_shutdown: Callable):
        super().__init__(on_shutdown=on_shutdown)
        self.waiting.append(on_shutdown)

    @classmethod
    def shut_down(cls) -> None:
        while cls.waiting:
            cls.waiting.pop()(None, None)


class LogInfo(Kept):
    """Keeps its lines."""

    said: ClassVar[list[str]] = []

    def __init__(self, *, msg: str):
        super().__init__(msg=msg)
        self.said.append(msg)


class PathJoinSubstitution(Kept):
    def perform(self, context: dict[str, str]) -> str:
        return "/".join(resolved(part, context) for part in self.args[0])


class PythonExpression(Kept):
    def perform(self, context: dict[str, str]) -> str:
        return str(eval("".join(resolved(part, context) for part in self.args[0])))


ABSENT: set[str] = set()


def get_package_prefix(package: str) -> str:
    """All packages are installed but those of `ABSENT`."""
    if package in ABSENT:
        raise LookupError(package)
    return str(ROOT)


STAND_INS = {
    "ament_index_python": [],
    "ament_index_python.packages": [("get_package_prefix", get_package_prefix), ("PackageNotFoundError", LookupError)],
    "launch": ["LaunchDescription"],
    "launch.actions": [
        "DeclareLaunchArgument", "EmitEvent", "IncludeLaunchDescription", LogInfo, "OpaqueFunction", "RegisterEventHandler",
    ],
    "launch.conditions": ["IfCondition"],
    "launch.event_handlers": ["OnProcessExit", OnShutdown],
    "launch.events": ["Shutdown"],
    "launch.launch_context": ["LaunchContext"],
    "launch.launch_description_sources": ["PythonLaunchDescriptionSource"],
    "launch.substitutions": [LaunchConfiguration, PathJoinSubstitution, PythonExpression],
    "launch_ros": [],
    "launch_ros.actions": ["Node"],
    "launch_ros.parameter_descriptions": ["ParameterValue"],
    "launch_ros.substitutions": [ExecutableInPackage, FindPackageShare],
}  # fmt: skip


@contextmanager
def launch_stand_ins() -> Iterator[None]:
    """In place of the launch packages; what launch files share is imported anew."""
    with pytest.MonkeyPatch.context() as patch:
        for module_name, contents in STAND_INS.items():
            module = types.ModuleType(module_name)
            for item in contents:
                if isinstance(item, tuple):
                    setattr(module, *item)
                    continue
                kind = type(item, (Kept,), {}) if isinstance(item, str) else item
                setattr(module, kind.__name__, kind)
            patch.setitem(sys.modules, module_name, module)
        sys.modules.pop(SHARED, None)
        try:
            yield
        finally:
            OnShutdown.shut_down()
            LogInfo.said.clear()
            sys.modules.pop(SHARED, None)


def resolved(item, context: dict[str, str]) -> str:
    return item if isinstance(item, str) else item.perform(context)


def description_of(name: str):
    path = ROOT / "launch" / name
    spec = importlib.util.spec_from_file_location(path.name.replace(".", "_"), path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description()


def declared_by(name: str) -> dict[str, Kept]:
    """The arguments that a launch file declares, by name."""
    return {a.args[0]: a for a in description_of(name).args[0] if type(a).__name__ == "DeclareLaunchArgument"}


def declared_names(name: str) -> set[str]:
    """Names of the arguments that a launch file declares."""
    with launch_stand_ins():
        return set(declared_by(name))
