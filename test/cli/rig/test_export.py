"""``tracker_node rig export`` and back with ``rig import``."""

import json

import numpy as np
import pytest

from helpers.cameras.moving_balls import balls_rig
from tracker_node.cli.main import main
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file


@pytest.fixture
def rig_path(tmp_path):
    write_rig_file(rig_file_of(balls_rig(3)), tmp_path / "rig.yaml")
    return tmp_path / "rig.yaml"


@pytest.mark.parametrize(
    ("target", "file"),
    [("pose2sim", "a.toml"), ("anipose", "a.toml"), ("caliscope", "a.toml"), ("opencv", "a.yml"), ("qualisys", "a.qca.txt")],
)
def test_there_and_back(rig_path, tmp_path, target, file, capsys):
    assert main(["rig", "export", str(rig_path), "--to", target, "-o", str(tmp_path / file)]) == 0
    assert main(["rig", "import", str(tmp_path / file), "-o", str(tmp_path / "back.yaml")]) == 0
    for a, b in zip(load_rig(tmp_path / "back.yaml"), load_rig(rig_path), strict=True):
        np.testing.assert_allclose(a.T_world_cam, b.T_world_cam, atol=1e-9)
        np.testing.assert_allclose(a.model.K, b.model.K, atol=1e-9)
    assert main(["rig", "export", str(rig_path), "--to", target, "-o", str(tmp_path / file)]) == 2
    assert "is there already" in capsys.readouterr().err


def test_lenses_one_by_one_keep_what_ros_keeps_and_the_rest_is_told(rig_path, tmp_path, capsys):
    assert main(["rig", "export", str(rig_path), "--to", "camera_info", "-o", str(tmp_path / "lenses")]) == 0
    assert "the places of the cameras" in capsys.readouterr().out
    files = [str(tmp_path / "lenses" / f"cam{i}.yaml") for i in (1, 2, 3)]
    assert main(["rig", "import", *files, "--like", str(rig_path), "-o", str(tmp_path / "back.yaml")]) == 0
    np.testing.assert_allclose(load_rig(tmp_path / "back.yaml")["cam2"].T_world_cam, load_rig(rig_path)["cam2"].T_world_cam)


def test_dlt_needs_a_size_and_loses_distortion(rig_path, tmp_path, capsys):
    assert main(["rig", "export", str(rig_path), "--to", "dlt", "-o", str(tmp_path / "dlt.csv")]) == 0
    assert "distortion (cam1, cam2, cam3)" in capsys.readouterr().out
    assert main(["rig", "import", str(tmp_path / "dlt.csv"), "-o", str(tmp_path / "back.yaml")]) == 2
    assert "--size" in capsys.readouterr().err
    assert main(["rig", "import", str(tmp_path / "dlt.csv"), "--size", "320x240", "-o", str(tmp_path / "back.yaml")]) == 0
    np.testing.assert_allclose(load_rig(tmp_path / "back.yaml")["cam3"].center, load_rig(rig_path)["cam3"].center, atol=1e-6)


def test_millimetres_are_noticed_and_can_be_said(rig_path, tmp_path, capsys):
    main(["rig", "export", str(rig_path), "--to", "pose2sim", "-o", str(tmp_path / "a.toml")])
    lines = (tmp_path / "a.toml").read_text().splitlines()
    for i, line in enumerate(lines):
        if line.startswith("translation"):
            lines[i] = "translation = " + str([1000.0 * v for v in json.loads(line.split("=")[1])])
    (tmp_path / "mm.toml").write_text("\n".join(lines))
    assert main(["rig", "import", str(tmp_path / "mm.toml"), "-o", str(tmp_path / "back.yaml")]) == 2
    assert "say their unit: --unit mm" in capsys.readouterr().err
    assert main(["rig", "import", str(tmp_path / "mm.toml"), "--unit", "mm", "-o", str(tmp_path / "back.yaml")]) == 0
    assert "--unit mm" not in capsys.readouterr().out
    np.testing.assert_allclose(load_rig(tmp_path / "back.yaml")["cam1"].center, load_rig(rig_path)["cam1"].center, atol=1e-9)


def test_what_is_in_metres_already_takes_no_unit(rig_path, tmp_path, capsys):
    main(["rig", "export", str(rig_path), "--to", "qualisys", "-o", str(tmp_path / "a.qca.txt")])
    assert main(["rig", "import", str(tmp_path / "a.qca.txt"), "--unit", "mm", "-o", str(tmp_path / "back.yaml")]) == 2
    assert "none with qualisys files" in capsys.readouterr().err
    assert not (tmp_path / "back.yaml").exists()


def test_a_rig_file_needs_no_import(rig_path, tmp_path, capsys):
    assert main(["rig", "import", str(rig_path), "-o", str(tmp_path / "back.yaml")]) == 2
    assert "a rig.yaml, which needs no import but --sources" in capsys.readouterr().err
    assert not (tmp_path / "back.yaml").exists()
