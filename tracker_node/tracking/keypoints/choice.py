"""Who of the people in the images is the body, and whether a detector has taken its left for its right."""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...compiled.kernels import compiled
from ...model.configuration import State
from ...observation.keypoints.people import Person, rearranged
from ..engine import Choice
from ..modality import PeopleSeen, Persons
from .modality import KeypointModality, rows_of
from .people_groups import mirrored
from .proportions import Proportions
from .start import PointStart

_EXPECTED_M = 0.10  # how far from where they are expected points of a person are, as a standard deviation
_OUTLIER = 0.15  # fraction of points that are anywhere
_LEAST = 2.0  # log-likelihood ratio, a point that is sure, of the body against anybody
_SOMEBODY = 1.0  # points of the body's that somebody has at least, as the sum of their scores
_SWAP_PRIOR = -2.0  # log odds of a swap before anything has been seen, a person
_SWAP_KEPT = 0.7  # fraction of a camera's log odds of a swap that is kept from set to set
# In a camera that is alone: log-likelihood ratio at most of points that jump from side to side, and log odds in each image of the
# detector being right, which swaps of up to sixty images outweigh
_SURE_JUMP, _RIGHT = 30.0, 0.5
_ALONE_SETS = 5  # after which nothing is left of what several cameras said of swaps
_CONTRADICTED_SETS = 3  # in a row in which half of several cameras show a body exchanged, or others only: no detector errs so...
_AGAIN_SETS = 12  # of those, more, until that is asked again
_OTHERWISE = 0.7  # ...and it stands otherwise than it was taken to, if points cost less than that of what they cost as it stands
# Left and right of single joints: standard deviation of points of a person around where they are expected; from how many of them
# costs grow linearly; log-likelihood ratio from which a joint is exchanged, as one in fifty images has it
_PAIR_M, _PAIR_FAR, _PAIR_LEAST = 0.05, 3.0, 4.0


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
        self._mirrored = modality.mirrored
        self._proportions = Proportions(rig, modality.names, modality.offsets.body)
        self.reset()

    def reset(self) -> None:
        """Nothing is known of swaps, and nobody has been looked for."""
        self.restart()
        self._proportions.reset()
        self._start.reset()

    def restart(self) -> None:
        """The body begins anew, and left and right of nobody are known."""
        self._denies: bool | None = None  # whether people were seen but not the body, when a detector has looked last
        self._denied, self._counted_ns, self._alone_sets = 0, -1, 0
        self._contradicted_sets = _CONTRADICTED_SETS - 1  # nothing speaks for the body yet
        self._swaps = np.full(len(self._rig), _SWAP_PRIOR)
        self._before: list[np.ndarray | None] = [None] * len(self._rig)  # pixels of the body's points in the image before

    def find(self, people: PeopleSeen, near: np.ndarray | None = None) -> State | None:
        """Where the body begins."""
        self._swaps[:] = _SWAP_PRIOR
        found = self._start.find(people, near)
        if found is None and self._start.group is not None:
            self._proportions.take(self._start.group)  # whom the body may not suit
        return found

    def choose(self, people: PeopleSeen, expected: State) -> Persons:
        """The body in each camera."""
        looked = [persons is not None for persons in people]
        if not any(looked):
            self._denies = None
            return ()
        places = self._modality.places(expected)
        chosen = [None if persons is None else self._chosen(i, persons, places) for i, persons in enumerate(people)]
        if sum(map(bool, chosen)) > 1:
            self._alone_sets = 0
        elif all(looked):
            self._alone_sets += 1
        self._denies = not any(chosen) and any(self._is_somebody(person) for persons in people for person in persons or ())
        self._contradicted_sets = self._contradicted_sets + 1 if self._contradict(chosen, people) else 0
        chosen = self._with_pairs(chosen, places)
        self._proportions.look(chosen)
        return chosen

    @property
    def doubt_of_size(self) -> str:
        """Why the body may not be the person's; empty where it may."""
        return self._proportions.doubt

    @property
    def is_of_another_size(self) -> bool:
        """Whether the body cannot be the person's."""
        return self._proportions.is_out

    @property
    def is_contradicted(self) -> bool:
        """Whether half of the cameras have shown the body exchanged, or more of them others only."""
        return self._contradicted_sets >= _CONTRADICTED_SETS

    def otherwise(self, people: PeopleSeen, state: State) -> State | None:
        """The nearest state in which the body may begin, if points suit it clearly better."""
        if self._contradicted_sets <= _CONTRADICTED_SETS:
            return None
        self._contradicted_sets = -_AGAIN_SETS
        found = next((found for found, _ in self._start.candidates(people, state.T_world_root[:3, 3])), None)
        return None if found is None or self._cost(people, found) > _OTHERWISE * self._cost(people, state) else found

    def _cost(self, people: PeopleSeen, state: State) -> float:
        """What each point costs near a state, of whoever suits it best in each camera."""
        places, suited = self._modality.places(state), []
        for i, persons in enumerate(people):
            person, as_found, exchanged = self._best(i, persons or (), places, -np.inf)
            suited.append(mirrored(person) if person is not None and exchanged > as_found else person)
        return self._start.cost(state, suited)

    def _contradict(self, chosen: list[Person | None], people: PeopleSeen) -> bool:
        """Whether half of several cameras show the body exchanged, or more than half that or others only, who may hide it."""
        exchanged = sum(person is not None and self._swaps[i] > 0.0 for i, person in enumerate(chosen))
        seen = sum(person is not None for person in chosen)
        pairs = zip(chosen, people, strict=True)
        others = sum(person is None and any(map(self._is_somebody, persons or ())) for person, persons in pairs)
        return seen + others > 1 and (2 * exchanged >= seen + others or 2 * (exchanged + others) > seen + others)

    def _is_somebody(self, person: Person) -> bool:
        """Whether points were found at all: detectors of one body send it in every image, without any where it is hidden."""
        return float(person.scores[rows_of(person.names, self._modality.names)].sum()) >= _SOMEBODY

    def denied_sets(self, stamp_ns: int) -> int:
        """Image sets in a row until now in which somebody was seen, and nobody was the body."""
        if self._denies is not None and stamp_ns > self._counted_ns:  # one that is gone through again counts once
            self._counted_ns, self._denied = stamp_ns, self._denied + 1 if self._denies else 0
        return self._denied

    def claims(self, people: PeopleSeen, expected: State) -> list[np.ndarray]:
        """How well everybody suits."""
        places, found = self._modality.places(expected), []
        for i, persons in enumerate(people):
            pixels, seen = self._rig.cameras[i].project(places)
            sigma_px = self._sigma_px(i, places, _EXPECTED_M)
            pairs = [self._either_way(person, pixels, seen, sigma_px) for person in persons or ()]
            found.append(np.array([max(pair[:2]) if max(pair[:2]) > _LEAST * pair[2] else -np.inf for pair in pairs]))
        return found

    def candidates(self, people: PeopleSeen, near: np.ndarray | None = None) -> list[tuple[State, float]]:
        """Where the body may begin."""
        return self._start.candidates(people, near)

    def _with_pairs(self, persons: list[Person | None], places: np.ndarray) -> list[Person | None]:
        """With left and right of single joints exchanged, as a detector has those of shoulders where the trunk is twisted.

        Only where all cameras together contradict: what most of them see exchanged may be so, and the expectation wrong.
        """
        gains = np.array([self._pair_gains(i, person, places) for i, person in enumerate(persons)])
        wrong = (gains > _PAIR_LEAST) & (gains.sum(axis=0) < 0.0)
        return [
            self._with_rows(person, own) if person and own.any() else person for person, own in zip(persons, wrong, strict=True)
        ]

    def _pair_gains(self, i: int, person: Person | None, places: np.ndarray) -> np.ndarray:
        """(n_points,) log-likelihood ratio of each pair, exchanged against as found, the same for both of its points."""
        if person is None:
            return np.zeros(len(places))
        camera, names = self._rig.cameras[i], self._modality.names
        pixels, seen = camera.project(places)
        sigma_px = self._sigma_px(i, places, _PAIR_M)
        rows = rows_of(person.names, names)
        found = self._distances(person, rows, pixels, sigma_px)
        exchanged = self._distances(person, rows[self._mirrored], pixels, sigma_px)
        gain = np.where(seen & np.isfinite(found - exchanged), found - exchanged, 0.0)
        return gain + np.where(self._mirrored == np.arange(len(names)), 0.0, gain[self._mirrored])

    @staticmethod
    def _distances(person: Person, rows: np.ndarray, pixels: np.ndarray, sigma_px: float) -> np.ndarray:
        """(n,) costs of the points in ``rows``: half of the squared distances, linear far off, times their scores."""
        far = np.sqrt(_squares(person.pixels, person.covariances, rows, pixels, sigma_px)[0])
        return person.scores[rows] * np.where(far < _PAIR_FAR, 0.5 * far**2, _PAIR_FAR * (far - 0.5 * _PAIR_FAR))

    def _with_rows(self, person: Person, wrong: np.ndarray) -> Person:
        """The person with the points in ``wrong`` exchanged with those of the other side."""
        names, rows = self._modality.names, np.arange(len(person.names))
        to = [person.names.index(names[k]) for k in np.flatnonzero(wrong)]
        rows[to] = [person.names.index(names[k]) for k in self._mirrored[wrong]]
        return rearranged(person, rows.tolist())

    def _sigma_px(self, i: int, places: np.ndarray, sigma_m: float) -> float:
        """Pixels of a length, that of a person, at the body's distance from a camera."""
        camera = self._rig.cameras[i]
        depth = float(np.median((places - camera.center) @ camera.T_world_cam[:3, 2]))
        size = self._modality.size
        return sigma_m * size * float(camera.model.K[0, 0]) / max(depth, 0.1 * size)

    def _chosen(self, i: int, persons: tuple[Person, ...], places: np.ndarray) -> Person | None:
        """Who is the body in a camera."""
        best, as_found, exchanged = self._best(i, persons, places, _LEAST)
        if best is None:
            self._before[i] = None
            return None
        if len(self._rig) == 1 or self._alone_sets > _ALONE_SETS:
            odds = self._by_image_before(i, best, 0.5 * self._sigma_px(i, places, _EXPECTED_M))
        else:
            swap = self._swaps[i] * _SWAP_KEPT + _SWAP_PRIOR * (1.0 - _SWAP_KEPT)
            odds = float(np.clip(swap + exchanged - as_found, -10.0, 10.0))
        self._swaps[i], self._before[i] = odds, best.pixels[rows_of(best.names, self._modality.names)]
        return mirrored(best) if odds > 0.0 else best

    def _best(
        self, i: int, persons: tuple[Person, ...], places: np.ndarray, least: float
    ) -> tuple[Person | None, float, float]:
        """Who suits the body best in a camera, of those who do by ``least`` a sure point; `_either_way` of the points."""
        pixels, seen = self._rig.cameras[i].project(places)
        sigma_px, most = self._sigma_px(i, places, _EXPECTED_M), -np.inf
        best: tuple[Person | None, float, float] = None, 0.0, 0.0
        for person in persons:
            as_found, exchanged, sure = self._either_way(person, pixels, seen, sigma_px)
            suits = max(as_found, exchanged)
            if suits > most and (suits > least * sure or least == -np.inf):
                most, best = suits, (person, as_found, exchanged)
        return best

    def _by_image_before(self, i: int, person: Person, sigma_px: float) -> float:
        """Log odds of a swap, the best sequences compared, in a camera that is alone: points that jump from side to side tell it.

        Where the body is expected says nothing: it turns about with a swap that nobody else contradicts.
        """
        before = self._before[i]
        if before is None:
            return _SWAP_PRIOR
        as_found, exchanged, _ = self._either_way(person, before, np.isfinite(before).all(axis=1), sigma_px)
        jump, odds = float(np.clip(exchanged - as_found, -_SURE_JUMP, _SURE_JUMP)), self._swaps[i]
        return max(odds, jump) - max(0.0, odds + jump) - _RIGHT

    def _either_way(
        self, person: Person, pixels: np.ndarray, seen: np.ndarray, sigma_px: float
    ) -> tuple[float, float, float]:
        """`_agreement` of the person as found, and with left and right exchanged; and the sum of the scores."""
        as_found, sure = self._agreement(person, pixels, seen, sigma_px)
        return as_found, self._agreement(mirrored(person), pixels, seen, sigma_px)[0], sure

    def _agreement(self, person: Person, pixels: np.ndarray, seen: np.ndarray, sigma_px: float) -> tuple[float, float]:
        """Log-likelihood ratio of the points, where they are expected against anywhere around the person; and their scores' sum.

        Somebody who sits behind a table has points of small scores, and is as much the body as one who stands free.
        """
        rows = rows_of(person.names, self._modality.names)
        area = max((person.box[2] - person.box[0]) * (person.box[3] - person.box[1]), 1.0) * 4.0
        square, determinant = _squares(person.pixels, person.covariances, rows, pixels, sigma_px)
        density = np.exp(-0.5 * square) / (2.0 * np.pi * np.sqrt(determinant))
        ratio = np.log((1.0 - _OUTLIER) * density * area + _OUTLIER)
        says = seen & np.isfinite(ratio)
        scores = person.scores[rows][says]
        return float((scores * ratio[says]).sum()), float(scores.sum())


@compiled
def _squares(points, covariances, rows, expected, sigma_px):
    """(n,) squared distances of the points in ``rows`` from where they are expected, over their variance; its determinants, px^4.

    ``sigma_px`` is the standard deviation of what is expected.
    """
    squares, determinants = np.empty(rows.size), np.empty(rows.size)
    for k in range(rows.size):
        S, u, v = covariances[rows[k]], points[rows[k], 0] - expected[k, 0], points[rows[k], 1] - expected[k, 1]
        uu, uv, vv = S[0, 0] + sigma_px**2, S[0, 1], S[1, 1] + sigma_px**2
        determinants[k] = uu * vv - uv * uv
        squares[k] = (vv * u * u - 2.0 * uv * u * v + uu * v * v) / determinants[k]
    return squares, determinants
