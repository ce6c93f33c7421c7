"""Which images are looked at, which views are too blurred, and what is said of a camera that saw no board."""

from types import SimpleNamespace

import numpy as np
import pytest

from tracker_node.calibration.board import views as board_views
from tracker_node.calibration.board.board import Board, BoardView
from tracker_node.calibration.board.views import CameraViews, detect_boards, with_board, without_blur
from tracker_node.errors import CalibrationError

CHESS = Board("chessboard", 6, 4, 0.03)
CHARUCO = Board("charuco", 6, 5, 0.03)


def view(edge_px=2.0, stamp_ns=0):
    return BoardView(stamp_ns, np.arange(4), np.zeros((4, 2)), edge_px)


def edges(views):
    return [view.edge_px for view in views]


def test_edges_of_four_pixels_are_sharp_whatever_the_others_are():
    sharp, blurred = without_blur([view(e) for e in (1.0, 1.0, 1.0, 4.0, 4.1)])
    assert edges(sharp) == [1.0, 1.0, 1.0, 4.0] and blurred == 1


def test_beyond_that_views_are_held_against_the_median():
    sharp, blurred = without_blur([view(e) for e in (5.0, 5.0, 5.0, 8.9, 9.1, 20.0, 4.0)])
    assert edges(sharp) == [5.0, 5.0, 5.0, 8.9, 4.0] and blurred == 2


def test_no_views_are_none():
    assert without_blur([]) == ([], 0)


def seen(n_views, n_searched=10, backs=0):
    return CameraViews((160, 120), tuple(view() for _ in range(n_views)), n_searched, backs=backs)


def test_cameras_without_the_board_are_left_out_with_the_reason():
    given = {"a": seen(1), "b": seen(0, 12), "c": seen(2), "d": seen(0, 7, 3)}
    found, left_out = with_board(given, CHESS, 2)
    assert list(found) == ["a", "c"] and list(left_out) == ["b", "d"]
    asked = "are its columns and rows (inner corners) and its kind right; is it printed white on black (inverted)?"
    assert left_out["b"] == f"the board ({CHESS}) is in none of its 12 images: {asked}"
    assert left_out["d"].startswith(f"the board ({CHESS}) is in none of its 7 images: its mirrored back is")
    assert left_out["d"].endswith("(in 3 of those searched for it)")


def test_an_inverted_board_of_squares_is_asked_for_otherwise():
    board = Board("charuco", 6, 5, 0.03, inverted=True)
    _, left_out = with_board({"a": seen(1), "b": seen(0)}, board, 1)
    assert left_out["b"].endswith(": are its columns and rows (squares) and its kind right?")


def test_too_few_cameras_are_refused_by_the_first_without_the_board():
    with pytest.raises(CalibrationError, match=r"b.*in none of its 10 images"):
        with_board({"a": seen(1), "b": seen(0), "c": seen(0)}, CHESS, 2)
    assert len(with_board({"a": seen(1), "b": seen(0)}, CHESS, 1)[0]) == 1


def test_too_few_cameras_that_all_see_it_are_refused_too():
    with pytest.raises(CalibrationError, match=r"a.*2 cameras are needed that see the board"):
        with_board({"a": seen(1)}, CHESS, 2)


class Source:
    """Images at a rate; each is its own number."""

    width, height = 160, 120

    def __init__(self, n_images, rate_hz=10.0, first_ns=0):
        self.n_images, self.rate_hz, self._first_ns = n_images, rate_hz, first_ns
        self.counts = SimpleNamespace(problems=["cut off"])

    def __iter__(self):
        for i in range(self.n_images):
            yield self._first_ns + round(i * 1e9 / self.rate_hz), np.full((2, 2, 3), i, np.uint8)


@pytest.fixture
def board_in(monkeypatch):
    """Says in which images the board is, and its back; lists the images that were looked at."""
    here = SimpleNamespace(front=set(), back=set(), looked=[], looked_for_back=[])

    class Detector:
        def __init__(self, board):
            pass

        def find(self, bgr, stamp_ns, number):
            here.looked.append(number)
            assert bgr[0, 0, 0] == number
            return view(stamp_ns=stamp_ns) if number in here.front else None

        def sees_back(self, bgr):
            here.looked_for_back.append(int(bgr[0, 0, 0]))
            return bgr[0, 0, 0] in here.back

    monkeypatch.setattr(board_views, "BoardDetector", Detector)
    return here


def test_every_image_of_a_short_recording_is_searched(board_in):
    board_in.front = {3, 5}
    told = []
    found = detect_boards({"a": Source(20)}, CHARUCO, most_images=20, progress=lambda *given: told.append(given))["a"]
    assert board_in.looked == list(range(20)) and found.n_searched == 20 and found.image_size == (160, 120)
    assert [v.stamp_ns for v in found.views] == [300_000_000, 500_000_000] and found.problems == ("cut off",)
    assert found.image[0, 0, 0] == 3 and found.blurred == 0 and found.backs == 0
    assert told == [("looking for the board", done, 20) for done in (10, 20, 20)]


def test_of_a_long_recording_bursts_of_three_are_searched(board_in):
    found = detect_boards({"a": Source(40)}, CHARUCO, most_images=12)["a"]
    assert board_in.looked == [0, 1, 2, 10, 11, 12, 20, 21, 22, 30, 31, 32] and found.n_searched == 12


def test_a_third_of_the_images_without_the_board_are_searched_for_its_back_until_it_was_seen(board_in):
    board_in.back = {3, 5}
    found = detect_boards({"a": Source(8)}, CHARUCO)["a"]
    assert board_in.looked_for_back == [0, 3, 4, 5, 6, 7] and found.backs == 2


def test_the_longest_and_the_fastest_recording_say_how_far_bursts_are_apart():
    period = board_views._burst_period_s
    assert period({"a": Source(100, 10.0), "b": Source(60, 30.0)}, 300) == 0.0  # 10 s at 30 Hz
    assert period({"a": Source(100, 10.0), "b": Source(60, 30.0)}, 299) == pytest.approx(10.0 * 3 / 299)


def test_progress_goes_no_farther_than_its_end(board_in):
    told = []
    counter = board_views._Counter(11, lambda *given: told.append(given[1:]))
    for _ in range(25):
        counter.add()
    assert told == [(10, 11)]
    counter.finish()
    assert told == [(10, 11), (11, 11)]
    quiet = board_views._Counter(10, None)
    for _ in range(10):
        quiet.add()
    quiet.finish()
