"""A clip before it is drawn: poses of all people, cameras around them, the room with what the motion needs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmark.clothed._cameras import View, draw_cameras
from benchmark.clothed._traits import Traits, draw_outfit, draw_traits
from benchmark.clothed.person._body import Body, load_body
from benchmark.clothed.person._clothes import dress
from benchmark.clothed.person._motions import bend_hands, draw_motion, passing_by
from benchmark.clothed.person._posing import Pose, Poser, skin
from benchmark.clothed.render._people import Crowd, crowd
from benchmark.clothed.render._room import Room, draw_room, draw_size

_AROUND_M = 0.13  # hands and hair beyond the markers
_PASSER_CLEAR_M, _PASSER_HALF_WAY_M = 0.65, 1.7
_STOOL_HALF_M = 0.19


@dataclass(frozen=True, eq=False)
class Stage:
    """All that a clip is drawn from.

    Parameters
    ----------
    seed, traits : of the clip.
    poses : a list for each person, the tracked one first.
    t_pose : of the tracked person.
    rotations : (n, 17, 3, 3) of its segments, `person._posing.POSED`, in the world.
    views : the cameras.
    room, people : what they see.
    """

    seed: int
    traits: Traits
    poses: list[list[Pose]]
    t_pose: Pose
    rotations: np.ndarray
    views: list[View]
    room: Room
    people: Crowd

    @property
    def truth(self) -> np.ndarray:
        """(n, 17, 3) markers of the tracked person, meters."""
        return np.array([pose.markers for pose in self.poses[0]])


@dataclass(frozen=True)
class Sources:
    """Where bodies and captured clips lie, and what is taken instead of a seed's choice; ``hands``: they bend at the wrists."""

    bodies: Path
    clips: Path | None
    body: str | None = None
    motion: str | None = None
    hands: bool = False


def set_stage(seed: int, sources: Sources, n_images: int | None = None, scale: float = 1.0) -> Stage:
    """Everything about a clip but its images.

    Parameters
    ----------
    seed : of the clip.
    sources : of bodies and motions.
    n_images : instead of the seed's choice.
    scale : of the images' size.

    Returns
    -------
    The stage.
    """
    rng = np.random.default_rng([7, seed])
    traits = draw_traits(seed, rng, sources.body, sources.motion)
    body = load_body(traits.cast.body, sources.bodies)
    poser = Poser(body)
    motion = draw_motion(traits.motion, n_images or traits.n_images, rng, sources.clips)
    hands = bend_hands(len(motion), np.random.default_rng([10, seed])) if sources.hands else None
    poses = _centered(poser.follow(motion, traits.motion.is_planted, hands))
    truth = np.array([pose.markers for pose in poses])
    size = draw_size(rng)
    views = draw_cameras(_around(truth), body.stature, size[0], rng)
    people = [(body, poses)]
    if traits.passer is not None:
        other = load_body(traits.passer, sources.bodies)
        people.append((other, _passing(other, truth, views, sources.clips, rng)))
    boxes = _needed(traits, body, poses, views, rng)
    room = draw_room(size, boxes, np.concatenate([_lines(views, p) for _, p in people]), rng)
    dressed = [dress(b, draw_outfit(room.wall_color, room.floor_color, rng)) for b, _ in people]
    views = [view.scaled(scale) for view in views]
    rotations = np.array([poser.segment_rotations(pose) for pose in poses])
    return Stage(seed, traits, [p for _, p in people], poser.t_pose(), rotations, views, room, crowd(dressed))


def _needed(traits: Traits, body: Body, poses: list[Pose], views: list[View], rng: np.random.Generator) -> list[np.ndarray]:
    """Furniture that the motion, or the cast, asks for."""
    boxes = [_stool(body, poses)] if traits.motion.name == "sit" else []
    if traits.cast.has_obstacle:
        boxes.append(_obstacle(np.array([pose.markers for pose in poses]), views, rng))
    return boxes


def _centered(poses: list[Pose]) -> list[Pose]:
    at = np.array([pose.markers[:, :2] for pose in poses]).reshape(-1, 2)
    shift = -0.5 * (at.min(axis=0) + at.max(axis=0))
    return [pose.moved(np.array([*shift, 0.0])) for pose in poses]


def _around(truth: np.ndarray) -> np.ndarray:
    """Points about the markers that are to be in view, (m, 3)."""
    offsets = np.concatenate([np.eye(3), -np.eye(3)]) * _AROUND_M
    return (truth.reshape(-1, 1, 3) + offsets).reshape(-1, 3)


def _lines(views: list[View], poses: list[Pose]) -> np.ndarray:
    """(m, 2, 3) from every camera to markers of some images."""
    targets = np.concatenate([pose.markers for pose in poses[:: max(1, len(poses) // 8)]])
    return np.array([(view.T_world_cam[:3, 3], target) for view in views for target in targets])


def _passing(body: Body, truth: np.ndarray, views: list[View], clips: Path | None, rng: np.random.Generator) -> list[Pose]:
    """Another person who walks between the tracked one and a camera."""
    view = views[int(rng.integers(len(views)))]
    middle = truth.reshape(-1, 3)[:, :2].mean(axis=0)
    to_camera = view.T_world_cam[:2, 3] - middle
    to_camera /= np.linalg.norm(to_camera)
    away = max(0.9, float(((truth[..., :2] - middle) @ to_camera).max()) + _PASSER_CLEAR_M)
    across = np.array([-to_camera[1], to_camera[0]]) * rng.choice([-1.0, 1.0])
    at = middle + away * to_camera
    start, end = at - _PASSER_HALF_WAY_M * across, at + _PASSER_HALF_WAY_M * across
    motion = passing_by(len(truth), clips, start, end, body.leg_length)
    return Poser(body).follow(motion, planted=False)


def _stool(body: Body, poses: list[Pose]) -> np.ndarray:
    """The box (2, 3) on which a motion sits down: below the pelvis where that is lowest."""
    hips = np.array([0.5 * (pose.markers[3] + pose.markers[10]) for pose in poses])
    seated = poses[int(np.argmin(hips[:, 2]))]
    vertices = skin(body, seated, body.vertices)
    bottom = body.weight_of("pelvis") > 0.5
    top = float(vertices[bottom, 2].min()) - 0.006
    middle = vertices[bottom, :2].mean(axis=0)
    half = _STOOL_HALF_M * body.stature / 1.75
    return np.array([[*(middle - half), 0.0], [*(middle + half), top]])


def _obstacle(truth: np.ndarray, views: list[View], rng: np.random.Generator) -> np.ndarray:
    """A low box (2, 3) that hides feet and shanks from one camera."""
    place = views[int(rng.integers(len(views)))].T_world_cam[:3, 3]
    middle = truth.reshape(-1, 3).mean(axis=0)
    way = (place - middle)[:2] / np.linalg.norm((place - middle)[:2])
    reach = float(((truth.reshape(-1, 3) - middle)[:, :2] @ way).max())
    half = rng.uniform(0.2, 0.35, 2)
    at = middle[:2] + way * (reach + 0.35 + half.max())
    return np.array([[*(at - half), 0.0], [*(at + half), rng.uniform(0.35, 0.55)]])


