"""Detection of camera positions in another unit than meters, from the distances between the cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import TrackerError
from .rig import Camera

LARGEST_ROOM_M = 100.0  # a camera farther than this from the others is hardly meant in meters
LEAST_PX = 20.0  # a body that is smaller in the images is not tracked


@dataclass(frozen=True)
class WrongUnit:
    """What speaks for another unit.

    Parameters
    ----------
    cameras : the ones that stand too far away, by name.
    all_of_them : these are all cameras of the rig.
    apart_m : how far they stand from the others, as it is written.
    factor : by which their places become meters.
    """

    cameras: tuple[str, ...]
    all_of_them: bool
    apart_m: float
    factor: float

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        names = ", ".join(self.cameras)
        who = f"The cameras are {self.apart_m:.0f} m apart"
        if not self.all_of_them:
            who = f"{names}: stands {self.apart_m:.0f} m from the others"
        unit = "millimeters" if self.factor < 5e-3 else "centimeters"
        return (
            f"{who}: the translation of T_world_cam seems to be in {unit}, a rig is in meters ({self.apart_m * self.factor:.2f} m"
            f" then). Divide it by {1 / self.factor:.0f}."
        )


def wrong_unit(cameras: Sequence[Camera]) -> WrongUnit | None:
    """Evidence that cameras stand farther apart than any room is large; None without it, and for a single camera."""
    if len(cameras) < 2:
        return None
    centers = np.array([camera.center for camera in cameras])
    distances = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    half = len(cameras) // 2  # of two in the middle the nearer, so that one camera in three does not make all look far
    apart = np.sort(distances, axis=1)[:, half]
    far = apart > LARGEST_ROOM_M
    if not far.any():
        return None
    typical = float(np.median(apart[far]))
    names = tuple(camera.name for camera, is_far in zip(cameras, far, strict=True) if is_far)
    return WrongUnit(names, bool(far.all()), typical, 1e-3 if typical > 1000.0 else 1e-2)


def check_metres(cameras: Sequence[Camera], size_m: float) -> None:
    """Refuse cameras in another unit; a rig that is really large sees a body of this size from far away, too small to track.

    Parameters
    ----------
    cameras : of the rig.
    size_m : size of the body that is to be tracked between them.

    Raises
    ------
    TrackerError : with the sentence that ``rig check`` writes.
    """
    wrong = wrong_unit(cameras)
    if wrong is None:
        return
    middle_m = 0.5 * wrong.apart_m
    largest_px = max(size_m * float(camera.model.K[1, 1]) / middle_m for camera in cameras if camera.name in wrong.cameras)
    if largest_px < LEAST_PX:
        raise TrackerError(f"rig: {wrong.sentence} (tracker_node rig check looks for other faults, too)")
