"""From a start to the state whose colors suit the images best: by alignment part by part, by stepping or by simplex."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ...objective.color.score import ColorObjective
from ...objective.constraints.prior import Prior, SumObjective
from ...objective.normal_equations import Correspondences
from ...objective.points.photometry import SurfaceCorrespondences
from ...optimize.fitter import Fit, Fitter, Stage
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions, OptimizerResult
from ...optimize.score_objective import SearchResult
from ...optimize.simplex import STAGES, SimplexStage, search_simplex
from ...optimize.stepping import SCHEDULES, SteppingOptions, schedule, step_downhill
from ..config import ColorConfig, ColorOverBackgroundConfig
from ..engine import Solver
from ..limbs.tree import Limb, limbs_of, stages_of
from ..modality import Images
from ..poses import Poses, PoseSearch, Round
from .modality import ColorModality, ColorScores

_TOLERANCE = 1e-3
_TRACKING = schedule((20, 10, 5), (4, 2, 1))
_STEPPING_POLISH = SteppingOptions(schedule((5,), (1,)))
_SIMPLEX_POLISH = (SimplexStage(0.01, np.deg2rad(1.0), 0.2, max_evaluations=20),)
_BEAM = 6  # places of a lost limb that are followed
_LIMB = LevenbergMarquardtOptions(max_iterations=15, tolerance=_TOLERANCE)
_SEARCH_LEVEL = 2  # of the pyramid


class ColorSearch(Protocol):
    """Finds states by colors."""

    def run(self, start: State, priors: Sequence[Prior], first: bool) -> Fit:
        """Walk from a start.

        Parameters
        ----------
        start : state to begin at.
        priors : in gray levels squared.
        first : of a first image set.

        Returns
        -------
        The best state.
        """
        ...

    def find_limb(self, limb: Limb, around: State, rng: np.random.Generator) -> State:
        """Search one limb.

        Parameters
        ----------
        limb : moves; the rest of the body stays.
        around : state to search around.
        rng : seeded.

        Returns
        -------
        The state in which the limb suits the images best of many tried.
        """
        ...


class ColorSolver(Solver):
    """A search, and once more where limbs that have been lost are found again (`Solver`).

    Parameters
    ----------
    model, config : as for the `Tracker`.
    modality : of the colors.
    search : finds states.
    """

    def __init__(self, model: ArticulatedModel, config: ColorOverBackgroundConfig, modality: ColorModality, search: ColorSearch):
        self._model, self._config, self._modality, self._search = model, config, modality, search
        self._limbs = [limb for limb in limbs_of(model)[1:] if limb.dofs.any()]
        self.reset()

    def reset(self) -> None:
        """The generator begins anew."""
        self._rng = np.random.default_rng(self._config.seed)

    def fit(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """From coarse to fine, then limbs that do not agree."""
        fit = self._search.run(start, self._priors(start), first)
        for limb in self._limbs:
            if self._agreement(fit, limb) < self._config.degraded_agreement and self._config.search_states:
                fit = self._with_limb(limb, fit)
        return fit

    def _priors(self, expected: State) -> list[Prior]:
        config, axes = self._config, self._model.chain.axes
        stay = np.full(self._model.n_dof, config.stay_angle)
        stay[:3] = config.stay_position
        neutral = np.zeros(self._model.n_dof)
        neutral[N_ROOT_DOF:] = [config.neutral_angle * axis.stiffness for axis in axes]
        return [Prior(expected, stay), Prior(State.neutral(self._model, expected.T_world_root), neutral)]

    def _agreement(self, fit: Fit, limb: Limb) -> float:
        """Of all parts of a limb together; infinite where none is seen."""
        return self._modality.agreement(fit.state).of(limb.shapes)

    def _with_limb(self, limb: Limb, fit: Fit) -> Fit:
        """The fit with the limb where it suits better, if such a place is found."""
        before = self._agreement(fit, limb)
        found = self._search.find_limb(limb, fit.state, self._rng)
        again = self._search.run(found, self._priors(found), first=False)
        if self._agreement(again, limb) <= before:
            return fit
        return replace(again, iterations=fit.iterations + again.iterations, evaluations=fit.evaluations + again.evaluations)


class AlignmentSearch(ColorSearch):
    """Levenberg-Marquardt on surface points: part by part where that is asked for, then all variables level by level."""

    def __init__(self, model: ArticulatedModel, config: ColorConfig, modality: ColorModality):
        self._model, self._config, self._modality, self._fitter = model, config, modality, Fitter(model)
        self._parts = stages_of(model.chain) if config.hierarchical else ()

    def run(self, start: State, priors: Sequence[Prior], first: bool) -> Fit:
        """Align from coarse to fine, on the coarsest level part by part."""
        config = self._config
        passes, coarsest = config.first_passes if first else config.passes, config.levels - 1
        options = LevenbergMarquardtOptions(max_iterations=config.iterations, tolerance=_TOLERANCE)
        # All parts share the coarsest level's points
        stages = [Stage(coarsest, options, dofs=part.dofs, links=part.links, renew=i == 0) for i, part in enumerate(self._parts)]
        stages += [Stage(level, options) for level in range(coarsest, -1, -1) for _ in range(passes)]
        return self._fitter.fit(start, self._modality, stages, priors)

    def find_limb(self, limb: Limb, around: State, rng: np.random.Generator) -> State:
        """Generate and test, from proximal to distal.

        For each link in turn random angles, from the few best places of what carries it; only the links placed so far are scored.
        The best of the whole limb are aligned.
        """
        config, chain = self._config, self._model.chain
        points = self._modality.correspond(around, min(_SEARCH_LEVEL, config.levels - 1))
        moved = (chain.link_moved_by & limb.dofs).any(axis=1)
        links = [link for link in np.flatnonzero(moved).tolist() if chain.axis_count[link]]
        rounds = []
        for i, link in enumerate(links):
            beam = _BEAM if i else 1
            score = _Costs(points.on_links(_placed(chain, moved, links[i + 1 :])))
            n = config.search_states // (len(links) * beam)
            rounds.append(Round(float(np.deg2rad(config.search_angle_deg)), n, beam, chain.dofs_of([link]), score))
        search = PoseSearch(chain, rounds[0].score or _Costs(points), limb.dofs, rng)
        poses, _ = search.run(Poses.of([around]), rounds, _BEAM)
        stage = Stage(None, _LIMB, dofs=limb.dofs, links=moved)
        fits = [self._fitter.fit(poses.state(i), _Held(points), [stage]) for i in range(len(poses))]
        return min(fits, key=lambda fit: fit.equations.cost).state


@dataclass(frozen=True, eq=False)
class _Costs:
    """Poses scored by points of the surface."""

    points: SurfaceCorrespondences

    def __call__(self, poses: Poses) -> np.ndarray:
        return -np.array([self.points.cost(poses.state(i)) for i in range(len(poses))])


@dataclass(frozen=True, eq=False)
class _Held:
    """Correspondences that stay as they are, whatever the state."""

    correspondences: Correspondences

    def correspond(self, state: State, detail: object) -> Correspondences:
        return self.correspondences


class MaskScores(ColorScores):
    """The score of the mask (`ColorScores`)."""

    def __init__(self, score: ColorObjective):
        self.score = score

    def set_colors(self, learned: np.ndarray | None, rgb: np.ndarray) -> None:
        """Take the learned colors."""
        self.score.set_colors(learned)

    def set_images(self, images: Images, expected: State | None) -> None:
        """Take the images of a set."""
        self.score.set_images(images)


class ScoreSearch(AlignmentSearch):
    """Downhill on the score of the mask (Trewartha, Yeadon & Knight): by stepping or by simplex, part by part."""

    def __init__(self, model: ArticulatedModel, config: ColorConfig, modality: ColorModality, score: ColorObjective):
        super().__init__(model, config, modality)
        self._score = score

    def run(self, start: State, priors: Sequence[Prior], first: bool) -> Fit:
        """Walk downhill part by part, then all together.

        The hierarchy needs no polish of its own for the root's variables: the last walk moves them all.
        """
        walks: list[tuple[list[int] | None, bool]] = [(part.variables, False) for part in self._parts] or [(None, False)]
        walks += [(None, True)] if self._parts else []
        state, evaluations, converged = start, 0, False
        for variables, polish in walks:
            found = self._walk(state, variables, polish)
            state, evaluations, converged = found.state, evaluations + found.evaluations, found.converged
        return walked(self._modality, state, priors, len(walks), evaluations, converged)

    def _walk(self, state: State, variables: list[int] | None, polish: bool) -> SearchResult:
        config, score, chain = self._config, self._score, self._model.chain
        if config.optimizer == "stepping":
            loops = _TRACKING if config.schedule == "tracking" else SCHEDULES[config.schedule]
            return step_downhill(score, state, chain, _STEPPING_POLISH if polish else SteppingOptions(loops), variables)
        return search_simplex(score, state, chain, _SIMPLEX_POLISH if polish else STAGES, variables)


def walked(
    modality: ColorModality, state: State, priors: Sequence[Prior], iterations: int, evaluations: int, converged: bool
) -> Fit:
    """The fit at the end of a walk on scores; its equations are those of the surface's points.

    Parameters
    ----------
    modality : of the colors.
    state : where the walk has ended.
    priors : in gray levels squared.
    iterations, evaluations, converged : of the walk.

    Returns
    -------
    Held at ``state``.
    """
    points = modality.correspond(state, 0)
    objective = SumObjective([points], priors=priors)
    return Fit(state, objective.linearize(state), iterations, evaluations, converged, points, objective)


def ended(result: OptimizerResult, correspondences: Correspondences) -> Fit:
    """The fit that an alignment without priors has ended with.

    Parameters
    ----------
    result, correspondences : the alignment's, and what it was on.

    Returns
    -------
    With the correspondences as its objective.
    """
    return Fit(
        result.state, result.equations, result.iterations, result.evaluations, result.converged, correspondences,
        SumObjective([correspondences]),
    )  # fmt: skip


def _placed(chain: KinematicChain, links: np.ndarray, later: Sequence[int]) -> np.ndarray:
    """Mask (n_links,) of ``links`` (n_links,) without those that the joint of a ``later`` one moves."""
    placed = links.copy()
    for link in later:
        placed &= ~chain.link_moved_by[:, N_ROOT_DOF + int(chain.axis_start[link])]
    return placed
