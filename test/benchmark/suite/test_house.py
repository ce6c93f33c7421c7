"""What counts as a module, a folder, a documented function, a page and a line of the script."""

import json

import pytest

from benchmark.suite import house

SOURCE = '''
def one(a): ...

def two(a, b) -> None:
    """Nothing."""

def told(a, *, b: int) -> int:
    """Sum.

    Parameters
    ----------
    a, b : numbers.

    Returns
    -------
    Their sum.
    """

def half(a, *rest) -> int:
    """Sum.

    Parameters
    ----------
    a, rest : numbers.
    """

def nothing(a, b) -> None:
    """Say it.

    Parameters
    ----------
    a, b : numbers.
    """

def _hidden(a, b): ...

class Shown:
    def __init__(self, a, b): ...
    def small(self, a): ...
    def method(self, a, b): ...
    @staticmethod
    def static(a, b): ...
    @classmethod
    def made(cls, a): ...

class _Hidden:
    def method(self, a, b): ...
'''


def test_public_functions_of_two_arguments_and_what_documents_them(tmp_path):
    file = tmp_path / "module.py"
    file.write_text(SOURCE)
    found = {function.name: house.is_documented(function) for function in house.public_functions(file)}
    assert found == {"two": False, "told": True, "half": False, "nothing": True, "method": False, "static": False}


def test_folders_are_counted_by_the_files_directly_in_them(tmp_path):
    for name in ("tracker_node/a/1.py", "tracker_node/a/2.py", "tracker_node/a/b/3.py", "test/4.py", "benchmark/5.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert house.largest_folder(tmp_path) == (tmp_path / "tracker_node" / "a", 2)


def test_generated_pages_are_not_counted(tmp_path):
    (tmp_path / "docs").mkdir()
    for name in ("README.md", "docs/index.md"):
        (tmp_path / name).write_text("# Page\n")
    (tmp_path / "docs" / "measured.md").write_text(f"{house.GENERATED} by a program -->\n# Figures\n")
    assert [page.name for page in house.pages_of(tmp_path)] == ["README.md", "index.md"]


def test_lines_of_the_script():
    assert house.script_lines("# A\n\n```python\nimport b\n\nb.c()  # d\n```\n") == 2
    with pytest.raises(ValueError, match="block of Python"):
        house.script_lines("# A\n\n    b\n")


def test_the_program_writes_every_key(tmp_path):
    assert house.main(["--quick", "--json", str(tmp_path / "house.json")]) == 0
    metrics = json.loads((tmp_path / "house.json").read_text())["metrics"]
    assert set(metrics) == {
        "house.modules", "house.lines", "house.largest_folder", "house.public_functions", "house.documented_public", "docs.pages",
        "docs.words", "api.script_lines", "phone.tutorial_commands", "start.import_s", "start.import_in_numpy",
    }  # fmt: skip
    assert metrics["house.largest_folder"] <= 15 and metrics["api.script_lines"] <= 12
    assert metrics["start.import_in_numpy"] > 0.0
