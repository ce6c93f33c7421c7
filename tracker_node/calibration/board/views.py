"""Views of a board by several cameras: detected in recordings, grouped by stamps, and selected: still ones, from many places."""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import minimum_spanning_tree

from ...errors import CalibrationError
from ...geometry import se3
from ...loaders.images.source import ImageSource
from ...parallel import Workers
from .board import Board, BoardDetector, BoardView

NS_PER_S = 1e9
LEAST_COMMON = 2  # time steps that link two cameras
LONGEST_GAP_S = 0.3  # beyond it nothing is said about how a board moved between two images
BURST = 3  # successive images processed, which show how the board moves
_BACK = "its mirrored back is, which is not measured from: show this camera the printed side together with another camera"
_SHARP_PX = 4.0  # an edge this wide is sharp in any camera
_BLURRED = 1.8  # times as wide as the camera's median: too blurred to be used

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class BoardTimeStep:
    """One time step: what the cameras (by name) that found the board saw; ``stamp_ns`` is the mean of theirs."""

    views: Mapping[str, BoardView]

    @property
    def stamp_ns(self) -> int:
        stamps = [view.stamp_ns for view in self.views.values()]
        return min(stamps) + round(float(np.mean([stamp - min(stamps) for stamp in stamps])))


def group_views(views: Mapping[str, Sequence[BoardView]], tolerance_s: float) -> list[BoardTimeStep]:
    """Group the views of one time step.

    Parameters
    ----------
    views : camera -> its views.
    tolerance_s : views this near to the earliest of a time step belong to it, one of each camera.

    Returns
    -------
    In order of time.
    """
    waiting = [(view.stamp_ns, name, view) for name, found in views.items() for view in found]
    waiting.sort(key=lambda entry: entry[:2])
    time_steps: list[dict[str, BoardView]] = []
    began = 0
    for stamp_ns, name, view in waiting:
        if not time_steps or stamp_ns - began > tolerance_s * NS_PER_S or name in time_steps[-1]:
            time_steps.append({})
            began = stamp_ns
        time_steps[-1][name] = view
    return [BoardTimeStep(group) for group in time_steps]


def speeds(views: Sequence[BoardView], longest_s: float = LONGEST_GAP_S) -> np.ndarray:
    """How quickly the board moves in each of one camera's views, to the next before or after it, whichever is less.

    Parameters
    ----------
    views : of one camera, in order of time.
    longest_s : views farther apart are not compared.

    Returns
    -------
    (n,) px/s; NaN where no other view is near.
    """
    between = np.full(len(views) + 1, np.inf)
    for i, (a, b) in enumerate(itertools.pairwise(views)):
        seconds = (b.stamp_ns - a.stamp_ns) / NS_PER_S
        common, at_a, at_b = np.intersect1d(a.ids, b.ids, return_indices=True)
        if 0.0 < seconds <= longest_s and len(common):
            between[i + 1] = np.linalg.norm(b.pixels[at_b] - a.pixels[at_a], axis=1).mean() / seconds
    slower = np.minimum(between[:-1], between[1:])
    return np.where(np.isfinite(slower), slower, np.nan)


def spanning_tree(common: np.ndarray) -> csr_matrix:
    """The tree of the pairs of cameras that share most time steps, from how many each two share (c, c); half of it is filled."""
    return minimum_spanning_tree(csr_matrix(np.where(np.triu(common, 1) > 0, 1.0 / np.maximum(common, 1), 0.0)))


