"""Cameras that no longer show the body as they did: covered, upside down, out of focus, full of noise.

Two things are compared. The *support* of a camera is the log-likelihood ratio of the contours that it finds against none, a
sample of the body's outline; in shares of its own while all was well, and of what the other cameras find of the same body in the
same set. A camera that supports next to nothing shows nothing of the body. One that supports less may do so by the wall behind;
what its *picture* has lost or got besides tells why: the largest second differences along rows fall where it is out of focus,
their median rises with noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from ..estimate import BLIND, DEFOCUSED, NOISY, CameraFault

_EVERY_ROW, _ROWS = 16, 30  # of an image is looked at, but no more than so many
_SHARPEST = 0.99  # quantile of the second differences, beyond which they are of edges, even in a plain room
_NOISE_OF_EDGES = 4.29  # what noise alone has beyond that quantile, on average, in medians: both of absolute normal values
_RATE = 0.05  # weight of the newest image set in what is usual
_LEAST_SUPPORT = 2.0  # of a body that is seen at all: what is less in all cameras tells nothing of one
_CHANCE = 3.0  # support wherever a body is put
_PROVED = 0.45  # of what is usual of the others: a camera that has so much has shown the body at some time
_BLIND, _WEAK = 0.3, 0.9  # shares of what is usual, below which a camera shows nothing of the body, or less than it did
_BLURRED, _NOISIER, _NOISE_LEVELS = 0.5, 3.0, 5.0  # of sharpness; of noise, and gray levels more
_EDGES = 1.5  # sharpness in that of noise, with which there are edges that tell
_SHOWN, _SHOWN_NS = 0.5, 1_000_000_000  # share of its points, by which a detector finds a body; how long that counts, or a miss
_NAMED_SETS = 3  # in a row, from which on a camera is named, and left out if it is blind...
_AGAIN_SETS = 10  # ...but for one set of so many, in which it may show the body again


class _Picture:
    """How sharp and how noisy the images of one camera are, gray levels: of this one, and usually."""

    def __init__(self) -> None:
        self.now: np.ndarray | None = None
        self._usual = np.zeros(2)

    def look(self, image: np.ndarray) -> None:
        """Take in an (h, w, 3) image."""
        row = image[:: max(_EVERY_ROW, image.shape[0] // _ROWS), :, 1].astype(np.int16)
        counts = np.bincount(np.abs(2 * row[:, 1:-1] - row[:, :-2] - row[:, 2:]).ravel())
        n = int(counts.sum())
        noise = _mean_between(counts, int(0.4 * n), int(0.6 * n))
        edges = _mean_between(counts, int(_SHARPEST * n), n)
        sharpness = np.sqrt(max(edges**2 - (_NOISE_OF_EDGES * noise) ** 2, 0.0))
        first, self.now = self.now is None, np.array([sharpness, noise])
        if first:
            self._usual = self.now

    def learn(self) -> None:
        """This image is as it should be."""
        if self.now is not None:
            self._usual = self._usual + _RATE * (self.now - self._usual)

    @property
    def is_blurred(self) -> bool:
        """Whether it is far less sharp than usual."""
        usual, noise = self._usual.tolist()
        return self.now is not None and usual > max(_EDGES * noise, 1.0) and bool(self.now[0] < _BLURRED * usual)

    @property
    def is_noisy(self) -> bool:
        """Whether there is far more noise than usual."""
        return self.now is not None and bool(self.now[1] > _NOISIER * self._usual[1] + _NOISE_LEVELS)


@dataclass(eq=False)
class _View:
    """What one camera shows: its ``usual`` support, nan at first; what is the matter with it, for how many sets, since when, and
    its last share of what is usual; the stamp of the set in which a detector has found the body there, while it does, and of that
    since which it misses it, where it finds it in others."""

    usual: float = math.nan
    picture: _Picture = field(default_factory=_Picture)
    kind: str | None = None
    sets: int = 0
    since_ns: int = 0
    share: float = math.nan
    shown_ns: int = -(2**62)
    missed_ns: int = 2**62

    def take(self, kind: str | None, stamp_ns: int, support: float, share: float, tells: bool) -> None:
        """Take in one set, of which it is known what is the matter; ``tells``: its support is worth to be remembered."""
        if kind is None:
            self.sets = 0
            if tells:
                self.usual = support if math.isnan(self.usual) else (1.0 - _RATE) * self.usual + _RATE * support
            self.picture.learn()
        else:
            if self.kind is None:
                self.since_ns = stamp_ns
            self.sets += 1
        self.kind, self.share = kind, share

    @property
    def is_named(self) -> bool:
        return self.kind is not None and self.sets >= _NAMED_SETS

    def show(self, share: float, stamp_ns: int, by_others: bool) -> None:
        """Take in what a detector finds of the body, nan: there is nothing to say; ``by_others``: it is found in others."""
        there = share >= _SHOWN
        self.shown_ns = stamp_ns if there else -(2**62)
        if share > 0.0:
            self.missed_ns = 2**62
        elif share == 0.0 and by_others:
            self.missed_ns = min(self.missed_ns, stamp_ns)
        if there and self.kind == BLIND:
            self.kind, self.sets = None, 0

    def fault(self, name: str, stamp_ns: int) -> CameraFault | None:
        """What is the matter with the camera of that name, if it is to be named."""
        if self.kind is not None and self.is_named:
            return CameraFault(name, self.kind, self.share, 0.0, self.since_ns)
        missed = stamp_ns - self.missed_ns >= _SHOWN_NS
        return CameraFault(name, BLIND, 0.0, 0.0, self.missed_ns) if missed else None

    @property
    def is_left_out(self) -> bool:
        return self.kind == BLIND and self.is_named and self.sets % _AGAIN_SETS > 0


class BlindedCameras:
    """Knows what each camera usually finds of the body; deterministic in what it is given.

    Parameters
    ----------
    names : of the cameras of the rig.

    Attributes
    ----------
    faults : after the last set.
    """

    def __init__(self, names: Sequence[str]):
        self._names = tuple(names)
        self.reset()

    def reset(self) -> None:
        """Nothing is usual."""
        self._views, self._turn, self._latest_ns = [_View() for _ in self._names], 0, -(2**62)
        self.faults: tuple[CameraFault, ...] = ()

    @property
    def blind(self) -> list[int]:
        """Indices of the cameras from whose images nothing of the body is to be learned."""
        return [i for i, view in enumerate(self._views) if view.kind is not None]

    @property
    def left_out(self) -> list[int]:
        """Indices of the cameras whose images the next set is to be without."""
        return [i for i, view in enumerate(self._views) if view.is_left_out]

    def look(
        self, stamp_ns: int, images: Sequence[np.ndarray | None], support: np.ndarray, shown: np.ndarray | None = None
    ) -> None:  # fmt: skip
        """Take in one set, in which the body is where the state says; one that is gone through again counts no more.

        Parameters
        ----------
        stamp_ns : of the set.
        images : pixels per camera of the rig, None where the set has none.
        support : (n_cameras,) log-likelihood ratio per sample of the outline; nan where a camera should not see any.
        shown : (n_cameras,) of `keypoints.judge.shares_found`: a camera in which a detector finds the body is not blind for a
            second, however clothes blend with a wall; one in which it has found nothing for a second is. None: it finds nothing.
        """
        if shown is not None:
            by_others = int((shown >= _SHOWN).sum()) >= 2
            for view, share in zip(self._views, shown.tolist(), strict=True):
                view.show(share, stamp_ns, by_others)
        if stamp_ns <= self._latest_ns:
            return
        self._latest_ns = stamp_ns
        self._look_at_pictures(images)
        usual, found = [view.usual for view in self._views], support.tolist()
        for i, share in enumerate(_shares_of_usual(found, usual)):
            view = self._views[i]
            if view.is_left_out:
                view.sets += 1
            elif not math.isnan(share):
                blind = share < _BLIND or _is_by_chance(i, found, usual)
                is_shown = stamp_ns - view.shown_ns <= _SHOWN_NS
                kind = BLIND if blind and not is_shown else _kind(view.picture, share)
                view.take(kind, stamp_ns, found[i], share, tells=not blind)
        faults = (view.fault(name, stamp_ns) for name, view in zip(self._names, self._views, strict=True))
        self.faults = tuple(fault for fault in faults if fault is not None)

    def _look_at_pictures(self, images: Sequence[np.ndarray | None]) -> None:
        """One camera a set, in turn, and those that something is the matter with: it costs as much as a good line."""
        self._turn = (self._turn + 1) % len(images)
        for i, (image, view) in enumerate(zip(images, self._views, strict=True)):
            if image is not None and (i == self._turn or view.kind is not None or view.picture.now is None):
                view.picture.look(image)


def _shares_of_usual(support: Sequence[float], usual: Sequence[float]) -> list[float]:
    """Of each camera, what is usual of it, in shares of what the others have; nan where nothing is to be said."""
    typical = _median(usual)
    of_new = _median(support) if math.isnan(typical) else typical
    usual = [of_new if math.isnan(u) else u for u in usual]
    shares = []
    for i, own in enumerate(support):
        others = [(s, u) for j, (s, u) in enumerate(zip(support, usual, strict=True)) if j != i and not math.isnan(s)]
        tells = not math.isnan(own) and others and _median([s for s, _ in others]) >= _LEAST_SUPPORT
        shares.append(_share(_share(own, usual[i]), _median([_share(s, u) for s, u in others])) if tells else math.nan)
    return shares


def _share(value: float, whole: float) -> float:
    return value / whole if whole else math.inf


def _is_by_chance(i: int, support: Sequence[float], usual: Sequence[float]) -> bool:
    """Whether a camera that has never proved itself finds hardly more than chance would, of what the others do see."""
    others = _median([*support[:i], *support[i + 1 :]])
    proved = usual[i] >= _PROVED * _median([*usual[:i], *usual[i + 1 :]])
    return not proved and others > 2.0 * _CHANCE and support[i] < max(_CHANCE, _BLIND * others)


def _kind(picture: _Picture, share: float) -> str | None:
    if share < _WEAK and picture.is_noisy:
        return NOISY
    return DEFOCUSED if share < _WEAK and picture.is_blurred else None


def _median(values: Sequence[float]) -> float:
    """Of those that are not nan; nan of none. Of a handful numpy takes twenty times as long."""
    told = [value for value in values if not math.isnan(value)]
    return median(told) if told else math.nan


def _mean_between(counts: np.ndarray, first: int, last: int) -> float:
    """Mean of the values from one place to another in their order, by how often each occurs."""
    places = np.clip(np.cumsum(counts), first, last)
    return float(np.diff(places, prepend=first) @ np.arange(len(counts))) / (last - first)
