"""Elements and attributes of a URDF: what is read, in which order turns are, and what is refused with its place."""

import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.file_model import LARGEST
from tracker_node.loaders.model.urdf_xml import read_robot


def robot(tmp_path, inside="", name="a.urdf", attributes=""):
    path = tmp_path / name
    path.write_text(f"<robot {attributes}>{inside}</robot>")
    return path


def test_elements_are_called_by_their_names(tmp_path):
    root = read_robot(robot(tmp_path, '<link name="arm"><visual/><visual/></link><link/>'))
    assert root.tag == "robot"
    first, second = root.all("link")
    assert (first.field, second.field) == ("link[arm]", "link")
    assert [visual.field for visual in first.all("visual")] == ["link[arm].visual"] * 2
    assert first.all("other") == []


def test_one_of_a_kind(tmp_path):
    root = read_robot(robot(tmp_path, "<a/><b/><b/>"))
    assert root.one("a").tag == root.needed("a").tag == "a"
    assert root.one("c") is None
    with pytest.raises(FileFormatError, match=r"one <b>.*2 of them"):
        root.one("b")
    with pytest.raises(FileFormatError, match=r"a <c>.*none"):
        root.needed("c")


def test_numbers(tmp_path):
    root = read_robot(robot(tmp_path, attributes='one="1.5" two=" 1 -2e1 " text="" zero="0"'))
    assert root.number("one") == 1.5
    assert root.number("none", 7.0) == 7.0
    assert root.number("one", 7.0) == 1.5
    assert root.positive("one") == 1.5
    assert root.numbers("two", 2) == (1.0, -20.0)
    assert root.numbers("none", 2, (3.0, 4.0)) == (3.0, 4.0)
    assert root.numbers("two", 2, (3.0, 4.0)) == (1.0, -20.0)
    assert root.text("one") == "1.5"


@pytest.mark.parametrize(
    ("method", "arguments", "message"),
    [
        ("number", ("none",), "robot.none.*a finite number.*nothing"), ("numbers", ("two", 3), "3 finite numbers"),
        ("numbers", ("two", 1), "1 finite numbers"), ("number", ("text",), "a finite number"),
        ("positive", ("zero",), "a positive number"), ("positive", ("minus",), "a positive number"),
        ("number", ("word",), "a finite number"), ("number", ("grouped",), "a finite number"),
        ("number", ("nan",), "a finite number"), ("number", ("huge",), "a finite number"),
        ("text", ("none",), "text.*nothing"), ("text", ("text",), "text"),
    ],
)  # fmt: skip
def test_what_is_refused(tmp_path, method, arguments, message):
    values = {"two": "1 2", "text": "", "zero": "0", "minus": "-1", "word": "x", "grouped": "1_0", "nan": "nan"}
    values["huge"] = repr(2.0 * LARGEST)
    attributes = " ".join(f'{name}="{value}"' for name, value in values.items())
    with pytest.raises(FileFormatError, match=message):
        getattr(read_robot(robot(tmp_path, attributes=attributes)), method)(*arguments)


def test_the_largest_number_is_still_one(tmp_path):
    assert read_robot(robot(tmp_path, attributes=f'x="{-LARGEST!r}"')).number("x") == -LARGEST


def test_an_origin_turns_about_fixed_axes(tmp_path):
    """R = Rz(yaw) Ry(pitch) Rx(roll): the file's z, after a quarter turn about x and then one about z, is x."""
    root = read_robot(robot(tmp_path, '<origin xyz="1 2 3" rpy="1.5707963267948966 0 1.5707963267948966"/>'))
    expected = np.eye(4)
    expected[:3, :3] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    expected[:3, 3] = 1.0, 2.0, 3.0
    np.testing.assert_allclose(root.origin(), expected, atol=1e-12)
    pitched = read_robot(robot(tmp_path, '<origin rpy="0.3 0.5 0"/>')).origin()
    np.testing.assert_allclose(pitched[:3, 0], [np.cos(0.5), 0.0, -np.sin(0.5)], atol=1e-12)
    np.testing.assert_array_equal(pitched[:3, 3], 0.0)
    np.testing.assert_array_equal(read_robot(robot(tmp_path)).origin(), np.eye(4))


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"<robot>", "line 1, column 8.*XML"), (b"<other/>", "<robot>.*<other>"), (b"<robot>\n  <a></b></robot>", "line 2"),
     (b'<?xml version="1.0" encoding="nonsense"?><robot/>', "XML")],
)  # fmt: skip
def test_files_that_are_no_robot(tmp_path, content, message):
    path = tmp_path / "a.urdf"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        read_robot(path)


def test_zeros_at_the_end_are_left_out(tmp_path):
    path = tmp_path / "a.urdf"
    path.write_bytes(b"<robot/>\0\0")
    assert read_robot(path).tag == "robot"
    path.write_bytes('<?xml version="1.0" encoding="UTF-16"?><robot name="a"/>'.encode("utf-16"))
    assert read_robot(path).text("name") == "a"


@pytest.mark.parametrize("value", ["${x}", "$(find a)", "http://www.ros.org/wiki/xacro", "http://ros.org/xacro"])
def test_xacro_is_named(tmp_path, value):
    with pytest.raises(FileFormatError, match="xacro"):
        read_robot(robot(tmp_path, f'<link name="{value}"/>'))
    with pytest.raises(FileFormatError, match="a xacro file"):
        read_robot(robot(tmp_path, name="a.XACRO"))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(FileFormatError, match="no such file"):
        read_robot(tmp_path / "none.urdf")
    with pytest.raises(FileFormatError, match="a readable file"):
        read_robot(tmp_path)