def chosen(time_steps: Sequence[BoardTimeStep], speed: Mapping[tuple[str, int], float], most: int) -> list[BoardTimeStep]:
    """Select time steps: seen by many cameras, still, and unlike those already selected.

    First those that link the cameras (`LEAST_COMMON` for each pair of the `spanning_tree`, even if these are more than ``most``).
    Then greedy: each takes the time step that adds most. A camera counts for a time step by how far its view lies from the views
    of that camera already chosen (of the board's size in the image), and less the quicker the board moves.

    Parameters
    ----------
    time_steps : to select from, in order of time.
    speed : (camera, image) -> px/s, see `speeds`.
    most : how many at most.

    Returns
    -------
    In order of time.
    """
    if len(time_steps) <= most:
        return list(time_steps)
    names = sorted({name for time_step in time_steps for name in time_step.views})
    seen = np.array([[name in time_step.views for name in names] for time_step in time_steps])
    places = np.array(
        [[place_of(time_step.views[n]) if n in time_step.views else np.zeros(4) for n in names] for time_step in time_steps]
    )
    pace = np.array([[speed.get((n, i.views[n].image), np.nan) if n in i.views else np.nan for n in names] for i in time_steps])
    usual = float(np.nanmedian(pace)) if np.isfinite(pace).any() else 0.0
    still = seen / (1.0 + np.nan_to_num(pace, nan=0.0) / max(usual, 1e-9))
    nearest = np.ones(seen.shape)  # distance to the nearest chosen view of the same camera, one board at most
    taken: list[int] = []

    def take(gain: np.ndarray) -> None:
        nonlocal nearest
        gain[taken] = -1.0
        best = int(np.argmax(gain))
        taken.append(best)
        distance = np.linalg.norm(places - places[best], axis=2)
        nearest = np.where(seen & seen[best], np.minimum(nearest, distance), nearest)

    for a, b in zip(*spanning_tree(seen.T.astype(int) @ seen).nonzero(), strict=True):
        both = seen[:, a] & seen[:, b]
        for _ in range(min(LEAST_COMMON, both.sum()) - both[taken].sum()):
            take(np.where(both, (still * nearest)[:, [a, b]].sum(axis=1), -1.0))
    while len(taken) < most:
        take((still * nearest).sum(axis=1) * (seen.sum(axis=1) - 0.5))
    return [time_steps[i] for i in sorted(taken)]


def place_of(view: BoardView) -> np.ndarray:
    """(4,) where the board is in the image, how large and how tilted, in its own size."""
    size = max(view.spread_px, 1.0)
    offsets = (view.pixels - view.pixels.mean(axis=0)) / size
    return np.array([*(0.5 * view.pixels.mean(axis=0) / size), np.log(size), 2.0 * float(np.mean(offsets[:, 0] * offsets[:, 1]))])


def with_neighbors(some: Sequence[BoardTimeStep], time_steps: Sequence[BoardTimeStep]) -> list[BoardTimeStep]:
    """Time steps with those just before and after them, which tell how the board moves.

    Parameters
    ----------
    some : selected time steps.
    time_steps : all of them, in order of time.

    Returns
    -------
    In order of time.
    """
    taken = {id(time_step) for time_step in some}
    kept = []
    for k, time_step in enumerate(time_steps):
        around = [time_steps[j] for j in (k - 1, k + 1) if 0 <= j < len(time_steps)]
        near = [other for other in around if abs(other.stamp_ns - time_step.stamp_ns) <= LONGEST_GAP_S * NS_PER_S]
        if id(time_step) in taken or any(id(other) in taken for other in near):
            kept.append(time_step)
    return kept


def velocities(time_steps: Sequence[BoardTimeStep], Ts_world_board: np.ndarray) -> np.ndarray:
    """Velocities of the board from its poses before and after.

    Zero where no other pose is within `LONGEST_GAP_S`. Time steps need not be in order of time.

    Parameters
    ----------
    time_steps : n of them, in any order.
    Ts_world_board : (n, 4, 4).

    Returns
    -------
    (n, 6) twists (v, omega) a second, in the board's frame; zero where no other pose is within `LONGEST_GAP_S`.
    """
    result = np.zeros((len(time_steps), 6))
    stamps = [time_step.stamp_ns for time_step in time_steps]
    order = sorted(range(len(time_steps)), key=lambda k: stamps[k])
    for place, k in enumerate(order):
        around = [order[j] for j in (place - 1, place + 1) if 0 <= j < len(order)]
        near = [j for j in around if 0 < abs(stamps[j] - stamps[k]) <= LONGEST_GAP_S * NS_PER_S]
        if not near:
            continue
        T = se3.inverse(Ts_world_board[k])
        ends = [(stamps[j], se3.log(T @ Ts_world_board[j])) for j in near]
        if len(ends) == 1:
            ends.append((stamps[k], np.zeros(6)))
        (begin, at_begin), (end, at_end) = sorted(ends, key=lambda entry: entry[0])
        result[k] = (at_end - at_begin) * NS_PER_S / (end - begin)
    return result


