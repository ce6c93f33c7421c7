"""The one loop by which states are fitted: stage by stage, from correspondences found anew to a step of the state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from ..model.articulated import ArticulatedModel
from ..model.configuration import State, configured
from ..objective.constraints.prior import Prior, SumObjective
from ..objective.normal_equations import Comparison, Correspondences, LeastSquaresObjective, NormalEquations
from .levenberg_marquardt import LevenbergMarquardtOptions, OptimizerResult, clip_to_limits, minimize, stepped


class Corresponds(Protocol):
    """What finds correspondences of a body in a state."""

    def correspond(self, state: State, detail: Any) -> Correspondences:
        """Find correspondences.

        Parameters
        ----------
        state : of the body.
        detail : how finely, in the terms of who finds them.

        Returns
        -------
        A value: nothing of it changes later.
        """
        ...


@dataclass(frozen=True, eq=False)
class Stage:
    """One round of a fit: correspondences are found at the state, then the state moves.

    Attributes
    ----------
    detail : how correspondences are found, in the terms of who finds them.
    solver : Levenberg-Marquardt while they stay as they are; None: one Gauss-Newton step, taken whatever it costs.
    damping : of that step, relative to the diagonal of H; a number, or (n_dof,).
    curvature : of the leading correspondences in that step: fraction of their H that their robust cost really has.
    dofs : (n_dof,) mask of what may move; None: everything.
    links : (n_links,) mask of those whose correspondences count, where these can be told apart (`on_links`); None: all.
    renew : whether correspondences are found anew; else those of the stage before hold.
    compares : whether the cameras are compared: before a Gauss-Newton step, else after the solver.
    repeats : so often more the stage is run at most, while a step moves a part of the body by more than ``settled_m`` meters.
    """

    detail: Any
    solver: LevenbergMarquardtOptions | None = None
    damping: float | np.ndarray = 1e-3
    curvature: float = 1.0
    dofs: np.ndarray | None = None
    links: np.ndarray | None = None
    renew: bool = True
    compares: bool = False
    repeats: int = 0
    settled_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Fit(OptimizerResult):
    """A fitted state with what it rests on.

    Attributes
    ----------
    correspondences : the leading ones, of the last stage.
    objective : what the last stage has minimized: all correspondences, constraints and priors.
    comparison : the cameras' own equations beside those of all; None where no stage has compared them.
    jumped : found by a search, far from where it was expected.
    modes : (n_dof, n_modes) tangents to other states that explain the images as well, each times the root of its probability;
        None: there are none.
    """

    correspondences: Correspondences
    objective: SumObjective
    comparison: Comparison | None = None
    jumped: bool = False
    modes: np.ndarray | None = None


def at_state(fit: Fit, state: State) -> Fit:
    """A fit held at another state.

    Parameters
    ----------
    fit : as it has ended.
    state : where the body is taken to be instead.

    Returns
    -------
    The same correspondences, with the equations at ``state``.
    """
    return replace(fit, state=state, equations=fit.objective.linearize(state))


class Masked:
    """A least-squares objective in which nothing but some degrees of freedom (mask (n_dof,)) can move."""

    def __init__(self, objective: LeastSquaresObjective, dofs: np.ndarray):
        self._objective, self._stays = objective, ~dofs

    def linearize(self, state: State) -> NormalEquations:
        """With rows and columns of what stays made those of a variable that nothing moves."""
        found, stays = self._objective.linearize(state), self._stays
        H, g = found.H.copy(), found.g.copy()
        H[stays], H[:, stays], g[stays] = 0.0, 0.0, 0.0
        H[stays, stays] = 1.0
        return NormalEquations(H, g, found.cost, found.count)


class Fitter:
    """Fits the states of one body, within the limits of its joints; deterministic.

    Parameters
    ----------
    model : the body.
    constraints : objectives beside those of the images, in the unit of the correspondences.
    """

    def __init__(self, model: ArticulatedModel, constraints: Sequence[LeastSquaresObjective] = ()):
        self._model, self._constraints = model, tuple(constraints)

    def fit(
        self,
        start: State,
        lead: Corresponds,
        stages: Sequence[Stage],
        priors: Sequence[Prior] = (),
        others: Sequence[LeastSquaresObjective] = (),
        independent: Sequence[LeastSquaresObjective] = (),
        lead_share: float = 1.0,
    ) -> Fit:
        """Run all stages from ``start``.

        Parameters
        ----------
        start : state to begin at.
        lead : finds correspondences in every stage.
        stages : one after the other, at least one.
        priors : in the unit of the correspondences.
        others : correspondences that hold throughout; each of them, and the leading ones, count by an equal share.
        independent : correspondences that hold throughout and see something else: they count in full.
        lead_share : factor of what the leading ones count for.

        Returns
        -------
        The state after the last stage, with its equations there.
        """
        chain = self._model.chain
        state, iterations, evaluations, comparison = clip_to_limits(start, chain), 0, 0, None
        beside = [*independent, *self._constraints]
        factors = [1.0 / (1 + len(others))] * (1 + len(others)) + [1.0] * len(beside)
        factors[0] *= lead_share
        found: Correspondences | None = None
        result: OptimizerResult | None = None
        for stage in stages:
            places, moved_m, times = self._places(state), np.inf, 0
            while times == 0 or (times <= stage.repeats and moved_m > stage.settled_m):
                times += 1
                if stage.renew or found is None:
                    found = lead.correspond(state, stage.detail)
                own = found if stage.links is None else _on_links(found, stage.links)
                whole = SumObjective([own, *others, *beside], factors, priors)
                objective = whole if stage.dofs is None else Masked(whole, stage.dofs)
                if stage.solver is not None:
                    result = minimize(objective, state, chain, stage.solver)
                    state = result.state
                    iterations, evaluations = iterations + result.iterations, evaluations + result.evaluations
                    if stage.compares:
                        comparison = Comparison(state, result.equations, found.camera_equations(state))
                else:
                    equations = objective.linearize(state)
                    if stage.compares and comparison is None:
                        alone = equations if not (others or independent) else SumObjective([own], priors=priors).linearize(state)
                        comparison = Comparison(state, alone, found.camera_equations(state))
                    if stage.curvature < 1.0:
                        equations = _curved(equations, found.linearize(state), factors[0] * (1.0 - stage.curvature))
                    state, result = stepped(equations, state, chain, stage.damping), None
                    iterations, evaluations = iterations + 1, evaluations + 1
                if stage.repeats:
                    before, places = places, self._places(state)
                    moved_m = float(np.linalg.norm(places - before, axis=1).max())
        if found is None:
            raise ValueError("expected at least one stage, got none")
        if result is None:
            equations, evaluations = whole.linearize(state), evaluations + 1
            result = OptimizerResult(state, equations, 0, 0, bool(np.isfinite(equations.cost)))
        return Fit(state, result.equations, iterations, evaluations, result.converged, found, whole, comparison)

    def _places(self, state: State) -> np.ndarray:
        """(n_shapes, 3) meters, world: where the parts are."""
        return configured(self._model, state).Ts_world_shape[:, :3, 3]


def _on_links(correspondences: Any, links: np.ndarray) -> Correspondences:
    return correspondences.on_links(links)


def _curved(equations: NormalEquations, of_lead: NormalEquations, missing: float) -> NormalEquations:
    """With the curvature that a robust cost really has near its minimum, for a step that does not fall short."""
    return replace(equations, H=equations.H - missing * of_lead.H)
