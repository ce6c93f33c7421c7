"""Which parts the engine of a configuration has: modalities, solver, judge."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..camera.rig import CameraRig
from ..model.articulated import ArticulatedModel
from ..model.humans.keypoints import BLAZEPOSE, KeypointTable
from ..parallel import Workers
from ..render.occluders import Occluders
from .chamfer.judge import ChamferJudge
from .chamfer.modality import FINE, ChamferFitting, ChamferModality
from .config import CHAMFER, COLOR_OVER_BACKGROUND, JOINT, KEYPOINTS, REGION, TEXTURE, ColorConfig, TrackerConfig
from .engine import AnyEngine, Engine, JointEngine, LedEngine, SequentialEngine
from .keypoints.choice import PersonChoice
from .keypoints.fitting import KeypointFitting
from .keypoints.judge import KeypointJudge
from .keypoints.modality import KeypointModality
from .keypoints.start import PointStart
from .limbs.judge import LimbJudge
from .modality import Modality
from .region.area import RegionArea
from .region.fitting import RegionFitting
from .region.judge import RegionJudge
from .region.modality import RegionModality
from .region.reacquisition import Reacquisition

Backgrounds = Mapping[str, np.ndarray | list]


def make_engine(
    rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, backgrounds: Backgrounds, occluders: Occluders | None = None,
    keypoints: KeypointTable = BLAZEPOSE,
) -> AnyEngine:  # fmt: skip
    """The engine of the modalities in use; compiled code of others is not loaded.

    Parameters
    ----------
    rig, model, config, backgrounds : as for the `Tracker`.
    occluders : what stands before the body; None: nothing does.
    keypoints : what a detector's points are on the body.

    Returns
    -------
    An engine that has learned nothing.

    Raises
    ------
    ModelError : the body does not suit a modality.
    """
    workers, occluders = Workers(config.threads), occluders or Occluders(None, rig)
    if not config.contours and KEYPOINTS in config.modalities:
        points = KeypointModality(rig, model, config.keypoints, keypoints)
        judge = KeypointJudge(rig, model, points)
        by_points = KeypointFitting(model, config, points)
        return Engine([points], by_points, judge, True, PersonChoice(rig, points, PointStart(rig, model, by_points)))
    if config.colors is None:
        return contour_engine(rig, model, config, backgrounds, workers, occluders, keypoints)
    if config.colors == TEXTURE:
        colors = _texture_engine(rig, model, config, workers)
    elif config.colors == COLOR_OVER_BACKGROUND:
        colors = _background_engine(rig, model, config, backgrounds, workers)
    else:
        colors = _color_engine(rig, model, config, workers)
    if not config.contours:
        return colors
    contours = contour_engine(rig, model, config, backgrounds, workers, occluders, keypoints)
    if config.is_joint and config.colors == TEXTURE:
        from .color.texture import TextureModality

        texture = colors.modalities[0]
        assert isinstance(texture, TextureModality)
        return LedEngine(colors, contours, texture)
    if JOINT in config.tags:
        from .color.modality import ColorModality

        modality = colors.modalities[0]
        assert isinstance(modality, ColorModality)
        return JointEngine(colors, contours, modality, model.chain, config.joint)
    return SequentialEngine(colors, contours)


def contour_engine(
    rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, backgrounds: Backgrounds, workers: Workers,
    occluders: Occluders | None = None, keypoints: KeypointTable = BLAZEPOSE,
) -> Engine:  # fmt: skip
    """The engine of regions, chamfer distances, or both.

    Parameters
    ----------
    rig, model, config, backgrounds : as for the `Tracker`.
    workers : threads that share cameras or poses.
    occluders : what stands before the body; None: nothing does.
    keypoints : what a detector's points are on the body.

    Returns
    -------
    An engine in information units.
    """
    chamfer = ChamferModality(rig, model, config, backgrounds, workers.map, occluders) if CHAMFER in config.modalities else None
    if REGION not in config.modalities:
        assert chamfer is not None
        judge = ChamferJudge(rig, config.chamfer, chamfer)
        return Engine([chamfer], ChamferFitting(model, config, chamfer), judge, True)
    region = RegionModality(rig, model, config, workers.map, occluders, backgrounds)
    points = KeypointModality(rig, model, config.keypoints, keypoints) if KEYPOINTS in config.modalities else None
    fitting = RegionFitting(model, config, region, None if chamfer is None else (chamfer, FINE), points)
    limbs = LimbJudge(model, config.status)
    area = RegionArea(rig, model, config, region, workers)
    modalities: list[Modality] = [region, *(each for each in (chamfer, points) if each is not None)]
    of_points = None if points is None else KeypointFitting(model, config, points)
    solver = Reacquisition(rig, model, config, limbs, fitting, area, of_points)
    choice = None
    if points is not None and of_points is not None:
        choice = PersonChoice(rig, points, PointStart(rig, model, of_points))
    return Engine(modalities, solver, RegionJudge(rig, model, config, fitting, limbs), True, choice)


def _color_engine(rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, workers: Workers) -> Engine:
    from ..objective.color.score import ColorObjective, ColorOptions
    from ..objective.points.photometry import PhotometryOptions
    from .color.judge import ColorJudge, ColorLimbs
    from .color.modality import ColorModality
    from .color.rigid import RigidScores, RigidSearch
    from .color.search import AlignmentSearch, ColorSearch, ColorSolver, MaskScores, ScoreSearch

    color = config.color
    what = color.representation, color.normalized_weight
    options = PhotometryOptions(*what, color.levels, robust_scale=color.robust_scale)
    search: ColorSearch
    if color.optimizer != "alignment":
        scores = MaskScores(ColorObjective(model, rig, ColorOptions(*what, gained=color.fit_gain), workers=workers))
        modality = ColorModality(rig, model, color, options, workers.map, scores, fit_gain=color.fit_gain)
        search = ScoreSearch(model, color, modality, scores.score)
    elif model.chain.n_axes == 0:
        rigid = RigidScores(model, rig, color, workers)
        modality = ColorModality(rig, model, color, options, workers.map, rigid, fit_gain=color.fit_gain)
        search = RigidSearch(model, rig, color, modality, rigid)
    else:
        modality = ColorModality(rig, model, color, options, workers.map, fit_gain=color.fit_gain)
        search = AlignmentSearch(model, color, modality)
    judge = ColorJudge(rig, model, color, modality, ColorLimbs(model))
    return Engine([modality], ColorSolver(model, color, modality, search), judge, False)


def _background_engine(
    rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, backgrounds: Backgrounds, workers: Workers
) -> Engine:
    from ..objective.points.photometry import PhotometryOptions
    from .color.modality import ColorModality
    from .color.over_background import BackgroundJudge, BackgroundScores, BackgroundSearch
    from .color.search import ColorSolver

    color, scores = config.color_over_background, BackgroundScores(rig, model, backgrounds, workers)
    options = PhotometryOptions(ColorConfig.representation, color.normalized_weight, 1, robust_scale=color.robust_scale)
    modality = ColorModality(rig, model, color, options, workers.map, scores)
    search = BackgroundSearch(model, color, modality, scores)
    judge = BackgroundJudge(rig, model, color, modality, scores)
    return Engine([modality], ColorSolver(model, color, modality, search), judge, False)


def _texture_engine(rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, workers: Workers) -> Engine:
    from .color.texture import TextureJudge, TextureModality, TextureSolver

    modality = TextureModality(rig, model, config.texture, workers)
    solver = TextureSolver(model, config.texture, modality)
    return Engine([modality], solver, TextureJudge(rig, config.texture, modality), False)
