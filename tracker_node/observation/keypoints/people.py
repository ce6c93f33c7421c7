"""People that a detector has found in an image: points with covariances, and the pixels that they cover.

People as a tracker may use them, whatever a detector has said: finite numbers, and covariances that are some.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class Silhouette:
    """Which pixels of a part of an image show a person.

    Attributes
    ----------
    probabilities : (height, width) uint8, 0 to 255 for a probability of 0 to 1.
    origin : (u, v) of the first pixel in the image.
    """

    probabilities: np.ndarray
    origin: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Person:
    """One person in one image.

    Attributes
    ----------
    names : of the detector's points, the same for everybody.
    pixels : (n, 2) u and v of the points.
    covariances : (n, 2, 2) of their errors, pixels^2, as the detector states them.
    scores : (n,) probability that a point is where ``pixels`` says; 0 for one that was not found.
    score : probability that there is a person at all.
    box : (4,) least u, least v, largest u, largest v of what shows the person.
    silhouette : the pixels of the person; None where the detector tells none.
    skeleton : (n, 3) meters in the axes of the camera (right, down, forward) from anywhere: where the points of a person of usual
        size are to each other, as the detector guesses; nan for one that is not guessed; None where the detector guesses none.
    """

    names: tuple[str, ...]
    pixels: np.ndarray
    covariances: np.ndarray
    scores: np.ndarray
    score: float
    box: tuple[float, float, float, float]
    silhouette: Silhouette | None = None
    skeleton: np.ndarray | None = None

    def __post_init__(self):
        n = len(self.names)
        shapes = (self.pixels.shape, self.covariances.shape, self.scores.shape)
        if shapes != ((n, 2), (n, 2, 2), (n,)):
            raise ValueError(f"expected pixels, covariances, scores of shapes (n, 2), (n, 2, 2), (n,), got {shapes}")
        if self.skeleton is not None and self.skeleton.shape != (n, 3):
            raise ValueError(f"expected a skeleton of shape (n, 3), got {self.skeleton.shape}")


People = tuple[Person, ...]
"""The people in one image, in no particular order."""


_AROUND = 0.1  # of the longer side: how far a person goes on beyond the outermost points
_FAR_PX = 1e6  # no point is farther from the image than this
_FAR_M = 1e3  # nor one of a skeleton from the others


def moved_in_image(person: Person, affine: np.ndarray, size: tuple[int, int]) -> Person:
    """The person elsewhere in the image.

    Parameters
    ----------
    person : as found.
    affine : (2, 3) from where a pixel is to where it shall be; hardly turned.
    size : (width, height) of the image.

    Returns
    -------
    With a silhouette moved by whole pixels, without what is no longer in the image.
    """
    corners = np.array(person.box).reshape(2, 2) @ affine[:, :2].T + affine[:, 2]
    left, top, right, bottom = corners.ravel().tolist()
    pixels, silhouette = person.pixels @ affine[:, :2].T + affine[:, 2], person.silhouette
    if silhouette is not None:
        reach = np.array(silhouette.probabilities.shape[::-1])
        middle = np.add(silhouette.origin, 0.5 * (reach - 1))
        origin = np.add(silhouette.origin, np.rint(affine[:, :2] @ middle + affine[:, 2] - middle)).astype(int)
        first, last = np.clip([-origin, np.array(size) - origin], 0, reach)
        inside = silhouette.probabilities[first[1] : last[1], first[0] : last[0]]
        silhouette = Silhouette(inside, (int(origin[0] + first[0]), int(origin[1] + first[1]))) if inside.size else None
    return replace(person, pixels=pixels, box=(left, top, right, bottom), silhouette=silhouette)


def rearranged(person: Person, rows: Sequence[int]) -> Person:
    """The person with other points under its names, such as those of the other side.

    Parameters
    ----------
    person, rows : (n,) of the points, in the order of the names.

    Returns
    -------
    With all that is known of each point.
    """
    rows = list(rows)
    skeleton = None if person.skeleton is None else person.skeleton[rows]
    return replace(
        person, pixels=person.pixels[rows], covariances=person.covariances[rows], scores=person.scores[rows], skeleton=skeleton
    )  # fmt: skip


def box_around(pixels: np.ndarray) -> tuple[float, float, float, float]:
    """A person's box by (n, 2) points that were found, which end before the person does."""
    least, most = pixels.min(axis=0), pixels.max(axis=0)
    margin = max(_AROUND * float((most - least).max()), 0.5)
    return float(least[0] - margin), float(least[1] - margin), float(most[0] + margin), float(most[1] + margin)


def checked(person: Person) -> Person:
    """A person of whose points the impossible ones are as if they had not been found: score 0.

    Covariances are symmetric after that to the last bit, so messages need one half of them. A box that is none is that of the
    points.

    Parameters
    ----------
    person : of any detector.

    Returns
    -------
    person : with finite numbers.

    Raises
    ------
    ValueError : score or box are not finite, a name comes twice, or points are shares of the image.
    """
    if len(set(person.names)) != len(person.names):
        raise ValueError("expected each name of a point once")
    if not np.isfinite([*person.box, person.score]).all():
        raise ValueError(f"expected finite numbers for score and box, got {person.score}, {list(person.box)}")
    uu, uv, vv = (person.covariances[:, i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
    with np.errstate(invalid="ignore", over="ignore"):
        found = np.isfinite(person.covariances).all(axis=(1, 2)) & (np.abs(person.pixels) < _FAR_PX).all(axis=1)
        found &= (person.scores >= 0.0) & (person.scores <= 1.0)
        found &= (uu >= 0.0) & (vv >= 0.0) & (uv * uv <= uu * vv * (1.0 + 1e-9))
    covariances = np.stack([uu, uv, uv, vv], axis=1).reshape(-1, 2, 2)
    skeleton, box, seen = person.skeleton, person.box, person.pixels[found & (person.scores > 0.0)]
    if len(seen) > 1 and np.abs(seen - 0.5).max() <= 0.5 and np.ptp(seen, axis=0).any():
        raise ValueError("expected pixels, got points between 0 and 1: are they shares of the image?")
    if len(seen) and not (box[2] > box[0] and box[3] > box[1]):
        box = box_around(seen)
    if skeleton is not None:
        skeleton = np.where((found & (np.abs(skeleton) < _FAR_M).all(axis=1))[:, None], skeleton, np.nan)
    return replace(
        person,
        pixels=np.where(found[:, None], person.pixels, 0.0),
        covariances=np.where(found[:, None, None], covariances, np.eye(2)),
        scores=np.where(found, person.scores, 0.0),
        box=box,
        skeleton=skeleton,
    )
