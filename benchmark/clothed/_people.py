"""People in the images of clips: found by the network where the tracker expects them, and kept in a file for the next run.

What is kept is found again by the pixels, the crop, the weights and the code of the detector. A tracker that has changed expects
the body elsewhere by a hair, and asks the network anew, unless near crops are to do.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import sqlite3
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from tracker_node.observation import keypoints
from tracker_node.observation.image_set import ImageSet
from tracker_node.observation.keypoints.blazepose import NAMES, BlazePose, BlazePoseFiles
from tracker_node.observation.keypoints.crop import Crop
from tracker_node.observation.keypoints.people import People, Person, Silhouette, checked
from tracker_node.runs.people.detection import Detector, distinct

_CODE = tuple(path.read_bytes() for path in sorted(Path(keypoints.__file__).parent.glob("*.py")))  # as it has been loaded
_NEAR_CENTER, _NEAR_SIZE, _NEAR_RAD = 0.04, 0.06, 0.08  # shares of a crop's size, and its angle


def add_arguments(parser: argparse.ArgumentParser, drawn: str, output: Path) -> None:
    """Options of programs that track clips with what the network finds.

    Parameters
    ----------
    parser : added to.
    drawn : names of the clips that are looked for.
    output : where what the network finds is kept.
    """
    add = parser.add_argument
    add("--clips", nargs="+", type=Path, metavar="FOLDER", help="these clips")
    add("--drawn", type=Path, default=Path("out/clothed"), metavar="FOLDER", help=f"of {drawn} (default: %(default)s)")
    add("--near", action="store_true", help="take what was found in nearly the same crop: while the tracker is worked on")
    add("--output", type=Path, default=output, metavar="FOLDER", help="of what the network finds (default: %(default)s)")
    add("--set", nargs="+", default=[], metavar="KEY=VALUE", dest="changes", help="parameters of the tracker, e.g. threads=1")


class Expecting(Protocol):
    """Knows where the body is expected."""

    def expected_crops(self, stamp_ns: int) -> list[tuple[Crop, ...]]: ...


@dataclass(frozen=True, eq=False)
class Found:
    """What the detector has found in an image, and how long it took."""

    people: People
    ms: float


class KeptPeople:
    """A detector whose finds are kept.

    Parameters
    ----------
    files : weights of the networks.
    path : of the file that finds are kept in.
    near : take the finds of a crop that is nearly the same.
    detector : instead of the network.

    Attributes
    ----------
    asked, kept : images so far, and those of them that the file had.
    """

    def __init__(self, files: BlazePoseFiles, path: Path, near: bool = False, detector: Detector | None = None):
        path.parent.mkdir(parents=True, exist_ok=True)
        self._files, self._near, self.detector = files, near, detector or BlazePose(files)
        self._table = sqlite3.connect(path, isolation_level=None)
        self._table.execute("PRAGMA synchronous = OFF")
        self._table.execute("CREATE TABLE IF NOT EXISTS found (image TEXT, crop TEXT, u, v, size, angle, ms, people BLOB)")
        self._table.execute("CREATE INDEX IF NOT EXISTS images ON found (image, crop)")
        self._code = _code_digest(files)
        self.asked = self.kept = 0

    def with_people(self, tracker: Expecting, image_set: ImageSet) -> tuple[ImageSet, float]:
        """The image set with the people in its images, and how long the network took (or has taken) for it.

        Parameters
        ----------
        tracker : knows where the body is expected.
        image_set : the next one.

        Returns
        -------
        Image set, milliseconds.
        """
        images, total = [], 0.0
        for image, crops in zip(image_set.images, tracker.expected_crops(image_set.stamp_ns), strict=True):
            pixels = np.ascontiguousarray(image.bgr)
            near = [self.find(pixels, crop) for crop in crops]
            people = distinct(tuple(person for found in near for person in found.people))
            whole = Found((), 0.0) if people else self.find(pixels, None)  # as people_in looks
            images.append(replace(image, people=people or whole.people))
            total += sum(found.ms for found in [*near, whole])
        return replace(image_set, images=tuple(images)), total

    def find(self, image: np.ndarray, crop: Crop | None) -> Found:
        """The people in an image.

        Parameters
        ----------
        image : (height, width, 3) BGR.
        crop : where to look; None: anywhere.

        Returns
        -------
        As the detector says it, or has said it before.
        """
        key = hashlib.blake2b(image, digest_size=16, key=self._code).hexdigest()
        self.asked += 1
        found = self._kept(key, crop)
        if found is not None:
            self.kept += 1
            return found
        began = time.perf_counter()
        people = tuple(checked(person) for person in self.detector.detect(image, () if crop is None else (crop,)))
        ms = 1e3 * (time.perf_counter() - began)
        where = (0.0, 0.0, 0.0, 0.0) if crop is None else (*crop.center, crop.size, crop.angle)
        row = (key, repr(crop), *map(float, where), ms, packed(people))
        self._table.execute("INSERT INTO found VALUES (?, ?, ?, ?, ?, ?, ?, ?)", row)
        return Found(people, ms)

    def _kept(self, key: str, crop: Crop | None) -> Found | None:
        row = self._table.execute("SELECT people, ms FROM found WHERE image = ? AND crop = ?", (key, repr(crop))).fetchone()
        if row is None and self._near and crop is not None:
            question = "SELECT people, ms, u, v, size, angle FROM found WHERE image = ? AND size > 0"
            rows = [each for each in self._table.execute(question, (key,)) if is_near(crop, *each[2:])]
            row = min(rows, key=lambda each: np.hypot(each[2] - crop.center[0], each[3] - crop.center[1]), default=None)
        return None if row is None else Found(unpacked(row[0]), row[1])


def is_near(crop: Crop, u: float, v: float, size: float, angle: float) -> bool:
    """Whether a square is nearly a crop."""
    moved = np.hypot(u - crop.center[0], v - crop.center[1])
    turned = abs((angle - crop.angle + np.pi) % (2.0 * np.pi) - np.pi)
    return bool(moved < _NEAR_CENTER * crop.size and abs(size / crop.size - 1.0) < _NEAR_SIZE and turned < _NEAR_RAD)


def _code_digest(files: BlazePoseFiles) -> bytes:
    """Of all that decides what is found but image and crop."""
    digest = hashlib.blake2b(digest_size=32)
    for content in (*_CODE, files.detector.read_bytes(), files.points.read_bytes()):
        digest.update(content)
    return digest.digest()


def packed(people: People) -> bytes:
    """People of the detector as bytes."""
    arrays: dict[str, np.ndarray] = {}
    for i, person in enumerate(people):
        arrays |= {f"pixels{i}": person.pixels, f"covariances{i}": person.covariances, f"scores{i}": person.scores}
        arrays[f"whole{i}"] = np.array([person.score, *person.box], np.float64)
        if person.skeleton is not None:
            arrays[f"skeleton{i}"] = person.skeleton
        if person.silhouette is not None:
            arrays |= {f"mask{i}": person.silhouette.probabilities, f"origin{i}": np.array(person.silhouette.origin)}
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)
    return content.getvalue()


def unpacked(content: bytes) -> People:
    """Inverse of `packed`."""
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        count = sum(name.startswith("whole") for name in arrays.files)
        return tuple(_person(dict(arrays), i) for i in range(count))


def _person(arrays: dict[str, np.ndarray], i: int) -> Person:
    silhouette = None
    if f"mask{i}" in arrays:
        u, v = arrays[f"origin{i}"].tolist()
        silhouette = Silhouette(arrays[f"mask{i}"], (u, v))
    score, left, top, right, bottom = arrays[f"whole{i}"].tolist()
    pixels, covariances, scores = (arrays[f"{name}{i}"] for name in ("pixels", "covariances", "scores"))
    return Person(NAMES, pixels, covariances, scores, score, (left, top, right, bottom), silhouette, arrays.get(f"skeleton{i}"))
