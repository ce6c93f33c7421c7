"""Images of containers and the development container, read without Docker: instructions, files, commands, shell."""

import fnmatch
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCKERFILES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docker").glob("*.Dockerfile"))
INSTRUCTIONS = (
    "ADD", "ARG", "CMD", "COPY", "ENTRYPOINT", "ENV", "EXPOSE", "FROM", "HEALTHCHECK", "LABEL", "RUN", "SHELL", "STOPSIGNAL",
    "USER", "VOLUME", "WORKDIR",
)  # fmt: skip


@dataclass(frozen=True)
class Instruction:
    """A line of a Dockerfile, continued lines joined."""

    name: str
    rest: str

    @property
    def words(self) -> list[str]:
        """Of the exec form, or of the shell."""
        return json.loads(self.rest) if self.rest.startswith("[") else shlex.split(self.rest)


def instructions_of(path: Path) -> list[Instruction]:
    lines = [line for line in path.read_text().splitlines() if not line.lstrip().startswith("#")]
    joined = "\n".join(lines).replace("\\\n", " ")
    return [Instruction(*line.split(maxsplit=1)) for line in joined.splitlines() if line.strip()]


def copied(instructions: list[Instruction]) -> dict[str, str]:
    """Source in the repository -> target in the image."""
    found = {}
    for instruction in instructions:
        if instruction.name == "COPY":
            *sources, target = instruction.words
            found |= dict.fromkeys(sources, target)
    return found


def ignored(name: str) -> bool:
    patterns = (ROOT / ".dockerignore").read_text().split()
    return any(fnmatch.fnmatch(name, pattern.removeprefix("**/")) for pattern in patterns)


def test_there_is_one_for_ros_and_one_without():
    assert DOCKERFILES == ["docker/python.Dockerfile", "docker/ros.Dockerfile"]


@pytest.mark.parametrize("name", DOCKERFILES)
def test_instructions_are_known_and_begin_with_an_image_of_a_stated_version(name):
    found = instructions_of(ROOT / name)
    assert {instruction.name for instruction in found} <= set(INSTRUCTIONS)
    assert found[0].name == "FROM" and re.fullmatch(r"[\w./-]+:[\w.-]+", found[0].rest) and not found[0].rest.endswith("latest")
    for instruction in found:
        if instruction.name in ("CMD", "ENTRYPOINT", "SHELL"):
            assert all(isinstance(word, str) for word in json.loads(instruction.rest)), "expected the exec form"


@pytest.mark.parametrize("name", DOCKERFILES)
def test_copied_files_are_there_and_not_left_out(name):
    for source, target in copied(instructions_of(ROOT / name)).items():
        path = ROOT / source
        assert path.exists() and not ignored(source), source
        assert path.is_file() or path.name == target, f"{source}: a folder's content is copied, so the target needs its name"
        assert subprocess.run(["git", "check-ignore", "-q", source], cwd=ROOT, check=False).returncode == 1, source


@pytest.mark.parametrize("name", DOCKERFILES)
def test_commands_are_those_of_a_shell_and_leave_no_lists_of_packages(name):
    for instruction in instructions_of(ROOT / name):
        if instruction.name != "RUN":
            continue
        subprocess.run(["bash", "-n", "-c", instruction.rest], check=True)
        assert ("apt-get update" in instruction.rest) == ("rm -rf /var/lib/apt/lists/*" in instruction.rest)
        for file in re.findall(r"-r (\S+)", instruction.rest):
            assert file in (f"{target}{Path(source).name}" for source, target in copied(instructions_of(ROOT / name)).items())


@pytest.mark.parametrize("name", DOCKERFILES)
def test_all_that_the_package_is_built_from_is_copied(name):
    """All that `setup.py` reads beside the package itself."""
    needed = {"setup.py", "setup.cfg", "pyproject.toml", "package.xml", "README.md"}
    needed |= {"config", "launch", "resource", "tracker_node"}
    assert needed <= set(copied(instructions_of(ROOT / name)))


def test_the_extras_of_the_image_are_those_of_setup():
    text = (ROOT / "docker/python.Dockerfile").read_text()
    (extras,) = re.findall(r'"\.\[([\w,]+)\]"', text)
    setup = (ROOT / "setup.py").read_text()
    assert all(f'"{extra}": ' in setup for extra in extras.split(","))


def test_the_entry_point_runs_its_command_with_everything_sourced(tmp_path):
    script = ROOT / "docker/ros_entrypoint.sh"
    assert os.access(script, os.X_OK)
    text = script.read_text()
    for path in re.findall(r"^source (\S+)$", text, re.MULTILINE):
        here = tmp_path / path.lstrip("/")
        here.parent.mkdir(parents=True)
        here.write_text(f"echo sourced {path}\n")
        text = text.replace(path, str(here))
    done = subprocess.run(["bash", "-c", text, "entry", "echo", "a b"], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "a b" and done.stdout.count("sourced") == 3


def test_the_development_container_calls_targets_of_make():
    container = json.loads((ROOT / ".devcontainer/devcontainer.json").read_text())
    makefile = (ROOT / "Makefile").read_text()
    for key in ("onCreateCommand", "postCreateCommand"):
        assert re.search(rf"^{shlex.split(container[key])[-1]}:", makefile, re.MULTILINE), key
    assert re.fullmatch(r"[\w./-]+:3\.12-\w+", container["image"])
    interpreter = container["customizations"]["vscode"]["settings"]["python.defaultInterpreterPath"]
    assert interpreter == "${containerWorkspaceFolder}/.venv/bin/python" and "VENV := .venv" in makefile


def test_a_wheel_is_built_from_what_is_copied(tmp_path):
    """With the data files that a run needs, and the mark of a typed package."""
    context = tmp_path / "context"
    for source, target in copied(instructions_of(ROOT / "docker/python.Dockerfile")).items():
        if (ROOT / source).is_dir():
            shutil.copytree(ROOT / source, context / target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            (context / target).mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / source, context / target / Path(source).name)
    options = ["--no-deps", "--no-build-isolation", "--wheel-dir", str(tmp_path)]
    subprocess.run([sys.executable, "-m", "pip", "wheel", *options, str(context)], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    listed = zipfile.ZipFile(wheel).namelist()
    for file in ("tracker_node/py.typed", "tracker_node/api/functions.py", "config/models/human.yaml"):
        assert any(name.endswith(file) for name in listed), file
