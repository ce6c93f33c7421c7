"""``rig import``: other programs' calibrations become a rig.yaml that loads."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from helpers.sources import projects
from tracker_node.calibration.points.dlt import dlt_parameters
from tracker_node.camera.light import Light
from tracker_node.cli.main import main
from tracker_node.geometry import so3
from tracker_node.loaders.rig.camera_info import dump_camera_info
from tracker_node.loaders.rig.control_points import dump_dlt
from tracker_node.loaders.rig.qualisys_xml import dump_qualisys
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file


def write_toml(path, rig) -> None:
    lines = []
    for i, camera in enumerate(rig):
        T = camera.T_cam_world
        lines += [
            f"[cam_{i}]",
            f'name = "{camera.name}"',
            f"size = [{camera.model.width}.0, {camera.model.height}.0]",
            f"matrix = {camera.model.K.tolist()}",
            f"distortions = {camera.model.distortion.tolist()}",
            f"rotation = {so3.log(T[:3, :3]).tolist()}",
            f"translation = {T[:3, 3].tolist()}",
        ]
    path.write_text("\n".join(lines) + "\n[metadata]\nerror = 0.0\n")


def test_a_pose2sim_rig_there_and_back(tmp_path, capsys):
    rig = circle_rig(3)
    write_toml(tmp_path / "calib.toml", rig)
    output = tmp_path / "out" / "rig.yaml"
    sources = str(tmp_path / "videos" / "{name}_{number:02}.mp4")
    assert main(["rig", "import", "--pose2sim", str(tmp_path / "calib.toml"), "--sources", sources, "-o", str(output)]) == 0
    imported = load_rig(output)
    assert imported.names == rig.names
    assert imported["cam02"].source == str(tmp_path / "videos" / "cam02_02.mp4")
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (30, 3)) + np.array([0.0, 0.0, 1.0])
    for camera in rig:
        np.testing.assert_allclose(imported[camera.name].project(points)[0], camera.project(points)[0], atol=1e-9)
    assert "does not exist" in capsys.readouterr().out


def test_lenses_of_ros_with_the_places_of_another_rig(tmp_path, capsys):
    rig = replace(circle_rig(2), world_frame="lab", lights=(Light("ambient", (0.5, 0.5, 0.5)),))
    for camera in rig:
        dump_camera_info(camera.name, camera.model, tmp_path / f"{camera.name}.yaml")
    write_rig_file(rig_file_of(rig), tmp_path / "places.yaml")
    files = [str(tmp_path / f"{camera.name}.yaml") for camera in rig]
    output = str(tmp_path / "rig.yaml")
    assert main(["rig", "import", "--camera-info", *files, "--like", str(tmp_path / "places.yaml"), "-o", output]) == 0
    np.testing.assert_allclose(load_rig(output)["cam02"].T_world_cam, rig["cam02"].T_world_cam, atol=1e-12)
    assert (load_rig(output).world_frame, load_rig(output).lights) == ("lab", rig.lights)  # they were left out
    assert main(["rig", "import", "--camera-info", *files, "-o", output]) == 2
    assert "is there already" in capsys.readouterr().err
    assert main(["rig", "import", "--camera-info", *files, "-o", output, "--force"]) == 0
    np.testing.assert_array_equal(load_rig(output)["cam02"].T_world_cam, np.eye(4))
    assert "places are not known" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--pose2sim", "none.toml"], "none.toml: field '(file)'"),
        (["--camera-info", "{tmp}/cam01.yaml", "{tmp}/cam01.yaml"], "a different name for each camera"),
        (["--camera-info", "{tmp}/cam01.yaml", "--sources", "{{nam}}.mp4"], "expected a pattern with {name} or {number}"),
        (["--camera-info", "{tmp}/cam01.yaml", "--unit", "mm"], "in meters already, got 'mm'"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, capsys, arguments, said):
    dump_camera_info("cam01", circle_rig(1).cameras[0].model, tmp_path / "cam01.yaml")
    arguments = [argument.format(tmp=tmp_path) for argument in arguments]
    assert main(["rig", "import", *arguments, "-o", str(tmp_path / "rig.yaml")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and said in error
    assert not (tmp_path / "rig.yaml").exists()


def test_videos_of_a_folder_are_named_by_camera(tmp_path, capsys):
    """Numbers that begin at 0 went to the cameras of the same numbers, from 1, and nothing was said."""
    write_toml(tmp_path / "calib.toml", circle_rig(3))
    projects.films(tmp_path / "videos", [f"video_{i}.mp4" for i in range(3)])
    arguments = ["rig", "import", str(tmp_path / "calib.toml"), "--sources", str(tmp_path / "videos")]
    assert main([*arguments, "-o", str(tmp_path / "rig.yaml")]) == 0
    assert "cam01 (video_0.mp4), cam02 (video_1.mp4), cam03 (video_2.mp4)" in capsys.readouterr().out


def test_numbers_count_cameras_that_are_left_out(tmp_path, capsys):
    """The videos of the third and fourth camera went to the second and third of the rig."""
    rig, pattern, output = circle_rig(3), str(tmp_path / "c{number}.mp4"), str(tmp_path / "rig.yaml")
    dump_qualisys(rig, tmp_path / "a.qca.txt")
    text = (tmp_path / "a.qca.txt").read_text()
    (tmp_path / "a.qca.txt").write_text(text.replace('active="1" serial="cam02"', 'active="0" serial="cam02"'))
    assert main(["rig", "import", str(tmp_path / "a.qca.txt"), "--sources", pattern, "-o", output]) == 0
    assert [Path(camera.source).stem for camera in load_rig(output)] == ["c1", "c3"]
    assert "camera 2 (cam02) is inactive: left out" in capsys.readouterr().out
    write_toml(tmp_path / "calib.toml", rig)
    text = (tmp_path / "calib.toml").read_text()
    (tmp_path / "calib.toml").write_text(text.replace("[cam_2]", "[cam_4]").replace('"cam01"', '"cam01"\nignore = true'))
    assert main(["rig", "import", str(tmp_path / "calib.toml"), "--sources", pattern, "-o", output, "--force"]) == 0
    assert [Path(camera.source).stem for camera in load_rig(output)] == ["c2", "c3"]
    assert "not the number of the table: cam02 2 ([cam_1]), cam03 3 ([cam_4])" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("apart_m", "unit", "said"),
    [
        (40.0, [], ""), (150.0, [], "m apart; if the file is"), (9e3, [], "--unit mm, cm or m"), (9e3, ["--unit", "mm"], ""),
        (300.0, ["--unit", "m"], "m apart; if the file is"),
    ],
)  # fmt: skip
def test_a_rig_of_kilometers_needs_its_unit(tmp_path, capsys, apart_m, unit, said):
    """FreeMoCap and Anipose write millimeters: cameras 6.7 km apart were written, with a note."""
    write_toml(tmp_path / "calib.toml", circle_rig(2, radius=0.5 * apart_m))
    code = main(["rig", "import", str(tmp_path / "calib.toml"), *unit, "-o", str(tmp_path / "rig.yaml")])
    assert code == (2 if "cm" in said else 0) and (tmp_path / "rig.yaml").exists() == (code == 0)
    printed = capsys.readouterr()
    assert said in printed.out + printed.err and ("apart" in printed.out + printed.err) == bool(said)


def test_a_rig_that_was_mended_gets_its_videos(tmp_path):
    rig = circle_rig(2)
    write_rig_file(rig_file_of(rig), tmp_path / "mended.yaml")
    sources = str(tmp_path / "{name}.mp4")
    assert main(["rig", "import", str(tmp_path / "mended.yaml"), "--sources", sources, "-o", str(tmp_path / "rig.yaml")]) == 0
    found = load_rig(tmp_path / "rig.yaml")
    assert [camera.source for camera in found] == [str(tmp_path / f"{name}.mp4") for name in rig.names]
    np.testing.assert_allclose(found.cameras[1].T_world_cam, rig.cameras[1].T_world_cam, atol=1e-12)


@pytest.mark.parametrize(("factor", "noted"), [(1.0, False), (0.5, True), (2.0, True)])
def test_a_size_that_is_not_that_of_the_images_is_noted(tmp_path, capsys, factor, noted):
    """DLT coefficients do not say it, and half and twice the size were taken without a word."""
    rig, output = circle_rig(3), str(tmp_path / "rig.yaml")
    width, height = (round(factor * side) for side in (rig.cameras[0].model.width, rig.cameras[0].model.height))
    dump_dlt([dlt_parameters(camera) for camera in rig], tmp_path / "dlt.csv")
    assert main(["rig", "import", str(tmp_path / "dlt.csv"), "--size", f"{width}x{height}", "-o", output]) == 0
    assert (f"far from the middle of images of {width}x{height}; is --size" in capsys.readouterr().out) == noted
