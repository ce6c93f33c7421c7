"""Other places for one limb of a start: where the rest of the body says that its colors are.

Every part has its own density of colors, learned from the small images where the rest of the body has been found. Where the
images agree with what the model states, that is used for all parts; where not, left and right are taken to be alike. Nothing is
learned from a limb in doubt. Thousands of its poses are scored over these; the result are the best that differ, and the limb at
rest, for parts of unknown color.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ...camera.rig import Camera
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.area.score import AreaScore
from ...observation.region.colors import stated_densities
from ...optimize.robust_start import best_apart
from ...parallel import Workers
from ...render.raycast.raycaster import render_view
from ..limbs.tree import Limb
from ..poses import Poses, other_side, reachable
from .evidence import StartEvidence, color_density, scene_density

_SAMPLES = 800
_REFINED = 25  # about each of the best
_SHAKE_RAD = 0.3
_LOOKED_AT = 120  # of the best, that others are chosen from
_APART = 0.2  # of a limb's length: tips of limbs that are elsewhere
_RING_PX = 14
_BODY_COUNT = 30.0  # pixels of the whole body that each class has besides its own
_BORNE_OUT = 0.7  # fraction of the body's pixels that have the colors that the model states, for all of these to be used


class LimbAlternatives:
    """Finds them in the latest images of ``evidence``, with ``cameras`` of their size; deterministic.

    Parameters
    ----------
    workers : threads that share poses.
    """

    def __init__(self, model: ArticulatedModel, cameras: Sequence[Camera], evidence: StartEvidence, workers: Workers):
        self._model, self._cameras, self._evidence = model, tuple(cameras), evidence
        self._score = AreaScore(model, cameras, workers)
        shapes = np.arange(len(model.shapes), dtype=np.int32)
        self._stated = stated_densities(model, shapes).astype(np.float64)
        self._partners = other_side([shape.name for shape in model.shapes])
        self._low, self._high = reachable(model.chain)
        self._neutral = np.array([axis.neutral for axis in model.chain.axes])

    def find(self, state: State, limb: Limb, doubtful: np.ndarray, n: int) -> list[State]:
        """States with a limb at rest and in other places.

        Parameters
        ----------
        state, limb : of the body, and that which is placed.
        doubtful : (n_shapes,) mask; no colors are learned from these shapes, and none from the limb.
        n : other places at most.

        Returns
        -------
        The one at rest, and the others, the best of these first.
        """
        self._score.set_maps(self._maps(state, doubtful | limb.shapes), np.arange(len(self._model.shapes)))
        rng, own = np.random.default_rng(0), np.flatnonzero(limb.dofs[N_ROOT_DOF:])
        unit = rng.random((_SAMPLES, len(own)))
        joints = np.repeat(state.joint_positions[None], _SAMPLES, axis=0)
        joints[:, own] = self._low[own] + unit * (self._high - self._low)[own]
        joints = joints[self._apart(state, limb, joints, 4 * n)]
        size = _SHAKE_RAD
        for _ in range(3):
            shaken = np.repeat(joints[:, None], _REFINED, axis=1)
            moved = shaken[:, 1:, own] + size * rng.standard_normal((len(joints), _REFINED - 1, len(own)))
            shaken[:, 1:, own] = np.clip(moved, self._low[own], self._high[own])
            scores = self._scores(state, shaken.reshape(-1, joints.shape[1])).reshape(shaken.shape[:2])
            joints = shaken[np.arange(len(joints)), np.argmax(scores, axis=1)]
            size *= 0.5
        at_rest = state.joint_positions.copy()
        at_rest[own] = self._neutral[own]
        found = [at_rest, *(joints[i] for i in self._apart(state, limb, joints, n))]
        return [State(state.T_world_root, angles) for angles in found]

    def _scores(self, state: State, joints: np.ndarray) -> np.ndarray:
        poses = Poses(np.repeat(state.T_world_root[None], len(joints), axis=0), joints)
        return self._score.scores(poses.roots, poses.joints)

    def _apart(self, state: State, limb: Limb, joints: np.ndarray, n: int) -> list[int]:
        """Indices of the best ``n`` of ``joints`` (m, n_axes) whose tips are apart from each other and from that of ``state``."""
        tips, apart = {-1: self._tip(state, limb)}, _APART * self._length(state, limb)

        def same(i: int, chosen: list[int]) -> bool:
            tips[i] = self._tip(State(state.T_world_root, joints[i]), limb)
            return not all(np.linalg.norm(tips[i] - tips[other]) > apart for other in (-1, *chosen))

        return best_apart(np.argsort(-self._scores(state, joints), kind="stable")[:_LOOKED_AT], same, n)

    def _tip(self, state: State, limb: Limb) -> np.ndarray:
        T = Configuration(self._model, state).Ts_world_link[limb.end]
        return T[:3, :3] @ limb.tip + T[:3, 3]

    def _length(self, state: State, limb: Limb) -> float:
        """Meters from the origin of its first link to its tip."""
        first = Configuration(self._model, state).Ts_world_link[np.flatnonzero(limb.links)[0], :3, 3]
        return float(np.linalg.norm(self._tip(state, limb) - first))

    def _maps(self, state: State, doubtful: np.ndarray) -> list[np.ndarray | None]:
        """Log-odds (n_shapes, h, w) of every part, learned where ``state`` has the body."""
        body = Configuration(self._model, state)
        scenes: list[np.ndarray | None] = []
        counts = np.zeros(self._stated.shape)
        for camera, image in zip(self._cameras, self._evidence.images, strict=True):
            if image is None:
                scenes.append(None)
                continue
            labels = render_view(body, camera).labels
            covered = (labels > 0).astype(np.uint8)
            wide = cv2.dilate(covered, np.ones((2 * _RING_PX + 1, 2 * _RING_PX + 1), np.uint8))
            scenes.append(scene_density(image, wide - cv2.dilate(covered, np.ones((5, 5), np.uint8))))
            for shape in np.flatnonzero(~doubtful):
                own = labels == shape + 1
                counts[shape] += own.sum() * color_density(image, own)
        return self._evidence.maps_of_parts(self._densities(counts), scenes)

    def _densities(self, counts: np.ndarray) -> np.ndarray:
        """(n_shapes, bins) from counted pixels of that shape; few are helped out by those of the whole body."""
        stated = self._stated.any(axis=1)
        as_stated = (counts * (self._stated > 1.0 / counts.shape[1]))[stated].sum()
        borne_out = as_stated > _BORNE_OUT * max(float(counts[stated].sum()), 1.0)
        if not borne_out:
            counts = 0.5 * (counts + counts[self._partners])
        totals = counts.sum(axis=1)
        whole = counts.sum(axis=0) / max(float(totals.sum()), 1.0)
        result = (counts + _BODY_COUNT * whole) / (totals + _BODY_COUNT)[:, None]
        return np.where((stated & borne_out)[:, None], 0.5 * (result + self._stated), result)
