"""Compiled code is made, or loaded, before the first image comes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..camera.rig import Camera, CameraRig, axes_equations
from ..compiled.ahead import Progress, compile_ahead, show_progress
from ..geometry import se3
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..model.humans.keypoints import BLAZEPOSE, KeypointTable
from ..observation.image_set import CameraImage, ImageSet
from ..observation.keypoints.people import People, Person, Silhouette
from ..render.raycast.raycaster import render_view
from .config import KEYPOINTS, REGION, InitializationConfig, TrackerConfig
from .tracker import Tracker

_WIDTH_PX = 160
_SCENE_BGR = (90, 110, 100)
_SETS = 3  # the first image set of a body, one with a prediction, and one after whose neighbors cameras are compared


def warm_up(
    rig: CameraRig,
    model: ArticulatedModel,
    config: TrackerConfig,
    state: State | None = None,
    occluders: ArticulatedModel | None = None,
    keypoints: KeypointTable | None = None,
    progress: Progress = show_progress,
) -> None:
    """Track a drawn body in small images with a tracker of this kind, and forget it.

    What the tracker does later is the same with and without: only its code is in memory. How much is fitted and searched is
    cut down, since only that it is counts.

    Parameters
    ----------
    rig, model, config : cameras, body and parameters of the tracker.
    state : where the body is; None: it is searched, too.
    occluders : what may stand before the body.
    keypoints : as for the `Tracker`.
    progress : told of what is compiled.

    Raises
    ------
    TrackerError : the configuration does not suit the body.
    """
    if REGION in config.modalities:
        compile_ahead(progress)
    small = _small_rig(rig)
    configuration = Configuration(model, state or _in_the_middle(rig, model))
    brief = _brief(config)
    table = keypoints or BLAZEPOSE if KEYPOINTS in config.modalities else {}
    _track(Tracker(small, model, brief, _backgrounds(small), configuration.state, occluders, keypoints), configuration, table)
    if state is None and config.initialization.enabled:
        searching = replace(brief, initialization=_brief_search(config.initialization))
        _track(Tracker(small, model, searching, _backgrounds(small), None, occluders, keypoints), configuration)


class SmallTrackers:
    """Says, by making it for small images, whether a tracker can be made; that takes a twentieth of the time.

    Parameters
    ----------
    rig, model : of the trackers.
    with_background : names of cameras with an image of the empty scene.
    keypoints : as for the `Tracker`.
    """

    def __init__(
        self, rig: CameraRig, model: ArticulatedModel, with_background: Sequence[str], keypoints: KeypointTable | None = None
    ):
        self._rig, self._model, self._keypoints = _small_rig(rig), model, keypoints
        backgrounds = _backgrounds(self._rig)
        self._backgrounds = {name: backgrounds[name] for name in with_background}

    def check(self, cameras: Sequence[str], config: TrackerConfig) -> None:
        """Make a tracker for some cameras, and forget it.

        Parameters
        ----------
        cameras, config : names, and parameters.

        Raises
        ------
        TrackerError : the configuration does not suit the body.
        """
        backgrounds = {name: image for name, image in self._backgrounds.items() if name in cameras}
        without_search = replace(config, initialization=replace(config.initialization, enabled=False))
        Tracker(self._rig.subset(tuple(cameras)), self._model, without_search, backgrounds, keypoints=self._keypoints)


def _track(tracker: Tracker, configuration: Configuration, table: KeypointTable | None = None) -> None:
    """With a detector's points from the second image set on, where there is a table of them."""
    drawn = {camera.name: _drawn(configuration, camera) for camera in tracker.rig}
    people = {camera.name: _people(configuration, camera, table) if table else None for camera in tracker.rig}
    for i in range(_SETS):
        stamp_ns = round(i * 1e9 * tracker.config.synchronizer.image_period_s)
        images = (CameraImage(name, stamp_ns, own, people=people[name] if i > 0 else None) for name, own in drawn.items())
        tracker.step(ImageSet(stamp_ns, tuple(images)))


def _brief(config: TrackerConfig) -> TrackerConfig:
    region = replace(config.region, first_scales="1", wide_scales="1", scales="1", samples_per_line=2)
    limb_search = replace(config.limb_search, poses=min(config.limb_search.poses, 1))
    color = replace(config.color, first_passes=1, levels=min(config.color.levels, 2), search_states=0)
    over = replace(config.color_over_background, search_states=0)
    return replace(
        config, region=region, limb_search=limb_search, color=color, texture=replace(config.texture, search_states=0),
        color_over_background=over, initialization=replace(config.initialization, enabled=False),
    )  # fmt: skip


def _brief_search(start: InitializationConfig) -> InitializationConfig:
    return replace(
        start, size_px=32, hypotheses=4, candidates=1, repaired_candidates=0, tracked_candidates=1, tracked_sets=1,
        interval_sets=0, min_score=0.0,
    )  # fmt: skip


def _small_rig(rig: CameraRig) -> CameraRig:
    cameras = []
    for camera in rig:
        height = max(1, round(camera.model.height * _WIDTH_PX / camera.model.width))
        cameras.append(replace(camera, model=camera.model.resized(_WIDTH_PX, height), background=None))
    return replace(rig, cameras=tuple(cameras))


def _backgrounds(rig: CameraRig) -> dict[str, np.ndarray]:
    sizes = {camera.name: (camera.model.height, camera.model.width, 3) for camera in rig}
    return {name: np.full(size, _SCENE_BGR, np.uint8) for name, size in sizes.items()}


def _drawn(configuration: Configuration, camera) -> np.ndarray:
    """(h, w, 3) BGR: the parts in their colors before a plain wall."""
    colors = np.array([_SCENE_BGR, *(shape.color_rgb[::-1] for shape in configuration.model.shapes)], np.uint8)
    return colors[render_view(configuration, camera).labels]


def _people(configuration: Configuration, camera: Camera, table: KeypointTable) -> People:
    """The body as a detector sees it that finds all that one can."""
    model = configuration.model
    names = tuple(name for name, point in table.items() if point.landmark in model.landmark_names)
    places = configuration.landmarks_world[[model.landmark_index(table[name].landmark) for name in names]]
    pixels, n = camera.project(places)[0], len(names)
    covariances, skeleton = np.tile(np.eye(2), (n, 1, 1)), (places - camera.center) @ camera.T_world_cam[:3, :3]
    (left, top), (right, bottom) = pixels.min(axis=0).tolist(), pixels.max(axis=0).tolist()
    shown = Silhouette(np.where(render_view(configuration, camera).labels > 0, 255, 0).astype(np.uint8), (0, 0))
    return (Person(names, pixels, covariances, np.ones(n), 1.0, (left, top, right, bottom), shown, skeleton),)


def _in_the_middle(rig: CameraRig, model: ArticulatedModel) -> State:
    """The neutral body where the optical axes come nearest to each other."""
    A, b = axes_equations(rig)
    middle, state = np.linalg.solve(A + 1e-6 * np.eye(3), b), State.neutral(model)
    return State(se3.from_rotation_translation(state.T_world_root[:3, :3], middle), state.joint_positions)
