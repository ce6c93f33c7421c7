"""How the cameras see each limb: what outlines cannot tell of one that is narrow, seen by one camera, or mostly hidden."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.shapes.primitives import END_RADIUS, START_RADIUS
from ...objective.lines.correspondences import PartEvidence
from .tree import Limb

_SECOND_VIEW = 0.3  # of its samples in the camera that sees most of a limb, which another one has where its depth is known...
_LEAST_IN_SECOND = 5  # ...and at least so many
_FLAT_SETS = 2  # in a row without another one, from which on what two have seen before tells its depth no more
FLAT = "one camera alone sees its outline"
_LEAST_WIDTH_PX = 2.5  # of a limb that outlines tell from others; of narrower ones of a drawn figure 3 % were wrong and TRACKING
# Of as much of its outline as was ever there to be seen: on twelve clips of clothed people by four and by three cameras 43 % of
# the wrong limb-sets that were TRACKING had less, and 2 % of the right ones...
_LEAST_IN_VIEW = 0.6
_CLEAR = 0.8  # ...unless so much of what is there is found


class LimbViews:
    """Knows how much of each limb cameras have to see, and have had; deterministic in what it has been given since `reset`.

    Parameters
    ----------
    model, limbs : the body, and its limbs, the trunk first.
    """

    def __init__(self, model: ArticulatedModel, limbs: Sequence[Limb]):
        self._masks = np.array([limb.shapes for limb in limbs], dtype=np.float64)
        radii = np.array([rows[:, [START_RADIUS, END_RADIUS]].max(initial=0.0) for rows in model.capsules])
        widths = [2.0 * np.median(radii[limb.shapes]) if limb.shapes.any() else np.inf for limb in limbs]
        self._widths_m = np.array(widths if len(limbs) > 1 else [np.inf])  # of the shape in the middle; a thing is told from none
        self.reset()

    def reset(self) -> None:
        """Nothing has been seen."""
        self._most = np.zeros(len(self._masks))  # samples a camera, the most that a limb has had
        self.restart()

    def restart(self) -> None:
        """Nobody knows how the body was seen a moment ago."""
        self._flat_sets = np.full(len(self._masks), _FLAT_SETS)  # image sets in a row in which one camera alone saw each

    def told(self) -> None:
        """In this set something else has said where limbs are."""
        self._flat_sets[:] = 0

    def doubts(self, evidence: PartEvidence, found: np.ndarray, px_per_m: float, told_joints: bool = False) -> list[str]:
        """Take in an image set: why each limb, where its outline is found, may be elsewhere all the same.

        Parameters
        ----------
        evidence : of the image set.
        found : (n_limbs,) share of each limb's outline that is; nan where none is to be seen.
        px_per_m : pixels of a meter at the body.
        told_joints : the body has said where its joints are.

        Returns
        -------
        The reasons; "" where there is none.
        """
        if told_joints:
            self.told()
            return [_doubt(width, 0, 1.0) for width in px_per_m * self._widths_m]
        samples = self._masks @ evidence.expected.T  # (n_limbs, n_cameras)
        of_body = evidence.expected.sum(axis=1)
        self._flat_sets = np.where(self._seen_by_one(samples, of_body), self._flat_sets + 1, 0)
        there = samples.sum(axis=1) / max(int(np.count_nonzero(of_body)), 1)
        self._most = np.maximum(self._most, there)
        in_view = np.where(found < _CLEAR, there / np.maximum(self._most, 1.0), 1.0)
        in_view[0] = 1.0  # the trunk is where the limbs are
        rows = zip((px_per_m * self._widths_m).tolist(), self._flat_sets.tolist(), in_view.tolist(), strict=True)
        return [_doubt(*row) for row in rows]

    def _seen_by_one(self, samples: np.ndarray, of_body: np.ndarray) -> np.ndarray:
        """(n_limbs,) mask of limbs of which one camera alone sees enough: bent towards it, they look as bent away from it.

        The trunk is where the whole body is.
        """
        if len(samples) == 1:  # the poses of things that look alike are found one by one
            return np.zeros(1, dtype=np.bool_)
        samples = np.sort(np.hstack([np.zeros((len(samples), 1)), np.vstack([of_body, samples[1:]])]), axis=1)
        return samples[:, -2] < np.maximum(_LEAST_IN_SECOND, _SECOND_VIEW * samples[:, -1])


def _doubt(width_px: float, flat_sets: int, in_view: float) -> str:
    if width_px < _LEAST_WIDTH_PX:
        return f"it is {width_px:.1f} pixels wide"
    if flat_sets >= _FLAT_SETS:
        return FLAT
    return f"{100.0 * in_view:.0f} % of its outline is in view" if in_view < _LEAST_IN_VIEW else ""
