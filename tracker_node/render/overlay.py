"""The fitted body drawn over its image (tinted parts, outlines, bones, landmarks), and the image through the body's mask.

Parts of the left side are blue, those of the right side orange, others green: mirrored limbs, the mistake most worth seeing,
show at a glance.
"""

from __future__ import annotations

from colorsys import rgb_to_hsv

import cv2
import numpy as np

from ..camera.rig import Camera
from ..geometry import se3
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration
from .palette import GREEN, SIDES, rgb
from .raycast.raycaster import render_labels, render_mask, render_view

_HUES = {side: 180.0 * rgb_to_hsv(*rgb(color))[0] for side, color in {**SIDES, "": GREEN}.items()}  # of OpenCV: half degrees
_DARK, _WHITE = (25, 25, 25), (255, 255, 255)
_SHIFT = 4  # sub-pixel bits of OpenCV's drawing
_STRAIGHT_PX = 0.7  # by how much a line may leave out corners of the pixels' border


def draw_overlay(
    bgr: np.ndarray, configuration: Configuration, camera: Camera, alpha: float = 0.4, outline: bool = True, skeleton: bool = True
) -> np.ndarray:
    """A copy of an image with the body drawn over it.

    Parameters
    ----------
    bgr : (height, width, 3) uint8, as large as the camera's images.
    configuration : the posed body.
    camera : that took the image.
    alpha : how strongly the parts are tinted, 0 (not at all) to 1 (opaque).
    outline : draw the outline of the body, and thinner ones of its parts.
    skeleton : draw landmarks, and bones between the joints.

    Returns
    -------
    (height, width, 3) uint8 BGR.

    Raises
    ------
    ValueError : an image that is not as large as the camera's.
    """
    _check_image(bgr, camera)
    drawn = np.ascontiguousarray(bgr).copy()
    width = _line_width(configuration, camera)
    labels = render_view(configuration, camera).labels
    rows, columns = np.flatnonzero(labels.any(axis=1)), np.flatnonzero(labels.any(axis=0))
    if len(rows):
        margin = width + 3
        v0, v1 = max(0, rows[0] - margin), rows[-1] + 1 + margin
        u0, u1 = max(0, columns[0] - margin), columns[-1] + 1 + margin
        crop, parts = drawn[v0:v1, u0:u1], np.ascontiguousarray(labels[v0:v1, u0:u1])
        cv2.copyTo(_tinted(crop, parts, part_colors(configuration.model), alpha, width if outline else 0), parts, crop)
        if outline:
            _draw_outline(crop, parts, width)
    if skeleton:
        _draw_skeleton(drawn, configuration, camera, width)
    return drawn


def part_colors(model: ArticulatedModel) -> np.ndarray:
    """(n_shapes + 1, 3) uint8 BGR by label: a hue for each side, changing in lightness from part to part."""
    hsv = np.zeros((len(model.shapes) + 1, 1, 3), dtype=np.uint8)
    seen: dict[str, int] = {}
    for label, shape in enumerate(model.shapes, start=1):
        side = next((s for s in ("left", "right") if shape.link.startswith(s) or shape.name.startswith(s)), "")
        count = seen[side] = seen.get(side, -1) + 1
        spread = 10.0 if side else 16.0
        hsv[label, 0] = (_HUES[side] + spread * ((count * 0.618) % 1.0 - 0.5), 255 - 70 * (count % 2), 255 - 45 * (count % 3))
    return cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)[:, 0]


def part_outlines(configuration: Configuration, camera: Camera) -> list[tuple[int, np.ndarray]]:
    """Closed lines around what is seen of each part.

    Parameters
    ----------
    configuration : the posed body.
    camera : that sees it.

    Returns
    -------
    lines : number of the shape, and (n, 2) px; a part has one for each region of it that is seen.
    """
    found = render_labels(configuration, camera, 1)
    if found is None:
        return []
    (u0, v0, _, _), labels = found
    lines: list[tuple[int, np.ndarray]] = []
    for label in np.flatnonzero(np.bincount(labels.ravel(), minlength=1)[1:]) + 1:
        mask = (labels == label).view(np.uint8)
        for contour in cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0]:
            contour = cv2.approxPolyDP(contour, _STRAIGHT_PX, True)
            lines.append((int(label) - 1, contour[:, 0] + (float(u0), float(v0))))
    return lines


def _line_width(configuration: Configuration, camera: Camera) -> int:
    """Pixels; follows the size of the image and is no coarser than the body."""
    landmarks = configuration.landmarks_world if configuration.model.landmarks else configuration.Ts_world_link[:, :3, 3]
    pixels, valid = camera.project(landmarks)
    by_image = max(1, round(min(camera.model.width, camera.model.height) / 400))
    if valid.sum() < 2:
        return by_image
    extent = float(np.ptp(pixels[valid], axis=0).max())
    return max(1, min(by_image, round(extent / 130)))


