"""What optimizers by scores alone need to know of an objective, and what they return."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from ..model import configuration
from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain


class ScoreObjective(Protocol):
    """A score of states; lower is better, infinity is a state that cannot be scored."""

    def score(self, state: State) -> float: ...

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`, at once."""
        ...

    def at_row_step(self, row_step: int) -> ScoreObjective:
        """The same images and options, but every n-th image row only."""
        ...


@runtime_checkable
class PartialObjective(ScoreObjective, Protocol):
    """One that takes less time where only some parts of a body move."""

    def beside(self, state: State, variables: Sequence[int]) -> ScoreObjective:
        """The same, to rounding, for states that differ in some variables alone.

        Parameters
        ----------
        state : the others as they stay.
        variables : indices, as of `model.configuration.to_variables`.

        Returns
        -------
        An objective for such states.
        """
        ...


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The best state of all that the last stage scored.

    Attributes
    ----------
    variables : (n,) as of `model.configuration.to_variables`; ``state`` is the same.
    score : on the rows that the last stage scored; infinite where not even the start could be scored.
    evaluations : scores asked for.
    evaluations_per_variable : (n,) those along each variable; what served all at once is shared out evenly over the active ones.
    converged : the rule that ends the search was met; a fact of the run, not an error.
    """

    state: State
    variables: np.ndarray
    score: float
    evaluations: int
    evaluations_per_variable: np.ndarray
    converged: bool


_ALIKE = 3  # times as many links


class VariableSpace:
    """Pose variables within the joints' limits, scored and counted."""

    def __init__(self, objective: ScoreObjective, start: State, chain: KinematicChain):
        free = np.full(configuration.N_ROOT, np.inf)
        self.lower, self.upper = np.concatenate([-free, chain.lower]), np.concatenate([free, chain.upper])
        self.start = np.clip(configuration.to_variables(start), self.lower, self.upper)
        self.size = len(self.start)
        self.evaluations = 0
        self.per_variable = np.zeros(self.size)
        self._whole = self._objective = self._staged = objective
        self._moved = [frozenset(np.flatnonzero(moved).tolist()) for moved in chain.link_moved_by.T]
        self._row_step, self._held = 1, tuple[int, ...]()

    def begin_stage(self, row_step: int) -> None:
        """Score every n-th image row from now on; 1 leaves the objective as it was given."""
        if row_step != self._row_step:
            self._row_step, self._held = row_step, ()
            self._staged = self._objective = self._whole if row_step == 1 else self._whole.at_row_step(row_step)

    def together(self, variables: Sequence[int]) -> list[list[int]]:
        """Runs of variables that move about the same links: all of them one, and that not many times as many as another.

        Parameters
        ----------
        variables : in the order in which they are stepped.

        Returns
        -------
        runs : one of all where that makes no difference to the objective.
        """
        if not isinstance(self._staged, PartialObjective):
            return [list(variables)]
        runs, most = [list(variables[:1])], self._moved[variables[0]]
        for i in variables[1:]:
            if self._moved[i] <= most and _ALIKE * len(self._moved[i]) >= len(most):
                runs[-1].append(i)
            else:
                runs.append([i])
                most = self._moved[i]
        return runs

    def hold(self, x: np.ndarray, variables: Sequence[int]) -> bool:
        """Score states from now on in which some variables alone change.

        Parameters
        ----------
        x : (n_variables,) the others as they stay.
        variables : those that change.

        Returns
        -------
        changed : whether a score of before is to be taken anew, since it is rounded otherwise now.
        """
        if self._held == tuple(variables) or not isinstance(self._staged, PartialObjective):
            return False
        self._held, self._objective = tuple(variables), self._staged.beside(configuration.from_variables(x), variables)
        return True

    def scores(self, points: Sequence[np.ndarray], variable: int | None = None, active: Sequence[int] = ()) -> np.ndarray:
        """Score points, and count them.

        Parameters
        ----------
        points : (n_variables,) each.
        variable : the one that they are counted for; None: all at once.
        active : variables that the count is divided among where ``variable`` is None.

        Returns
        -------
        (k,) scores.
        """
        states = [configuration.from_variables(x) for x in points]
        values = np.array([self._objective.score(states[0])]) if len(states) == 1 else self._objective.scores(states)
        self.evaluations += len(states)
        if variable is not None:
            self.per_variable[variable] += len(states)
        elif len(active):
            self.per_variable[list(active)] += len(states) / len(active)
        return values

    def result(self, x: np.ndarray, score: float, converged: bool) -> SearchResult:
        """The search's answer.

        Parameters
        ----------
        x, score : (n_variables,) the best point, and its score.
        converged : whether the rule that ends the search was met.

        Returns
        -------
        With all counts; not converged where the score is infinite.
        """
        return SearchResult(
            configuration.from_variables(x), x, score, self.evaluations, self.per_variable, converged and math.isfinite(score)
        )
