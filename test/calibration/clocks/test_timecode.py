"""``synchronize --by timecode``: cameras of other rates, over midnight, and one without."""

import json
from dataclasses import replace
from fractions import Fraction

import pytest

from helpers.cameras.start_scenes import scene
from helpers.sources.timecoded_video import write_timecoded
from tracker_node.cli.main import main
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file

NTSC, DOUBLE = Fraction(30000, 1001), Fraction(60000, 1001)


def written(folder, *videos):
    cameras = []
    for camera, (label, rate) in zip(scene(len(videos)).rig, videos, strict=True):
        source = write_timecoded(folder / f"{camera.name}.mov", label, rate)
        lens = replace(camera.model, width=64, height=48)
        cameras.append(replace(camera, source=str(source), model=lens))
    rig = folder / "rig.yaml"
    write_rig_file(rig_file_of(replace(scene(len(videos)).rig, cameras=tuple(cameras))), rig)
    return rig


def test_cameras_of_other_rates_over_midnight(tmp_path):
    rig = written(tmp_path, ("23:59:58:00", 25), ("00:00:00:10", 25), ("23:59:59:12", 25))
    output = tmp_path / "timed.yaml"
    assert main(["synchronize", "--rig", str(rig), "--by", "timecode", "-o", str(output), "--quiet"]) == 0
    timed = load_rig(output)
    offsets = [1e-9 * camera.time_offset_ns for camera in timed]
    assert offsets[1] - offsets[0] == pytest.approx(2.4, abs=1e-5) and offsets[2] - offsets[0] == pytest.approx(1.48, abs=1e-5)
    figures = json.loads(output.with_suffix(".json").read_text())["metrics"]
    assert 4.0 < figures["time.cam0.offset_sigma_ms"] < 20.0 and output.with_suffix(".png").stat().st_size > 5000


def test_dropped_numbers_and_another_rate(tmp_path):
    rig = written(tmp_path, ("10:00:00;00", NTSC), ("10:00:00;30", DOUBLE))
    output = tmp_path / "timed.yaml"
    assert main(["synchronize", "--rig", str(rig), "--by", "timecode", "-o", str(output), "--quiet"]) == 0
    first, second = load_rig(output)
    assert 1e-9 * (second.time_offset_ns - first.time_offset_ns) == pytest.approx(30 * 1001 / 60000, abs=1e-5)


def test_a_camera_without_timecode_is_named(tmp_path, capsys):
    rig = written(tmp_path, ("10:00:00:00", 25), (None, 25))
    assert main(["synchronize", "--rig", str(rig), "--by", "timecode", "-o", str(tmp_path / "timed.yaml")]) == 2
    error = capsys.readouterr().err
    assert "cam1.mov" in error and "expected a timecode, got 'none'" in error and not (tmp_path / "timed.yaml").exists()
