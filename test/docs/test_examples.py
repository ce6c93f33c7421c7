"""Notebooks of `examples/` run from their first cell to their last, each in an empty folder."""

from pathlib import Path

import nbformat
import pandas as pd
import pytest
from nbclient import NotebookClient
from nbformat import NotebookNode

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "examples").glob("*.ipynb"))


def executed(notebook: Path, folder: Path) -> NotebookNode:
    """The notebook with its outputs, run by the Python of the tests in ``folder``."""
    nodes = nbformat.read(notebook, as_version=4)
    NotebookClient(nodes, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}).execute()
    return nodes


def test_there_are_notebooks():
    assert "examples/joint_angles.ipynb" in NOTEBOOKS


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_valid_and_kept_without_outputs(repository, name):
    nodes = nbformat.read(repository / name, as_version=4)
    nbformat.validate(nodes)
    code = [cell for cell in nodes.cells if cell.cell_type == "code"]
    assert code and all(not cell.outputs and cell.execution_count is None for cell in code)


def test_joint_angles(repository, tmp_path, monkeypatch):
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("JUPYTER_DATA_DIR", str(tmp_path / "jupyter"))
    folder = tmp_path / "work"
    folder.mkdir()
    nodes = executed(repository / "examples/joint_angles.ipynb", folder)
    outputs = [output for cell in nodes.cells if cell.cell_type == "code" for output in cell.outputs]
    shown = "\n".join(output["data"]["text/plain"] for output in outputs if "data" in output)
    assert "right_shoulder_elevation" in shown and "'mpjpe_mm'" in shown and "'lost_sets': 0" in shown
    assert any("image/png" in output.get("data", {}) for output in outputs)
    tables = {path.name for path in (folder / "tables").iterdir()}
    assert {"isb_angles.csv", "landmarks.csv"} <= tables and (folder / "run.trc").is_file() and (folder / "run.mot").is_file()
    assert len(pd.read_csv(folder / "tables" / "isb_angles.csv")) == 20
