"""``reproduce table1``, ``convergence`` and ``figures``, small, from one end to the other."""

import json

import cv2
import numpy as np
import pytest

from tracker_node.cli.groups import reproduce
from tracker_node.cli.main import main
from tracker_node.experiments.rigid_tracking import UNITS, VARIABLES


def metrics_of(folder):
    return json.loads((folder / "metrics.json").read_text())["metrics"]


def colors_on(path):
    """Share of a picture's pixels that are neither gray, black nor white."""
    image = cv2.imread(str(path)).astype(int)
    return float(np.mean(image.max(axis=2) - image.min(axis=2) > 40))


def test_experiments_are_found():
    assert {"table1", "convergence", "figures"} <= {each.name for each in reproduce.SUBVERBS}


@pytest.mark.long
def test_table1(tmp_path, capsys):
    assert main(["reproduce", "table1", "--quick", "--output", str(tmp_path)]) == 0
    metrics = metrics_of(tmp_path)
    for method in ("stepping", "best", "floor", "floor_hard", "floor_ambient", "same_backend"):
        for variable, unit in zip(VARIABLES, UNITS, strict=True):
            rms = metrics[f"table1.{method}.{variable}_rms_{unit}"]
            assert 0.0 < rms <= metrics[f"table1.{method}.{variable}_max_{unit}"] < 25.0
    # The best optimizer ends where the corrected score has its minimum, which the floor is found from the truth.
    assert metrics["table1.best.score"] == pytest.approx(metrics["table1.floor.score"], rel=0.02)
    assert metrics["table1.floor_hard.score"] < min(metrics["table1.floor.score"], metrics["table1.stepping.score"])
    for variable in VARIABLES[:3]:
        assert abs(metrics[f"table1.best.{variable}_rms_mm"] - metrics[f"table1.floor.{variable}_rms_mm"]) < 4.0
    assert 10.0 < metrics["table1.evaluations_per_variable"] < 40.0
    table = (tmp_path / "table.txt").read_text()
    assert "paper: max / rms" in table and "8.0 / 4.8 mm" in table and table in capsys.readouterr().out + "\n"
    assert colors_on(tmp_path / "fig4.png") > 0.02
    assert all(colors_on(tmp_path / f"{name}.png") > 0.0002 for name in ("bias", "cost", "valley"))
    page = (tmp_path / "report.html").read_text()
    assert page.count("data:image/png") == 4 and "one renderer: stepping" in page


@pytest.mark.long
def test_convergence(tmp_path):
    assert main(["reproduce", "convergence", "--quick", "--output", str(tmp_path)]) == 0
    metrics = metrics_of(tmp_path)
    for body in ("ellipsoid", "nurbs"):
        for variable, unit in zip(VARIABLES, UNITS, strict=True):
            prefix = f"convergence.{body}.{variable}"
            assert metrics[f"{prefix}_minimum_off_{unit}"] == 0.0  # to the coarse grid of a quick run
            assert 0.0 < metrics[f"{prefix}_basin_narrowest_{unit}"] <= metrics[f"{prefix}_basin_median_{unit}"]
        assert metrics[f"convergence.{body}.default_60mm_6deg"] == 1.0
    for name in ("fig5", "fig6", "success_ellipsoid", "success_nurbs"):
        assert colors_on(tmp_path / f"{name}.png") > 0.001


@pytest.mark.long
def test_figures(tmp_path, capsys):
    assert main(["reproduce", "figures", "--quick", "--output", str(tmp_path)]) == 0
    for name in ("fig1", "fig2"):
        assert colors_on(tmp_path / f"{name}.png") > 0.02
    assert cv2.imread(str(tmp_path / "fig3.png")).std() > 5.0
    assert (tmp_path / "surface_distance.txt").read_text() == capsys.readouterr().out
    metrics = metrics_of(tmp_path)
    assert 2.0 < metrics["surface_distance.left_thigh_mean_mm"] < 20.0
    assert metrics["surface_distance.head_mean_mm"] < metrics["surface_distance.head_max_mm"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["convergence", "--trials", "0"], "--trials"), (["figures", "--rig", "nowhere.yaml"], "nowhere.yaml")],
)
def test_bad_input_is_one_line(arguments, said, tmp_path, capsys):
    assert main(["reproduce", *arguments, "--quick", "--output", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert said in error.splitlines()[-1]
