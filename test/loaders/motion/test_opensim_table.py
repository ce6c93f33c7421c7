"""Tables of OpenSim, which reads them itself here."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker_node.errors import FileFormatError
from tracker_node.loaders.motion.trc import NumberTable, dump_table, load_table

HEADER = "Coordinates\nversion=1\nnRows=2\nnColumns=3\ninDegrees=yes\n\nendheader\n"
TEXT = HEADER + "time\tknee_angle_r\thip_r\n0.0\t10\t20\n0.5\t30\tnan\n"


def table(n=6, k=4, in_degrees=True, seed=0):
    rng = np.random.default_rng(seed)
    valid = rng.random((n, k)) > 0.3
    names = tuple(f"angle_{i}" for i in range(k))
    return NumberTable(names, np.arange(n) / 60.0, rng.normal(size=(n, k)) * valid, valid, in_degrees)


@pytest.mark.parametrize("suffix", ["mot", "sto"])
@pytest.mark.parametrize("in_degrees", [True, False])
def test_opensim_reads_the_numbers_and_the_gaps(opensim, tmp_path, suffix, in_degrees):
    written = table(in_degrees=in_degrees)
    dump_table(written, tmp_path / f"a.{suffix}")
    read = opensim.TimeSeriesTable(str(tmp_path / f"a.{suffix}"))
    assert read.getColumnLabels() == written.names
    assert list(read.getIndependentColumn()) == written.times_s.tolist()
    assert read.getTableMetaDataString("inDegrees") == ("yes" if in_degrees else "no")
    numbers = read.getMatrix().to_numpy()
    assert np.array_equal(np.isfinite(numbers), written.valid)
    assert np.array_equal(numbers[written.valid], written.values[written.valid])


def test_a_table_without_gaps_is_read_by_the_older_class_too(opensim, tmp_path):
    written = replace(table(), valid=np.ones((6, 4), dtype=bool))
    dump_table(written, tmp_path / "a.mot")
    storage = opensim.Storage(str(tmp_path / "a.mot"))
    assert storage.getSize() == 6 and storage.isInDegrees()
    row = opensim.Vector(4, 0.0)
    storage.getDataAtTime(3 / 60.0, 4, row)
    assert row.to_numpy() == pytest.approx(written.values[3])


@given(st.integers(1, 6), st.integers(1, 5), st.booleans(), st.integers(0, 999))
def test_any_table_comes_back(tmp_path_factory, n, k, in_degrees, seed):
    path = tmp_path_factory.mktemp("mot") / "a.mot"
    written = table(n, k, in_degrees, seed)
    dump_table(written, path)
    read = load_table(path)
    assert read.names == written.names and read.in_degrees == in_degrees
    assert np.array_equal(read.valid, written.valid)
    assert np.array_equal(read.values, written.values) and np.array_equal(read.times_s, written.times_s)


def test_a_table_that_opensim_wrote(opensim, tmp_path):
    theirs = opensim.TimeSeriesTable()
    theirs.setColumnLabels(["knee_angle_r", "hip_flexion_r"])
    for i in range(3):
        theirs.appendRow(0.1 * i, opensim.RowVector([1.5 * i, -2.0]))
    theirs.addTableMetaDataString("inDegrees", "no")
    opensim.STOFileAdapter.write(theirs, str(tmp_path / "a.sto"))
    read = load_table(tmp_path / "a.sto")
    assert read.names == ("knee_angle_r", "hip_flexion_r") and not read.in_degrees
    assert read.values[:, 0].tolist() == [0.0, 1.5, 3.0] and read.values[:, 1].tolist() == [-2.0] * 3


@pytest.mark.parametrize(("old", "new", "field"), [
    ("endheader\n", "", "header"),
    ("inDegrees=yes", "inDegrees=maybe", "inDegrees"),
    ("inDegrees=yes\n", "", "inDegrees"),
    ("time\t", "frame\t", "column names"),
    ("hip_r", "knee_angle_r", "column names"),
    ("0.0\t10\t20\n0.5\t30\tnan\n", "", "rows"),
    ("10\t20", "10", "line 9"),
    ("10\t20", "10\ttwenty", "line 9"),
    ("0.5\t30", "0.0\t30", "time"),
])  # fmt: skip
def test_errors_name_file_and_place(tmp_path, old, new, field):
    assert old in TEXT
    (tmp_path / "a.mot").write_text(TEXT.replace(old, new))
    with pytest.raises(FileFormatError, match=r"a\.mot") as caught:
        load_table(tmp_path / "a.mot")
    assert caught.value.field == field


def test_spaces_do_for_tabs(tmp_path):
    (tmp_path / "a.mot").write_text(TEXT.replace("\t", "   "))
    read = load_table(tmp_path / "a.mot")
    assert read.values.tolist() == [[10.0, 20.0], [30.0, 0.0]] and read.valid.tolist() == [[True, True], [True, False]]


@given(st.lists(st.tuples(st.integers(0, len(TEXT) - 1), st.text(max_size=3)), min_size=1, max_size=6))
def test_damaged_text_is_read_or_named(tmp_path_factory, changes):
    path = tmp_path_factory.mktemp("damaged") / "a.mot"
    text = TEXT
    for place, put in changes:
        text = text[:place] + put + text[place + 1 :]
    path.write_text(text, encoding="utf-8", errors="replace")
    try:
        read = load_table(path)
    except FileFormatError as error:
        assert "a.mot" in str(error)
        return
    assert read.values.shape == (len(read.times_s), len(read.names)) == read.valid.shape
    assert np.isfinite(read.values).all() and (np.diff(read.times_s) > 0).all()
