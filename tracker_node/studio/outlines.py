"""A posed body as lines over an image: the outlines of its parts, and the points that it can be taken by."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ..camera.rig import Camera, CameraRig
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..render.overlay import part_colors
from ..render.raycast.raycaster import render_labels

WORKING_HEIGHT_PX = 1000  # outlines and scores are made in images of about this height, at most


def working_rig(rig: CameraRig) -> tuple[CameraRig, int]:
    """The rig on images smaller by a whole factor, and that factor: 1 for images that are small already."""
    tallest = max(max(camera.model.height, camera.model.width) for camera in rig)
    factor = max(1, round(tallest / WORKING_HEIGHT_PX))
    small = (replace(c, model=c.model.resized(c.model.width // factor, c.model.height // factor)) for c in rig)
    return CameraRig(tuple(small), rig.world_frame, rig.lights), factor


@dataclass(frozen=True, eq=False)
class Handles:
    """Points by which a body is taken with the mouse: its landmarks, and the origins of links that have none there.

    Attributes
    ----------
    names : of the landmarks and links.
    links : (n,) index of the link that each is fixed to.
    points : (n, 3) meters, in the link.
    bones : pairs of handles between which a line is drawn.
    """

    names: tuple[str, ...]
    links: np.ndarray
    points: np.ndarray
    bones: tuple[tuple[int, int], ...]

    def world(self, body: Configuration) -> np.ndarray:
        """(n, 3) meters."""
        T = body.Ts_world_link[self.links]
        return np.einsum("nij,nj->ni", T[:, :3, :3], self.points) + T[:, :3, 3]


_SAME_PLACE_M = 0.01
_STRAIGHT_PX = 0.7  # by how much a line may leave out corners of the pixels' border


def handles_of(model: ArticulatedModel) -> Handles:
    """The handles of a body."""
    body = Configuration(model, State.neutral(model))
    names, links, points = list(model.landmark_names), list(model.landmark_links), list(model.landmark_positions)
    at = [*body.landmarks_world]
    origin_of: dict[int, int] = {}
    for link, name in enumerate(model.chain.links):
        origin = body.Ts_world_link[link, :3, 3]
        near = [i for i, point in enumerate(at) if np.linalg.norm(point - origin) < _SAME_PLACE_M]
        if not near:
            near = [len(names)]
            names.append(name)
            links.append(link)
            points.append(np.zeros(3))
            at.append(origin)
        origin_of[link] = near[0]
    bones = [(origin_of[int(p)], origin_of[i]) for i, p in enumerate(model.chain.parents) if p >= 0]
    bones += [(origin_of[int(link)], i) for i, link in enumerate(model.landmark_links)]
    used = tuple(dict.fromkeys((a, b) for a, b in bones if a != b))
    return Handles(tuple(names), np.array(links, dtype=np.int64), np.array(points).reshape(-1, 3), used)


class OutlineDrawer:
    """Outlines of one body in the cameras of one rig, in pixels of its full images."""

    def __init__(self, rig: CameraRig, model: ArticulatedModel):
        self.handles = handles_of(model)
        self._rig, self._model = rig, model
        self._small, self._factor = working_rig(rig)

    def colors(self) -> list[str]:
        """Of the parts, as CSS writes them."""
        return [f"rgb({r} {g} {b})" for b, g, r in part_colors(self._model)[1:].tolist()]

    def drawn(self, state: State) -> dict[str, Any]:
        """By camera: ``parts``, pairs of a part's index and a closed line [u, v, u, v, ...]; ``handles``, [u, v] or None."""
        body = Configuration(self._model, state)
        places = self.handles.world(body)
        return {
            camera.name: {"parts": self._parts(body, small), "handles": _pixels(camera, places)}
            for camera, small in zip(self._rig, self._small, strict=True)
        }

    def _parts(self, body: Configuration, camera: Camera) -> list[tuple[int, list[float]]]:
        found = render_labels(body, camera, 1)
        if found is None:
            return []
        (u0, v0, _, _), labels = found
        lines: list[tuple[int, list[float]]] = []
        for label in np.flatnonzero(np.bincount(labels.ravel(), minlength=1)[1:]) + 1:
            mask = (labels == label).view(np.uint8)
            for contour in cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0]:
                contour = cv2.approxPolyDP(contour, _STRAIGHT_PX, True)
                pixels = (contour[:, 0] + (u0 + 0.5, v0 + 0.5)) * self._factor - 0.5
                lines.append((int(label) - 1, np.round(pixels, 1).ravel().tolist()))
        return lines


def _pixels(camera: Camera, points: np.ndarray) -> list[list[float] | None]:
    pixels, valid = camera.project(points)
    return [np.round(pixel, 2).tolist() if ok else None for pixel, ok in zip(pixels, valid, strict=True)]
