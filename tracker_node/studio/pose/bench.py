"""What works on a pose in the recorded images: scores and fits, in images small enough for both.

Agreement of a pose with the images of one image set, while it is set by hand: by its contours, or by its colors.

Each says what the engine of its modality would say of the pose.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np

from ...camera.rig import CameraRig
from ...loaders.images.source import load_backgrounds, resized_backgrounds
from ...loaders.json_values import finite
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.lines.correspondences import PartEvidence
from ...objective.points.photometry import PhotometryOptions
from ...observation.image_set import CameraImage, ImageSet
from ...parallel import Workers
from ...tracking.color.agreement import agreement_of
from ...tracking.config import TrackerConfig
from ...tracking.estimate import TrackEstimate
from ...tracking.region.modality import LineDetail, RegionModality
from ...tracking.tracker import Tracker
from ..images import working_rig
from ..session import StudioSession

_KEPT_SETS = 4


class PoseBench:
    """Scores and fits poses in the image sets of a session; from any thread.

    Raises
    ------
    TrackerError : a session without rig, body or images, or background images that cannot be used.
    """

    def __init__(self, session: StudioSession):
        self._images, self._model = session.needed_images(), session.needed_model()
        rig = session.needed_rig()
        self.rig, self.factor = working_rig(rig)
        self._backgrounds = resized_backgrounds(load_backgrounds(rig), self.rig)
        # A pose that is given is fitted to, not searched
        self._config = replace(session.config, initialization=replace(session.config.initialization, enabled=False))
        self.scorer = self._make_scorer(self._config)
        self._scoring, self._fitting = threading.Lock(), threading.Lock()
        self._small: dict[int, ImageSet] = {}

    def _make_scorer(self, config: TrackerConfig) -> PoseScorer:
        if config.colors is not None and not config.contours and self._model.has_colors:
            return ColorScore(self.rig, self._model, config)
        return ContourScore(self.rig, self._model, config, self._backgrounds)

    def score(self, state: State, index: int) -> PoseScore:
        """Score a pose.

        Parameters
        ----------
        state : of the body.
        index : number of the image set.

        Returns
        -------
        By all cameras together, by each of them, and by part.
        """
        images = {image.camera: image.pixels for image in self.image_set(index).images}
        with self._scoring:
            return self.scorer.score(state, images)

    def fit(self, state: State, index: int) -> TrackEstimate:
        """Fit one image set by the tracker, started in a pose.

        Parameters
        ----------
        state : of the body.
        index : number of the image set.

        Returns
        -------
        The tracker's estimate.
        """
        image_set = self.image_set(index)
        with self._fitting:
            tracker = Tracker(self.rig, self._model, self._config, self._backgrounds, state)
            return tracker.step(image_set)

    def image_set(self, index: int) -> ImageSet:
        """An image set in the size that is worked on."""
        found = self._small.get(index)
        if found is None:
            full = self._images.image_set(index)
            found = ImageSet(full.stamp_ns, tuple(self._shrunk(image) for image in full.images))
            self._small = dict([*self._small.items(), (index, found)][-_KEPT_SETS:])
        return found

    def _shrunk(self, image: CameraImage) -> CameraImage:
        lens = self.rig[image.camera].model
        pixels = cv2.resize(image.bgr, (lens.width, lens.height), interpolation=cv2.INTER_AREA)
        return CameraImage(image.camera, image.stamp_ns, pixels)


_LEAST_OUTLINE = 10  # samples of the outline of which a camera says something


@dataclass(frozen=True)
class CameraScore:
    """What one camera says of a pose: ``value`` up to 1, None where it sees too little of the body, by so many samples."""

    camera: str
    value: float | None
    samples: int


@dataclass(frozen=True)
class PoseScore:
    """Of a pose: all cameras together, each of them, and each part of the body (None: seen too little)."""

    total: float | None
    cameras: tuple[CameraScore, ...]
    parts: tuple[float | None, ...]


class PoseScorer(Protocol):
    """Scores poses of one body in images of one rig; 1 is best.

    ``name`` and ``meaning`` say of what the score is. Not for several threads at once.
    """

    name: str
    meaning: str

    def score(self, state: State, images: Mapping[str, np.ndarray]) -> PoseScore:
        """Score a pose.

        Parameters
        ----------
        state : of the body.
        images : (h, w, 3) uint8 BGR by camera; cameras without one do not count.

        Returns
        -------
        1 is best.
        """
        ...


class ContourScore(PoseScorer):
    """Scores poses of one body in the images of one rig.

    Colors are learned in the very pose that is scored, as an engine does that is started there, so a pose has one score, whatever
    was scored before. Lines are drawn at the finest scale of the tracker's, whose parameters hold.

    Parameters
    ----------
    backgrounds : background images (h, w, 3) by camera, in the size of the rig's images.
    """

    name = "outline found"
    meaning = "fraction of the body's outline that lies on a change of colors, as the region engine measures it"

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, backgrounds: Mapping[str, np.ndarray]):
        self._rig, self._config = rig, config.region
        self._modality = RegionModality(rig, model, config, Workers(config.threads).map, backgrounds=backgrounds)

    def score(self, state: State, images: Mapping[str, np.ndarray]) -> PoseScore:
        """Fraction of the outline that is found. The total is that of all samples."""
        shown, modality, region = [images.get(camera.name) for camera in self._rig], self._modality, self._config
        modality.learn_first(shown, state, region.margin_px)
        modality.set_images(shown, state)
        lines = modality.correspond(state, LineDetail(1.0, region.model_sigma_px))
        return self._scored(modality.part_evidence(lines, state, region.inlier_px))

    def _scored(self, evidence: PartEvidence) -> PoseScore:
        expected, close = evidence.expected, evidence.close
        cameras = tuple(
            CameraScore(camera.name, _fraction(close[i].sum(), expected[i].sum()), int(expected[i].sum()))
            for i, camera in enumerate(self._rig)
        )
        parts = tuple(map(_fraction, close.sum(axis=0), expected.sum(axis=0)))
        return PoseScore(_fraction(close.sum(), expected.sum()), cameras, parts)


def _fraction(close: float, expected: float) -> float | None:
    return float(close / expected) if expected >= _LEAST_OUTLINE else None


class ColorScore(PoseScorer):
    """Scores poses of a body whose parts have stated colors."""

    name = "colors agree"
    meaning = "fraction of the body's mask whose colors are the model's, against chance, as the color engine judges"

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig):
        color = config.color
        self._rig, self._painted = rig, [model] * len(rig)
        self._options = PhotometryOptions(
            color.representation, color.normalized_weight, color.levels, robust_scale=color.robust_scale
        )

    def score(self, state: State, images: Mapping[str, np.ndarray]) -> PoseScore:
        """Agreement of the colors. The total is that of the median camera, as for the engine."""
        found = agreement_of(self._painted, self._rig, [images.get(c.name) for c in self._rig], state, self._options)
        cameras = tuple(
            CameraScore(camera.name, finite(value), int(pixels))
            for camera, value, pixels in zip(self._rig, found.cameras, found.pixels.sum(axis=1), strict=True)
        )
        total = found.median if np.isfinite(found.cameras).any() else None
        return PoseScore(total, cameras, tuple(map(finite, found.parts)))
