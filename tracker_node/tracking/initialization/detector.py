"""Where a body is in images, without any hint: a start without a hand-set pose.

From coarse to fine, on images in which the body is some eighty pixels high: log-odds of body against scene for every pixel
(`evidence`); from these a visual hull, and in it the places where a body may stand (`objective.area.visual_hull`);
poses from a small library at these places, in all headings, by how much of the evidence they cover
(`objective.area.score`); the best are drawn to the silhouettes and get other limbs tried (`fit`,
`search`). What is left are a few starts for the engine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # imports its modules when they are first used

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...objective.area.score import AreaScore
from ...objective.area.visual_hull import occupancy, places, seen_volume
from ...observation.small_view import SmallView
from ...parallel import Workers
from ...render.shape_arrays import ShapeArrays
from ..config import InitializationConfig
from ..modality import Images
from ..poses import library_poses
from .evidence import StartCoverage, StartEvidence
from .parts import LimbAlternatives
from .search import HypothesisSearch, Poses, SilhouetteFit
from .segmentation import StartSegmentation

_VOXELS = 14  # along the body
_HEADINGS = 12
_PRIOR = 3e-4  # cost of a joint one sigma from neutral, as a fraction of all evidence
_RANDOM_POSES = 16
_PLACES = 3


@dataclass(frozen=True)
class _Effort:
    """How much a search tries.

    Parameters
    ----------
    hypotheses : share of all that are drawn to the silhouettes.
    kept : hypotheses of which variants are tried, one in so many, one number for each time.
    limb_samples : settings of a limb that are tried.
    drawn_variants : of each hypothesis, those that cover most: fits are dear.
    shakes : times that all that is left is shaken.
    rounds, iterations : of a fit.
    """

    hypotheses: float
    kept: tuple[int, ...]
    limb_samples: int
    drawn_variants: int
    shakes: int
    rounds: int
    iterations: int


_ONLY = _Effort(1.0, (4, 8, 8), 48, 99, 3, 3, 4)  # where the scene is known, nothing comes after it
_WIDE = _Effort(1.0, (4, 8, 8), 24, 2, 1, 2, 3)
_NARROW = _Effort(0.5, (8,), 24, 2, 0, 2, 3)
_ROUNDS = ((_NARROW, False), (_NARROW, False), (_WIDE, True), (_NARROW, True), (_NARROW, True), (_NARROW, True))
# of search and learning: how much is tried, and whether only what it finds goes on
_SURE = 0.45  # a start that covers so much of the evidence is not searched elsewhere


@dataclass(frozen=True, eq=False)
class Start:
    """A state that a body may be in; ``score`` is the share of all evidence for a body that it covers, 1 at best."""

    state: State
    score: float


class PoseDetector:
    """Finds starts; deterministic in the images that it has been shown since `reset`.

    Parameters
    ----------
    rig, model, config : cameras, body, parameters.
    backgrounds : camera name -> BGR image (or list of images) of the background, where there is one.
    workers : threads that share poses.

    Attributes
    ----------
    problem : why the last `find` has found nothing. watching : because it has not seen enough image sets yet.
    alternatives : other places for limbs, in the latest images.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: InitializationConfig,
        backgrounds: Mapping[str, np.ndarray | list],
        workers: Workers,
    ):
        self._model, self._config, self._workers = model, config, workers
        self.size_m = body_size(model)
        self._views = [SmallView(camera, scale) for camera, scale in zip(rig, _scales(rig, self.size_m, config), strict=True)]
        self._cameras = [view.camera for view in self._views]
        self._library = library_poses(model, _RANDOM_POSES, config.seed)
        self._middles = np.array([_middle(model, State(np.eye(4), joints)) for joints in self._library])
        small = {}
        for camera, view in zip(rig, self._views, strict=True):
            if camera.name in backgrounds:
                background = backgrounds[camera.name]
                small[camera.name] = [view.shrink(p) for p in (background if isinstance(background, list) else [background])]
        self._evidence = StartEvidence(self._cameras, small)
        self._segmentation = StartSegmentation(self._evidence, self._cameras, self.size_m)
        self.alternatives = LimbAlternatives(model, self._cameras, self._evidence, workers)
        self.problem = ""
        self.watching = False

    def reset(self) -> None:
        """Forget all images."""
        self._evidence.reset()

    def watch(self, images: Images) -> None:
        """Take in an image set in which nothing is searched (yet): what moves is separated from what does not."""
        self._evidence.watch([None if im is None else view.shrink(im) for im, view in zip(images, self._views, strict=True)])

    def find(self, images: Images, around: State | None = None) -> list[Start]:
        """Detect the body; where there is no start, ``problem`` says why.

        Parameters
        ----------
        images : BGR, of all cameras.
        around : where the body was last: that place, and poses like that one, are tried besides others.

        Returns
        -------
        Starts that differ in place or heading, the best first; empty where there are none.
        """
        self.watch(images)
        seen = [i for i, image in enumerate(images) if image is not None]
        self.watching = False
        needed = min(self._config.min_cameras, len(self._cameras))
        if len(seen) < needed:
            self.problem = f"{len(seen)} of {len(self._cameras)} cameras have an image, {needed} are needed to find a start"
            return []
        evidence = self._evidence
        if not evidence.scene_known and evidence.watched < self._config.watch_sets:
            self.watching = True
            self.problem = f"watching what moves ({evidence.watched} of {self._config.watch_sets} image sets)"
            return []
        evidence.forget_colors()
        middles = self._places(evidence.maps(), seen)
        if around is not None and len(middles):
            middles = np.concatenate([[_middle(self._model, around)], middles])
        if not len(middles):
            known = evidence.scene_known
            what = "differs from the backgrounds" if known else "moves; without backgrounds it has to"
            self.problem = f"nothing of the size of a body {what}"
            return []
        starts = self._looked_for(middles, around)
        good = [start for start in starts if start.score >= self._config.min_score]
        self.problem = "" if good else f"the best pose covers {100 * max(starts[0].score, 0.0):.0f} % of what stands out"
        return good

    def _looked_for(self, middles: np.ndarray, around: State | None) -> list[Start]:
        """Starts at or near ``middles`` (n, 3), the best first.

        Without background images, colors are learned where a body is likely, then where one has been found.
        """
        evidence = self._evidence
        if evidence.scene_known:
            return self._search(evidence.maps(), self._hypotheses(middles, around))
        found: list[Start] = []
        learned = evidence.colors, evidence.support
        for middle in middles[:2]:
            if found and found[0].score > _SURE:
                break
            self._segmentation.learn_about(middle)
            beginning, starts = self._hypotheses(self._heights(middle), around), []
            for effort, alone in _ROUNDS:
                starts = self._search(evidence.maps(), beginning, effort)
                self._segmentation.learn_from(Configuration(self._model, starts[0].state), middle)
                own = Poses.of([start.state for start in starts])
                beginning = own if alone else Poses.joined([own, beginning])
            if not found or starts[0].score > found[0].score:
                learned = evidence.colors, evidence.support
            found = sorted([*found, *starts], key=lambda start: -start.score)
        evidence.colors, evidence.support = learned
        return found[: self._config.candidates]

    def coverage(self) -> StartCoverage:
        """What states leave uncovered in the images of the latest `find`."""
        return StartCoverage(self._model, self._cameras, self._evidence.sure())

    def shares(self, states: Sequence[State]) -> np.ndarray:
        """(n,) how much of the evidence of the latest `find` each state covers."""
        poses, maps = Poses.of(list(states)), self._evidence.maps()
        total = sum(float(m[m > 0.0].sum()) for m in maps if m is not None)
        score = AreaScore(self._model, self._cameras, self._workers)
        score.set_maps(maps)
        return score.scores(poses.roots, poses.joints) / max(total, 1e-9)

    def _places(self, maps: Sequence[np.ndarray | None], seen: Sequence[int]) -> np.ndarray:
        cameras = [self._cameras[i] for i in seen]
        volume = seen_volume(cameras, self.size_m, self.size_m / _VOXELS)
        occupied = occupancy(volume, cameras, [maps[i] for i in seen], min(2 if self._evidence.scene_known else 3, len(seen)))
        return places(volume, occupied, self.size_m, _PLACES)

    def _hypotheses(self, middles: np.ndarray, around: State | None) -> Poses:
        turns = self._turns()
        n = len(middles) * len(turns) * len(self._library)
        roots = np.tile(np.eye(4), (n, 1, 1))
        places_of, turn_of, pose_of = np.unravel_index(np.arange(n), (len(middles), len(turns), len(self._library)))
        roots[:, :3, :3] = turns[turn_of]
        roots[:, :3, 3] = middles[places_of] - np.einsum("nij,nj->ni", turns[turn_of], self._middles[pose_of])
        poses = Poses(roots, self._library[pose_of])
        return poses if around is None else Poses.joined([Poses.of([around]), poses])

    def _turns(self) -> np.ndarray:
        """Orientations (n, 3, 3) of the root: a jointed body stands upright, anything else lies as it likes."""
        if self._model.chain.n_axes:
            angles = np.arange(_HEADINGS) * (2.0 * np.pi / _HEADINGS)
            return scipy.spatial.transform.Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]).as_matrix()
        turns = scipy.spatial.transform.Rotation.random(8 * _HEADINGS, rng=self._config.seed)
        return np.concatenate([np.eye(3)[None], turns.as_matrix()])

    def _heights(self, middle: np.ndarray) -> np.ndarray:
        """Feet move less than the rest, shadows on the floor with them: the middle may be higher or lower."""
        return middle + self.size_m * np.array([[0.0, 0.0, share] for share in (-0.06, 0.06, 0.18)])

    def _search(self, maps: Sequence[np.ndarray | None], poses: Poses, effort: _Effort = _ONLY) -> list[Start]:
        """From hypotheses to a few starts, the best first."""
        config, rng = self._config, np.random.default_rng(self._config.seed)
        total = max(sum(float(m[m > 0.0].sum()) for m in maps if m is not None), 1e-9)
        score = AreaScore(self._model, self._cameras, self._workers)
        score.set_maps(maps)
        search = HypothesisSearch(score, _PRIOR * total, self.size_m)
        fit = SilhouetteFit(self._model, self._cameras, maps)
        scores = search.scores(poses)

        def keep(n: int, apart_m: float, apart_rad: float) -> None:
            nonlocal poses, scores
            kept = search.best(poses, scores, n, apart_m * self.size_m, apart_rad)
            poses, scores = poses[kept], scores[kept]

        def drawn(some: Poses) -> Poses:
            return Poses.of(
                self._workers.map(lambda i: fit.fit(some.state(i), effort.rounds, effort.iterations), list(range(len(some))))
            )

        keep(round(effort.hypotheses * config.hypotheses), 0.15, 0.4)
        poses, scores = search.better(poses, scores, drawn(poses))
        for share in effort.kept:
            keep(max(config.hypotheses // share, config.candidates), 0.1, 0.4)
            variants = search.promising(search.varied(poses, effort.limb_samples, rng), len(poses), effort.drawn_variants)
            poses, scores = search.best_of(poses, scores, drawn(variants))
        poses, scores = search.shaken(poses, scores, effort.limb_samples, rng)
        poses, scores = search.better(poses, scores, drawn(poses))
        keep(2 * config.candidates, 0.1, 0.6)
        for _ in range(effort.shakes):
            poses, scores = search.shaken(poses, scores, 2 * effort.limb_samples, rng)
        keep(config.candidates, 0.1, 0.6)
        return [Start(poses.state(i), float(scores[i]) / total) for i in range(len(poses))]


def body_size(model: ArticulatedModel) -> float:
    """Length, meters, of the longest side of the box around the neutral body."""
    bounds = ShapeArrays.from_model(model).bounds
    Ts = Configuration(model, State.neutral(model)).Ts_world_shape
    middles = np.einsum("nij,nj->ni", Ts[:, :3, :3], bounds[:, :3]) + Ts[:, :3, 3]
    thin = np.minimum(bounds[:, 3], np.median(bounds[:, 3]))[:, None]
    return float(np.max((middles + thin).max(axis=0) - (middles - thin).min(axis=0)))


def _middle(model: ArticulatedModel, state: State) -> np.ndarray:
    """(3,) mean of the places of the shapes."""
    return Configuration(model, state).Ts_world_shape[:, :3, 3].mean(axis=0)


def _scales(rig: CameraRig, size_m: float, config: InitializationConfig) -> list[float]:
    """How much smaller images may be for a body in the middle to be ``config.size_px`` high."""
    volume = seen_volume(rig.cameras, size_m, size_m)
    middle = volume.points.mean(axis=0)
    scales = []
    for camera in rig:
        depth = max(float(np.linalg.norm(camera.center - middle)), size_m)
        scales.append(min(1.0, config.size_px * depth / (size_m * camera.model.K[1, 1])))
    return scales
