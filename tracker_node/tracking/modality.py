"""What the body is compared with in images: the protocol behind which regions, contours, colors and textures are exchangeable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from ..model.configuration import State
from ..objective.normal_equations import Correspondences
from ..observation.keypoints.people import People, Person
from .motion.model import ExposureDelays

Images = Sequence[np.ndarray | None]
"""BGR pixels (h, w, 3) uint8 per camera of the rig, None where the set has none."""
PeopleSeen = Sequence[People | None]
"""Whom a detector has found in each camera of the rig, None where it has not looked; empty where no detector is used."""
Persons = Sequence[Person | None]
"""The body as a detector has found it in each camera of the rig, None where it has not; empty where no detector is used."""

PartColors = tuple[np.ndarray, Sequence[np.ndarray | None]]
"""(n_shapes,) color class of every part; per camera of the rig (n_classes, n_colors) densities, None where they are not known."""


class Modality(Protocol):
    """Evidence of one kind in the images of one set; deterministic in what it has been given since `reset`.

    ``lessons`` are how often, and how, it learns from the first image set: after each but the last the body is fitted.
    """

    @property
    def surfaces(self) -> np.ndarray | None:
        """(n_shapes, 4) meters: where the surface of each part is beside its shape; None where that is not followed."""
        return None

    @property
    def colors(self) -> PartColors | None:
        """What the body looks like; None where that is not learned."""
        return None

    def reset(self) -> None:
        """Forget everything learned."""
        ...

    def lessons(self, known: bool) -> Sequence[Any]:
        """What `learn_first` takes, one after the other; empty where nothing is to be learned.

        ``known``: the body is exactly where it is said to be, and nothing is fitted.
        """
        return ()

    def learn_first(self, images: Images, state: State, lesson: Any) -> None:
        """Learn anew what body and background look like.

        Parameters
        ----------
        images : in which the body is near ``state``.
        state : of the body.
        lesson : one of `lessons`.
        """
        return

    def set_images(
        self, images: Images, expected: State | None, delays: ExposureDelays | None = None, persons: Persons = ()
    ) -> None:
        """Take the images of the next set.

        Parameters
        ----------
        images : of all cameras, at one stamp or nearly.
        expected : where the body is expected; None: not known, and nothing is compared.
        delays : when each camera exposes; None: all at the stamp.
        persons : the body as a detector has found it.
        """
        ...

    def correspond(self, state: State, detail: Any) -> Correspondences:
        """Correspondences of the body with the images.

        Parameters
        ----------
        state : in which it is decided what is visible.
        detail : how finely, in the modality's own terms (`Stage.detail`).

        Returns
        -------
        A value: nothing of it changes later.
        """
        ...

    def learn(self, images: Images, state: State, weights: np.ndarray | None) -> None:
        """Learn what body and background look like now.

        Parameters
        ----------
        images : those last set.
        state : of the body in them.
        weights : (n_shapes,) how far each part is where ``state`` says, 0 to 1; None: not known.
        """
        return


def cameras_in_turn(images: Images, count: int, every: int, skipped: Sequence[bool] | None = None) -> list[np.ndarray | None]:
    """The images of the cameras whose turn it is to learn, None for the others.

    Parameters
    ----------
    images : by camera.
    count : image sets since the start.
    every : image sets between two lessons of a camera.
    skipped : by camera, whether it has learned already; None: none has.

    Returns
    -------
    As many images as ``images``.
    """
    skipped = [False] * len(images) if skipped is None else skipped
    return [image if (i + count) % every == 0 and not skipped[i] else None for i, image in enumerate(images)]
