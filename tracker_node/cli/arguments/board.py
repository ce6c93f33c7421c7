"""Arguments and recordings that the calibrations from a board share."""

from __future__ import annotations

import argparse
import filecmp
import itertools
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import FileFormatError, TrackerError, UnknownNameError
from .cameras import size_option

if TYPE_CHECKING:
    from ...calibration.board.board import Board
    from ...calibration.board.views import CameraViews
    from ...loaders.images.source import ImageSource

DISTORTIONS = ("plumb_bob", "rational_polynomial", "equidistant", "none")
_SQUARE_M = (0.002, 0.5)  # what a person can print and hold


def add_board_arguments(parser: argparse.ArgumentParser) -> None:
    """Board, recordings, output."""
    add = parser.add_argument
    add("--videos", nargs="+", required=True, metavar="[NAME=]FILE",
        help="one video, image folder or pattern a camera; NAME is the camera's, without it the file's or folder's")  # fmt: skip
    add_board_shape(parser)
    add("--distortion", choices=DISTORTIONS, default="plumb_bob",
        help="lens model; equidistant is for fisheyes, rational_polynomial for wide lenses (default: %(default)s)")  # fmt: skip
    add("--images", type=int, default=600, metavar="N", help="search about so many images a camera (default: %(default)s)")
    add("--report", metavar="FILE", help="page with metrics and images (default: beside the output, .html)")
    add("--force", action="store_true", help="overwrite the output and the report")
    add("--quiet", action="store_true", help="no progress on stderr")


def add_board_shape(parser: argparse.ArgumentParser, required: bool = True) -> None:
    """Arguments that describe the board, for `board_of`.

    Parameters
    ----------
    parser : of a verb.
    required : whether a board must be given.
    """
    add = parser.add_argument
    board = parser.add_argument_group("board").add_mutually_exclusive_group(required=required)
    board.add_argument("--charuco", metavar="COLUMNSxROWS", help="a ChArUco board of so many squares")
    board.add_argument("--chessboard", metavar="COLUMNSxROWS", help="a chessboard of so many inner corners")
    add("--square", type=float, required=required, metavar="M", help="edge of a square, meters")
    add_markers(parser)
    add("--legacy", action="store_true", help="a ChArUco board made by OpenCV before 4.6, with an even number of rows")


def add_markers(parser: argparse.ArgumentParser) -> None:
    """Markers on the board, for `check_markers`."""
    add = parser.add_argument
    add("--marker-ratio", type=float, default=0.75, metavar="X", help="marker to square (default: %(default)s)")
    add("--dictionary", default="DICT_4X4_1000", metavar="NAME", help="of OpenCV (default: %(default)s)")
    add("--inverted", action="store_true", help="black and white are exchanged on the board")


def check_markers(args: argparse.Namespace) -> None:
    """Raise a `TrackerError` for markers that no board has, naming the option."""
    from ...calibration.board.board import dictionaries

    if not 0.1 <= args.marker_ratio < 1.0:
        raise FileFormatError("command line", "--marker-ratio", "0.1 or more, and less than 1", args.marker_ratio)
    if args.dictionary not in dictionaries():
        raise UnknownNameError("dictionary", args.dictionary, dictionaries())


def board_of(args: argparse.Namespace) -> Board:
    """The board that the arguments describe.

    Raises
    ------
    FileFormatError, UnknownNameError : naming the option.
    """
    from ...calibration.board.board import Board, n_markers

    option, text = ("--charuco", args.charuco) if args.charuco else ("--chessboard", args.chessboard)
    columns, rows = size_option(option, text, "columns x rows from 3x3 to 100x100, such as 4x5", 3, 100)
    if not _SQUARE_M[0] <= args.square <= _SQUARE_M[1]:
        hint = f"; {args.square:g} mm would be {1e-3 * args.square:g}" if 1e3 * _SQUARE_M[0] <= args.square else ""
        expected = f"the edge of a square in meters, {_SQUARE_M[0]} to {_SQUARE_M[1]}{hint}"
        raise FileFormatError("command line", "--square", expected, args.square)
    check_markers(args)
    kind = "charuco" if args.charuco else "chessboard"
    board = Board(kind, columns, rows, args.square, args.marker_ratio, args.dictionary, args.inverted, args.legacy)
    if board.n_markers > n_markers(board.dictionary):
        most = n_markers(board.dictionary)
        expected = f"a board of at most the {most} markers of {board.dictionary}, one on every second square"
        raise FileFormatError("command line", option, expected, text)
    return board


