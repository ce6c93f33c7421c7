"""JSON read, and numbers for JSON."""

import math

import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.json_values import finite, finite_list, parse_json, parse_xml, read_json
from tracker_node.loaders.model.urdf_xml import read_robot
from tracker_node.loaders.rig.opencv_storage import read_storage
from tracker_node.loaders.rig.qualisys_xml import load_qualisys


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


@pytest.mark.parametrize(
    ("reader", "top", "encoding"),
    [
        (read_storage, "opencv_storage", "utf-8"), (load_qualisys, "calibration", "utf-8"), (read_robot, "robot", "utf-8"),
        (load_qualisys, "calibration", "utf-16"), (read_robot, "robot", "utf-16"),
    ],
)  # fmt: skip
def test_no_reader_of_xml_takes_entities(tmp_path, reader, top, encoding):
    """Calibrations of Qualisys and robots were read with them: a few hundred bytes could become gigabytes."""
    path = tmp_path / "a.xml"
    path.write_bytes(f'<!DOCTYPE {top} [\n<!ENTITY a "b">]><{top} name="&a;"/>'.encode(encoding))
    with pytest.raises(FileFormatError, match=r"'line 2, column \d+': expected XML without entities of its own"):
        reader(path)


def test_xml_is_read():
    assert parse_xml('<a b="1"><c/></a>', "x")[0].tag == "c"
    assert parse_xml(b'<?xml version="1.0" encoding="latin1"?><a>\xe9</a>', "x").text == "é"
    assert parse_xml("<!DOCTYPE a><a>&amp;</a>", "x").text == "&"  # a document type alone does no harm
    with pytest.raises(FileFormatError, match=r"^x: field 'line 2, column 5': expected XML, got 'mismatched tag'"):
        parse_xml("<a>\n  </b></a>", "x")
    with pytest.raises(FileFormatError, match="undefined entity"):
        parse_xml('<!DOCTYPE a SYSTEM "file:///etc/passwd"><a>&b;</a>', "x")


def test_numbers_that_are_not_finite_are_null():
    assert finite(np.float32(1.5)) == 1.5 and type(finite(np.float32(1.5))) is float and finite(0) == 0.0
    assert finite(math.inf) is None and finite(-math.inf) is None and finite(math.nan) is None
    values = np.array([[1.23456, np.nan], [-np.inf, -2.0]])
    assert finite_list(values, 2) == [[1.23, None], [None, -2.0]]
    assert finite_list(values, 4)[0][0] == 1.2346
    assert type(finite_list(values, 2)[0][0]) is float and np.isnan(values[0, 1])
