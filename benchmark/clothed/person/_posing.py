"""A body in the poses of a motion: world transforms of its joints, its skin, its markers.

What a motion's skeleton does not have is shared out: the torso's turn over three vertebrae, the head's over neck and head, a
raised arm over collar bone and shoulder.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np

from benchmark.clothed.person._body import JOINTS, PARENTS, Body
from tracker_node.geometry import so3
from tracker_node.synthesis.motions.motion import SEGMENTS, Motion

_SEGMENT_OF = {"shoulder": "upper_arm", "elbow": "forearm", "hip": "thigh", "knee": "shank", "ankle": "foot"}
_SIDES = (("left", 1.0), ("right", -1.0))
POSED = {"pelvis": "pelvis", "torso": "spine3", "head": "head"} | {
    f"{side}_{segment}": f"{side}_{joint}"
    for side in ("left", "right")
    for joint, segment in (("clavicle", "clavicle"), *_SEGMENT_OF.items(), ("wrist", "hand"))
}
"""Segments whose rotations are exact -> the joint that turns each; names are those of the tracker's human."""
_COLLAR_FROM_RAD, _COLLAR_PART = np.deg2rad(50.0), 0.2  # beyond this elevation of the arm, the collar bone takes its part
_ARM_RADIUS_M = 0.055  # of a sleeved forearm beside the trunk


@dataclass(frozen=True, eq=False)
class Pose:
    """Skinning transforms (20, 3, 4) from the rest pose to the world, and markers (17, 3), meters."""

    transforms: np.ndarray
    markers: np.ndarray

    def moved(self, shift: np.ndarray) -> Pose:
        """The pose moved by (3,) meters."""
        transforms = self.transforms.copy()
        transforms[:, :, 3] += shift
        return Pose(transforms, self.markers + shift)


