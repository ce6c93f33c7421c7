"""The benchmark of round cones within meshes runs, and its figures are those of solids whose volumes are known."""

import numpy as np
import pytest

from benchmark import mesh_capsules
from tracker_node.model.shapes.primitives import Box, Ellipsoid


def test_figures_of_a_ball_and_a_box():
    ball = mesh_capsules._figures(mesh_capsules._mesh(Ellipsoid((0.1, 0.1, 0.1))), 20_000)
    assert ball["hull_share"] == pytest.approx(1.0, abs=1e-9)
    assert 0.9 < ball["share"] < 1.01 and ball["protrusion_mm"] < 1.0
    beam = mesh_capsules._figures(mesh_capsules._mesh(Box((1.0, 0.1, 0.1))), 20_000)
    assert beam["share"] > 0.9 * np.pi / 4.0  # of a square, a round tube holds that much
    assert beam["protrusion_mm"] < 2.0


def test_it_reports_what_it_measures(monkeypatch, capsys):
    monkeypatch.setattr(mesh_capsules, "measure", lambda points: {"capsules.ball.share": points})
    assert mesh_capsules.main(["--quick"]) == 0
    assert "capsules.ball.share" in capsys.readouterr().out
