"""Cameras, what moves in their images, and how much of a say each pair of them has.

What the doctor can find.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..camera.rig import Camera
from .motion import ImageMotion, agreement

_FIT_TIME_STEPS = 40  # enough for a fit
_NO_TRUST, _FULL_TRUST = 0.15, 0.5  # sines of the angle between the baseline and the line of sight
_LEAST_WEIGHT = 0.02


@dataclass(frozen=True, eq=False)
class Setup:
    """Cameras as they are taken to be, what moves in their images, and how much each pair of them says, (C, C).

    ``center`` (3,) is the middle of what moves.
    """

    cameras: tuple[Camera, ...]
    motions: Mapping[str, ImageMotion]
    weights: np.ndarray

    @classmethod
    def of(cls, cameras: Sequence[Camera], motions: Mapping[str, ImageMotion]) -> Setup:
        """Cameras and motion with the weights that the places of the cameras give.

        Parameters
        ----------
        cameras : C of them.
        motions : camera -> what moves in its images.

        Returns
        -------
        The setup.
        """
        setup = cls(tuple(cameras), motions, np.ones((len(cameras), len(cameras))))
        return replace(setup, weights=setup._pair_weights())

    def _pair_weights(self) -> np.ndarray:
        """(C, C) weights 0..1. Two cameras that look at each other see planes about their baseline end on: any small thing then
        lies in many planes, and says little."""
        center = self.center
        weights = np.zeros((len(self.cameras), len(self.cameras)))
        for i, a in enumerate(self.cameras):
            for j, b in enumerate(self.cameras[:i]):
                sine = min(_sine(b.center - a.center, center - a.center), _sine(b.center - a.center, center - b.center))
                weights[i, j] = weights[j, i] = np.clip((sine - _NO_TRUST) / (_FULL_TRUST - _NO_TRUST), _LEAST_WEIGHT, 1.0)
        return weights

    def thinned(self) -> Setup:
        """With fewer time steps where there are many, for fits."""
        step = max(1, len(next(iter(self.motions.values())).valid) // _FIT_TIME_STEPS)
        return replace(self, motions={name: motion.every(step) for name, motion in self.motions.items()})

    def with_camera(self, index: int, camera: Camera) -> Setup:
        """The setup with one camera replaced.


        Parameters
        ----------
        index : of the camera.
        camera : the new one.

        Returns
        -------
        A new setup; weights stay.
        """
        return replace(self, cameras=(*self.cameras[:index], camera, *self.cameras[index + 1 :]))

    def with_motions(self, changed: Mapping[str, ImageMotion]) -> Setup:
        return replace(self, motions={**self.motions, **changed})

    def agreement_of(self, index: int) -> float:
        """Weighted mean agreement of one camera with all others."""
        camera, total, weight = self.cameras[index], 0.0, 0.0
        for i, other in enumerate(self.cameras):
            if i != index:
                value = agreement(camera, self.motions[camera.name], other, self.motions[other.name])
                if np.isfinite(value):
                    total += self.weights[index, i] * value
                    weight += self.weights[index, i]
        return total / weight if weight > 0.0 else float("nan")

    @property
    def center(self) -> np.ndarray:
        """The point (3,) nearest to the lines of sight to the middle of each camera's motion."""
        normal, right = 1e-9 * np.eye(3), np.zeros(3)
        for camera in self.cameras:
            motion = self.motions[camera.name]
            if len(motion.amounts):
                ray = camera.T_world_cam[:3, :3] @ camera.model.rays(motion.center)[0]
                across = np.eye(3) - np.outer(ray, ray)
                normal, right = normal + across, right + across @ camera.center
        return np.linalg.solve(normal, right)


def _sine(a: np.ndarray, b: np.ndarray) -> float:
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.linalg.norm(np.cross(a, b))) / lengths if lengths > 0.0 else 0.0


FAULTS = {
    "source": "no images",
    "resolution": "wrong resolution",
    "swapped": "swapped cameras",
    "mirrored": "mirrored axis",
    "unit": "wrong unit",
    "place": "wrong place of a camera",
    "moved": "camera moved during the recording",
    "focal": "wrong focal length",
    "clock": "clock offset",
    "exposure": "exposure changes",
    "interlaced": "interlaced video",
    "repeated": "repeated images",
    "rate": "too low image rate",
}


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Parameters
    ----------
    fault : key of `FAULTS`.
    cameras : those it concerns; empty for the whole rig.
    sentence : what is wrong, in plain words, and what to do.
    values : the measured numbers behind it.
    """

    fault: str
    cameras: tuple[str, ...]
    sentence: str
    values: dict[str, float] = field(default_factory=dict)
