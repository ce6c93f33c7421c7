"""CSV files that no program wrote: one line that says where."""

from pathlib import Path

import pytest

from helpers.sources.small_disk import limited_files
from tracker_node.errors import FileFormatError
from tracker_node.loaders.csv_file import CsvTable, CsvWriter


@pytest.mark.parametrize(("before", "line"), [("", 1), ("a,b\n1,2\n", 3)])
def test_a_field_of_more_than_128_kilobytes_is_named(tmp_path: Path, before: str, line: int) -> None:
    path = tmp_path / "clicks.csv"
    path.write_text(f'{before}1,"{"x" * 200_000}"\n')
    with pytest.raises(FileFormatError, match=rf"clicks\.csv: field 'line {line}'.*limit"):
        list(CsvTable(path).rows())


def test_the_mark_that_spreadsheets_begin_with_is_no_part_of_the_first_column(tmp_path: Path) -> None:
    path = tmp_path / "clicks.csv"
    path.write_bytes(b"\xef\xbb\xbfcamera,u\r\ncam01,2.5\r\n")
    table = CsvTable(path, ("camera", "u"))
    assert table.header == ("camera", "u") and [row.number(1) for row in table.rows()] == [2.5]


def test_a_full_disk_is_told_with_the_file(tmp_path: Path) -> None:
    with limited_files(1000), pytest.raises(OSError, match="File too large") as refused:
        CsvWriter(tmp_path / "states.csv", ["a"]).write_rows([["x" * 2000]])
    assert refused.value.filename == str(tmp_path / "states.csv")