class Poser:
    """Poses of one body, its arms spread from a wide trunk."""

    def __init__(self, body: Body):
        self.body = body
        self._marker_places, self._marker_joints = body.markers()
        self._hang = _hanging(body)
        self._spread = _spread(body)

    def pose(self, rotations: dict[str, np.ndarray], hips: np.ndarray, hands: np.ndarray | None = None) -> Pose:
        """One pose.

        Parameters
        ----------
        rotations : segment -> world rotation (3, 3), body axes.
        hips : (3,) point midway between the hips, world.
        hands : (2, 2) flexion and ulnar deviation of the wrists, left and right, radians; None: straight.

        Returns
        -------
        The pose.
        """
        turns = self._turns(self._spread_arms(rotations), np.zeros((2, 2)) if hands is None else hands)
        rest = self.body.joints
        places = np.zeros_like(rest)
        for i, parent in enumerate(PARENTS.values()):
            if parent:
                p = JOINTS.index(parent)
                places[i] = places[p] + turns[parent] @ (rest[i] - rest[p])
        middle = 0.5 * (places[JOINTS.index("left_hip")] + places[JOINTS.index("right_hip")])
        places += hips - middle
        transforms = np.empty((len(JOINTS), 3, 4))
        for i, joint in enumerate(JOINTS):
            transforms[i, :, :3] = turns[joint]
            transforms[i, :, 3] = places[i] - turns[joint] @ rest[i]
        held = transforms[self._marker_joints]
        markers = np.einsum("nij,nj->ni", held[:, :, :3], self._marker_places) + held[:, :, 3]
        return Pose(transforms, markers)

    def segment_rotations(self, pose: Pose) -> np.ndarray:
        """World rotations (17, 3, 3) of the segments of `POSED`, body axes: identity where the body stands with hanging arms."""
        turns = dict(zip(JOINTS, pose.transforms[:, :, :3], strict=True))
        hang = self._hang | {f"{side}_wrist": self._hang[f"{side}_elbow"] for side, _ in _SIDES}
        return np.array([turns[joint] @ hang.get(joint, np.eye(3)).T for joint in POSED.values()])

    def t_pose(self) -> Pose:
        """Standing with arms to the sides, facing +x, soles on the floor, hips above the origin."""
        rotations = {segment: np.eye(3) for segment in SEGMENTS}
        for side, sign in _SIDES:
            for segment in ("upper_arm", "forearm"):
                rotations[f"{side}_{segment}"] = so3.exp([sign * np.pi / 2, 0.0, 0.0])
        pose = self.pose(rotations, np.zeros(3))
        return pose.moved(np.array([0.0, 0.0, -lowest(self.body, pose)]))

    def follow(self, motion: Motion, planted: bool, hands: np.ndarray | None = None) -> list[Pose]:
        """The body through a motion that is scaled to its legs, on the floor z = 0.

        Parameters
        ----------
        motion : any.
        planted : the feet stand still: root positions are then the path of the feet's middle. Otherwise the floor is where the
            lowest point of the body is most of the time.
        hands : (n, 2, 2), as of `pose`.

        Returns
        -------
        A pose an image.
        """
        hips = motion.root_positions * (self.body.leg_length / motion.leg_length)
        poses = [
            self.pose(dict(zip(SEGMENTS, rotations, strict=True)), at, None if hands is None else hands[i])
            for i, (rotations, at) in enumerate(zip(motion.rotations, hips, strict=True))
        ]
        floors = np.array([lowest(self.body, pose) for pose in poses])
        if not planted:
            return [pose.moved(np.array([0.0, 0.0, -np.percentile(floors, 20)])) for pose in poses]
        return [
            pose.moved(np.array([*(at[:2] - _feet(pose)), -floor]))
            for pose, at, floor in zip(poses, hips, floors, strict=True)
        ]

    def _turns(self, rotations: dict[str, np.ndarray], hands: np.ndarray) -> dict[str, np.ndarray]:
        """World rotation of every joint from its rest pose."""
        pelvis, torso, head = (rotations[name] for name in ("pelvis", "torso", "head"))
        bend, nod = so3.log(pelvis.T @ torso), so3.log(torso.T @ head)
        turns = {"pelvis": pelvis, "neck": torso @ so3.exp(0.5 * nod), "head": head}
        for i, joint in enumerate(("spine1", "spine2", "spine3"), start=1):
            turns[joint] = pelvis @ so3.exp(bend * i / 3.0)
        for (side, sign), (flexion, deviation) in zip(_SIDES, hands, strict=True):
            turns[f"{side}_clavicle"] = torso @ _collar(torso.T @ rotations[f"{side}_upper_arm"], sign)
            for joint, segment in _SEGMENT_OF.items():
                turns[f"{side}_{joint}"] = rotations[f"{side}_{segment}"] @ self._hang[f"{side}_{joint}"]
            bent = so3.exp([-sign * flexion, 0.0, 0.0]) @ so3.exp([0.0, deviation, 0.0])  # palms face inward
            turns[f"{side}_wrist"] = rotations[f"{side}_forearm"] @ bent @ self._hang[f"{side}_elbow"]
        return turns

    def _spread_arms(self, rotations: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Arms that hang turned outward, so that they do not enter the trunk."""
        result = dict(rotations)
        torso = rotations["torso"]
        for side, sign in _SIDES:
            upper = rotations[f"{side}_upper_arm"]
            hangs = np.clip((torso.T @ upper)[2, 2], 0.0, 1.0)
            turn = torso @ so3.exp([sign * self._spread * hangs, 0.0, 0.0]) @ torso.T
            for segment in ("upper_arm", "forearm"):
                result[f"{side}_{segment}"] = turn @ rotations[f"{side}_{segment}"]
        return result


def skin(body: Body, pose: Pose, rest: np.ndarray) -> np.ndarray:
    """Linear blend skinning.

    Parameters
    ----------
    body : whose weights.
    pose : of the body.
    rest : (n, 3) vertices in the rest pose, e.g. of clothes.

    Returns
    -------
    (n, 3) vertices in the world, meters.
    """
    return _skin(rest, body.weight_joints, body.weights, pose.transforms)


@nb.njit(cache=True)
def _skin(rest, joints, weights, transforms):
    result = np.zeros_like(rest)
    for i in range(len(rest)):
        for k in range(joints.shape[1]):
            w, T = weights[i, k], transforms[joints[i, k]]
            for a in range(3):
                result[i, a] += w * (T[a, 0] * rest[i, 0] + T[a, 1] * rest[i, 1] + T[a, 2] * rest[i, 2] + T[a, 3])
    return result


def lowest(body: Body, pose: Pose) -> float:
    """Height of a posed body's lowest point.

    Parameters
    ----------
    body, pose : whose skin, how it stands.

    Returns
    -------
    Meters.
    """
    return float(skin(body, pose, body.vertices)[:, 2].min())


def _feet(pose: Pose) -> np.ndarray:
    """(2,) middle between the ankles."""
    return 0.5 * (pose.markers[5, :2] + pose.markers[12, :2])


def _minimal(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Smallest rotation (3, 3) that turns the direction of a to that of b."""
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    return so3.exp(axis / sine * np.arctan2(sine, a @ b)) if sine > 1e-12 else np.eye(3)


def _hanging(body: Body) -> dict[str, np.ndarray]:
    """Turns from the rest pose to straight arms and legs that hang down, for every joint of the limbs."""
    down = np.array([0.0, 0.0, -1.0])
    turns: dict[str, np.ndarray] = {}
    for side, _ in _SIDES:
        at = {name: body.joint(f"{side}_{name}") for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")}
        upper = _minimal(at["elbow"] - at["shoulder"], down)
        turns[f"{side}_shoulder"] = upper
        turns[f"{side}_elbow"] = _minimal(upper @ (at["wrist"] - at["elbow"]), down) @ upper
        leg = at["ankle"] - at["hip"]
        sideways = so3.exp([np.arctan2(-leg[1], -leg[2]), 0.0, 0.0])  # legs straight below the hips
        turns[f"{side}_hip"] = turns[f"{side}_knee"] = sideways
        turns[f"{side}_ankle"] = np.eye(3)
    return turns


def _spread(body: Body) -> float:
    """Angle by which hanging arms stand off, radians: what a wide trunk and hips take."""
    z = body.vertices[:, 2]
    level = (z < body.joint("spine2")[2]) & (z > body.joint("left_hip")[2] - 0.1)
    trunk = level & (body.weight_of("pelvis", "spine1", "spine2", "left_hip", "right_hip") > 0.5)
    width = np.abs(body.vertices[trunk, 1]).max() + _ARM_RADIUS_M * body.stature / 1.75
    shoulder, reach = body.joint("left_shoulder"), body.joint("left_shoulder")[2] - body.joint("left_hip")[2]
    return float(np.clip(np.arctan2(width - shoulder[1], reach), 0.0, 0.5))


def _collar(arm: np.ndarray, sign: float) -> np.ndarray:
    """Turn of the collar bone in the torso for an upper arm (3, 3) in torso axes that is raised."""
    elevation = np.arccos(np.clip(arm[2, 2], -1.0, 1.0))
    return so3.exp([sign * _COLLAR_PART * max(0.0, elevation - _COLLAR_FROM_RAD), 0.0, 0.0])
