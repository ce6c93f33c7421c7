"""``calibrate dlt``: from clicked control points to a rig file, and what is refused."""

import numpy as np
import pytest

from helpers.cameras.cross_files import control_point_rows
from helpers.cameras.cross_files import write_control_points as write
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError
from tracker_node.experiments.cross.throw import cross_rig
from tracker_node.loaders.rig.control_points import COLUMNS, load_control_points
from tracker_node.loaders.rig.rig_yaml import load_rig

RIG = cross_rig()


@pytest.fixture
def rows():
    return control_point_rows()


@pytest.mark.parametrize("constraint", ["none", "square", "radial"])
def test_exact_clicks_give_the_rig_back(tmp_path, rows, constraint, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)  # sources are given relative to it
    points, output = write(tmp_path / "points.csv", rows), tmp_path / "rig.yaml"
    arguments = ["--points", str(points), "--size", "768x576", "--constraint", constraint, "--sources", "videos/{name}.avi"]
    assert main(["calibrate", "dlt", *arguments, "-o", str(output)]) == 0
    rig = load_rig(output)
    assert rig.names == RIG.names and rig["left"].source == str(tmp_path / "videos" / "left.avi")
    for found, true in zip(rig, RIG, strict=True):
        np.testing.assert_allclose(found.T_world_cam, true.T_world_cam, atol=1e-5)
        np.testing.assert_allclose(found.model.K, true.model.K, atol=1e-2)
    said = capsys.readouterr().out
    assert "top              20     0.00" in said and "reconstruct the points 0.00 mm from their places" in said


def test_the_worst_point_is_named(tmp_path, rows, capsys):
    rows[7][5] = repr(float(rows[7][5]) + 15.0)
    points = write(tmp_path / "points.csv", rows)
    main(["calibrate", "dlt", "--points", str(points), "--size", "768x576", "-o", str(tmp_path / "rig.yaml")])
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("left"))
    assert line.split()[-1] == "p7" and float(line.split()[2]) > 1.0


def test_nothing_is_overwritten(tmp_path, rows, capsys):
    points, output = write(tmp_path / "points.csv", rows), tmp_path / "rig.yaml"
    output.write_text("precious")
    arguments = ["calibrate", "dlt", "--points", str(points), "--size", "768x576", "-o", str(output)]
    assert main(arguments) == 2 and "is there already" in capsys.readouterr().err
    assert output.read_text() == "precious"
    assert main([*arguments, "--force"]) == 0 and load_rig(output).names == RIG.names


@pytest.mark.parametrize(("pattern", "said"), [("{nam}.avi", "a pattern with {name} or {number}"), ("usb9:{name}", "usb9:left")])
def test_a_wrong_pattern_of_sources_is_named(tmp_path, rows, capsys, pattern, said):
    points, output = write(tmp_path / "points.csv", rows), tmp_path / "rig.yaml"
    arguments = ["--points", str(points), "--size", "768x576", "--sources", pattern, "-o", str(output)]
    assert main(["calibrate", "dlt", *arguments]) == 2
    assert said in capsys.readouterr().err and not output.exists()


def refusal(tmp_path, rows, capsys, header=COLUMNS, size="768x576") -> str:
    points = write(tmp_path / "points.csv", rows, header)
    assert main(["calibrate", "dlt", "--points", str(points), "--size", size, "-o", str(tmp_path / "rig.yaml")]) == 2
    return capsys.readouterr().err


def test_bad_input_is_named(tmp_path, rows, capsys):
    assert "camera 'left': expected at least 6 control points, got 5" in refusal(tmp_path, rows[:5], capsys)
    flat = [[*row[:4], "0.5", *row[5:]] for row in rows]
    assert "lie in one plane" in refusal(tmp_path, flat, capsys)
    line = [[*row[:2], row[4], row[4], row[4], *row[5:]] for row in rows]
    assert "lie on one line" in refusal(tmp_path, line, capsys)
    millimeters = [[*row[:2], *(repr(1e3 * float(value)) for value in row[2:5]), *row[5:]] for row in rows]
    assert "are they millimeters? give meters" in refusal(tmp_path, millimeters, capsys)
    assert "--size" in refusal(tmp_path, rows, capsys, size="768")
    assert "columns starting with camera,point" in refusal(tmp_path, rows, capsys, header=("cam", *COLUMNS[1:]))


@pytest.mark.parametrize(
    ("row", "column", "value", "message"),
    [
        (3, 5, "wide", r"line 5, column 'u'.*a number"),
        (3, 1, "p2", r"line 5.*each point once for camera 'left'"),
        (23, 2, "9.0", r"line 25.*point 'p3' in one place"),
        (3, 0, "", r"line 5.*names of a camera and a point"),
    ],
)
def test_bad_lines_are_named(tmp_path, rows, row, column, value, message):
    rows[row][column] = value
    with pytest.raises(FileFormatError, match=message):
        load_control_points(write(tmp_path / "points.csv", rows))


def test_an_empty_file_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match="one line at least"):
        load_control_points(write(tmp_path / "points.csv", []))
