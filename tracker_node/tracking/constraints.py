"""What a body may not do, as objectives beside those of the images."""

from __future__ import annotations

from ..model.articulated_model import ArticulatedModel
from ..objective.collision import CollisionObjective
from ..objective.coupling import CouplingObjective
from ..objective.normal_equations import LeastSquaresObjective
from .config import TrackerConfig


def constraints_of(model: ArticulatedModel, config: TrackerConfig) -> list[LeastSquaresObjective]:
    """Parts that may not pass through each other, and axes that follow others, where the model has such."""
    result: list[LeastSquaresObjective] = []
    if config.collision.enabled:
        collisions = CollisionObjective(model, config.collision.sigma_m)
        result += [collisions] if len(collisions.pairs) else []
    if model.chain.couplings:
        result.append(CouplingObjective(model.chain))
    return result
