"""Which cameras a tracker believes: all that tells of their faults, in the order of an image set's life."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...observation.image_set import ImageSet
from ...optimize.fitter import Fit
from ..assessment import Assessment
from ..config import TrackerConfig
from ..estimate import CameraFault, Status
from ..modality import Images
from .blinded import BlindedCameras
from .bumped import BumpedCameras
from .delayed import DelayedCameras
from .frozen import FrozenCameras
from .self_check import SelfCheck, SelfCheckOptions

_REMAIN = 2  # cameras at least, where one that was turned far is left out: one alone knows less than two, one of them wrong


class CameraTrust:
    """Names cameras at fault and leaves their images out; deterministic in what it is given.

    Parameters
    ----------
    rig, model, config : as for the `Tracker`. Without ``config.self_check.enabled`` every camera is believed.

    Attributes
    ----------
    left_out : names of the cameras whose images of the latest set are not used.
    spoiled : whether a camera has just been found late: it has shown another moment in the sets before.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig):
        options = config.self_check
        angle_rad, delay_s = np.radians(options.angle_deg), options.delay_images * config.synchronizer.image_period_s
        self._rig, self._enabled = rig, options.enabled
        self._contradicted = SelfCheck(rig, model, SelfCheckOptions(options.window_s, angle_rad, delay_s, options.sigmas))
        self._frozen, self._blinded = FrozenCameras(rig, model), BlindedCameras(rig.names)
        self._bumped, self._delayed = BumpedCameras(rig, model, angle_rad), DelayedCameras(rig, model)
        self.reset()

    def reset(self) -> None:
        """Nothing has been seen."""
        self._contradicted.reset()
        self._frozen.reset()
        self._blinded.reset()
        self._bumped.reset()
        self._delayed.reset()
        self.left_out: list[str] = []
        self.spoiled = False
        self._shown: tuple[int, Images] | None = None

    def skip(self) -> None:
        """The body is somewhere else now: how it got there is no velocity."""
        self._contradicted.skip()

    @property
    def faults(self) -> tuple[CameraFault, ...]:
        """Of cameras that repeat an image, show the body no longer, were bumped, run late, or that the others contradict."""
        found = self._frozen.faults + self._blinded.faults + self._bumped.faults
        for others in (self._delayed.faults, self._contradicted.faults):  # what is less direct adds nothing to a camera's
            known = {fault.camera for fault in found}
            found += tuple(fault for fault in others if fault.camera not in known)
        return found

    def trusted(self, image_set: ImageSet, state: State | None, lost: bool) -> ImageSet:
        """The set without the images that are not to be used.

        Parameters
        ----------
        image_set : all that cameras gave.
        state : where the body was last; None: nobody knows.
        lost : it was LOST then.

        Returns
        -------
        Without images that were there before while the body has moved on, those that do not show it, and of cameras that are
        turned too far, or late; those of others that were bumped are turned back.
        """
        if not self._enabled:
            return image_set
        images = [image_set.get(camera.name) for camera in self._rig]
        shown = [None if image is None else image.pixels for image in images]
        self._shown = image_set.stamp_ns, shown
        before = self._delayed.far_off
        self._delayed.look(image_set)
        self.spoiled = not set(self._delayed.far_off) <= set(before)
        over = set(self._frozen.look(image_set.stamp_ns, shown, state))
        if state is not None and not lost:
            over.update(self._blinded.left_out)
        without = over.union(self._bumped.far_off, self._delayed.far_off)
        if sum(image is not None and i not in without for i, image in enumerate(images)) >= _REMAIN:
            over = without
        self.left_out = [self._rig.names[i] for i in sorted(over)]
        image_set = self._bumped.turned_back(image_set)
        if not over:
            return image_set
        return replace(image_set, images=tuple(i for i in image_set.images if i.camera not in self.left_out))

    def doubted(self, assessment: Assessment) -> Assessment:
        """DEGRADED while cameras that are used show different moments: a body is nowhere in between.

        Parameters
        ----------
        assessment : of the present set.

        Returns
        -------
        The same where they do not, and of a body that is LOST.
        """
        fault = next((fault for fault in self._delayed.faults if fault.camera not in self.left_out), None)
        if fault is None or assessment.status is Status.LOST:
            return assessment
        limbs = tuple(limb.doubted(fault.text) for limb in assessment.limbs)
        return replace(assessment, status=Status.DEGRADED, reason=assessment.reason or fault.text, limbs=limbs)

    def look(self, stamp_ns: int, images: Images, fit: Fit, assessment: Assessment) -> Images:
        """Take in what the images of a set show, once the body has been found in them.

        Parameters
        ----------
        stamp_ns, images, fit, assessment : of the set; images in the light of the first one.

        Returns
        -------
        The images that may be learned from: without those of cameras that show the body no longer.
        """
        if self._enabled:
            if self._shown is not None and self._shown[0] == stamp_ns:  # not one that is gone through again
                self._bumped.look(*self._shown, fit.state)
                self._shown = None
            if assessment.support is not None and assessment.status is not Status.LOST:
                self._blinded.look(stamp_ns, images, assessment.support, assessment.shown)
        blind = self._blinded.blind
        return [None if i in blind else image for i, image in enumerate(images)] if blind else images

    def compare(self, stamp_ns: int, fit: Fit, assessment: Assessment) -> None:
        """Look for cameras that disagree with the others, by this set and those before.

        Parameters
        ----------
        stamp_ns, fit, assessment : of the set.
        """
        if not self._enabled:
            return
        usable = assessment.status in (Status.TRACKING, Status.DEGRADED) and not assessment.jumped and not self._blinded.blind
        if fit.comparison is None or not usable:
            self._contradicted.skip()
        else:
            self._contradicted.add(stamp_ns, fit.comparison)
