"""Views of a board by several cameras, brought together by their stamps, and chosen among: still ones, from many places."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import minimum_spanning_tree

from ...geometry import se3
from .board import BoardView

NS_PER_S = 1e9
LEAST_COMMON = 2  # instants that link two cameras
LONGEST_GAP_S = 0.3  # beyond it nothing is said about how a board moved between two images


@dataclass(frozen=True, eq=False)
class BoardInstant:
    """One instant: what the cameras (by name) that found the board saw; ``stamp_ns`` is the mean of theirs."""

    views: Mapping[str, BoardView]

    @property
    def stamp_ns(self) -> int:
        stamps = [view.stamp_ns for view in self.views.values()]
        return min(stamps) + round(float(np.mean([stamp - min(stamps) for stamp in stamps])))


def group_views(views: Mapping[str, Sequence[BoardView]], tolerance_s: float) -> list[BoardInstant]:
    """Views of one instant together: stamps within ``tolerance_s`` of the earliest, one view of a camera; in order of time."""
    waiting = [(view.stamp_ns, name, view) for name, found in views.items() for view in found]
    waiting.sort(key=lambda entry: entry[:2])
    instants: list[dict[str, BoardView]] = []
    began = 0
    for stamp_ns, name, view in waiting:
        if not instants or stamp_ns - began > tolerance_s * NS_PER_S or name in instants[-1]:
            instants.append({})
            began = stamp_ns
        instants[-1][name] = view
    return [BoardInstant(group) for group in instants]


def speeds(views: Sequence[BoardView], longest_s: float = LONGEST_GAP_S) -> np.ndarray:
    """(n,) px/s: how quickly the board moves in each of one camera's views, to the next before or after it, whichever is less.

    Not-a-number where no other view is within ``longest_s``.
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
    """The tree of the pairs of cameras that share most instants, from how many each two share (c, c); half of it is filled."""
    return minimum_spanning_tree(csr_matrix(np.where(np.triu(common, 1) > 0, 1.0 / np.maximum(common, 1), 0.0)))


def chosen(instants: Sequence[BoardInstant], speed: Mapping[tuple[str, int], float], most: int) -> list[BoardInstant]:
    """At most ``most`` instants, in order of time: seen by many cameras, still, and unlike those already chosen.

    First those that link the cameras (`LEAST_COMMON` for each pair of the `spanning_tree`, even if these are more than ``most``).
    Then greedy: each takes the instant that adds most. A camera counts for an instant by how far its view lies from the views of
    that camera already chosen (of the board's size in the image), and less the quicker the board moves.

    Parameters
    ----------
    speed : (camera, image) -> px/s, see `speeds`.
    """
    if len(instants) <= most:
        return list(instants)
    names = sorted({name for instant in instants for name in instant.views})
    seen = np.array([[name in instant.views for name in names] for instant in instants])
    places = np.array([[_place(instant.views[n]) if n in instant.views else np.zeros(4) for n in names] for instant in instants])
    pace = np.array([[speed.get((n, i.views[n].image), np.nan) if n in i.views else np.nan for n in names] for i in instants])
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
    return [instants[i] for i in sorted(taken)]


def _place(view: BoardView) -> np.ndarray:
    """(4,) where the board is in the image, how large and how tilted, in its own size."""
    size = max(view.spread_px, 1.0)
    offsets = (view.pixels - view.pixels.mean(axis=0)) / size
    return np.array([*(0.5 * view.pixels.mean(axis=0) / size), np.log(size), 2.0 * float(np.mean(offsets[:, 0] * offsets[:, 1]))])


def with_neighbors(some: Sequence[BoardInstant], instants: Sequence[BoardInstant]) -> list[BoardInstant]:
    """The instants ``some`` with those just before and after them, which tell how the board moves; in order of time."""
    taken = {id(instant) for instant in some}
    kept = []
    for k, instant in enumerate(instants):
        around = [instants[j] for j in (k - 1, k + 1) if 0 <= j < len(instants)]
        near = [other for other in around if abs(other.stamp_ns - instant.stamp_ns) <= LONGEST_GAP_S * NS_PER_S]
        if id(instant) in taken or any(id(other) in taken for other in near):
            kept.append(instant)
    return kept


def velocities(instants: Sequence[BoardInstant], Ts_world_board: np.ndarray) -> np.ndarray:
    """(n, 6) twists (v, omega) of the board a second, in its own frame, from its poses before and after.

    Zero where no other pose is within `LONGEST_GAP_S`. Instants need not be in order of time.
    """
    result = np.zeros((len(instants), 6))
    stamps = [instant.stamp_ns for instant in instants]
    order = sorted(range(len(instants)), key=lambda k: stamps[k])
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
