"""From images to a state to track from: starts are found, tried by the engine, and the one that holds is taken."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ..camera.camera_rig import CameraRig
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import State
from ..observation.image_set import ImageSet
from .config import StartConfig
from .engine import Engine, Images
from .estimate import Status
from .start import StartFinder

_SURE = 0.6  # a start that covers so much of the evidence is taken whatever the engine says
_WORSE = 0.08  # of that share, by which an engine may make a start worse


class Starter:
    """Asks a `StartFinder`, then an `Engine`; parameters are those of the finder.

    Attributes
    ----------
    problem : why the last `find` has found nothing.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: StartConfig,
        plates: Mapping[str, np.ndarray | list],
        parallel: Callable[[Callable, list], list],
    ):
        self._finder = StartFinder(rig, model, config, plates, parallel)
        self._every, self._count = config.every, 0
        self.problem = "no initial state has been given"

    def reset(self) -> None:
        """Forget all images."""
        self._finder.reset()
        self._count = 0

    def watch(self, images: Images) -> None:
        """Take in an image set in which nothing has to be found."""
        self._finder.watch(images)

    def find(self, images: Images, image_set: ImageSet, engine: Engine, around: State | None = None) -> State | None:
        """Where the body is, or None, and ``problem`` says why. The engine then has learnt from whatever it has tried last.

        After a search in vain, the next few image sets are only watched.
        """
        if self._count > 0:
            self._count -= 1
            self._finder.watch(images)
            return None
        starts = self._finder.find(images, around)
        self.problem = self._finder.problem
        if not starts:
            self._count = 0 if self._finder.watching else self._every
            return None
        tried: list[tuple[bool, State]] = []
        for start in starts:
            engine.reset()
            state = engine.begin(images, start.state)
            engine.observe(images, state)
            result = engine.fit(state, True)
            tried.append((engine.judge(result, image_set).status is not Status.LOST, result.state))
        shares = self._finder.shares([state for _, state in tried] + [start.state for start in starts])
        refined, unrefined = shares[: len(tried)], shares[len(tried) :]
        best = int(np.argmax(np.maximum(refined, unrefined)))
        held, state = tried[best]
        if refined[best] < unrefined[best] - _WORSE:  # the engine has left what the body was found by
            held, state = False, starts[best].state
        if held or max(refined[best], unrefined[best]) > _SURE:
            return state
        self._count = self._every
        covers = f"{100 * unrefined[best]:.0f} % of what stands out"
        self.problem = f"the best of {len(starts)} poses does not hold; it covers {covers}"
        return None

