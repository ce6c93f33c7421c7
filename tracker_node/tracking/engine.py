"""What finds the body in the images of one set: the interface behind which contours and colors are exchangeable.

The `Tracker` knows time: it predicts, asks its engine, and believes the answer or not. An engine knows images: for each set the
tracker calls `observe`, `fit`, then `judge`, `report` and `learn`, in this order; `begin` comes before them on the first set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..model.configuration import State
from ..objective.constraints.prior import Prior
from ..objective.normal_equations import Comparison, NormalEquations
from ..observation.image_set import ImageSet
from ..optimize.result import OptimizerResult
from .covariance import ImageEvidence
from .estimate import CameraReport, LimbReport, Status
from .motion.model import Passage

Images = Sequence[np.ndarray | None]
"""BGR pixels (h, w, 3) uint8 per camera of the rig, None where the set has none."""


@dataclass(frozen=True)
class Verdict:
    """How far a fit can be trusted.

    ``reason`` is empty when the status is TRACKING. ``noise``: what was fitted is not the body at all, and the predicted state is
    the better answer. ``jumped``: the body was found far from where it was expected, and how it got there says nothing of its
    speed. ``limbs`` are judged one by one where the engine can; ``trust`` (n_dof,) then is the share of the information's square
    root that is to be believed. ``surety`` is what the images say for this state against chance, by which states in the same
    images can be compared; None where the engine has no such measure.
    """

    status: Status
    reason: str
    noise: bool = False
    jumped: bool = False
    limbs: tuple[LimbReport, ...] = ()
    trust: np.ndarray | None = None
    surety: float | None = None


@dataclass(frozen=True, eq=False)
class Report:
    """What the last fit says of itself: each camera's part, rms residual over all, covariance (n_dof, n_dof) in the tangent.

    ``images`` is what of it the images have told, ``arcs`` what of the covariance `fit_covariance` puts down to arcs, where the
    engine knows.
    """

    cameras: tuple[CameraReport, ...]
    residual_px: float
    covariance: np.ndarray
    images: ImageEvidence | None = None
    arcs: np.ndarray | None = None


class Engine(Protocol):
    """Finds a body near a state in the images of one set; deterministic in what it has been given since `reset`.

    ``in_information_units``: its normal equations are those of minus twice a log posterior, so that a filter can go by them.
    """

    in_information_units: bool

    def reset(self) -> None:
        """Forget everything learnt."""
        ...

    def begin(self, images: Images, start: State, *, known: bool = False) -> State:
        """Learn what is needed from the first image set, in which the body is near ``start``; returns a better start.

        ``known``: the body is just there, as another tracker has found it, and nothing is fitted.
        """
        ...

    def observe(self, images: Images, expected: State | None, passage: Passage | None = None) -> None:
        """Look at the images where the body is expected; None: nobody knows where it is, and nothing is looked at.

        ``passage`` tells where the body is when each camera exposes; None: all expose at one instant.
        """
        ...

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> OptimizerResult:
        """The state that suits the observed images best, searched from ``start``; longer on the ``first`` set.

        ``prior`` is what is believed beforehand, in units of information; engines with units of their own leave it out.
        """
        ...

    def judge(self, result: OptimizerResult, image_set: ImageSet) -> Verdict:
        """Whether that is the body."""
        ...

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations of the observed images at another state; `report` then is about that one."""
        ...

    def comparison(self) -> Comparison | None:
        """What each camera has said of the last fit; None where the engine has units of its own."""
        ...

    def report(self, result: OptimizerResult, image_set: ImageSet) -> Report:
        """Residuals and covariance of ``result``."""
        ...

    def learn(self, images: Images, state: State) -> None:
        """Take in what the body, believed to be in ``state``, and its surroundings look like now."""
        ...
