"""``make docs``: the reference is built from the docstrings of every public module, with no ROS."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

BLOCKED = ("rclpy", "sensor_msgs", "geometry_msgs", "std_msgs", "tracker_msgs", "visualization_msgs", "diagnostic_msgs")
PROGRAM = """
import sys
sys.modules.update(dict.fromkeys({blocked}))
sys.argv = ["pdoc", *{arguments}]
from pdoc.__main__ import cli
cli()
"""


def options_of_make(repository: Path) -> tuple[list[str], list[str]]:
    """Modules and options that ``make docs`` gives to pdoc."""
    makefile = (repository / "Makefile").read_text()
    modules = shlex.split(re.search(r"^DOCUMENTED := (.*)$", makefile, re.MULTILINE)[1])
    options = re.search(r"-m pdoc \$\(DOCUMENTED\) (.*) -o ", makefile)[1]
    return modules, shlex.split(options)


def build(repository: Path, modules: list[str], output: Path) -> str:
    arguments = [*modules, *options_of_make(repository)[1], "-o", str(output)]
    program = PROGRAM.format(blocked=BLOCKED, arguments=arguments)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=repository, check=False)
    assert done.returncode == 0, done.stderr
    return done.stderr


def test_pages_have_signatures_parameters_and_sources(repository, tmp_path):
    build(repository, ["tracker_node.geometry", "tracker_node.errors"], tmp_path)
    assert (tmp_path / "index.html").is_file()
    page = (tmp_path / "tracker_node/geometry/se3.html").read_text()
    assert "from_rotation_translation" in page
    errors = (tmp_path / "tracker_node/errors.html").read_text()
    assert re.search(r"<h6 id=\"[^\"]*parameters\">Parameters</h6>", errors, re.IGNORECASE)  # numpydoc is understood


@pytest.mark.long
def test_every_public_module_has_its_page(repository, tmp_path):
    build(repository, options_of_make(repository)[0], tmp_path)
    for module in (repository / "tracker_node").rglob("*.py"):
        relative = module.relative_to(repository)
        if relative.parts[1] in ("ros", "cli") or any(part.startswith("_") for part in (*relative.parts[:-1], relative.stem)):
            continue
        assert (tmp_path / relative.with_suffix(".html")).is_file(), relative
