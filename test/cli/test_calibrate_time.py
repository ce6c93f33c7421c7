"""``calibrate time`` from videos to a rig: what it finds, writes and refuses."""

import json

import cv2
import numpy as np
import pytest

from tracker_node.cli.main import main
from tracker_node.loaders.rig_yaml import load_rig

RATE_HZ, N, LATE_S = 60.0, 80, 0.0533
SIZE = (160, 120)


@pytest.fixture
def rig(tmp_path):
    """Two cameras side by side before a disc that swings; the second is late by its own clock."""
    lines = ["cameras:"]
    for name, x, late_s in (("left", -0.5, 0.0), ("right", 0.5, LATE_S)):
        video = cv2.VideoWriter(str(tmp_path / f"{name}.avi"), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, SIZE)
        for i in range(N):
            t = i / RATE_HZ + late_s
            place = np.array([0.3 * np.sin(5.0 * t) - x, 0.5 * np.sin(9.0 * t + 1.0) * np.sin(2.3 * t), 3.0])
            u, v = 150.0 * place[:2] / place[2] + [80.0, 60.0]
            image = np.full((SIZE[1], SIZE[0], 3), 60, np.uint8)
            cv2.circle(image, (round(16 * float(u)), round(16 * float(v))), 16 * 9, (60, 220, 120), -1, cv2.LINE_AA, shift=4)
            video.write(image)
        video.release()
        pose = f"[[1, 0, 0, {x}], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"
        lens = "image_size: [160, 120], K: [[150, 0, 80], [0, 150, 60], [0, 0, 1]]"
        lines.append(f"  {name}: {{{lens}, T_world_cam: {pose}, source: {name}.avi, time_offset_s: 0.01}}")
    path = tmp_path / "rig.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path


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
