"""``synchronize`` from videos to a rig: what it finds, writes and refuses."""

import json

import numpy as np
import pytest

from benchmark.calibration import synchronize as benchmark
from helpers.cameras.swinging_disc import LATE_S, write_swinging_disc
from tracker_node.calibration.clocks.offsets import ClockFit, Clocks
from tracker_node.calibration.clocks.synchronization import clocks_of_videos
from tracker_node.cli.main import main
from tracker_node.cli.synchronize import print_table
from tracker_node.loaders.rig.rig_yaml import load_rig


@pytest.fixture
def rig(tmp_path):
    return write_swinging_disc(tmp_path)


def test_a_late_camera(rig, tmp_path, capsys):
    output = tmp_path / "out/timed.yaml"
    output.parent.mkdir()
    arguments = ["synchronize", "--rig", str(rig), "-o", str(output), "--max-offset", "0.4", "--quiet"]
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
    assert main(["synchronize", "--rig", str(rig), "-o", str(output), *more]) != 0
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


def test_by_sound_and_by_flashes_of_real_videos(tmp_path, capsys):
    room, place = benchmark.make_room(5), np.array([0.2, -0.1, 1.1])
    benchmark.write_sounds(room, tmp_path, 5, place)
    off = benchmark.errors_ms(room, tmp_path, "--by", "sound", "--at", *map(str, place))
    assert np.abs(off).max() < 1.0
    said = capsys.readouterr().out
    assert "rig_timed.png" in said and (tmp_path / "rig_timed.png").read_bytes().startswith(b"\x89PNG")
    assert np.abs(benchmark.errors_ms(room, tmp_path, "--by", "sound")).max() < 5.0
    figures = json.loads((tmp_path / "rig_timed.json").read_text())["metrics"]
    assert figures["time.cam1.offset_sigma_ms"] > 1.0  # a meter is three milliseconds


def test_videos_of_cameras_of_which_nothing_is_known(tmp_path):
    room, place = benchmark.make_room(5), np.array([0.2, -0.1, 1.1])
    benchmark.write_sounds(room, tmp_path, 5, place)
    clocks = clocks_of_videos({camera.name: str(tmp_path / camera.source) for camera in room.rig}, 2.0)
    way_s = [float(np.linalg.norm(camera.center - place)) / benchmark.SPEED_OF_SOUND for camera in room.rig]
    found = np.array([clock.offset_s for clock in clocks.cameras.values()])
    off = np.diff(found - room.late_s + way_s)  # by the way of the sound, which is not known
    assert np.abs(off).max() < 1e-3 and np.abs(np.diff(found - room.late_s)).max() < 0.02
    assert min(clock.offset_sigma_s for clock in clocks.cameras.values()) > 4e-3


def test_by_flashes_of_real_videos(tmp_path, monkeypatch):
    monkeypatch.setattr(benchmark, "FLASHED_S", 20.0)
    room = benchmark.make_room(6)
    benchmark.write_flashes(room, tmp_path, 6)
    assert np.abs(benchmark.errors_ms(room, tmp_path, "--by", "flash")).max() < 12.0


def test_videos_without_sound_are_named(rig, tmp_path, capsys):
    assert main(["synchronize", "--rig", str(rig), "-o", str(tmp_path / "x.yaml"), "--by", "sound", "--quiet"]) == 2
    assert "left.avi: field '(content)': expected a sound track, got 'none'" in capsys.readouterr().err


@pytest.mark.parametrize("more", [["--at", "0", "0", "1"], ["--by", "flash", "--whole-images"], ["--by", "sound", "--no-drift"]])
def test_options_of_another_way_are_refused(rig, tmp_path, capsys, more):
    assert main(["synchronize", "--rig", str(rig), "-o", str(tmp_path / "x.yaml"), *more]) == 2
    assert f"field '{more[0] if more[0] == '--at' else more[-1]}'" in capsys.readouterr().err


def test_the_name_of_before_says_the_present_one(capsys):
    assert main(["calibrate", "time", "--rig", "rig.yaml"]) == 2
    assert "it is 'synchronize' now" in capsys.readouterr().err
