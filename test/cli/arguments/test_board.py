"""The board and its recordings as the command line names them: each limit, from both sides."""

import argparse

import pytest

from tracker_node.cli.arguments.board import _name_and_path, add_board_arguments, board_of, sources_of
from tracker_node.errors import FileFormatError, TrackerError, UnknownNameError


def arguments(*options, videos=("a.mp4",)):
    parser = argparse.ArgumentParser()
    add_board_arguments(parser)
    return parser.parse_args(["--videos", *videos, *options])


def charuco(*options, size="5x4", square="0.04"):
    return board_of(arguments("--charuco", size, "--square", square, *options))


def test_a_charuco_board():
    board = charuco("--marker-ratio", "0.6", "--dictionary", "DICT_5X5_50")
    assert (board.kind, board.columns, board.rows, board.square_m) == ("charuco", 5, 4, 0.04)
    assert (board.marker_ratio, board.dictionary, board.inverted, board.legacy) == (0.6, "DICT_5X5_50", False, False)
    board = charuco("--inverted")
    assert (board.inverted, board.legacy) == (True, False)
    board = charuco("--legacy")
    assert (board.inverted, board.legacy) == (False, True)


def test_a_chessboard_needs_no_markers():
    board = board_of(arguments("--chessboard", "20x20", "--square", "0.04", "--dictionary", "DICT_4X4_50"))
    assert (board.kind, board.columns, board.rows) == ("chessboard", 20, 20)


@pytest.mark.parametrize("square", ["0.002", "0.5"])
def test_squares_that_a_person_can_print(square):
    assert charuco(square=square).square_m == float(square)


@pytest.mark.parametrize(
    ("square", "hint"), [("0.001", ""), ("0.6", ""), ("1.9", ""), ("2", "; 2 mm would be 0.002"), ("40", "; 40 mm would be 0.04")]
)  # fmt: skip
def test_squares_that_are_no_metres(square, hint):
    with pytest.raises(FileFormatError) as told:
        charuco(square=square)
    assert told.value.field == "--square"
    assert told.value.expected == f"the edge of a square in meters, 0.002 to 0.5{hint}"


def test_markers_are_smaller_than_squares():
    assert charuco("--marker-ratio", "0.1").marker_ratio == 0.1
    for ratio in ("0.09", "1.0"):
        with pytest.raises(FileFormatError, match="--marker-ratio"):
            charuco("--marker-ratio", ratio)


def test_a_dictionary_has_a_marker_for_every_second_square():
    """Fifty markers: ten by ten squares need all of them, eleven by ten five more."""
    assert charuco("--dictionary", "DICT_4X4_50", size="10x10").columns == 10
    with pytest.raises(FileFormatError, match="at most the 50 markers of DICT_4X4_50"):
        charuco("--dictionary", "DICT_4X4_50", size="11x10")
    with pytest.raises(UnknownNameError, match="DICT_4X4_49"):
        charuco("--dictionary", "DICT_4X4_49")


@pytest.mark.parametrize("size", ["2x4", "4x2", "101x4", "4x101", "4"])
def test_sizes_of_boards(size):
    with pytest.raises(FileFormatError, match="3x3 to 100x100"):
        charuco(size=size)


@pytest.mark.parametrize(
    ("text", "name", "path"),
    [
        ("left.mp4", "left", "left.mp4"),
        ("videos/cam-1.mp4", "cam_1", "videos/cam-1.mp4"),
        ("videos/left", "left", "videos/left"),
        ("01.mp4", "cam_01", "01.mp4"),
        ("left=a/1.mp4", "left", "a/1.mp4"),
        ("left=a=b.mp4", "left", "a=b.mp4"),
    ],
)
def test_names_of_cameras(text, name, path):
    assert _name_and_path(text) == (name, path)


def test_a_file_with_an_equals_sign_is_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a=b.mp4").touch()
    assert _name_and_path("a=b.mp4") == ("a_b", "a=b.mp4")


@pytest.mark.parametrize("text", ["1left=a.mp4", "=a.mp4", "le ft=a.mp4", "links\u00e4=a.mp4"])
def test_names_that_cameras_cannot_have(text):
    with pytest.raises(FileFormatError, match="letters, digits and _"):
        _name_and_path(text)


def test_too_few_images_are_refused_first():
    chessboard = ("--chessboard", "4x4", "--square", "0.04")
    with pytest.raises(FileFormatError, match="at least 10"):
        sources_of(arguments(*chessboard, "--images", "9"))
    with pytest.raises(TrackerError) as told:
        sources_of(arguments(*chessboard, "--images", "10", videos=("there_is_none.mp4",)))
    assert "at least 10" not in str(told.value)


def test_two_cameras_of_one_name(tmp_path):
    import cv2
    import numpy as np

    for folder in ("left", "right"):
        (tmp_path / folder / "cam").mkdir(parents=True)
        cv2.imwrite(str(tmp_path / folder / "cam" / "0.png"), np.zeros((8, 8, 3), np.uint8))
    videos = [str(tmp_path / folder / "cam") for folder in ("left", "right")]
    given = arguments("--chessboard", "4x4", "--square", "0.04", videos=videos)
    with pytest.raises(TrackerError, match="two recordings for camera 'cam'"):
        sources_of(given)
    given.videos = [f"a={videos[0]}", f"b={videos[1]}"]
    assert list(sources_of(given)) == ["a", "b"]