def _tinted(crop: np.ndarray, parts: np.ndarray, colors: np.ndarray, alpha: float, seam_width: int) -> np.ndarray:
    """The crop with its parts tinted, and light seams between them unless ``seam_width`` is 0."""
    tint = colors[parts]
    tinted = cv2.addWeighted(crop, 1.0 - alpha, tint, alpha, 0.0)
    if seam_width:
        differs = np.zeros(parts.shape, dtype=bool)
        differs[1:] |= (parts[1:] != parts[:-1]) & (parts[1:] > 0) & (parts[:-1] > 0)
        differs[:, 1:] |= (parts[:, 1:] != parts[:, :-1]) & (parts[:, 1:] > 0) & (parts[:, :-1] > 0)
        seams = cv2.dilate(differs.view(np.uint8), np.ones((max(1, seam_width - 1),) * 2, dtype=np.uint8)) > 0
        tinted[seams] = (0.5 * tint[seams] + 127.0).astype(np.uint8)
    return tinted


def _draw_outline(crop: np.ndarray, parts: np.ndarray, width: int) -> None:
    """A white line with a dark rim around the body; outside of it, so that thin limbs are not hidden."""
    distance = cv2.distanceTransform((parts == 0).view(np.uint8), cv2.DIST_L2, 5)
    ring = (distance > 0) & (distance < width + 3.0)
    away, colors = distance[ring][:, None], crop[ring].astype(np.float32)
    for color, reach in ((_DARK, width + 1.5), (_WHITE, width + 0.3)):
        opacity = np.clip(reach + 1.0 - away, 0.0, 1.0)  # a neighbor's center is half a pixel beyond the border
        colors += opacity * (np.array(color, dtype=np.float32) - colors)
    crop[ring] = colors.astype(np.uint8)


def _draw_skeleton(drawn: np.ndarray, configuration: Configuration, camera: Camera, width: int) -> None:
    model = configuration.model
    origins = configuration.Ts_world_link[:, :3, 3]
    joints, joint_valid = camera.project(origins)
    for link, parent in enumerate(model.chain.parents):
        if parent >= 0 and joint_valid[link] and joint_valid[parent]:
            ends = _fixed(joints[parent]), _fixed(joints[link])
            if width > 1:
                cv2.line(drawn, *ends, _DARK, width + 2, cv2.LINE_AA, _SHIFT)
            cv2.line(drawn, *ends, (0, 255, 255), width, cv2.LINE_AA, _SHIFT)
    if not model.landmarks and len(origins) == 1 and joint_valid[0]:
        _draw_axes(drawn, configuration.Ts_world_link[0], camera, width)
    points, valid = camera.project(configuration.landmarks_world) if model.landmarks else (joints, joint_valid)
    for point in points[valid]:
        radius = round((0.6 + 1.3 * width) * (1 << _SHIFT))
        cv2.circle(drawn, _fixed(point), radius + (12 << _SHIFT) // 16, _DARK, -1, cv2.LINE_AA, _SHIFT)
        cv2.circle(drawn, _fixed(point), radius, _WHITE, -1, cv2.LINE_AA, _SHIFT)


def _draw_axes(drawn: np.ndarray, T_world_link: np.ndarray, camera: Camera, width: int) -> None:
    """The frame of a rigid object, 10 cm long: x red, y green, z blue."""
    ends, valid = camera.project(se3.apply(T_world_link, np.vstack([np.zeros(3), 0.1 * np.eye(3)])))
    for axis, color in enumerate(((0, 0, 255), (0, 200, 0), (255, 80, 0)), start=1):
        if valid[0] and valid[axis]:
            cv2.line(drawn, _fixed(ends[0]), _fixed(ends[axis]), color, width + 1, cv2.LINE_AA, _SHIFT)


def _fixed(pixel: np.ndarray) -> tuple[int, int]:
    scaled = np.clip(np.round(pixel * (1 << _SHIFT)), -(2**20), 2**20).astype(int)
    return int(scaled[0]), int(scaled[1])


def masked_image(bgr: np.ndarray, configuration: Configuration, camera: Camera) -> np.ndarray:
    """A copy of an image, black where the body is not (Trewartha et al., Fig. 10).

    A body that is where it should be shows itself and nothing of its surroundings.

    Parameters
    ----------
    bgr : (height, width, 3) uint8, as large as the camera's images.
    configuration : the posed body.
    camera : that took the image.

    Returns
    -------
    (height, width, 3) uint8 BGR.

    Raises
    ------
    ValueError : an image that is not as large as the camera's.
    """
    _check_image(bgr, camera)
    seen = np.zeros(bgr.shape, dtype=np.uint8)
    cv2.copyTo(np.ascontiguousarray(bgr), render_mask(configuration, camera), seen)
    return seen


def _check_image(bgr: np.ndarray, camera: Camera) -> None:
    if bgr.shape != (camera.model.height, camera.model.width, 3) or bgr.dtype != np.uint8:
        expected = f"uint8 ({camera.model.height}, {camera.model.width}, 3) for camera '{camera.name}'"
        raise ValueError(f"expected an image of {expected}, got {bgr.dtype} {bgr.shape}")
