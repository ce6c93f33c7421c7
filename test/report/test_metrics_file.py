"""The file of figures, and the table."""

import json
import os
import subprocess
import sys

import numpy as np

from helpers.sources.small_disk import limited_files
from tracker_node.report.metrics_file import commit_of, cpu, format_metrics, print_metrics, versions, write_metrics


def test_file_holds_figures_and_circumstances(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/somewhere/bin/tracker_node", "evaluate", "a run"])
    path = tmp_path / "new" / "figures.json"
    write_metrics(path, {"walk.mpjpe_mm": np.float64(12.5), "walk.lost_sets": np.int64(0), "walk.ok": True})
    content = json.loads(path.read_text())
    assert list(content) == ["metrics", "command", "versions", "cpu"]
    assert content["metrics"] == {"walk.mpjpe_mm": 12.5, "walk.lost_sets": 0, "walk.ok": 1}
    assert isinstance(content["metrics"]["walk.lost_sets"], int)
    assert content["command"] == "tracker_node evaluate 'a run'"
    assert content["versions"]["numpy"] == np.__version__
    assert content["cpu"]["cores"] >= 1


def test_numbers_that_json_lacks_become_null(tmp_path):
    path = tmp_path / "figures.json"
    write_metrics(path, {"a": float("nan"), "b": float("inf"), "c": 1.0})
    assert json.loads(path.read_text())["metrics"] == {"a": None, "b": None, "c": 1.0}


def test_table_aligns_decimal_points(capsys):
    print_metrics({"long.key_name": 123.4567, "n": 7, "x": float("nan"), "tiny": 1.5e-7})
    lines = capsys.readouterr().out.splitlines()
    expected = [  # decimal points below each other
        "long.key_name  123.457",
        "n                7",
        "x                -",
        "tiny             1.500e-07",
    ]
    assert lines == expected


def test_empty_table():
    assert format_metrics({}) == "(no metrics)"


def test_circumstances_are_named():
    assert set(versions()) >= {"tracker_node", "python", "numpy", "numba", "opencv"}
    described = cpu()
    assert described["model"] and described["simd"]


def test_asking_for_the_commit_leaves_the_repository_alone(tmp_path):
    """Also where git may write nothing: a lock that it leaves behind would end everybody's commits."""

    def git(*arguments):
        command = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b", *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    file = tmp_path / "a.txt"
    file.write_text("a")
    assert commit_of(tmp_path) is None
    git("init", "-q")
    git("add", ".")
    git("commit", "-q", "-m", "first")
    os.utime(file, (1.0, 1.0))  # git looks at it again, and would note in its index that nothing has changed
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    with limited_files(100):
        assert commit_of(tmp_path) == git("rev-parse", "HEAD")[:12]
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
    file.write_text("b")
    assert commit_of(tmp_path) == f"{git('rev-parse', 'HEAD')[:12]}-dirty"
