"""Images of people: shaded, clothed, with shadows on themselves, each other and the room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmark.clothed.person._clothes import Dressed
from benchmark.clothed.person._posing import Pose, skin
from benchmark.clothed.render._empty_scene import EmptyScene
from benchmark.clothed.render._noise import TABLE
from benchmark.clothed.render._raster import nearest, project
from benchmark.clothed.render._room import Room
from benchmark.clothed.render._shading import SAMPLES, darken, shade
from benchmark.clothed.render._shadows import ShadowMaps, shadow_maps
from tracker_node.synthesis.scenes.rasterizer import vertex_normals

_FOOT_MARKERS = (5, 6, 12, 13)


@dataclass(frozen=True, eq=False)
class Crowd:
    """All people of a clip, as one mesh: what does not change from image to image.

    Parameters
    ----------
    dressed : the people.
    faces : (m, 3) of all.
    person_of_face : (m,).
    rest, garments, tints : of all vertices.
    colors, second_colors : (p, 5, 3) linear RGB.
    patterns, pattern_m : (p, 5).
    """

    dressed: tuple[Dressed, ...]
    faces: np.ndarray
    person_of_face: np.ndarray
    rest: np.ndarray
    garments: np.ndarray
    tints: np.ndarray
    colors: np.ndarray
    second_colors: np.ndarray
    patterns: np.ndarray
    pattern_m: np.ndarray


@dataclass(frozen=True, eq=False)
class Moment:
    """All people at one time: vertices and normals (n, 3), the lamps' shadow maps, feet (f, 3)."""

    vertices: np.ndarray
    normals: np.ndarray
    shadows: ShadowMaps
    feet: np.ndarray


def crowd(dressed: Sequence[Dressed]) -> Crowd:
    """All people of a clip as one mesh."""
    starts = np.cumsum([0, *(len(d.rest) for d in dressed)])
    outfits = [d.outfit for d in dressed]
    return Crowd(
        tuple(dressed),
        np.concatenate([d.body.faces + start for d, start in zip(dressed, starts, strict=False)]).astype(np.int64),
        np.repeat(np.arange(len(dressed)), [len(d.body.faces) for d in dressed]),
        np.concatenate([d.rest for d in dressed]),
        np.concatenate([d.garments for d in dressed]),
        np.concatenate([d.tints for d in dressed]),
        np.stack([o.colors for o in outfits]) ** 2.2,
        np.stack([o.second_colors for o in outfits]) ** 2.2,
        np.stack([o.patterns for o in outfits]),
        np.stack([o.pattern_m for o in outfits]),
    )


def moment(people: Crowd, poses: Sequence[Pose], room: Room, phase: float) -> Moment:
    """People in their poses, under the lamps.

    Parameters
    ----------
    people, poses : one pose each.
    room : whose lamps.
    phase : of the fabric's folds.

    Returns
    -------
    The moment.
    """
    vertices = np.concatenate([
        skin(d.body, pose, d.wrinkled(phase)) for d, pose in zip(people.dressed, poses, strict=True)
    ])  # fmt: skip
    feet = np.concatenate([pose.markers[list(_FOOT_MARKERS)] for pose in poses])
    shadows = shadow_maps(room.lights, vertices, people.faces)
    return Moment(vertices, vertex_normals(vertices, people.faces), shadows, feet)


def draw_people(scene: EmptyScene, room: Room, people: Crowd, now: Moment, view: np.ndarray) -> np.ndarray:
    """The scene with people in it.

    Parameters
    ----------
    scene : the empty one, of this camera.
    room : whose lamps.
    people, now : who, and where.
    view : (3, 4) of the camera.

    Returns
    -------
    (h, w, 3) float32 linear RGB.
    """
    image = np.empty_like(scene.ambient)
    shadows = now.shadows
    darken(
        scene.ambient, scene.by_lamp, scene.places, shadows.views, shadows.inverse_depths, shadows.occupied, now.feet, image
    )
    projected = project(view, now.vertices)
    rows, columns = scene.depths.shape
    low = np.clip(np.floor(projected[:, :2].min(axis=0)).astype(int) - 1, 0, [columns, rows])
    high = np.clip(np.ceil(projected[:, :2].max(axis=0)).astype(int) + 2, 0, [columns, rows])
    if (high <= low).any():
        return image
    projected[:, :2] = (projected[:, :2] - low + 0.5) * SAMPLES - 0.5
    shape = tuple(SAMPLES * (high - low)[::-1])
    inverse_depth, face = np.zeros(shape, np.float32), np.full(shape, -1, np.int32)
    nearest(projected, people.faces, True, inverse_depth, face)
    window = (slice(low[1], high[1]), slice(low[0], high[0]))
    shade(
        image[window], scene.depths[window], inverse_depth, face, projected, people.faces, people.person_of_face, now.vertices,
        now.normals, people.rest, people.garments, people.tints, people.colors, people.second_colors, people.patterns,
        people.pattern_m, room.lights, room.powers, room.ambient, shadows.views, shadows.inverse_depths, shadows.occupied, TABLE,
    )  # fmt: skip
    return image
