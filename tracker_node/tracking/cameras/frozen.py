"""Cameras that repeat an image while the body moves on: what they show is over, however well it fitted then.

A driver that hangs, a decoder that lost its stream or a loose cable give the last image again and again, with new stamps. Such an
image is equal to the one before to the last digit, as no image of a sensor ever is; images without noise of a scene that stands
still are, so the body must have moved in the image, and another camera's image must have changed. One that shows nothing at all
is that of a covered lens, in which the body is not found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State, configured
from ...render.shape_arrays import bounding_spheres, shape_places
from ..estimate import FROZEN, CameraFault

_EVERY_ROW, _ROWS = 8, 60  # of an image is compared, but no more than so many
_MOVED_PX = 0.5  # by which the body has to have moved since an image was new
_NAMED_REPEATS = 2  # in a row, from which on a camera is named; one is left out, but may be a frame that was lost


@dataclass(eq=False)
class _Shown:
    """The image that a camera shows: some of its rows, since when, where the body was then, and how often it came again."""

    rows: np.ndarray
    since_ns: int
    state: State | None
    repeats: int = 0


class FrozenCameras:
    """Knows what each camera has shown last; deterministic in what it is given.

    Parameters
    ----------
    rig, model : as for the `Tracker`.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel):
        self._rig, self._model, self._bounds = rig, model, bounding_spheres(model)
        self.reset()

    def reset(self) -> None:
        """Nothing has been shown."""
        self._shown: list[_Shown | None] = [None] * len(self._rig)
        self.faults: tuple[CameraFault, ...] = ()

    def look(self, stamp_ns: int, images: Sequence[np.ndarray | None], state: State | None) -> list[int]:
        """Take in the images of one set.

        Parameters
        ----------
        stamp_ns : of the set.
        images : pixels per camera of the rig, None where the set has none.
        state : where the body was last; None: nobody knows.

        Returns
        -------
        Indices of the cameras whose images are over; `faults` names those that have been so for long enough.
        """
        repeated, changed = [], False
        for i, image in enumerate(images):
            if image is None:
                continue
            rows, shown = image[:: max(_EVERY_ROW, image.shape[0] // _ROWS)], self._shown[i]
            if shown is not None and _equal(rows, shown.rows) and (rows != rows[0, 0]).any():
                shown.repeats += 1
                repeated.append((i, shown))
            else:
                self._shown[i] = _Shown(rows.copy(), stamp_ns, state)
                changed = changed or shown is not None
        over = [(i, shown) for i, shown in repeated if changed and self._has_moved(i, shown.state, state)]
        self.faults = tuple(
            CameraFault(self._rig.cameras[i].name, FROZEN, 1e-9 * (stamp_ns - shown.since_ns), 0.0, shown.since_ns)
            for i, shown in over if shown.repeats >= _NAMED_REPEATS
        )  # fmt: skip
        return [i for i, _ in over]

    def _has_moved(self, i: int, before: State | None, now: State | None) -> bool:
        """Whether anything of the body has moved in the image of camera ``i``."""
        if before is None or now is None:
            return False
        bodies = (configured(self._model, state) for state in (now, before))
        (pixels, seen), (was, was_seen) = (self._rig.cameras[i].project(shape_places(body, self._bounds)) for body in bodies)
        return bool(np.any(np.linalg.norm(pixels - was, axis=1)[seen & was_seen] > _MOVED_PX))


def _equal(rows: np.ndarray, others: np.ndarray) -> bool:
    """Whether images are equal; where they are not, the first row tells mostly."""
    return np.array_equal(rows[0], others[0]) and np.array_equal(rows, others)
