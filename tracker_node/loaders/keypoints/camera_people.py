"""People whom a detector has found in the images of one camera, as a file tells of them, and how sure their points are.

Which files of points belong to which camera of a rig, by their names.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import FileFormatError, UnknownNameError
from ...observation.keypoints.people import People, Person, box_around
from ..source_address import files_of_cameras
from .files import names_of

MOST_PEOPLE = 1000
"""In one image."""
MOST_POINTS = 1000
"""Of one person."""
LARGEST_PX = 1e6
"""No pixel of a real image is beyond."""
MOST_IMAGES = 10_000_000
"""Image numbers are below."""


@dataclass(frozen=True)
class CovarianceRule:
    """Standard deviation of a point of which a file tells a score only.

    It is the same in u and v: a fraction of the person's size in the image (longer side of the box) that falls in a straight line
    from score 0 to score 1.

    Attributes
    ----------
    share_at_zero, share_at_one : of the person's size, at score 0 and at score 1.
    least_px : lower bound, pixels.
    """

    share_at_zero: float = 0.05
    share_at_one: float = 0.01
    least_px: float = 0.5

    def sigma_px(self, scores: np.ndarray, size_px: float) -> np.ndarray:
        """Standard deviations.

        Parameters
        ----------
        scores : (n,) from 0 to 1.
        size_px : of the person, pixels.

        Returns
        -------
        (n,) pixels.
        """
        shares = self.share_at_zero + (self.share_at_one - self.share_at_zero) * scores
        return np.maximum(shares * size_px, self.least_px)


@dataclass(frozen=True, eq=False)
class FoundPerson:
    """What a file tells of one person.

    Attributes
    ----------
    points : (n, 3) u, v, score from 0 to 1; score 0 for a point that was not found.
    score : of the person, from 0 to 1; None where the file tells none.
    box : least u, least v, largest u, largest v; None where the file tells none.
    """

    points: np.ndarray
    score: float | None = None
    box: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class CameraPeople(Mapping[int, People]):
    """Image number, from 0 -> people. Images that the file does not mention are absent; in others there may be nobody.

    Attributes
    ----------
    source : file or folder.
    names : of the detector's points.
    found : image number -> what the file tells of each person.
    normalized : coordinates are fractions of the image's width and height, and `for_images` must be called.
    rule : covariances from scores.
    scale, shift : from coordinates of the file to pixels, along u and v.
    """

    source: str
    names: tuple[str, ...]
    found: Mapping[int, tuple[FoundPerson, ...]]
    normalized: bool = False
    rule: CovarianceRule = field(default_factory=CovarianceRule)
    scale: tuple[float, float] = (1.0, 1.0)
    shift: tuple[float, float] = (0.0, 0.0)

    def __getitem__(self, image: int) -> People:
        return tuple(self._person(each) for each in self.found[image] if (each.points[:, 2] > 0.0).any())

    def __iter__(self) -> Iterator[int]:
        return iter(self.found)

    def __len__(self) -> int:
        return len(self.found)

    def for_images(self, width: int, height: int, to: tuple[int, int] | None = None) -> CameraPeople:
        """The same people in pixels of images of a size.

        Parameters
        ----------
        width, height : of the images in which the detector has looked, pixels.
        to : (width, height) of the same images, resampled; None: as they are.

        Returns
        -------
        The same people.
        """
        shares = np.array([to[0] / width, to[1] / height]) if to is not None else np.ones(2)
        scale, shift = np.array([width, height], dtype=float) if self.normalized else np.ones(2), np.zeros(2)
        shift = shift - 0.5 if self.normalized else shift
        scale, shift = scale * shares, shift * shares + 0.5 * shares - 0.5
        return replace(self, normalized=False, scale=(float(scale[0]), float(scale[1])), shift=(float(shift[0]), float(shift[1])))

    def _person(self, found: FoundPerson) -> Person:
        if self.normalized:
            raise ValueError("expected the size of the images (for_images), since coordinates are shares of it")
        scores = found.points[:, 2]
        seen = scores > 0.0
        pixels = found.points[:, :2] * self.scale + self.shift
        box = box_around(pixels[seen]) if found.box is None else self._placed(found.box)
        pixels[~seen] = 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])
        sigmas = self.rule.sigma_px(scores, max(box[2] - box[0], box[3] - box[1]))
        score = float(scores[seen].mean()) if found.score is None else found.score
        return Person(self.names, pixels, sigmas[:, None, None] ** 2 * np.eye(2), scores.copy(), score, box)

    def _placed(self, box: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
        corners = np.array(box).reshape(2, 2) * self.scale + self.shift
        return float(corners[0, 0]), float(corners[0, 1]), float(corners[1, 0]), float(corners[1, 1])


PointsByCamera = dict[str, CameraPeople]
"""Name of a camera's file or folder -> people in its images."""


