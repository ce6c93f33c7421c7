"""Motions of clothed people: captured clips, also mirrored and at other speeds, and procedural ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmark.clothed.person import _procedural
from tracker_node.errors import UnknownNameError
from tracker_node.geometry import so3
from tracker_node.synthesis.motions.deepmimic import find_clip, read_clip
from tracker_node.synthesis.motions.motion import SEGMENTS, Motion, joined, within

RATE_HZ = 30.0
CAPTURED = ("walk", "dance_a", "dance_b", "kick", "punch", "jump", "spin", "spinkick")
PROCEDURAL: dict[str, Callable[[int, np.random.Generator], Motion]] = {
    "guard": _procedural.guard, "squat": _procedural.squat, "wave_and_turn": _procedural.wave_and_turn,
    "sit": _procedural.sit, "cross_arms": _procedural.cross_arms, "swing": _procedural.swing_arms,
}  # fmt: skip
MOTIONS = (*CAPTURED, *PROCEDURAL)
_RADIUS_M = 1.8  # of the path about its middle; longer paths are straightened, and feet slide a little
_MIRROR = np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class MotionChoice:
    """What is asked of a motion.

    Parameters
    ----------
    name : of `MOTIONS`.
    speed : captured clips are played so many times as fast.
    mirrored : left and right exchanged.
    heading_rad : turn about the vertical.
    """

    name: str
    speed: float = 1.0
    mirrored: bool = False
    heading_rad: float = 0.0

    @property
    def is_planted(self) -> bool:
        """Whether the feet stand still but for a path that is stated."""
        return self.name in PROCEDURAL


def draw_motion(choice: MotionChoice, n_images: int, rng: np.random.Generator, clips: Path | None) -> Motion:
    """A motion about the world's origin.

    Parameters
    ----------
    choice : which.
    n_images : at 30 Hz.
    rng : of the variations of procedural motions.
    clips : folder of the captured clips.

    Returns
    -------
    The motion.

    Raises
    ------
    UnknownNameError : no such motion, or no such clip. SourceError : no such folder.
    """
    if choice.name in PROCEDURAL:
        motion = PROCEDURAL[choice.name](n_images, rng)
    elif choice.name in CAPTURED:
        motion = _captured(choice, n_images, clips)
    else:
        raise UnknownNameError("motion", choice.name, MOTIONS)
    if choice.mirrored:
        motion = mirrored(motion)
    return turned(motion, choice.heading_rad)


def _captured(choice: MotionChoice, n_images: int, clips: Path | None) -> Motion:
    clip = read_clip(find_clip(choice.name, clips or Path()))
    motion = clip.resampled(RATE_HZ / choice.speed, n_images if clip.wraps else None)
    motion = replace(motion, rate_hz=RATE_HZ)
    if len(motion) < n_images:
        motion = joined([motion], n_images, motion.name)
    motion = replace(motion, root_positions=motion.root_positions[:n_images], rotations=motion.rotations[:n_images])
    return within(motion, _RADIUS_M).centered()


def bend_hands(n_images: int, rng: np.random.Generator) -> np.ndarray:
    """Flexion and ulnar deviation of the wrists: up to 50 and 15 degrees, each at a slow rhythm of its own.

    Parameters
    ----------
    n_images : at 30 Hz.
    rng : of rhythms.

    Returns
    -------
    (n_images, 2, 2) radians: left and right.
    """
    turns = rng.uniform(0.3, 0.7, (2, 2)) * np.arange(n_images)[:, None, None] / RATE_HZ + rng.uniform(size=(2, 2))
    return np.radians([50.0, 15.0]) * np.sin(2.0 * np.pi * turns)


def mirrored(motion: Motion) -> Motion:
    """Left and right exchanged."""
    swap = [SEGMENTS.index(_other_side(name)) for name in SEGMENTS]
    rotations = _MIRROR @ motion.rotations[:, swap] @ _MIRROR
    return replace(motion, root_positions=motion.root_positions @ _MIRROR, rotations=rotations)


def _other_side(name: str) -> str:
    if name.startswith("left_"):
        return name.replace("left_", "right_")
    return name.replace("right_", "left_")


def turned(motion: Motion, angle_rad: float) -> Motion:
    """The motion turned about the vertical through the world's origin.

    Parameters
    ----------
    motion : any.
    angle_rad : counterclockwise from above.

    Returns
    -------
    The motion.
    """
    turn = so3.exp([0.0, 0.0, angle_rad])
    return replace(motion, root_positions=motion.root_positions @ turn.T, rotations=turn @ motion.rotations)


def passing_by(n_images: int, clips: Path | None, start: np.ndarray, end: np.ndarray, leg_length: float) -> Motion:
    """A walk along a straight line at one speed.

    Parameters
    ----------
    n_images : at 30 Hz.
    clips : folder of the captured clips; None: the procedural walk.
    start, end : (2,) meters, of the line.
    leg_length : of the walker, meters.

    Returns
    -------
    The motion, its root positions for a body of that leg length.
    """
    if clips is None:
        walk = _procedural.swing_arms(n_images, np.random.default_rng(0))
    else:
        walk = replace(read_clip(find_clip("walk", clips)).resampled(RATE_HZ, n_images), rate_hz=RATE_HZ)
    way = end - start
    path = walk.root_positions[:, :2]
    leads = path[-1] - path[0] if clips is not None else np.array([1.0, 0.0])
    walk = turned(walk, np.arctan2(way[1], way[0]) - np.arctan2(leads[1], leads[0]))
    positions = walk.root_positions * (leg_length / walk.leg_length)
    positions[:, :2] = start + np.linspace(0.0, 1.0, n_images)[:, None] * way
    return replace(walk, root_positions=positions, leg_length=leg_length)
