"""Other places where limbs may be: followed from image set to image set until the contours of all of them decide.

One image set seldom tells a limb before a trunk of its color from one beside it. Where a limb may be as well is a *mode* of it:
it is fitted to the contours of every later set, as the limb itself is, and the log-likelihood ratio of the lines drawn about it
against those about the limb adds up, forgetting. A mode that comes to speak clearly for itself is where the limb is; one that
the contours speak against, or that ends where the limb does, is dropped.

On 19 drawn clips of clothed people the ratio told a right mode of a LOST limb from a wrong mode of a right one by an area under
the curve of 0.96 with one set and 0.95 with five, what the colors gain by 0.77: clothes of the color of the floor mislead them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.lines.correspondences import PartEvidence
from ..limbs.judge import LimbJudge
from ..poses import Poses

_MODES = 3  # of a limb that are followed, beside where it is taken to be
_APART_M = 0.12  # between the ends of a limb in two modes, when they are taken in
_SAME_M = 0.06  # between ends, below which two modes have become one
_KEPT = 0.8  # of the evidence from one image set to the next
_DAMPED = 0.7  # of a mode's motion from one image set to the next
_TAKEN = 2.0  # evidence at which a mode is where the limb is: log-likelihood ratio for each line that it should have, summed up
_DROPPED = -4.0  # at which it is no longer followed
_LEAST_SETS = 2  # that a mode is followed before it is taken


@dataclass(frozen=True, eq=False)
class PartPose:
    """A body with one part fitted, and how far its outline then agrees with the images."""

    state: State
    evidence: PartEvidence


class SearchedSet(Protocol):
    """The image set in which limbs are searched."""

    def gains(self, poses: Poses, shapes: np.ndarray) -> np.ndarray:
        """Log-likelihood that the colors gain by some parts, and the cells in which they show.

        Parameters
        ----------
        poses : n poses.
        shapes : (n_shapes,) mask of the parts; the rest of the body is where the first pose has it.

        Returns
        -------
        (n, 2)
        """
        ...

    def fit_part(self, state: State, dofs: np.ndarray) -> PartPose:
        """The body with some degrees of freedom fitted to its contours.

        Parameters
        ----------
        state : to begin at.
        dofs : (n_dof,) mask of what moves.

        Returns
        -------
        The fitted state, and what agrees there.
        """
        ...


@dataclass
class _Mode:
    """``angles`` (n_own,) of the limb's joints in the last set, and their ``motion`` to it; ``evidence`` for it over ``sets``."""

    angles: np.ndarray
    motion: np.ndarray
    evidence: float = 0.0
    sets: int = 0


class LimbModes:
    """Follows other places of limbs.

    Parameters
    ----------
    judge : knows the limbs.
    """

    def __init__(self, judge: LimbJudge):
        self._judge = judge
        self.reset()

    def reset(self) -> None:
        """No mode is followed."""
        self._modes: dict[int, list[_Mode]] = {}

    @property
    def followed(self) -> list[int]:
        """Limbs of which modes are followed: they may as well be elsewhere."""
        return sorted(self._modes)

    def add(self, i: int, state: State, places: Iterable[np.ndarray]) -> None:
        """Follow other places of a limb from now on.

        Parameters
        ----------
        i : index of the judge's limbs.
        state : the body as it is taken to be.
        places : (n_own,) radians of the limb's joints, the likeliest first; those whose ends are near others' are passed over.
        """
        modes = list(self._modes.get(i, []))
        ends = self._ends(i, state, modes)
        for angles in places:
            end = self._judge.tip(i, self._moved(i, state, angles))
            if len(modes) < _MODES and _distance(end, ends) > _APART_M:
                modes.append(_Mode(angles.copy(), np.zeros(len(angles))))
                ends.append(end)
        self._keep(i, modes)

    def drop(self, i: int) -> None:
        """Follow no mode of limb ``i`` any more."""
        self._modes.pop(i, None)

    def follow(self, state: State, evidence: PartEvidence, images: SearchedSet) -> dict[int, State]:
        """Fit all modes to the images of the next set, and add up what speaks for them.

        Parameters
        ----------
        state : the body as it is fitted to them.
        evidence : of its lines.
        images : those of this set.

        Returns
        -------
        By limb, the body with the limb in a mode that speaks clearly for itself.
        """
        clear: dict[int, State] = {}
        for i in self.followed:
            best, kept, ends = _TAKEN, list[_Mode](), [self._judge.tip(i, state)]
            for mode in self._modes[i]:
                pose = self._fitted(i, mode, state, images)
                mode.evidence = _KEPT * mode.evidence + self.gain(i, pose.evidence, evidence)
                end = self._judge.tip(i, pose.state)
                if mode.evidence <= _DROPPED or _distance(end, ends) < _SAME_M:
                    continue
                kept.append(mode)
                ends.append(end)
                if mode.evidence > best and mode.sets >= _LEAST_SETS:
                    clear[i], best = pose.state, mode.evidence
            self._keep(i, kept)
        return clear

    def gain(self, i: int, there: PartEvidence, here: PartEvidence) -> float:
        """What the contours of one image set say for one place of a limb against another.

        Parameters
        ----------
        i : index of the judge's limbs.
        there, here : of the lines about both.

        Returns
        -------
        Log-likelihood ratio for each line that the limb should have. Those of the rest of the body are left out: beside an arm
        a trunk has fewer, and they find less.
        """
        shapes = self._judge.limbs[i].shapes
        ratio, lines = (getattr(there, name)[:, shapes].sum() for name in ("log_ratio", "expected"))
        ratio_here, lines_here = (getattr(here, name)[:, shapes].sum() for name in ("log_ratio", "expected"))
        return float((ratio - ratio_here) / max(0.5 * (lines + lines_here), 1.0))

    def _fitted(self, i: int, mode: _Mode, state: State, images: SearchedSet) -> PartPose:
        """The body with limb ``i`` in ``mode``, which moves on with the images."""
        dofs = self._judge.limbs[i].dofs
        pose = images.fit_part(self._moved(i, state, mode.angles + mode.motion), dofs)
        angles = pose.state.joint_positions[dofs[N_ROOT_DOF:]]
        if mode.sets:  # the first fit is no motion
            mode.motion = _DAMPED * (angles - mode.angles)
        mode.angles, mode.sets = angles, mode.sets + 1
        return pose

    def _ends(self, i: int, state: State, modes: Iterable[_Mode]) -> list[np.ndarray]:
        """Where limb ``i`` ends as it is taken to be, then in its modes."""
        return [self._judge.tip(i, state), *(self._judge.tip(i, self._moved(i, state, mode.angles)) for mode in modes)]

    def _moved(self, i: int, state: State, angles: np.ndarray) -> State:
        joints = state.joint_positions.copy()
        joints[self._judge.limbs[i].dofs[N_ROOT_DOF:]] = angles
        return State(state.T_world_root, joints)

    def _keep(self, i: int, modes: list[_Mode]) -> None:
        self._modes.pop(i, None)
        if modes:
            self._modes[i] = modes


def _distance(end: np.ndarray, others: Iterable[np.ndarray]) -> float:
    return min(float(np.linalg.norm(end - other)) for other in others)
