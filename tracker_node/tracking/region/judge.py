"""Assessment of fits to correspondence lines: limb by limb, by their outlines; with residuals and covariance.

What errors correspondence lines have: neighbors share theirs, and some are the same in all cameras.

Two kinds add up in the gradient of the fit: the spread of lines about the contour beyond what each says of itself, which
neighbors have in common; and a shift of all contours, in all images alike (light falls from one side). How large they are was
learned from synthetic clips that no figure is taken from, see `benchmark/trust/trust.py`.
"""

from __future__ import annotations

from dataclasses import replace
from statistics import median

import numpy as np

from ...camera.rig import CameraRig
from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ...model.configuration import State, configured
from ...model.humans.keypoints import is_person
from ...objective.contour_residual import assemble
from ...objective.keypoints.correspondences import KeypointCorrespondences
from ...objective.lines import correspondence as kernel
from ...objective.lines.camera import add_correlated
from ...objective.lines.correspondences import LineCorrespondences, PartEvidence
from ...observation.image_set import ImageSet
from ..assessment import Assessment, Report, assess_cameras, camera_reports
from ..config import RegionConfig, TrackerConfig
from ..engine import Judge
from ..estimate import Status
from ..keypoints.judge import lost_odds, shares_found
from ..limbs.judge import LimbJudge, body_status, is_noise
from ..uncertainty.covariance import ImageEvidence, fit_covariance
from ..uncertainty.modes import turn_sigma
from .fitting import LineFit, RegionFitting

_LEAST_OUTLINE = 10  # samples of the outline that a camera should see, to be asked
_UNSEEN = -1e6  # log-likelihood ratio of a body that no camera sees: worse than any that is seen
_CHANCE = 3.0  # log-likelihood ratio of a contour against none, a sample, that a body has wherever it is put
_LEAST_DOUBT_RAD = np.radians(2.0)  # of doubt in each set, of a thing of which little is found
_ASKED = 0.01  # probability of lost, beyond which it is asked whether a limb's colors are common
_DISTINCT = 1.35  # log-likelihood ratio that a pixel of a limb has on average, of 2 at most; in bars of its color 0.4 to 1.3
_CLOTHES_SIZE = 0.2  # by which people in clothes look larger, as a standard deviation
_BRIDGED_SETS = 15  # since several cameras or points have told the depth of the body, for which it counts as known
_FOUND_LESS = 0.5  # times what is usual of the cameras: one that finds less of the outline does not agree