def found_points(values: np.ndarray, file: str, where: str) -> np.ndarray:
    """Points as `FoundPerson` holds them.

    Parameters
    ----------
    values : (n, 3) u, v, score; NaN in a point that was not found.
    file, where : file and field, for messages.

    Returns
    -------
    (n, 3) finite; score 0 and zeros for what was not found, scores above 1 are 1.

    Raises
    ------
    FileFormatError : an infinite number, or a pixel beyond `LARGEST_PX`.
    """
    missing = np.isnan(values).any(axis=1) | (values[:, 2] <= 0.0)
    points = np.where(missing[:, None], 0.0, values)
    beyond = ~(np.abs(points) <= LARGEST_PX).all(axis=1)
    if beyond.any():
        expected = f"u, v, score of a point, finite and within {LARGEST_PX:.0e}"
        raise FileFormatError(file, where, expected, values[int(np.argmax(beyond))].tolist())
    points[:, 2] = np.minimum(points[:, 2], 1.0)
    return points


class PeopleOfImages:
    """Collects the people in the images of one camera, and refuses what cannot be meant.

    Parameters
    ----------
    source : file or folder, for messages.
    orders : keys of `names.ORDERS` that the points may have, where the file has numbers only; the first with as many counts.
    normalized : see `CameraPeople`.

    Attributes
    ----------
    names : of the points, where the file has them; else empty.
    """

    def __init__(self, source: str, orders: Sequence[str] = (), normalized: bool = False):
        self.source, self.orders, self.normalized = source, orders, normalized
        self.names: tuple[str, ...] = ()
        self.found: dict[int, list[FoundPerson]] = {}
        self.n_points: int | None = None

    def look(self, image: int, file: str, where: str) -> list[FoundPerson]:
        """The people of an image, as far as they are known.

        Parameters
        ----------
        image : number, from 0.
        file, where : file and field, for messages.

        Returns
        -------
        A list to which `add` adds.
        """
        if not 0 <= image < MOST_IMAGES:
            raise FileFormatError(file, where, f"the number of an image, from 0 to {MOST_IMAGES - 1}", image)
        return self.found.setdefault(image, [])

    def add(self, image: int, person: FoundPerson, file: str, where: str) -> None:
        """One person more.

        Parameters
        ----------
        image, person : number from 0; what was found.
        file, where : file and field, for messages.

        Raises
        ------
        FileFormatError : more than `MOST_PEOPLE`, another number of points than before, or more than `MOST_POINTS`.
        """
        people, n = self.look(image, file, where), len(person.points)
        if len(people) >= MOST_PEOPLE:
            raise FileFormatError(file, where, f"at most {MOST_PEOPLE} people in one image", "more")
        self.n_points = n if self.n_points is None else self.n_points
        if not 0 < n <= MOST_POINTS or n != self.n_points:
            expected = f"at most {MOST_POINTS} points, as many for each person ({self.n_points})"
            raise FileFormatError(file, where, expected, f"{n} points")
        people.append(person)

    def add_points(self, image: int, values: np.ndarray, file: str, where: str) -> None:
        """One person more, of whom the points alone are known.

        Parameters
        ----------
        image, values : number from 0; (n, 3) u, v, score, NaN in a point that was not found.
        file, where : file and field, for messages.
        """
        self.add(image, FoundPerson(found_points(values, file, where)), file, where)

    def camera(self, names: Sequence[str] | None = ()) -> CameraPeople:
        """All that has been collected, people by image, in the order of the images' numbers.

        Parameters
        ----------
        names : of the points, where the file has none; empty: of a known detector; None: their numbers, whatever the detector.

        Raises
        ------
        FileFormatError : no known detector has as many points, or not as many names are given.
        """
        n = self.n_points or 0
        if names is None:
            names = tuple(map(str, range(n)))
        elif self.names or not n:
            names = self.names or tuple(names)
        else:
            names = names_of(n, self.orders, names, self.source, "points")
        found = {image: tuple(self.found[image]) for image in sorted(self.found)}
        return CameraPeople(self.source, names, found, self.normalized)


def match_files(keys: Iterable[str], cameras: Sequence[str]) -> dict[str, str]:
    """Files or folders of points by camera, see `files_of_cameras`.

    Parameters
    ----------
    keys, cameras : names of files or folders; names of the cameras.

    Returns
    -------
    Camera -> file; cameras without one are absent.

    Raises
    ------
    UnknownNameError : no camera has one, with the files that there are; or two cameras have the same.
    """
    keys = list(keys)
    found = files_of_cameras(keys, cameras)
    if not found:
        raise UnknownNameError("files of points for the cameras", ", ".join(cameras), keys)
    return found
