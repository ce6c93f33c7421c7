"""Coordinates of other programs' files as variables of a pose: signs, units, axes, and gaps."""

import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.evaluation.motion.coordinates import _variable, _with_gaps, load_coordinates
from tracker_node.model.humans.human import human_model


def gaps(*stamps):
    n = len(stamps)
    found, values, valid = _with_gaps(np.array(stamps), np.arange(1.0, n + 1)[:, None], np.ones((n, 1), bool))
    return found.tolist(), values[:, 0].tolist(), valid[:, 0].tolist()


def test_a_row_that_is_not_valid_lies_amid_every_gap():
    stamps, values, valid = gaps(0, 10, 20, 60, 70, 80)
    assert stamps == [0, 10, 20, 40, 60, 70, 80]
    assert values == [1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0]
    assert valid == [True, True, True, False, True, True, True]


@pytest.mark.parametrize("stamps", [(5,), (0, 10), (0, 10, 20)])
def test_without_a_gap_nothing_is_put_in(stamps):
    assert gaps(*stamps)[0] == list(stamps)


@pytest.mark.parametrize(
    ("label", "variable"), [("root_tilt", "tilt"), ("tilt", "tilt"), ("root_other", "root_other"), ("left_hip_flexion",) * 2]
)
def test_columns_have_the_names_of_variables(label, variable):
    assert _variable(label) == (variable, 1.0)


def table(path, degrees, names, rows):
    lines = ["motion", "version=1", f"nRows={len(rows)}", f"nColumns={len(names) + 1}", f"inDegrees={degrees}", "endheader"]
    lines += ["\t".join(("time", *names))]
    lines += ["\t".join(map(str, row)) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


MODEL = human_model()


@pytest.mark.parametrize(("degrees", "factor"), [("yes", np.pi / 180.0), ("no", 1.0)])
def test_angles_are_in_radians_and_places_in_metres(tmp_path, degrees, factor):
    path = table(
        tmp_path / "a.mot", degrees, ("left_knee_flexion", "root_z", "other"), [(2.0, 30.0, 1.5, 9.0), (2.1, 40.0, 1.6, 9.0)]
    )
    names, stamps, values, valid = load_coordinates(path, MODEL, y_up=False)
    assert names == ("z", "left_knee_flexion")
    assert stamps.tolist() == [2_000_000_000, 2_100_000_000]
    np.testing.assert_allclose(values, [[1.5, 30.0 * factor], [1.6, 40.0 * factor]])
    assert valid.all()


def test_places_in_y_up_files_are_brought_to_the_world(tmp_path):
    """The file's (x, y, z) are the world's (y, z, x)."""
    path = table(tmp_path / "a.mot", "yes", ("root_x", "root_y", "root_z"), [(0.0, 1.0, 2.0, 3.0)])
    names, _, values, _ = load_coordinates(path, MODEL)
    assert dict(zip(names, values[0], strict=True)) == {"x": 3.0, "y": 1.0, "z": 2.0}
    names, _, values, _ = load_coordinates(path, MODEL, y_up=False)
    assert dict(zip(names, values[0], strict=True)) == {"x": 1.0, "y": 2.0, "z": 3.0}


def test_opensim_s_single_axes_are_taken_with_our_signs(tmp_path):
    path = table(tmp_path / "a.mot", "yes", ("hip_flexion_l", "knee_angle_r", "elbow_flex_l"), [(0.0, 10.0, 20.0, 30.0)])
    names, _, values, _ = load_coordinates(path, MODEL)
    degrees = dict(zip(names, np.degrees(values[0]), strict=True))
    assert degrees["left_hip_flexion"] == pytest.approx(10.0)
    assert degrees["right_knee_flexion"] == pytest.approx(20.0)
    assert degrees["left_elbow_flexion"] == pytest.approx(30.0)


def test_a_file_without_any_variable_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match="variables of"):
        load_coordinates(table(tmp_path / "a.mot", "yes", ("other",), [(0.0, 1.0)]), MODEL)
