"""Clips of clothed people tracked: what was said of every image set, beside what was true."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from benchmark.clothed._people import KeptPeople
from benchmark.clothed._recording import CHAINS, JOINTS, LIMB_NAMES, ClothedClip
from benchmark.contour._runs import configured
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import ImageSet
from tracker_node.observation.keypoints.people import People
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import LimbStatus, Status, TrackEstimate
from tracker_node.tracking.keypoints.body_from_points import body_from_points
from tracker_node.tracking.modality import PeopleSeen, Persons
from tracker_node.tracking.tracker import Tracker

TOGETHER, POINTS, OWN_BODY, CONTOURS = "together", "points", "own_body", "contours"
ONE_CAMERA, ONE_ON_FLOOR = "one_camera", "one_camera_on_floor"
_ALONE = {POINTS: ["keypoints"], CONTOURS: ["region"]}
MODALITIES = _ALONE | {kind: ["region", "keypoints"] for kind in (TOGETHER, OWN_BODY, ONE_CAMERA, ONE_ON_FLOOR)}

OWN_BODY_SETS = 5
BONES = tuple(pair for chain in CHAINS for pair in pairwise(chain))
"""Joints of `JOINTS` at the ends of the eight bones of the limbs."""

WithPeople = Callable[[Tracker, ImageSet], tuple[ImageSet, float]]
"""Puts people into an image set; and the milliseconds of the network."""


def settings(kind: str, changes: Sequence[str]) -> TrackerConfig:
    """Defaults but for the modalities, and ``changes`` of the command line that those have."""
    names = MODALITIES[kind]
    known = [change for change in changes if change.partition(".")[0] not in {"region", "keypoints"} - set(names)]
    known += ["floor.enabled=true"] if kind == ONE_ON_FLOOR else []
    return configured(known, modalities=names)


def without_people(tracker: Tracker, image_set: ImageSet) -> tuple[ImageSet, float]:
    """For contours alone."""
    return image_set, 0.0


@dataclass(frozen=True, eq=False)
class Run:
    """A clip, or a part of it, tracked; arrays have the image set first.

    Attributes
    ----------
    clip, kind : name of the clip, and what was done to it.
    rows : (n,) image sets of the clip.
    truth_m, found_m : (n, 12, 3) joints; found are nan without a state.
    variances_m2 : (n, 12, 3) along the axes of the world; nan without a state.
    status : (n,) `Status`. limbs : (n, 4) `LimbStatus`, 0 without a state.
    step_ms, network_ms : (n,).
    people : by image set and camera, whom the detector has found.
    chosen : by image set and camera, who of them was taken for the body, as it was read.
    """

    clip: str
    kind: str
    rows: np.ndarray
    truth_m: np.ndarray
    found_m: np.ndarray
    variances_m2: np.ndarray
    status: np.ndarray
    limbs: np.ndarray
    step_ms: np.ndarray
    network_ms: np.ndarray
    people: list[list[People | None]]
    chosen: list[Persons]

    @property
    def has_state(self) -> np.ndarray:
        """(n,) bool."""
        return self.status != Status.INITIALIZING

    @property
    def errors_m(self) -> np.ndarray:
        """(n, 12) distances to the truth."""
        return np.linalg.norm(self.found_m - self.truth_m, axis=2)


class _Listening:
    """A choice that keeps what it has chosen last."""

    def __init__(self, choice):
        self._choice, self.last = choice, ()

    def __getattr__(self, name: str):
        return getattr(self._choice, name)

    def choose(self, people: PeopleSeen, expected: State) -> Persons:
        self.last = self._choice.choose(people, expected)
        return self.last


def track(
    clip: ClothedClip, kind: str, config: TrackerConfig, with_people: WithPeople, start: State | None = None,
    sets: Iterable[ImageSet] | None = None, first: int = 0,
) -> Run:  # fmt: skip
    """Track a clip as live: each image set once, nothing of what comes after.

    Parameters
    ----------
    clip, kind : which, and the name of the run.
    config : of the tracker.
    with_people : what the detector says of each set.
    start : state in the first set; None: the tracker has to find the body.
    sets : instead of those of the clip.
    first : row of the clip that they begin with.

    Returns
    -------
    The run.
    """
    tracker = Tracker(clip.rig, clip.model, config, None, start)
    estimates, step_ms, network_ms, people, chosen = [], [], [], [], []
    for image_set in clip.sets(first) if sets is None else sets:
        image_set, ms = with_people(tracker, image_set)
        choice = _listen(tracker)
        began = time.perf_counter()
        estimates.append(tracker.step(image_set))
        step_ms.append(1e3 * (time.perf_counter() - began))
        network_ms.append(ms)
        people.append([image.people for image in image_set.images])
        chosen.append(() if choice is None else choice.last)
    rows = np.arange(first, first + len(estimates))
    found, variances = zip(*(joints_of(clip.model, estimate) for estimate in estimates), strict=True)
    return Run(
        clip.name, kind, rows, clip.truth_m[rows], np.array(found), np.array(variances),
        np.array([int(estimate.status) for estimate in estimates]), np.array([limbs_of(estimate) for estimate in estimates]),
        np.array(step_ms), np.array(network_ms), people, chosen,
    )  # fmt: skip


def followed(
    clip: ClothedClip, config: TrackerConfig, with_people: WithPeople, end: int | None = None
) -> list[tuple[int, TrackEstimate]]:
    """A clip tracked as live, without a start.

    Parameters
    ----------
    clip, config, with_people : as of `track`.
    end : image set before which it ends; None: all.

    Returns
    -------
    Row and estimate of each image set in which the body is not LOST.
    """
    tracker = Tracker(clip.rig, clip.model, config)
    estimates = (tracker.step(with_people(tracker, image_set)[0]) for image_set in clip.sets(0, end))
    return [(row, each) for row, each in enumerate(estimates) if each.status.has_state and each.status is not Status.LOST]


def _listen(tracker: Tracker) -> _Listening | None:
    engine = tracker._track.engine
    choice = getattr(engine, "choice", None)
    if choice is None:
        return None
    if not isinstance(choice, _Listening):
        choice = engine.choice = _Listening(choice)
    choice.last = ()
    return choice


def joints_of(model: ArticulatedModel, estimate: TrackEstimate) -> tuple[np.ndarray, np.ndarray]:
    """Places (12, 3) of the joints, and their variances along the axes of the world; nan without a state."""
    if not estimate.status.has_state:
        return np.full((len(JOINTS), 3), np.nan), np.full((len(JOINTS), 3), np.nan)
    rows = [model.landmark_index(joint) for joint in JOINTS]
    configuration = Configuration(model, estimate.state)
    J = configuration.landmark_jacobian()[rows]
    return configuration.landmarks_world[rows], np.einsum("nij,jk,nik->ni", J, estimate.covariance, J)


def limbs_of(estimate: TrackEstimate) -> list[int]:
    """Of each limb what is said of it: LOST where the body is; where limbs are not judged, what is said of the body."""
    if not estimate.status.has_state:
        return [0] * len(LIMB_NAMES)
    told = {limb.name: int(limb.status) for limb in estimate.limbs}
    if estimate.status is Status.LOST:
        told = dict.fromkeys(LIMB_NAMES, int(LimbStatus.LOST))
    return [told.get(name, int(LimbStatus[estimate.status.name])) for name in LIMB_NAMES]


def replayed(people: Sequence[Sequence[People | None]]) -> WithPeople:
    """People as they were found before, set by set."""
    left = iter(people)

    def with_people(tracker: Tracker, image_set: ImageSet) -> tuple[ImageSet, float]:
        return with_given(image_set, next(left)), 0.0

    return with_people


def with_given(image_set: ImageSet, people: Sequence[People | None]) -> ImageSet:
    """The image set with these people, camera by camera."""
    images = (replace(image, people=each) for image, each in zip(image_set.images, people, strict=True))
    return replace(image_set, images=tuple(images))


def with_own_body(clip: ClothedClip, people: KeptPeople) -> ClothedClip:
    """The clip with a body made from its first image sets.

    Parameters
    ----------
    clip : whose images are looked at.
    people : finds people in them.

    Returns
    -------
    The same but for the body.
    """
    seen = [
        [people.find(np.ascontiguousarray(image.bgr), None).people for image in each.images]
        for each in clip.sets(0, OWN_BODY_SETS)
    ]
    return replace(clip, model=body_from_points(human_model(ankles=True), clip.rig, seen).model)


def bone_error_mm(clip: ClothedClip, model: ArticulatedModel) -> float:
    """Mean absolute error of the lengths of the eight bones of the limbs, against their mean lengths in the clip."""
    places = Configuration(model, State.neutral(model)).landmarks_world[[model.landmark_index(joint) for joint in JOINTS]]
    found = np.array([np.linalg.norm(places[a] - places[b]) for a, b in BONES])
    true = np.array([np.linalg.norm(clip.truth_m[:, a] - clip.truth_m[:, b], axis=1).mean() for a, b in BONES])
    return float(1e3 * np.abs(found - true).mean())
