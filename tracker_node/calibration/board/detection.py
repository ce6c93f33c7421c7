"""A board looked for in the recordings of all cameras at once, one thread a camera."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from ...errors import CalibrationError
from ...loaders.images.source import ImageSource
from .board import Board, BoardDetector, BoardView

BURST = 3  # images looked at in a row, so that it is known how the board moves
_BACK = "its mirrored back is, which is not measured from: show this camera the printed side together with another camera"
_SHARP_PX = 4.0  # an edge this wide is sharp in any camera
_BLURRED = 1.8  # times as wide as the camera's median: too blurred to be used

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class CameraViews:
    """What one camera saw of a board.

    Attributes
    ----------
    image_size : (width, height).
    views : in order of time.
    looked_at, blurred : images searched, and views left out since they are blurred.
    backs : images in which the board's mirrored back was seen; every third without the board is searched for it.
    problems : of the source, such as an end before the last announced image.
    picture : one of the images with the board, (h, w, 3) BGR.
    """

    image_size: tuple[int, int]
    views: tuple[BoardView, ...]
    looked_at: int = 0
    blurred: int = 0
    problems: tuple[str, ...] = field(default=())
    picture: np.ndarray | None = None
    backs: int = 0


def detect_boards(
    sources: Mapping[str, ImageSource], board: Board, most_images: int = 600, progress: Progress | None = None
) -> dict[str, CameraViews]:
    """Views of the board by every camera; those that never saw it have none (see `with_board`).

    Of long recordings about ``most_images`` a camera are searched: bursts of `BURST` images at the same times in all cameras.

    Parameters
    ----------
    progress : told (what, images done, images in all).

    Raises
    ------
    SourceError : images that change their size.
    """
    counter = _Counter(sum(source.n_images for source in sources.values()), progress)
    every_s = _burst_period_s(sources, most_images)
    with ThreadPoolExecutor(max_workers=min(len(sources), os.cpu_count() or 1)) as pool:
        jobs = {name: pool.submit(_detect, source, board, every_s, counter) for name, source in sources.items()}
        found = {name: job.result() for name, job in jobs.items()}
    counter.finish()
    return found


def with_board(seen: Mapping[str, CameraViews], board: Board, least: int) -> tuple[dict[str, CameraViews], dict[str, str]]:
    """The cameras that saw the board, and for each of the others why it has no part in the calibration.

    Raises
    ------
    CalibrationError : fewer than ``least`` cameras saw it; of the first that did not.
    """
    left_out = {}
    for name, found in seen.items():
        if not found.views:
            why = f"{_BACK} (in {found.backs} of those searched for it)" if found.backs else _advice(board)
            left_out[name] = f"the board ({board}) is in none of its {found.looked_at} images: {why}"
    if len(seen) - len(left_out) < least:
        name = next(iter(left_out), next(iter(seen), ""))
        raise CalibrationError(name, left_out.get(name, f"{least} cameras are needed that see the board"))
    return {name: found for name, found in seen.items() if name not in left_out}, left_out


def without_blur(views: list[BoardView]) -> tuple[list[BoardView], int]:
    """Views whose edges are about as sharp as the camera can, and how many are not."""
    if not views:
        return [], 0
    limit = max(_SHARP_PX, _BLURRED * float(np.median([view.edge_px for view in views])))
    sharp = [view for view in views if view.edge_px <= limit]
    return sharp, len(views) - len(sharp)


def _detect(source: ImageSource, board: Board, every_s: float, counter: _Counter) -> CameraViews:
    detector, views, looked_at, picture, backs = BoardDetector(board), [], 0, None, 0
    for number, (stamp_ns, bgr) in enumerate(source):
        counter.add()
        if every_s and 1e-9 * (stamp_ns % round(1e9 * every_s)) >= BURST / source.rate_hz - 1e-6:
            continue
        looked_at += 1
        view = detector.find(bgr, stamp_ns, number)
        if view is not None:
            views.append(view)
            picture = bgr if picture is None else picture
        elif looked_at % BURST == 1 or backs:
            backs += detector.sees_back(bgr)
    sharp, blurred = without_blur(views)
    size = source.width, source.height
    return CameraViews(size, tuple(sharp), looked_at, blurred, tuple(source.counts.problems), picture, backs)


def _burst_period_s(sources: Mapping[str, ImageSource], most_images: int) -> float:
    """Seconds between the beginnings of two bursts; 0: every image is looked at."""
    longest = max(source.n_images / source.rate_hz for source in sources.values())
    fastest = max(source.rate_hz for source in sources.values())
    if longest * fastest <= most_images:
        return 0.0
    return longest * BURST / most_images


def _advice(board: Board) -> str:
    counted = "inner corners" if board.kind == "chessboard" else "squares"
    inverted = "" if board.inverted else "; is it printed white on black (inverted)"
    return f"are its columns and rows ({counted}) and its kind right{inverted}?"


class _Counter:
    """Images done by all threads."""

    def __init__(self, total: int, progress: Progress | None):
        self._total, self._progress, self._done, self._lock = total, progress, 0, threading.Lock()

    def add(self) -> None:
        with self._lock:
            self._done = min(self._done + 1, self._total)
            if self._progress and (self._done % 10 == 0):
                self._progress("looking for the board", self._done, self._total)

    def finish(self) -> None:
        if self._progress:
            self._progress("looking for the board", self._total, self._total)
