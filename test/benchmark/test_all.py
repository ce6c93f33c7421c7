"""All benchmarks in one run: a failure does not stop the others, and a key has one program."""

import importlib.util
import json
from pathlib import Path

from benchmark import _all

PROGRAM = """
import json, sys
open(sys.argv[sys.argv.index("--json") + 1], "w").write(json.dumps({{"metrics": {metrics}, "command": "c"}}))
sys.exit({status})
"""


def program(folder: Path, name: str, metrics: dict[str, float], status: int = 0) -> Path:
    path = folder / f"{name}.py"
    path.write_text(PROGRAM.format(metrics=metrics, status=status))
    return path


def test_a_program_that_fails_does_not_stop_the_others(tmp_path, capfd):
    (tmp_path / "breaks.py").write_text("raise SystemExit(3)")
    program(tmp_path, "works", {"a.b": 1.5})
    assert _all.run_all(_all.programs(tmp_path), tmp_path / "out", []) == 1
    assert json.loads((tmp_path / "out" / "all.json").read_text())["a.b"]["value"] == 1.5
    assert "failed: breaks (status 3, no figures)" in capfd.readouterr().err


def test_a_key_of_two_programs_is_named(tmp_path, capfd):
    (tmp_path / "room").mkdir()
    chosen = {"one": program(tmp_path, "one", {"a.b": 1}), "room/two": program(tmp_path / "room", "two", {"a.b": 2, "c.d": 3})}
    assert _all.run_all(chosen, tmp_path / "out", []) == 1
    assert "a.b: printed by one and by room/two" in capfd.readouterr().err


def test_figures_of_an_earlier_run_do_not_count(tmp_path):
    good = program(tmp_path, "one", {"a.b": 1})
    assert _all.run_all({"one": good}, tmp_path / "out", []) == 0
    good.write_text("")
    assert _all.run_all({"one": good}, tmp_path / "out", []) == 1
    assert json.loads((tmp_path / "out" / "all.json").read_text()) == {}


def test_helpers_are_no_programs():
    names = set(_all.programs())
    assert {"core", "contour/figure"} <= names and not any(Path(name).name.startswith("_") for name in names)


def test_no_program_hides_a_module_that_others_import():
    """The folder of a program that is run comes first where Python looks for modules."""
    found = {name: importlib.util.find_spec(path.stem) for name, path in _all.programs().items()}
    assert [name for name, spec in found.items() if spec is not None and spec.origin is not None] == []
