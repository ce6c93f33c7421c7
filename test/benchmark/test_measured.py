"""docs/measured.md is what its program makes of the data file; a run of the benchmarks changes only what it has measured."""

import json
import shutil

import pytest

from benchmark import _all, _measured


def results(folder, program: str, metrics: dict) -> None:
    path = folder / f"{program}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    content = {"metrics": metrics, "command": "c", "versions": {}, "cpu": {"model": "Abacus", "cores": 2, "simd": "beads"}}
    path.write_text(json.dumps(content))


def test_the_page_and_the_data_file_are_as_the_program_writes_them():
    data = _measured.load()
    assert _measured.PAGE.read_text() == _measured.page(data)
    assert _measured.DATA.read_text() == _measured.dump(data)


def test_every_benchmark_that_the_page_names_is_there():
    programs = {f"benchmark/{name}.py" for name in _all.programs()}
    named = {entry["command"].split()[0] for _, entry in _measured.figures(_measured.load())}
    assert {name for name in named if name.startswith("benchmark/")} <= programs
    assert not {name for name in named if not name.startswith("benchmark/")} - {"make", "tracker_node"}


def test_a_run_puts_in_what_it_has_measured(tmp_path):
    data, page = tmp_path / "measured.yaml", tmp_path / "measured.md"
    shutil.copyfile(_measured.DATA, data)
    results(tmp_path / "run", "contour/figure", {"figure.joint_error_mm": 2.34567, "figure.set_ms": None})
    results(tmp_path / "run", "contour/accuracy", {"figure_2cams.joint_error_mm": 99.0, "unlisted.key": 1})  # another program's
    results(tmp_path / "run", "contour/balancing", {"balancing.mpjpe_mm": 30})  # the demo's key is printed by another program
    (tmp_path / "run/all.json").write_text(json.dumps({"figure.joint_error_mm": {"value": 0}}))
    assert _measured.main(["--json-folder", str(tmp_path / "run"), "--data", str(data), "--page", str(page)]) == 0
    before, after = dict(_measured.figures(_measured.load())), dict(_measured.figures(_measured.load(data)))
    assert after["figure.joint_error_mm"]["value"] == 2.35 and after["figure.joint_error_mm"]["machine"] == "Abacus, beads"
    assert after["balancing_own.mpjpe_mm"]["value"] == 30
    assert {key for key in before if before[key] != after[key]} == {"figure.joint_error_mm", "balancing_own.mpjpe_mm"}
    assert "| `figure.joint_error_mm` | **2.35** | <= 1.0 |" in page.read_text() and "Abacus, beads" in page.read_text()


def test_a_key_that_stands_there_twice_is_refused(tmp_path):
    entry = "{value: 1, command: c, machine: m, means: x}"
    group = f"- {{title: t, keys: {{a.b: {entry}}}}}\n"
    (tmp_path / "twice.yaml").write_text(f"machines: {{m: n}}\ngroups:\n{group}{group}")
    with pytest.raises(ValueError, match=r"a\.b stands there twice"):
        _measured.load(tmp_path / "twice.yaml")


@pytest.mark.parametrize(("value", "target", "met"), [(5, "<= 5", True), (5.1, "<= 5", False), (0.9, ">= 0.95", False)])
def test_targets(value, target, met):
    assert _measured.is_met(value, target) is met
