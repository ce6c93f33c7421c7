"""``calibrate time`` from videos to a rig: what it finds, writes and refuses."""

import json

import numpy as np
import pytest

from helpers.cameras.swinging_disc import LATE_S, write_swinging_disc
from tracker_node.calibration.clocks.offsets import ClockFit, Clocks
from tracker_node.cli.calibrate.time import print_table
from tracker_node.cli.main import main
from tracker_node.loaders.rig.rig_yaml import load_rig


@pytest.fixture
def rig(tmp_path):
    return write_swinging_disc(tmp_path)


def test_a_late_camera(rig, tmp_path, capsys):
    output = tmp_path / "out/timed.yaml"
    output.parent.mkdir()
    arguments = ["calibrate", "time", "--rig", str(rig), "-o", str(output), "--max-offset", "0.4", "--quiet"]
    assert main(arguments) == 0
    timed = load_rig(output)
    assert 1e-9 * (timed["right"].time_offset_ns - timed["left"].time_offset_ns) == pytest.approx(LATE_S, abs=0.003)
    assert timed["left"].source == str(tmp_path / "left.avi")
    figures = json.loads(output.with_suffix(".json").read_text())["metrics"]
    assert figures["time.right.offset_ms"] - figures["time.left.offset_ms"] == pytest.approx(1e3 * LATE_S, abs=3.0)
    assert figures["time.right.offset_sigma_ms"] > 0.0 and "time.right.covariance_left_ms2" in figures
    before = output.read_bytes()
    assert main(arguments) != 0
    assert "is there already" in capsys.readouterr().err and output.read_bytes() == before


@pytest.mark.parametrize(
    ("more", "said"),
    [(["--max-offset", "-1"], "--max-offset"), (["--seconds", "0"], "--seconds"), (["--rig", "missing.yaml"], "missing.yaml")],
)
def test_refusals(rig, tmp_path, capsys, more, said):
    output = tmp_path / "timed.yaml"
    assert main(["calibrate", "time", "--rig", str(rig), "-o", str(output), *more]) != 0
    error = capsys.readouterr().err
    assert said in error and "Traceback" not in error and not output.exists()


CLOCKS = Clocks(
    {"left": ClockFit(0.01, 0.002, 3e-5, 1e-6, 0.9, 0.5), "right": ClockFit(-0.01, 0.003, 0.0, 0.0, 0.8, 0.85)},
    5.0, np.array([[4e-6, -2e-6], [-2e-6, 9e-6]]), 1.5,
)  # fmt: skip


def test_the_table_says_what_was_not_estimated_and_what_is_in_doubt(capsys):
    print_table(CLOCKS)
    _, left, right, *notes = capsys.readouterr().out.splitlines()
    assert left.split() == ["left", "10.00", "+-", "2.00", "30.0", "+-", "1.0", "0.90", "0.50"]
    assert right.split() == ["right", "-10.00", "+-", "3.00", "not", "estimated", "0.80", "0.85"]
    assert len(notes) == 1
    assert "another offset of right" in notes[0]
