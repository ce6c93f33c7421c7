"""What errors correspondence lines have: neighbors share theirs, and some are the same in all cameras.

Two kinds add up in the gradient of the fit: the spread of lines about the contour beyond what each says of itself, which
neighbors have in common; and a shift of all contours, in all images alike (light falls from one side). How large they are was
learned from synthetic clips that no figure is taken from, see `benchmark/trust/trust.py`.
"""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...objective.contour_residual import assemble
from ...objective.lines.correspondences import LineCorrespondences
from ...objective.lines.spacing import add_crowding
from ..config import RegionConfig
from ..uncertainty.covariance import ImageEvidence

_TRACE = 1e-6
_LEAST_SHARE = 0.85  # of the least spread that weights go by; lines that seem to have less, of few cameras, agree by chance


class LineErrors:
    """Of one body in the cameras of a rig; its parameters are those of the region modality."""

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: RegionConfig):
        self._model, self._config, self._least_px = model, config, _LEAST_SHARE * config.least_sigma_px
        self._axes = np.array([camera.T_cam_world[:3, :3] for camera in rig])
        self._offsets = np.array([camera.T_cam_world[:3, 3] for camera in rig])
        self._focals = np.array([camera.model.params[:2] for camera in rig])
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
        chain, config, body = self._model.chain, self._config, Configuration(self._model, state)
        equations = lines.linearize(state)
        information = equations.H
        cameras, spread_px = lines.camera_equations(state), lines.at(state).spread_px
        found = lines.variance if spread_px is None else max(spread_px, self._least_px) ** 2
        n_links, surfaces = len(chain.links), lines.at(state).surfaces
        normal, spread, shifts = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6, 6)), np.zeros((n_links, 6, 2))
        for i, camera in enumerate(cameras):
            if camera is None:
                continue
            normal += camera.normal
            spread += self._crowding(lines, i, found)[:, None, None] * camera.normal
            shifts += camera.normal @ self._shift(i, body)
        clothes = np.zeros_like(normal)
        if surfaces is not None:  # they are unknown, and what is known of them has errors of its own
            M, P = surfaces.covariances, surfaces.priors
            of_all = np.einsum("lii->l", spread) / np.maximum(np.einsum("lii->l", normal), 1e-12)
            lost, clothes = surfaces.of_links(n_links), surfaces.of_links(n_links, M @ P @ M)
            # The same factor for all cameras, else what is taken off is not what is there; a trace is left of what cancels
            spread = of_all[:, None, None] * ((1.0 + _TRACE) * normal - lost - clothes)
            normal -= lost
        scatter, unused = np.empty_like(information), np.empty(chain.n_dof)
        errors = config.covariance_scale * spread + clothes
        assemble(errors, np.zeros((n_links, 6)), chain.link_moved_by, body.twists, scatter, unused)
        moved = (chain.link_moved_by.T @ shifts.reshape(n_links, -1)).reshape(-1, 6, 2)
        whole = (moved * body.twists[:, :, None]).sum(axis=1)
        scatter += config.body_shift_px**2 * whole @ whole.T
        alone = equations.g if share == 1.0 else None
        return ImageEvidence(share * information, share**2 * scatter, share * normal, alone)

    def _crowding(self, lines: LineCorrespondences, i: int, found: float) -> np.ndarray:
        """(n_links,): what the lines of camera ``i`` add to the scatter, in what they add to the information."""
        own, sums = lines.cameras[i], np.zeros((len(self._middles), 2))
        assert own is not None
        add_crowding(own.lines, own.info, len(own.lines), lines.variance, found, self._config.line_correlation_px, sums)
        return sums[:, 0] / np.maximum(sums[:, 1], 1e-12)

    def _shift(self, i: int, body: Configuration) -> np.ndarray:
        """(n_links, 6, 2) spatial twists that shift a link by a pixel along the axes of image ``i``."""
        T = body.Ts_world_link
        middles = np.einsum("lij,lj->li", T[:, :3, :3], self._middles) + T[:, :3, 3]
        depths = middles @ self._axes[i, 2] + self._offsets[i, 2]
        twists = np.zeros((len(middles), 6, 2))
        twists[:, :3] = (depths[:, None] / self._focals[i])[:, None, :] * self._axes[i, :2].T
        return twists
