"""JSON read, and numbers for JSON."""

import math

import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.json_values import finite, finite_list, parse_json, read_json


def test_json_is_read(tmp_path):
    (tmp_path / "a.json").write_text('{"a": [1, 2.5, null]}')
    assert read_json(tmp_path / "a.json") == {"a": [1, 2.5, None]}
    assert parse_json(b"[1]", "b.json") == [1]


def test_json_that_is_none(tmp_path):
    (tmp_path / "a.json").write_text("{")
    with pytest.raises(FileFormatError, match=r"a.json: field '\(content\)': expected JSON, got .*line 1 column 2"):
        read_json(tmp_path / "a.json")
    for text in (b"\xff\xfe\xff", "9" * 5000, ""):
        with pytest.raises(FileFormatError, match=r"^b.json: field '\(content\)': expected JSON"):
            parse_json(text, "b.json")
    with pytest.raises(FileFormatError, match=r"expected JSON, got 'lists or mappings nested without end'"):
        parse_json("[" * 200_000, "b.json")


def test_numbers_that_are_not_finite_are_null():
    assert finite(np.float32(1.5)) == 1.5 and type(finite(np.float32(1.5))) is float and finite(0) == 0.0
    assert finite(math.inf) is None and finite(-math.inf) is None and finite(math.nan) is None
    values = np.array([[1.23456, np.nan], [-np.inf, -2.0]])
    assert finite_list(values, 2) == [[1.23, None], [None, -2.0]]
    assert finite_list(values, 4)[0][0] == 1.2346
    assert type(finite_list(values, 2)[0][0]) is float and np.isnan(values[0, 1])
