"""CSV files that no program wrote: one line that says where."""

from pathlib import Path

import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.csv_file import CsvTable


@pytest.mark.parametrize(("before", "line"), [("", 1), ("a,b\n1,2\n", 3)])
def test_a_field_of_more_than_128_kilobytes_is_named(tmp_path: Path, before: str, line: int) -> None:
    path = tmp_path / "clicks.csv"
    path.write_text(f'{before}1,"{"x" * 200_000}"\n')
    with pytest.raises(FileFormatError, match=rf"clicks\.csv: field 'line {line}'.*limit"):
        list(CsvTable(path).rows())