@dataclass(frozen=True, eq=False)
class CameraViews:
    """What one camera saw of a board.

    Attributes
    ----------
    image_size : (width, height).
    views : in order of time.
    n_searched, blurred : images searched, and views left out since they are blurred.
    backs : images in which the board's mirrored back was seen; every third without the board is searched for it.
    problems : of the source, such as an end before the last announced image.
    image : one of the images with the board, (h, w, 3) BGR.
    """

    image_size: tuple[int, int]
    views: tuple[BoardView, ...]
    n_searched: int = 0
    blurred: int = 0
    problems: tuple[str, ...] = field(default=())
    image: np.ndarray | None = None
    backs: int = 0


def detect_boards(
    sources: Mapping[str, ImageSource], board: Board, most_images: int = 600, progress: Progress | None = None
) -> dict[str, CameraViews]:
    """Views of the board by every camera; those that never saw it have none (see `with_board`).

    Of long recordings about ``most_images`` a camera are searched: bursts of `BURST` images at the same times in all cameras.

    Parameters
    ----------
    sources : camera -> its recording.
    board : the board.
    most_images : images searched in each recording, about.
    progress : called with (what, images done, images in all).

    Returns
    -------
    Camera -> its views.

    Raises
    ------
    SourceError : images that change their size.
    """
    counter = _Counter(sum(source.n_images for source in sources.values()), progress)
    every_s = _burst_period_s(sources, most_images)
    workers = Workers(min(len(sources), os.cpu_count() or 1))
    found = workers.map(lambda source: _detect(source, board, every_s, counter), list(sources.values()))
    counter.finish()
    return dict(zip(sources, found, strict=True))


def with_board(seen: Mapping[str, CameraViews], board: Board, least: int) -> tuple[dict[str, CameraViews], dict[str, str]]:
    """Split the cameras into those that saw the board and the others.

    Parameters
    ----------
    seen : camera -> its views.
    board : the board, for messages.
    least : cameras that are needed.

    Returns
    -------
    The cameras that saw the board.
    Camera -> why it has no part in the calibration.

    Raises
    ------
    CalibrationError : fewer than ``least`` cameras saw it; of the first that did not.
    """
    left_out = {}
    for name, found in seen.items():
        if not found.views:
            why = f"{_BACK} (in {found.backs} of those searched for it)" if found.backs else _advice(board)
            left_out[name] = f"the board ({board}) is in none of its {found.n_searched} images: {why}"
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
    detector, views, n_searched, image, backs = BoardDetector(board), [], 0, None, 0
    for number, (stamp_ns, bgr) in enumerate(source):
        counter.add()
        if every_s and 1e-9 * (stamp_ns % round(1e9 * every_s)) >= BURST / source.rate_hz - 1e-6:
            continue
        n_searched += 1
        view = detector.find(bgr, stamp_ns, number)
        if view is not None:
            views.append(view)
            image = bgr if image is None else image
        elif n_searched % BURST == 1 or backs:
            backs += detector.sees_back(bgr)
    sharp, blurred = without_blur(views)
    size = source.width, source.height
    return CameraViews(size, tuple(sharp), n_searched, blurred, tuple(source.counts.problems), image, backs)


def _burst_period_s(sources: Mapping[str, ImageSource], most_images: int) -> float:
    """Seconds between the beginnings of two bursts; 0: every image is processed."""
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
