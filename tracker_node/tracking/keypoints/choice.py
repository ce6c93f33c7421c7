"""Who of the people in the images is the body, and whether a detector has taken its left for its right."""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...model.configuration import State
from ...observation.keypoints.people import Person
from ..engine import Choice
from ..modality import PeopleSeen, Persons
from .modality import KeypointModality
from .people_groups import mirrored
from .start import PointStart

_EXPECTED_M = 0.10  # how far from where they are expected points are, as a standard deviation
_OUTLIER = 0.15  # fraction of points that are anywhere
_LEAST = 2.0  # log-likelihood ratio, a point that is sure, of the body against anybody
_SWAP_PRIOR = -2.0  # log odds of a swap before anything has been seen, a person
_SWAP_KEPT = 0.7  # fraction of a camera's log odds of a swap that is kept from set to set


class PersonChoice(Choice):
    """Compares everybody in each camera with where the body is expected, as found and with left and right exchanged.

    Parameters
    ----------
    rig : cameras.
    modality : knows the points of the body.
    start : finds where the body begins.
    """

    def __init__(self, rig: CameraRig, modality: KeypointModality, start: PointStart):
        self._rig, self._modality, self._start = rig, modality, start
        self.reset()

    def reset(self) -> None:
        """Nothing is known of swaps."""
        self._swaps = np.full(len(self._rig), _SWAP_PRIOR)

    def find(self, people: PeopleSeen, near: np.ndarray | None = None) -> State | None:
        """Where the body begins."""
        self.reset()
        return self._start.find(people, near)

    def choose(self, people: PeopleSeen, expected: State) -> Persons:
        """The body in each camera."""
        if all(persons is None for persons in people):
            return ()
        places = self._modality.places(expected)
        return [self._chosen(i, persons or (), places) for i, persons in enumerate(people)]

    def _chosen(self, i: int, persons: tuple[Person, ...], places: np.ndarray) -> Person | None:
        camera, best, most = self._rig.cameras[i], None, -np.inf
        pixels, seen = camera.project(places)
        depth = float(np.median((places - camera.center) @ camera.T_world_cam[:3, 2]))
        sigma_px = _EXPECTED_M * float(camera.model.K[0, 0]) / max(depth, 0.1)
        swap = self._swaps[i] * _SWAP_KEPT + _SWAP_PRIOR * (1.0 - _SWAP_KEPT)
        for person in persons:
            as_found, sure = self._agreement(person, pixels, seen, sigma_px)
            exchanged, _ = self._agreement(mirrored(person), pixels, seen, sigma_px)
            odds = swap + exchanged - as_found
            if max(as_found, exchanged) > max(most, _LEAST * sure):
                most, best = max(as_found, exchanged), mirrored(person) if odds > 0.0 else person
                self._swaps[i] = float(np.clip(odds, -10.0, 10.0))
        return best

    def _agreement(self, person: Person, pixels: np.ndarray, seen: np.ndarray, sigma_px: float) -> tuple[float, float]:
        """Log-likelihood ratio of the points, where they are expected against anywhere around the person; and their scores' sum.

        Somebody who sits behind a table has points of small scores, and is as much the body as one who stands free.
        """
        rows = [person.names.index(name) for name in self._modality.names]
        area = max((person.box[2] - person.box[0]) * (person.box[3] - person.box[1]), 1.0) * 4.0
        S = person.covariances[rows] + sigma_px**2 * np.eye(2)
        e = person.pixels[rows] - pixels
        square = np.einsum("ni,nij,nj->n", e, np.linalg.inv(S), e)
        density = np.exp(-0.5 * square) / (2.0 * np.pi * np.sqrt(np.linalg.det(S)))
        ratio = np.log((1.0 - _OUTLIER) * density * area + _OUTLIER)
        says = seen & np.isfinite(ratio)
        scores = person.scores[rows][says]
        return float((scores * ratio[says]).sum()), float(scores.sum())