class RegionJudge(Judge):
    """Assesses fits of one body.

    Parameters
    ----------
    rig, model, config : as for the `Tracker`.
    fitting : that has made the fits.

    Attributes
    ----------
    limbs : judges limb by limb.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, fitting: RegionFitting, limbs: LimbJudge):
        self._rig, self._model, self._fitting, self.limbs = rig, model, fitting, limbs
        self._inlier_px, self._may_be_clothed = config.region.inlier_px, is_person(model)
        self._errors = LineErrors(rig, model, config.region)
        self._known: tuple[LineFit, ImageEvidence, tuple[np.ndarray, np.ndarray], float] | None = None
        self._sets_by_size = _BRIDGED_SETS

    def reset(self) -> None:
        """Forget the evidence of limbs."""
        self.limbs.reset()
        self._known = None
        self._sets_by_size = _BRIDGED_SETS

    def restart(self) -> None:
        """Forget which limbs are lost."""
        self.limbs.restart()
        self._sets_by_size = _BRIDGED_SETS

    def assess(self, fit: LineFit, image_set: ImageSet) -> Assessment:
        """Limb by limb, then by cameras."""
        evidence = self._fitting.region.part_evidence(fit.correspondences, fit.state, self._inlier_px)
        if not evidence.expected.any():
            reason = "no camera sees the body where it is expected"
            return Assessment(Status.LOST, reason, noise=True, limbs=self.limbs.nothing_seen(), log_ratio=_UNSEEN)
        points = next(iter(self._fitting.points_at(fit.state)), None)
        by_points = None if points is None else self._by_points(points, fit.state)
        if self._may_be_clothed:
            by_size = by_points is None and len(fit.correspondences.seeing(fit.state)) == 1
            self._sets_by_size = self._sets_by_size + 1 if by_size else 0
        helped = self._fitting.region.has_silhouettes
        images, (covariance, _), depth_m = self._of(fit)
        about_one = covariance if images.modes is None else covariance - images.modes @ images.modes.T
        common = np.array([p > _ASKED and self._is_common(limb.shapes) for limb, p in self.limbs.by_probability])
        own = self._fitting.region.surfaces_are_own
        _, px_per_m = self._fitting.region.size(fit.state)
        told_joints = bool(image_set.joint_positions)
        reports = self.limbs.update(
            evidence, fit.state, about_one, by_points, helped, common, own, depth_m, px_per_m, told_joints
        )
        status, reason = body_status(reports)
        doubt, doubt_rad = self.limbs.doubt(evidence, fit.state, covariance), 0.0
        if len(reports) == 1 and (doubt or status is not Status.TRACKING):  # a camera without an image is no doubt
            doubt_rad = max(turn_sigma(self._model, fit.state, covariance), _LEAST_DOUBT_RAD)
        if status is Status.TRACKING:
            status, reason = self._status_of_cameras(evidence, image_set, fit.correspondences.active)
        if status is Status.TRACKING and doubt:
            status, reason = Status.DEGRADED, doubt
        return Assessment(
            status, reason, noise=is_noise(evidence) and by_points is None, jumped=fit.jumped, limbs=reports,
            dof_weights=self.limbs.dof_weights(reports), part_weights=self.limbs.part_weights(reports),
            log_ratio=_log_ratio(evidence), support=_support(evidence),
            shown=None if points is None else shares_found(points, fit.state, self._rig, image_set), doubt_rad=doubt_rad,
        )  # fmt: skip

    def _is_common(self, shapes: np.ndarray) -> bool:
        """Whether what surrounds the body has the colors of a limb."""
        return self._fitting.region.distinctness(shapes) < _DISTINCT

    def _depth_by_size(self, fit: LineFit) -> np.ndarray | None:
        """(n_dof, 1) tangent, a standard deviation, of the depth of a person whom one camera alone sees, by outlines alone.

        Such a camera tells depth by size, and clothes, of which outlines know nothing, look like a larger body. What points or
        other cameras have told is known for some image sets.
        """
        open_depth = self._may_be_clothed and self._sets_by_size >= _BRIDGED_SETS
        known = not open_depth or self._fitting.region.surfaces_are_own
        seeing = [] if known else fit.correspondences.seeing(fit.state)
        if len(seeing) != 1 or self._fitting.points_at(fit.state):
            return None
        tangent = np.zeros((self._model.n_dof, 1))
        tangent[:3, 0] = _CLOTHES_SIZE * (fit.state.T_world_root[:3, 3] - self._rig.cameras[seeing[0]].center)
        return tangent

    def _by_points(self, points: KeypointCorrespondences, state: State) -> np.ndarray:
        """Log odds of each limb being lost, by the points of a detector."""
        return lost_odds(points, state, self.limbs.limbs, self._fitting.region.size_px(state))

    def _status_of_cameras(self, evidence: PartEvidence, image_set: ImageSet, active: list[int]) -> tuple[Status, str]:
        expected, close = evidence.expected.sum(axis=1), evidence.close.sum(axis=1)
        shares = {self._rig.cameras[i].name: close[i] / expected[i] for i in active if expected[i] >= _LEAST_OUTLINE}
        usual = float(median(shares.values())) if shares else 0.0
        return assess_cameras(
            shares, _FOUND_LESS * usual, image_set.cameras, len(self._rig), "the body's outline is not found",
            "where the body is",
        )  # fmt: skip

    def _of(self, fit: LineFit) -> tuple[ImageEvidence, tuple[np.ndarray, np.ndarray], float]:
        """What the lines say of a fit, its `fit_covariance`, and the deviation of its depth where that is open, meters."""
        if self._known is None or self._known[0] is not fit:
            depth, modes = self._depth_by_size(fit), fit.modes
            if depth is not None:
                modes = depth if modes is None else np.hstack([modes, depth])
            images = replace(self._errors.evidence(fit.correspondences, fit.state, self._fitting.share), modes=modes)
            body = configured(self._model, fit.state)
            depth_m = 0.0 if depth is None else float(np.linalg.norm(depth))
            self._known = fit, images, fit_covariance(fit.equations.H, images, body), depth_m
        return self._known[1:]

    def report(self, fit: LineFit, image_set: ImageSet) -> Report:
        """Residuals of the lines, pixels, and the covariance."""
        lines = fit.correspondences.at(fit.state)
        stats = [lines.stats(i) for i in range(len(self._rig))]
        cameras = camera_reports(self._rig, image_set, [_rms(own) for own in stats], [own[kernel.COUNT] for own in stats])
        images, (covariance, second_order), _ = self._of(fit)
        return Report(cameras, _rms(np.sum(stats, axis=0)), covariance, images, second_order)


def _rms(stats: np.ndarray) -> float:
    return float(np.sqrt(stats[kernel.SQUARES] / max(stats[kernel.WEIGHT], 1e-12)))


def _log_ratio(evidence: PartEvidence) -> float:
    """Log-likelihood of the body's outline against chance; what hides behind the rest wins nothing."""
    return float((evidence.log_ratio - _CHANCE * evidence.expected).sum())


def _support(evidence: PartEvidence) -> np.ndarray:
    """(n_cameras,) log-likelihood ratio of a contour against none, a sample of the outline that a camera should see."""
    expected = evidence.expected.sum(axis=1)
    seen = expected >= _LEAST_OUTLINE
    return np.where(seen, evidence.log_ratio.sum(axis=1) / np.maximum(expected, 1.0), np.nan)


_TRACE = 1e-6
_LEAST_SHARE = 0.85  # of the least spread that weights go by; lines that seem to have less, of few cameras, agree by chance


