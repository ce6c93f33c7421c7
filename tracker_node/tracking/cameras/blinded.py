"""Cameras that no longer show the body as they did: covered, upside down, out of focus, full of noise.

Two things are compared. The *support* of a camera is the log-likelihood ratio of the contours that it finds against none, a
sample of the body's outline; in shares of its own while all was well, and of what the other cameras find of the same body in the
same set. A camera that supports next to nothing shows nothing of the body. One that supports less may do so by the wall behind;
what its *picture* has lost or got besides tells why: the largest second differences along rows fall where it is out of focus,
their median rises with noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..estimate import BLIND, DEFOCUSED, NOISY, CameraFault

_EVERY_ROW = 32  # of an image is looked at
_SHARPEST = 0.9  # quantile of the second differences, beyond which they are of edges
_NOISE_OF_EDGES = 3.06  # what noise alone has beyond that quantile, on average, in medians: both of absolute normal values
_RATE = 0.05  # weight of the newest image set in what is usual
_LEAST_SUPPORT = 2.0  # of a body that is seen at all: what is less in all cameras tells nothing of one
_CHANCE = 3.0  # support wherever a body is put
_PROVED = 0.45  # of what is usual of the others: a camera that has so much has shown the body at some time
_BLIND, _WEAK = 0.3, 0.9  # shares of what is usual, below which a camera shows nothing of the body, or less than it did
_BLURRED, _NOISIER, _NOISE_LEVELS = 0.5, 3.0, 5.0  # of sharpness; of noise, and gray levels more
_NAMED_SETS = 3  # in a row, from which on a camera is named, and left out if it is blind...
_AGAIN_SETS = 10  # ...but for one set of so many, in which it may show the body again


class Picture:
    """How sharp and how noisy the images of one camera are, gray levels: of this one, and usually."""

    def __init__(self) -> None:
        self.now: np.ndarray | None = None
        self.usual: np.ndarray | None = None

    def look(self, image: np.ndarray) -> None:
        """Take in an (h, w, 3) image."""
        row = image[::_EVERY_ROW, :, 1].astype(np.int16)
        second = np.abs(2 * row[:, 1:-1] - row[:, :-2] - row[:, 2:]).ravel()
        n = len(second)
        second.partition([int(0.4 * n), int(0.6 * n), int(_SHARPEST * n)])
        noise = float(second[int(0.4 * n) : int(0.6 * n)].mean())
        edges = float(second[int(_SHARPEST * n) :].mean())
        sharpness = np.sqrt(max(edges**2 - (_NOISE_OF_EDGES * noise) ** 2, 0.0))
        self.now = np.array([sharpness, noise])
        if self.usual is None:
            self.usual = self.now

    def learn(self) -> None:
        """This image is as it should be."""
        if self.now is not None and self.usual is not None:
            self.usual = self.usual + _RATE * (self.now - self.usual)

    @property
    def sharpness(self) -> float:
        """In shares of what is usual."""
        return 1.0 if self.now is None or self.usual is None else float(self.now[0] / max(self.usual[0], 1.0))

    @property
    def is_noisy(self) -> bool:
        """Whether there is far more noise than usual."""
        if self.now is None or self.usual is None:
            return False
        return bool(self.now[1] > _NOISIER * self.usual[1] + _NOISE_LEVELS)


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
        n = len(self._names)
        self._usual, self._pictures, self._turn = np.full(n, np.nan), [Picture() for _ in range(n)], 0
        self._kinds: list[str | None] = [None] * n
        self._sets, self._since_ns, self._shares = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64), np.full(n, np.nan)
        self.faults: tuple[CameraFault, ...] = ()

    @property
    def blind(self) -> list[int]:
        """Indices of the cameras from whose images nothing of the body is to be learned."""
        return [i for i, kind in enumerate(self._kinds) if kind is not None]

    @property
    def left_out(self) -> list[int]:
        """Indices of the cameras whose images the next set is to be without."""
        return [i for i, kind in enumerate(self._kinds)
                if kind == BLIND and self._sets[i] >= _NAMED_SETS and self._sets[i] % _AGAIN_SETS]  # fmt: skip

    def look(self, stamp_ns: int, images: Sequence[np.ndarray | None], support: np.ndarray) -> None:
        """Take in one set, in which the body is where the state says.

        Parameters
        ----------
        stamp_ns : of the set.
        images : pixels per camera of the rig, None where the set has none.
        support : (n_cameras,) log-likelihood ratio per sample of the outline; nan where a camera should not see any.
        """
        self._look_at_pictures(images)
        left_out = self.left_out
        for i, share in enumerate(self._shares_of_usual(support)):
            if i in left_out:
                self._sets[i] += 1
            elif not np.isnan(share):
                self._judge(i, stamp_ns, support, float(share))
        self.faults = tuple(
            CameraFault(self._names[i], kind, float(self._shares[i]), 0.0, int(self._since_ns[i]))
            for i, kind in enumerate(self._kinds) if kind is not None and self._sets[i] >= _NAMED_SETS
        )  # fmt: skip

    def _judge(self, i: int, stamp_ns: int, support: np.ndarray, share: float) -> None:
        """Take in what a camera supports in one set."""
        kind = BLIND if self._is_by_chance(i, support) else self._kind(i, share)
        if kind is None:
            self._sets[i] = 0
            self._usual[i] = support[i] if np.isnan(self._usual[i]) else (1.0 - _RATE) * self._usual[i] + _RATE * support[i]
            self._pictures[i].learn()
        else:
            if self._kinds[i] is None:
                self._since_ns[i] = stamp_ns
            self._sets[i] += 1
        self._kinds[i], self._shares[i] = kind, share

    def _look_at_pictures(self, images: Sequence[np.ndarray | None]) -> None:
        """One camera a set, in turn, and those that something is the matter with: it costs as much as a good line."""
        self._turn = (self._turn + 1) % len(images)
        for i, image in enumerate(images):
            if image is not None and (i == self._turn or self._kinds[i] is not None or self._pictures[i].now is None):
                self._pictures[i].look(image)

    def _shares_of_usual(self, support: np.ndarray) -> np.ndarray:
        """(n_cameras,) of what is usual of a camera, in shares of what the others have; nan where nothing is to be said."""
        usual = self._usual.copy()
        told, typical = ~np.isnan(support), _median(usual)
        usual[np.isnan(usual)] = _median(support) if np.isnan(typical) else typical  # of one that is new the others say it
        shares = np.full(len(support), np.nan)
        for i in np.flatnonzero(told):
            others = told.copy()
            others[i] = False
            if not others.any() or np.median(support[others]) < _LEAST_SUPPORT:
                continue
            shares[i] = support[i] / usual[i] / np.median(support[others] / usual[others])
        return shares

    def _is_by_chance(self, i: int, support: np.ndarray) -> bool:
        """Whether a camera that has never proved itself finds hardly more than chance would, of what the others do see."""
        others = _median(np.delete(support, i))
        proved = self._usual[i] >= _PROVED * _median(np.delete(self._usual, i))
        return bool(not proved and others > 2.0 * _CHANCE and support[i] < max(_CHANCE, _BLIND * others))

    def _kind(self, i: int, share: float) -> str | None:
        if share < _BLIND:
            return BLIND
        if share < _WEAK and self._pictures[i].is_noisy:
            return NOISY
        return DEFOCUSED if share < _WEAK and self._pictures[i].sharpness < _BLURRED else None


def _median(values: np.ndarray) -> float:
    """Of those that are not nan; nan of none."""
    told = values[~np.isnan(values)]
    return float(np.median(told)) if len(told) else np.nan
