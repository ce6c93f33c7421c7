"""What `tracker_node` offers: names that are there, imported only when they are used, and the script of the README."""

import importlib
import inspect
import subprocess
import sys

import pandas as pd
import pytest

import tracker_node
from helpers.docs.pages import blocks_of
from helpers.docs.place import Place
from tracker_node.model.articulated import ArticulatedModel

LONGEST_SCRIPT = 12  # lines


@pytest.mark.parametrize("name", tracker_node.__all__)
def test_every_name_is_there_and_described(name):
    value = getattr(tracker_node, name)
    assert name == "__version__" or inspect.getdoc(value)
    assert name in dir(tracker_node)


def test_names_and_modules_are_told_once_each():
    assert sorted(tracker_node._MODULES) == sorted(set(tracker_node.__all__) - {"__version__"})
    assert tracker_node.__all__ == sorted(tracker_node.__all__)
    for name, module in tracker_node._MODULES.items():
        assert getattr(tracker_node, name) is getattr(importlib.import_module(f"tracker_node.{module}"), name)


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Traker'"):
        tracker_node.Traker  # noqa: B018


def test_nothing_is_imported_before_it_is_used():
    program = "import sys, tracker_node; print(*sorted(m for m in sys.modules if m.startswith('tracker_node')))"
    program += "; sys.exit('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["tracker_node", "tracker_node.version"]


def test_a_name_brings_no_ros_and_no_pandas():
    program = "import sys; from tracker_node import track; sys.exit(bool({'rclpy', 'pandas', 'xarray'} & set(sys.modules)))"
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_package_says_that_it_has_types(repository):
    assert (repository / "tracker_node" / "py.typed").is_file()
    assert '"py.typed"' in (repository / "setup.py").read_text()


def test_the_script_of_the_readme_makes_a_table_of_joint_angles(shelf, tmp_path, monkeypatch, capsys):
    (script,) = (block for block in blocks_of("README.md") if block.language == "python")
    assert len([line for line in script.text.splitlines() if line.strip()]) <= LONGEST_SCRIPT
    place = Place(tmp_path, shelf, {})
    place.lay(shelf.arm)
    place.lay(shelf.arm / "model.yaml", "person.yaml")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(script.text, "README.md", "exec"), names)
    written = pd.read_csv("angles.csv", index_col=0)
    assert isinstance(names["model"], ArticulatedModel) and "elbow_flexion" in capsys.readouterr().out
    assert written.shape == (10, 3) and written.notna().all().all()
