"""The two packages agree with each other and with what pip and colcon install."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from importlib.metadata import distribution, packages_distributions, requires
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import tracker_node

EXECUTABLES = {
    "camera_ingest", "compose", "keypoints", "pipeline", "player", "recorder", "rectify", "rerun_bridge", "tracker",
    "tracker_node",
}  # fmt: skip


def manifest(path: Path) -> ElementTree.Element:
    return ElementTree.parse(path).getroot()


def toml(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text())


def setup_keyword(repository: Path, name: str) -> str:
    tree = ast.parse((repository / "setup.py").read_text())
    values = [node.value for node in ast.walk(tree) if isinstance(node, ast.keyword) and node.arg == name]
    return ast.literal_eval(values[0])


def citation(repository: Path) -> dict[str, Any]:
    return yaml.safe_load((repository / "CITATION.cff").read_text())


def test_versions_agree(repository: Path) -> None:
    versions = {
        "tracker_node/__init__.py": tracker_node.__version__,
        "setup.py": setup_keyword(repository, "version"),
        "package.xml": manifest(repository / "package.xml").findtext("version"),
        "msgs/package.xml": manifest(repository / "msgs/package.xml").findtext("version"),
        "msgs/pyproject.toml": toml(repository / "msgs/pyproject.toml")["project"]["version"],
        "CITATION.cff": citation(repository)["version"],
        "CHANGELOG.rst": re.findall(r"^(\S+)\n-+$", (repository / "CHANGELOG.rst").read_text(), re.MULTILINE)[0],
    }
    assert set(versions.values()) == {tracker_node.__version__}, versions


def test_citation_has_what_the_format_asks_for(repository: Path) -> None:
    """The required keys of CFF 1.2.0, and the license and maintainers of the package."""
    found = citation(repository)
    assert found["cff-version"] == "1.2.0" and {"message", "title", "authors"} <= found.keys() and found["type"] == "software"
    assert found["license"] == setup_keyword(repository, "license")
    assert [author["name"] for author in found["authors"]] == [setup_keyword(repository, "maintainer")]
    assert isinstance(found["version"], str) and all(isinstance(word, str) for word in found["keywords"])
    papers = [f"https://doi.org/{paper['doi']}" for paper in found["references"] if "doi" in paper]
    assert len(found["references"]) == 2 and set(papers) <= set(setup_keyword(repository, "project_urls").values())


def test_classifiers_are_of_the_pythons_that_are_supported(repository: Path) -> None:
    metadata = distribution("tracker_node").metadata
    said = [text.rpartition(":: ")[2] for text in metadata.get_all("Classifier") or () if "Python :: 3." in text]
    assert said == ["3.11", "3.12"] and metadata["Requires-Python"] in (">=3.11,<3.13", "<3.13,>=3.11")


def test_manifests_say_the_same_as_setup(repository: Path) -> None:
    root = manifest(repository / "package.xml")
    assert root.findtext("description") == setup_keyword(repository, "description")
    assert root.findtext("maintainer") == setup_keyword(repository, "maintainer")
    assert root.findtext("license") == setup_keyword(repository, "license") == "Apache-2.0"
    assert manifest(repository / "msgs/package.xml").findtext("license") == "Apache-2.0"


def test_manifest_names_the_ros_packages_in_use(repository: Path) -> None:
    """Every ROS package that the sources import is an exec_depend, so that rosdep brings it."""
    declared = {e.text for e in manifest(repository / "package.xml").findall("exec_depend")}
    contracts = toml(repository / "pyproject.toml")["tool"]["importlinter"]["contracts"]
    ros_modules = set(next(c for c in contracts if c["type"] == "forbidden")["forbidden_modules"])
    imported = set()
    for source in (repository / "tracker_node").rglob("*.py"):
        for node in ast.walk(ast.parse(source.read_text())):
            if isinstance(node, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
                imported.add(node.module.partition(".")[0])
    assert imported & ros_modules <= declared


def test_executables_are_in_the_tree_and_compile(repository: Path) -> None:
    folder = repository / "resource/executables"
    assert {path.name for path in folder.iterdir()} == EXECUTABLES
    for path in folder.iterdir():
        assert os.access(path, os.X_OK), path
        compile(path.read_text(), str(path), "exec")


def test_executables_call_what_the_command_line_offers(repository: Path) -> None:
    main = pytest.importorskip("tracker_node.cli.main")
    for name in EXECUTABLES - {"tracker_node"}:
        assert name in main.NODES and f'node("{name}")' in (repository / "resource/executables" / name).read_text(), name
    assert callable(main.node) and callable(main.main)


def test_installation_has_what_ros2_run_looks_for() -> None:
    """The files that `ros2 run` and `ros2 pkg` look for, where the package is installed by pip."""
    prefix = Path(sys.prefix)
    if not (prefix / "share/tracker_node/package.xml").exists():
        pytest.skip("tracker_node is imported from the source tree, not installed")
    assert (prefix / "share/ament_index/resource_index/packages/tracker_node").exists()
    assert {path.name for path in (prefix / "lib/tracker_node").iterdir()} >= EXECUTABLES
    assert all(os.access(prefix / "lib/tracker_node" / name, os.X_OK) for name in EXECUTABLES)
    entry_points = distribution("tracker_node").entry_points
    assert [entry.name for entry in entry_points if entry.group == "console_scripts"] == ["tracker_node"]


def distribution_names(requirements: Iterable[str]) -> set[str]:
    """Of requirements that hold here, without extras."""
    parsed = [Requirement(text) for text in requirements]
    return {canonicalize_name(one.name) for one in parsed if one.marker is None or one.marker.evaluate({"extra": ""})}


def test_what_is_installed_beside_a_ros_from_apt_is_whole_and_has_nothing_of_ros(repository: Path) -> None:
    """`pip install --no-deps -r requirements/runtime.txt` leaves nothing out, and hides nothing of ROS that apt has installed."""
    lines = (repository / "requirements/runtime.txt").read_text().splitlines()
    listed = distribution_names(line for line in lines if not line.startswith("#"))
    tree = ast.parse((repository / "setup.py").read_text())
    assigned = {node.targets[0].id: node.value for node in tree.body if isinstance(node, ast.Assign)}
    needed = distribution_names(ast.literal_eval(assigned["RUNTIME_REQUIREMENTS"]))
    for name in listed:
        needed |= distribution_names(requires(name) or [])
    assert needed <= listed
    contracts = toml(repository / "pyproject.toml")["tool"]["importlinter"]["contracts"]
    ros_modules = next(c for c in contracts if c["type"] == "forbidden")["forbidden_modules"]
    providers = {canonicalize_name(name) for module in ros_modules for name in packages_distributions().get(module, [])}
    assert not providers & listed and not [name for name in listed if name.startswith("ros-")]


def imported_packages(file: Path) -> set[str]:
    """Packages that a module imports when it runs, at its top or in a function; not those for annotations alone."""
    found: set[str] = set()
    tree = ast.parse(file.read_text())
    typing = [node for node in ast.walk(tree) if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    left_out = {id(inner) for block in typing for inner in ast.walk(block)}
    for node in ast.walk(tree):
        if id(node) not in left_out and isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif id(node) not in left_out and isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module.partition(".")[0])
    return found


def test_packages_of_extras_are_imported_by_their_part_alone(repository: Path) -> None:
    """So that all others run without them; where they are needed, `errors.extra_module` says what installs them."""
    parts = {"starlette": "studio", "uvicorn": "studio", "websockets": "studio", "pandas": "", "xarray": ""}
    parts |= {"ai_edge_litert": "observation", "h5py": "loaders"}
    for file in (repository / "tracker_node").rglob("*.py"):
        part = file.relative_to(repository / "tracker_node").parts[0]
        wrong = {name for name in imported_packages(file) & parts.keys() if parts[name] != part}
        assert not wrong, (file, wrong)


def test_extras_are_those_that_the_messages_name(repository: Path) -> None:
    extras = set(distribution("tracker_node").metadata.get_all("Provides-Extra") or ())
    assert extras == {"ros", "studio", "keypoints", "h5", "data", "cluster", "sound", "rerun", "opensim", "docs", "test"}
    named = {
        match
        for file in (repository / "tracker_node").rglob("*.py")
        for match in re.findall(r'extra_module\([^()]*, "(\w+)"\)', file.read_text())
    }
    assert named == {"studio", "keypoints", "h5", "data", "cluster", "sound", "rerun", "opensim"}


def test_command_line_does_not_import_ros() -> None:
    """Offline commands run without ROS, and start quickly."""
    pytest.importorskip("tracker_node.cli.main")
    program = "import sys, tracker_node.cli.main; sys.exit('rclpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=120).returncode == 0


def attributes(tree: ast.ClassDef) -> set[str]:
    """What a class assigns to itself, and its annotated fields."""
    names = {node.target.id for node in tree.body if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)}
    stored = (node for node in ast.walk(tree) if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store))
    return names | {node.attr for node in stored if isinstance(node.value, ast.Name) and node.value.id == "self"}


def test_classes_of_tracking_that_act_stay_small(repository: Path) -> None:
    """Frozen dataclasses are records and may be wide; a class whose state changes has at most 15 attributes."""
    acting = {}
    for file in (repository / "tracker_node/tracking").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ClassDef) and not any("frozen=True" in ast.unparse(each) for each in node.decorator_list):
                acting[f"{file.stem}.{node.name}"] = len(attributes(node))
    assert acting["tracker.Tracker"] > 1 and acting["reacquisition.Reacquisition"] > 1
    assert not {name: count for name, count in acting.items() if count > 15}


def test_make_setup_shows_life_and_fails_as_pip_fails(repository: Path) -> None:
    """In a line for twenty of the packages, not in pip's three for each."""
    says = "for i in {1..45}; do echo Collecting $$i; echo '  Downloading it'; done; echo Installing collected packages: a"
    rule = f"life: ; @{{ {says}; exit $(STATUS); }} | $(SHOW_LIFE)"
    for status in (0, 3):
        command = ["make", "--silent", "--eval", rule, f"STATUS={status}", "life"]
        done = subprocess.run(command, cwd=repository, capture_output=True, text=True)
        assert done.stdout == "  20 packages fetched\n  40 packages fetched\n  unpacking 45 packages\n"
        assert bool(done.returncode) == bool(status), done.stderr
    makefile = (repository / "Makefile").read_text()
    assert re.search(r"pip install .*\$\(REQUIREMENTS:%=-r %\) \| \$\(SHOW_LIFE\)\n", makefile)
