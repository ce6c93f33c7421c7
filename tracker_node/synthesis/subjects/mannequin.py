"""A person that is not the tracker's model: the skinned body of mannequin-x, dressed, driven by motions of segments.

The body stands in a T-pose in its own axes (x left, y up, z forward). Its joints are exact: truth is read from them. What the
motion's skeleton does not have is shared out: the torso's turn over three vertebrae, the head's over neck and head.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ...geometry import so3
from ..motions.motion import Motion

# Landmark -> joint of the body (SMPL-X names).
LANDMARK_JOINTS = {
    f"{side}_{landmark}": f"{letter}_{joint}"
    for side, letter in (("left", "L"), ("right", "R"))
    for landmark, joint in (
        ("shoulder", "Shoulder"), ("elbow", "Elbow"), ("wrist", "Wrist"), ("hip", "Hip"), ("knee", "Knee"), ("ankle", "Ankle"),
    )
} | {"neck": "Neck"}  # fmt: skip
LANDMARKS = (*LANDMARK_JOINTS, "head")

# Body axes (x forward, y left, z up) from the mannequin's (x left, y up, z forward).
_BODY_FROM_MANNEQUIN = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

# Order of the rows of the SMPL-X parameter body_pose.
_BODY_POSE = (
    "L_Hip", "R_Hip", "Spine1", "L_Knee", "R_Knee", "Spine2", "L_Ankle", "R_Ankle", "Spine3", "L_Foot", "R_Foot",
    "Neck", "L_Collar", "R_Collar", "Head", "L_Shoulder", "R_Shoulder", "L_Elbow", "R_Elbow", "L_Wrist", "R_Wrist",
)  # fmt: skip

# Joint that a segment turns -> segment. Joints between take part of the turn (see `_world_rotations`).
_SEGMENT_OF_JOINT = {
    f"{letter}_{joint}": f"{side}_{segment}"
    for side, letter in (("left", "L"), ("right", "R"))
    for joint, segment in (
        ("Hip", "thigh"), ("Knee", "shank"), ("Ankle", "foot"), ("Shoulder", "upper_arm"), ("Elbow", "forearm"),
    )
}  # fmt: skip

# Joint of the skin -> part of the tracker's human model that it carries; fingers go with the hand, toes with the foot.
_PART_OF_JOINT = {
    "Pelvis": "pelvis", "Spine1": "abdomen", "Spine2": "torso", "Spine3": "torso", "Neck": "neck", "Head": "head",
} | {
    f"{letter}_{joint}": f"{side}_{part}"
    for side, letter in (("left", "L"), ("right", "R"))
    for joint, part in (
        ("Collar", "clavicle"), ("Shoulder", "upper_arm"), ("Elbow", "forearm"), ("Wrist", "hand"), ("Hip", "thigh"),
        ("Knee", "shank"), ("Ankle", "foot"), ("Foot", "foot"),
    )
}  # fmt: skip

COLORS_RGB = {
    "skin": (205, 150, 122), "hair": (62, 44, 33), "shirt": (44, 92, 150), "shorts": (46, 48, 58), "shoes": (196, 60, 48),
    "socks": (225, 225, 220),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class PosedBody:
    """One time step: ``vertices`` (24256, 3) and ``landmarks`` (14, 3) in the order of `LANDMARKS`, meters, world with Z up."""

    vertices: np.ndarray
    landmarks: np.ndarray


class MannequinSubject:
    """The body at a given stature.

    Parameters
    ----------
    stature : meters from the soles to the top of the head in the rest pose.
    part_colors_rgb : name of a part of the tracker's human model -> color in 0..255, of all its parts: a suit in those colors
        instead of clothes. Each vertex has the color of the part that carries it most.

    Attributes
    ----------
    faces : (48396, 3) vertex indices.
    colors_rgb : (24256, 3) uint8, clothes and skin, or the suit.
    """

    def __init__(self, stature: float = 1.75, part_colors_rgb: Mapping[str, tuple[int, int, int]] | None = None):
        from mannequin import Mannequin  # not needed by anything but synthesis

        self._body = Mannequin("wooden")
        rest = self._body.rest_pose(dtype=np.float64)
        vertices = self._body.vertices(rest)
        self._joints = {name: i for i, name in enumerate(self._body.joint_names)}
        self._rest_joints = self._body.joint_transforms(rest)[:, :3, 3]
        self._scale = stature / float(np.ptp(vertices[:, 1]))
        self.stature = stature
        self.faces = np.asarray(self._body.faces, dtype=np.int64)
        if part_colors_rgb is None:
            self.colors_rgb = _dressed(vertices, self._rest_joints, self._joints, self._body._skin_joint_indices)
        else:
            names = [self._body.joint_names[i] for i in _strongest(self._body._skin_joint_indices, self._body._skin_weights)]
            self.colors_rgb = np.array([part_colors_rgb[_part_of(name)] for name in names], dtype=np.uint8)
        # The head's landmark is the crown: a point of the head's skin, carried by the head joint.
        head = self._rest_joints[self._joints["Head"]]
        self._crown_in_head = np.array([0.0, vertices[:, 1].max() - head[1], 0.0])
        self._hang = {
            f"{letter}_{joint}": self._hanging(f"{letter}_{joint}", f"{letter}_{child}")
            for letter in ("L", "R")
            for joint, child in (("Shoulder", "Elbow"), ("Elbow", "Wrist"))
        }

    def _hanging(self, joint: str, child: str) -> np.ndarray:
        """Turn (3, 3) in mannequin axes from the T-pose's bone to one that hangs straight down."""
        bone = self._rest_joints[self._joints[child]] - self._rest_joints[self._joints[joint]]
        quarter = so3.exp([0.0, 0.0, -np.sign(bone[0]) * np.pi / 2])
        rest = quarter @ bone / np.linalg.norm(bone)
        axis = np.cross(rest, [0.0, -1.0, 0.0])
        sine = np.linalg.norm(axis)
        return so3.exp(axis / sine * np.arctan2(sine, -rest[1])) @ quarter if sine > 1e-9 else quarter

    @property
    def leg_length(self) -> float:
        """Meters from hip to ankle, along the bones."""
        hip, knee, ankle = (self._rest_joints[self._joints[n]] for n in ("L_Hip", "L_Knee", "L_Ankle"))
        return self._scale * float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))

    def pose(self, rotations: dict[str, np.ndarray], hips: np.ndarray) -> PosedBody:
        """Pose the body.

        Parameters
        ----------
        rotations : segment -> world rotation (3, 3), body axes.
        hips : (3,) point midway between the hips, world.

        Returns
        -------
        Mesh and landmarks in the world.
        """
        world = self._world_rotations(rotations)
        parameters = self._parameters(world)
        transforms = self._body.joint_transforms(parameters)
        to_world = _BODY_FROM_MANNEQUIN * self._scale
        joints = transforms[:, :3, 3] @ to_world.T
        shift = hips - 0.5 * (joints[self._joints["L_Hip"]] + joints[self._joints["R_Hip"]])
        landmarks = [joints[self._joints[name]] for name in LANDMARK_JOINTS.values()]
        head = transforms[self._joints["Head"]]
        landmarks.append(to_world @ (head[:3, :3] @ self._crown_in_head + head[:3, 3]))
        return PosedBody(self._body.vertices(parameters) @ to_world.T + shift, np.array(landmarks) + shift)

    def t_pose(self) -> PosedBody:
        """Standing with arms to the sides, facing +x, soles on the floor, hips above the origin."""
        identity = {segment: np.eye(3) for segment in ("pelvis", "torso", "head", *_SEGMENT_OF_JOINT.values())}
        for side, sign in (("left", 1.0), ("right", -1.0)):
            for segment in ("upper_arm", "forearm"):
                identity[f"{side}_{segment}"] = so3.exp([sign * np.pi / 2, 0.0, 0.0])
        body = self.pose(identity, np.zeros(3))
        floor = np.array([0.0, 0.0, body.vertices[:, 2].min()])
        return PosedBody(body.vertices - floor, body.landmarks - floor)

    def follow(self, motion: Motion) -> Iterator[PosedBody]:
        """The body through a motion, scaled to its legs, and stood on the floor z = 0."""
        scale = self.leg_length / motion.leg_length
        hips = motion.root_positions * [1.0, 1.0, scale]
        bodies = [self._at(motion, i, hips[i]) for i in range(len(motion))]
        # The sole of the standing foot is on the floor most of the time; feet of clips go a little below it now and then.
        lowest = [body.vertices[:, 2].min() for body in bodies]
        floor = np.array([0.0, 0.0, np.percentile(lowest, 20)])
        for body in bodies:
            yield PosedBody(body.vertices - floor, body.landmarks - floor)

    def _at(self, motion: Motion, i: int, hips: np.ndarray) -> PosedBody:
        names = ("pelvis", "torso", "head", *_SEGMENT_OF_JOINT.values())
        return self.pose({name: motion.of(name)[i] for name in names}, hips)

    def _world_rotations(self, rotations: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Rotation of every driven joint from its rest pose, in mannequin axes."""
        to_body = _BODY_FROM_MANNEQUIN
        segment = {name: to_body.T @ rotation @ to_body for name, rotation in rotations.items()}
        world = {joint: segment[name] for joint, name in _SEGMENT_OF_JOINT.items()}
        bend = so3.log(segment["pelvis"].T @ segment["torso"])
        for i, joint in enumerate(("Spine1", "Spine2", "Spine3"), start=1):
            world[joint] = segment["pelvis"] @ so3.exp(bend * i / 3.0)
        nod = so3.log(segment["torso"].T @ segment["head"])
        world["Neck"], world["Head"] = segment["torso"] @ so3.exp(0.5 * nod), segment["head"]
        world["Pelvis"] = segment["pelvis"]
        for letter in ("L", "R"):
            world[f"{letter}_Collar"] = segment["torso"]
            for joint in ("Shoulder", "Elbow"):
                world[f"{letter}_{joint}"] = world[f"{letter}_{joint}"] @ self._hang[f"{letter}_{joint}"]
            world[f"{letter}_Wrist"] = world[f"{letter}_Elbow"]
            world[f"{letter}_Foot"] = world[f"{letter}_Ankle"]
        return world

    def _parameters(self, world: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        names, parents = self._body.joint_names, self._body.parents
        parameters = self._body.rest_pose(dtype=np.float64)
        parameters["pelvis_rotation"] = Rotation.from_matrix(world["Pelvis"]).as_rotvec()
        for row, joint in enumerate(_BODY_POSE):
            parent = names[parents[self._joints[joint]]]
            parameters["body_pose"][row] = Rotation.from_matrix(world[parent].T @ world[joint]).as_rotvec()
        return parameters


def _strongest(joint_indices: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(n,) index of the joint with the largest weight of every vertex."""
    return joint_indices[np.arange(len(weights)), weights.argmax(axis=1)]


def _part_of(joint: str) -> str:
    hand = "left_hand" if joint.startswith("L_") else "right_hand"
    return _PART_OF_JOINT.get(joint, hand)


def _dressed(vertices, joints, index, skin_joints) -> np.ndarray:
    """Color (n, 3) uint8 of every vertex of the T-posed body from its place along the limbs."""
    x, y, z = vertices.T
    at = {name: joints[i] for name, i in index.items()}
    shoulder, elbow = abs(at["L_Shoulder"][0]), abs(at["L_Elbow"][0])
    knee, hip, ankle = (0.5 * (at[f"L_{n}"][1] + at[f"R_{n}"][1]) for n in ("Knee", "Hip", "Ankle"))
    region = np.full(len(vertices), "skin", dtype="<U6")
    arm = (np.abs(x) > shoulder) & (y > hip + 0.2)
    # The neckline: an opening about the neck, lower in front than behind.
    neck = at["Neck"]
    opening = (np.hypot(x, z - neck[2] - 0.02) < 0.085) & (y > neck[1] - np.where(z > neck[2] + 0.02, 0.03, -0.02))
    trunk = ~arm & (y < neck[1] + 0.08) & (y > hip + 0.06) & ~opening
    region[trunk | (arm & (np.abs(x) < shoulder + 0.6 * (elbow - shoulder)))] = "shirt"
    region[(y <= hip + 0.06) & (y > knee + 0.10)] = "shorts"
    region[y < ankle + 0.09] = "socks"
    region[y < ankle + 0.01] = "shoes"
    head = np.isin(skin_joints[:, -1], [index["Head"]]) & ~arm
    crown, chin_to_crown = y.max(), y.max() - at["Head"][1]
    region[head & ((y > crown - 0.30 * chin_to_crown) | ((z < at["Head"][2] - 0.01) & (y > at["Head"][1] + 0.03)))] = "hair"
    colors = np.array([COLORS_RGB[name] for name in region], dtype=np.float64)
    # Cloth is woven unevenly: a broad stripe pattern in the shirt gives inner edges of low contrast.
    stripes = (region == "shirt") & (np.floor(y / 0.05).astype(int) % 4 == 0)
    colors[stripes] *= 1.18
    return np.clip(colors, 0, 255).astype(np.uint8)