def sources_of(
    args: argparse.Namespace, stamps: str | None = None, late_s: Mapping[str, float] | None = None
) -> dict[str, ImageSource]:
    """Opened recordings by camera name.

    Parameters
    ----------
    args : of the command line.
    stamps : file with times for all cameras, see `loaders.images.stamps`.
    late_s : camera -> by how much its images are later than they say.

    Returns
    -------
    sources : by camera name.

    Raises
    ------
    TrackerError : two cameras of one name, or a recording that cannot be read; naming it.
    """
    from ...loaders.images.source import open_recordings

    if args.images < 10:
        raise FileFormatError("command line", "--images", "at least 10", args.images)
    return open_recordings(recordings_of(args), stamps, late_s)


def recordings_of(args: argparse.Namespace) -> dict[str, str]:
    """Paths of the recordings by camera name.

    Raises
    ------
    TrackerError : two cameras of one name.
    """
    paths: dict[str, str] = {}
    for text in args.videos:
        name, path = _name_and_path(text)
        if name in paths:
            raise TrackerError(f"two recordings for camera '{name}'; name them: --videos left={path} right=...")
        paths[name] = path
    return paths


def check_different(recordings: Mapping[str, str]) -> None:
    """Refuse one video under two names: its two cameras would stand in one place, and agree with each other.

    Parameters
    ----------
    recordings : path by camera name.

    Raises
    ------
    TrackerError : two files hold the same.
    """
    files = {name: Path(path) for name, path in recordings.items() if Path(path).is_file()}
    for (a, first), (b, second) in itertools.combinations(files.items(), 2):
        if first.stat().st_size == second.stat().st_size and filecmp.cmp(first, second, shallow=False):
            expected = "--videos: expected a recording of its own for each camera"
            raise TrackerError(f"{expected}, got the same for {a} and {b}: {first} and {second}")


def detect(
    args: argparse.Namespace, sources: dict[str, ImageSource], board: Board, least: int
) -> tuple[dict[str, CameraViews], dict[str, str]]:
    """Find the board in the images of every camera.

    A line on each camera goes to stdout, one on each that is left out to stderr.

    Parameters
    ----------
    args : of the command line.
    sources : by camera name.
    board : that is searched.
    least : cameras that must see it.

    Returns
    -------
    seen, left_out : views by camera; problems of the others.

    Raises
    ------
    CalibrationError : fewer than ``least`` cameras saw it.
    """
    from ...calibration.board.views import detect_boards, with_board
    from ...report.progress import StageProgress

    progress = None if args.quiet else StageProgress(f"calibrate {args.what}")
    seen, left_out = with_board(detect_boards(sources, board, args.images, progress), board, least)
    for name, problem in left_out.items():
        print(f"tracker_node calibrate {args.what}: {name}: {problem}; this camera is left out", file=sys.stderr)
    for name, found in seen.items():
        corners = sum(len(view.ids) for view in found.views)
        print(f"{name}: the board in {len(found.views)} of {found.n_searched} images, {corners} corners; {found.blurred} blurred")
        for problem in found.problems:
            print(f"{name}: note: {problem}")
        if found.backs:
            print(f"{name}: note: the board's mirrored back is in {found.backs} other images at least, which are left out")
    return seen, left_out


def _name_and_path(text: str) -> tuple[str, str]:
    name, found, path = text.partition("=")
    if not found or Path(text).exists():
        path = text
        name = re.sub(r"\W", "_", Path(text).stem if Path(text).suffix else Path(text).name)
        name = name if name[:1].isalpha() else f"cam_{name}"
    if not (name.isidentifier() and name.isascii()):
        raise FileFormatError("command line", "--videos", "camera names of letters, digits and _ (NAME=FILE)", text)
    return name, path
