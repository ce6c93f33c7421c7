"""Clicks on images as CSV."""

import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.rig.control_points import dump_clicks, load_clicks


@pytest.fixture
def path(tmp_path):
    return tmp_path / "clicks.csv"


def test_pixels_by_camera_and_point(path):
    path.write_text("camera,point,u,v\na,p,1.5,2\nb,p,3,4\na,q,5,6\n")
    clicks = load_clicks(path)
    assert {camera: list(points) for camera, points in clicks.items()} == {"a": ["p", "q"], "b": ["p"]}
    assert clicks["a"]["p"].tolist() == [1.5, 2.0] and clicks["a"]["q"].tolist() == [5.0, 6.0]
    assert clicks["b"]["p"].tolist() == [3.0, 4.0]


def test_what_is_written_is_read_back_bit_for_bit(path):
    dump_clicks({"a": {"p": np.array([1 / 3, 2.0])}, "b": {"q": np.array([0.1, -7.0])}}, path)
    assert path.read_text().splitlines()[:2] == ["camera,point,u,v", "a,p,0.33333333333333331,2"]
    clicks = load_clicks(path)
    assert clicks["a"]["p"].tolist() == [1 / 3, 2.0] and clicks["b"]["q"].tolist() == [0.1, -7.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("camera,point,u,v\n", r"field '\(file\)': expected one line at least, got 'none'"),
        ("point,camera,u,v\np,a,1,2\n", r"header.*camera,point,u,v"),
        ("camera,point,u,v\na,p,1,2\n,p,1,2\n", r"line 3.*names of a camera and a point, got \"'', 'p'"),
        ("camera,point,u,v\na,,1,2\n", r"line 2.*names of a camera and a point"),
        ("camera,point,u,v\na,p,1,2\na,p,1,2\n", r"line 3.*each point once for camera 'a', got \"'p' again"),
        ("camera,point,u,v\na,p,1,x\n", r"line 2, column 'v'.*a number, got 'x'"),
    ],
)
def test_refusals(path, text, said):
    path.write_text(text)
    with pytest.raises(FileFormatError, match=said):
        load_clicks(path)
