"""DLT coefficients as text."""

import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.rig.control_points import dump_dlt, load_dlt
from tracker_node.loaders.rig.formats import DLT, detect


@pytest.fixture
def path(tmp_path):
    return tmp_path / "dlt.csv"


@pytest.mark.parametrize("between", [",", " ", ";", "\t", ", "])
def test_a_column_for_each_camera(path, between):
    path.write_text("\n".join(f"{i}{between}{100 + i}" for i in range(11)) + "\n\n")
    assert load_dlt(path).tolist() == [list(range(11)), list(range(100, 111))]


def test_decimal_commas_and_a_header(path):
    """Commas counted as separators, so that there were twice as many cameras, and all of them were mirrored."""
    path.write_text("L;camera\n\n" + "\n".join(f"{i},5;{100 + i},25e+00" for i in range(11)))
    assert detect(path) == DLT
    assert load_dlt(path).tolist() == [[i + 0.5 for i in range(11)], [i + 100.25 for i in range(11)]]
    path.write_text(path.read_text().replace("102,25e+00", "x"))
    with pytest.raises(FileFormatError, match=r"field 'line 5': expected numbers, got '2\.5 x'"):
        load_dlt(path)


def test_what_is_written_is_read_back_bit_for_bit(path):
    values = np.array([np.arange(11) / 3.0, np.arange(11) * 1e-17])
    dump_dlt(values, path)
    assert len(path.read_text().splitlines()) == 11 and path.read_text().splitlines()[0] == "0.0,0.0"
    assert path.read_text().endswith("\n") and np.array_equal(load_dlt(path), values)


@pytest.mark.parametrize("n", [10, 12])
def test_another_number_of_lines_is_refused(path, n):
    path.write_text("1\n" * n)
    with pytest.raises(FileFormatError, match=rf"'\(file\)': expected 11 lines, one per coefficient.*got '{n} lines'"):
        load_dlt(path)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1 x", r"field 'line 3': expected numbers, got '1 x'"),
        ("1", r"field 'line 3': expected 2 numbers, one per camera, got '1'"),
        ("1 2 3", r"field 'line 3': expected 2 numbers, one per camera"),
        ("1 nan", r"field 'line 3': expected 2 numbers, one per camera"),
        ("inf 1", r"field 'line 3': expected 2 numbers, one per camera"),
    ],
)
def test_lines_that_are_refused(path, line, said):
    lines = ["1 2"] * 11
    lines[2] = line
    path.write_text("\n".join(lines))
    with pytest.raises(FileFormatError, match=said):
        load_dlt(path)