class LineErrors:
    """Of one body in the cameras of a rig; its parameters are those of the region modality."""

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: RegionConfig):
        self._model, self._config, self._least_px = model, config, _LEAST_SHARE * config.least_sigma_px
        self._cameras = np.ones((len(rig), 3, 5))
        for own, camera in zip(self._cameras, rig, strict=True):
            own[:, :4], own[:2, 4] = camera.T_cam_world[:3], camera.model.params[:2]
        self._middles = np.zeros((len(model.chain.links), 3))  # of each link, in its own frame
        for link in range(len(self._middles)):
            own = model.Ts_link_shape[model.shape_links == link]
            if len(own):
                self._middles[link] = own[:, :3, 3].mean(axis=0)

    def evidence(self, lines: LineCorrespondences, state: State, share: float = 1.0) -> ImageEvidence:
        """What lines say of a state, with their errors.

        Parameters
        ----------
        lines : of one image set.
        state : of the body.
        share : what the lines count for in the fit.

        Returns
        -------
        Information, and its covariance.
        """
        chain, config, body = self._model.chain, self._config, configured(self._model, state)
        there = lines.at(state)
        equations, spread_px, sums = there.equations, there.spread_px, there.sums
        found = lines.variance if spread_px is None else max(spread_px, self._least_px) ** 2
        correlated = np.zeros((len(sums.normal), len(self._middles), 2))
        for i in lines.active:
            own = lines.cameras[i]
            assert own is not None
            add_correlated(
                own.lines, own.info, len(own.lines), lines.variance, found, config.line_correlation_px, correlated[i]
            )
        normal, spread, shifted = sums_of_errors(
            sums.normal, correlated, self._cameras, self._middles, body.Ts_world_link, chain.link_moved_by, body.twists
        )
        clothes, surfaces = np.zeros_like(normal), there.surfaces
        if surfaces is not None:  # they are unknown, and what is known of them has errors of its own
            M, P = surfaces.covariances, surfaces.priors
            of_all = np.einsum("lii->l", spread) / np.maximum(np.einsum("lii->l", normal), 1e-12)
            lost, clothes = surfaces.of_links(len(normal)), surfaces.of_links(len(normal), M @ P @ M)
            # The same factor for all cameras, else what is taken off is not what is there; a trace is left of what cancels
            spread = of_all[:, None, None] * ((1.0 + _TRACE) * normal - lost - clothes)
            normal -= lost
        errors = config.covariance_scale * spread + clothes
        scatter, unused = config.body_shift_px**2 * shifted @ shifted.T, np.zeros(chain.n_dof)
        assemble(errors, np.zeros((len(normal), 6)), chain.link_moved_by, body.twists, scatter, unused)
        alone = equations.g if share == 1.0 else None
        return ImageEvidence(share * equations.H, share**2 * scatter, share * normal, alone)


@compiled
def sums_of_errors(normal, correlated, cameras, middles, Ts_link, moved_by, twists):
    """What is needed of all cameras to say how far their lines are off.

    Parameters
    ----------
    normal : (n_cameras, n_links, 6, 6) of `LineSums`.
    correlated : (n_cameras, n_links, 2) of `add_correlated`: what lines add to the scatter, and to the information.
    cameras : (n_cameras, 3, 5), a row for each axis of the image and the one along the view: the axis in the world, the camera's
        own offset along it, and the focal length.
    middles, Ts_link : (n_links, 3) middles of the links in their own frames, and (n_links, 4, 4) where these are.
    moved_by, twists : of `assemble`.

    Returns
    -------
    (n_links, 6, 6) information, the same times what lines add to the scatter, and (n_dof, 2) gradients where all contours are
    shifted by a pixel along either axis of every image.
    """
    n_cameras, n_links = normal.shape[:2]
    information, scatter = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6, 6))
    shifted, shift = np.zeros((twists.shape[0], 2)), np.empty((6, 2))
    for link in range(n_links):
        T, middle = Ts_link[link], middles[link]
        shift[:] = 0.0
        for i in range(n_cameras):
            own, camera = normal[i, link], cameras[i]
            factor = correlated[i, link, 0] / max(correlated[i, link, 1], 1e-12)
            depth = camera[2, 3]
            for a in range(3):
                depth += camera[2, a] * (T[a, 0] * middle[0] + T[a, 1] * middle[1] + T[a, 2] * middle[2] + T[a, 3])
            for a in range(6):
                for b in range(6):
                    information[link, a, b] += own[a, b]
                    scatter[link, a, b] += factor * own[a, b]
                for k in range(2):
                    along = own[a, 0] * camera[k, 0] + own[a, 1] * camera[k, 1] + own[a, 2] * camera[k, 2]
                    shift[a, k] += depth / camera[k, 4] * along
        for dof in range(twists.shape[0]):
            if moved_by[link, dof]:
                for a in range(6):
                    for k in range(2):
                        shifted[dof, k] += shift[a, k] * twists[dof, a]
    return information, scatter, shifted
