"""Control points as CSV: with clicks, and places alone."""

import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.rig.control_points import dump_control_points, load_control_points, load_places

HEADER = "camera,point,x,y,z,u,v\n"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "points.csv"


def test_points_by_camera(path):
    path.write_text(HEADER + "a,p,1,2,3,10,20\nb,p,1,2,3,30,40\na,q,4,5,6,50,60\n")
    found = load_control_points(path)
    assert list(found) == ["a", "b"] and found["a"].names == ("p", "q")
    assert found["a"].points.tolist() == [[1, 2, 3], [4, 5, 6]] and found["a"].pixels.tolist() == [[10, 20], [50, 60]]
    assert found["b"].points.tolist() == [[1, 2, 3]] and found["b"].pixels.tolist() == [[30, 40]]
    copy = path.with_name("copy.csv")
    dump_control_points(found, copy)
    assert copy.read_text() == HEADER + "a,p,1,2,3,10,20\na,q,4,5,6,50,60\nb,p,1,2,3,30,40\n"
    assert {name: place.tolist() for name, place in load_places(copy).items()} == {"p": [1, 2, 3], "q": [4, 5, 6]}


def test_places_alone(path):
    path.write_text("point,x,y,z\np,1,2,3\nq,4,5,6\n")
    assert {name: place.tolist() for name, place in load_places(path).items()} == {"p": [1, 2, 3], "q": [4, 5, 6]}


def test_a_point_has_one_place_to_a_nanometre(path):
    path.write_text(HEADER + "a,p,1000,2,3,10,20\nb,p,1000.0000000005,2,3,30,40\n")
    assert load_control_points(path)["b"].points[0, 0] == 1000.0000000005
    path.write_text(HEADER + "a,p,1000,2,3,10,20\nb,p,1000.000000002,2,3,30,40\n")
    with pytest.raises(FileFormatError, match=r"line 3.*point 'p' in one place, \[1000.0, 2.0, 3.0\], got '?\[1000.000000002"):
        load_control_points(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (HEADER, r"field '\(file\)': expected one line at least, got 'none'"),
        ("camera,point,x,y,z,v,u\n", r"header.*camera,point,x,y,z,u,v"),
        (HEADER + ",p,1,2,3,4,5\n", r"line 2.*names of a camera and a point"),
        (HEADER + "a,,1,2,3,4,5\n", r"line 2.*names of a camera and a point"),
        (HEADER + "a,p,1,2,3,4,5\na,p,1,2,3,4,5\n", r"line 3.*each point once for camera 'a'.*'p' again"),
        (HEADER + "a,p,1,2,3,4,x\n", r"line 2, column 'v'"),
        (HEADER + "a,p,x,2,3,4,5\n", r"line 2, column 'x'"),
    ],
)
def test_refusals(path, text, said):
    path.write_text(text)
    with pytest.raises(FileFormatError, match=said):
        load_control_points(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("point,x,y,z\n", r"field '\(file\)': expected one line at least, got 'none'"),
        ("point,x,z,y\n", r"header.*point,x,y,z"),
        ("point,x,y,z\n,1,2,3\n", r"line 2.*the name of a point, each once"),
        ("point,x,y,z\np,1,2,3\np,1,2,3\n", r"line 3.*the name of a point, each once, got 'p'"),
        ("point,x,y,z\np,1,2,x\n", r"line 2, column 'z'"),
    ],
)
def test_refusals_of_places(path, text, said):
    path.write_text(text)
    with pytest.raises(FileFormatError, match=said):
        load_places(path)
