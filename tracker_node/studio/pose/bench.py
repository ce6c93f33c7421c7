"""What works on a pose in the recorded images: scores and fits, in images small enough for both."""

from __future__ import annotations

import threading
from dataclasses import replace

import cv2
import numpy as np

from ...loaders.images.source import load_backgrounds, resized_backgrounds
from ...model.configuration import State
from ...observation.image_set import CameraImage, ImageSet
from ...tracking.config import TrackerConfig
from ...tracking.estimate import TrackEstimate
from ...tracking.tracker import Tracker
from ..outlines import working_rig
from ..session import StudioSession
from .score import ColorScore, ContourScore, PoseScore, PoseScorer

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
        same = image.pixels.shape[1::-1] == (lens.width, lens.height)
        pixels = image.bgr if same else cv2.resize(image.bgr, (lens.width, lens.height), interpolation=cv2.INTER_AREA)
        return CameraImage(image.camera, image.stamp_ns, np.ascontiguousarray(pixels))
