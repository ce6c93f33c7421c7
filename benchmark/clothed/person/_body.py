"""A skinned body: its rest pose, and the joints that motions turn.

Body axes: x forward, y left, z up; soles at z = 0. Bodies come from files of `_write_bodies`, or from mannequin-x, which is
installed anyway.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmark.clothed.person._write_bodies import joint_table
from tracker_node.errors import SourceError

PARENTS = {joint: parent for joint, (parent, _) in joint_table().items()}
JOINTS = tuple(PARENTS)
MANNEQUIN = "mannequin"
MANNEQUIN_STATURE_M = 1.75
FIRST_STEP = (
    "python3 -m venv out/anny && out/anny/bin/pip install torch==2.13.0 anny && "
    "out/anny/bin/python benchmark/clothed/person/_write_bodies.py --output {folder}"
)

# Marker of a TRC file -> joint. Toes, head and nose are points that ankle and head carry.
_SIDED = {"Shoulder": "shoulder", "Elbow": "elbow", "Wrist": "wrist", "Hip": "hip", "Knee": "knee", "Ankle": "ankle"}
MARKERS = (
    *(f"L{name}" for name in _SIDED), "LBigToe", *(f"R{name}" for name in _SIDED), "RBigToe", "Neck", "Head", "Nose",
)  # fmt: skip

_MANNEQUIN_JOINTS = {
    "pelvis": "Pelvis", "spine1": "Spine1", "spine2": "Spine2", "spine3": "Spine3", "neck": "Neck", "head": "Head",
} | {
    f"{side}_{joint}": f"{letter}_{name}"
    for side, letter in (("left", "L"), ("right", "R"))
    for joint, name in (("clavicle", "Collar"), *((joint, name) for name, joint in _SIDED.items()))
}  # fmt: skip
_BODY_FROM_MANNEQUIN = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Body:
    """A body in its rest pose.

    Parameters
    ----------
    name : for messages.
    vertices : (n, 3) meters.
    faces : (m, 3) int32, outward by the right hand.
    joints : (20, 3) meters, in the order of `JOINTS`.
    weight_joints, weights : (n, 4) joints that carry a vertex, and by how much.
    toes : (2, 3) base of the big toe, left and right.
    eyes : (n,) bool.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    joints: np.ndarray
    weight_joints: np.ndarray
    weights: np.ndarray
    toes: np.ndarray
    eyes: np.ndarray

    def joint(self, name: str) -> np.ndarray:
        """(3,) place of a joint."""
        return self.joints[JOINTS.index(name)]

    @property
    def stature(self) -> float:
        return float(np.ptp(self.vertices[:, 2]))

    @property
    def leg_length(self) -> float:
        """Meters from hip to ankle, along the bones."""
        hip, knee, ankle = (self.joint(f"left_{name}") for name in ("hip", "knee", "ankle"))
        return float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))

    def weight_of(self, *joints: str) -> np.ndarray:
        """(n,) how much some joints carry each vertex."""
        rows = [JOINTS.index(joint) for joint in joints]
        return np.where(np.isin(self.weight_joints, rows), self.weights, 0.0).sum(axis=1)

    @property
    def crown(self) -> np.ndarray:
        """(3,) highest point of the head."""
        return self.vertices[np.argmax(self.vertices[:, 2])]

    @property
    def nose(self) -> np.ndarray:
        """(3,) tip of the nose: the foremost point of the head, between the eyes and the chin."""
        middle = (self.weight_of("head") > 0.5) & (np.abs(self.vertices[:, 1] - self.crown[1]) < 0.02)
        return self.vertices[np.argmax(np.where(middle, self.vertices[:, 0], -np.inf))]

    def markers(self) -> tuple[np.ndarray, np.ndarray]:
        """Markers in the rest pose.

        Returns
        -------
        (17, 3) places, meters, in the order of `MARKERS`.
        (17,) joint that carries each.
        """
        held = {"Neck": ("neck", self.joint("neck")), "Head": ("head", self.crown), "Nose": ("head", self.nose)}
        for letter, side, toe in (("L", "left", self.toes[0]), ("R", "right", self.toes[1])):
            held |= {f"{letter}{n}": (f"{side}_{j}", self.joint(f"{side}_{j}")) for n, j in _SIDED.items()}
            held[f"{letter}BigToe"] = (f"{side}_ankle", toe)
        return np.array([held[m][1] for m in MARKERS]), np.array([JOINTS.index(held[m][0]) for m in MARKERS])


def load_body(name: str, folder: Path) -> Body:
    """A body by name.

    Parameters
    ----------
    name : of a file in the folder, or ``mannequin``.
    folder : of the files of `_write_bodies`.

    Returns
    -------
    The body.

    Raises
    ------
    SourceError : no such file; says how to write it.
    """
    if name == MANNEQUIN:
        return mannequin_body()
    path = folder / f"{name}.npz"
    if not path.is_file():
        raise SourceError(path, f"no such body; write all of them by: {FIRST_STEP.format(folder=folder)}")
    with np.load(path, allow_pickle=False) as arrays:
        return Body(name, **{key: arrays[key] for key in arrays.files})


def mannequin_body(stature: float = MANNEQUIN_STATURE_M) -> Body:
    """The wooden body of mannequin-x, its arms to the sides."""
    from mannequin import Mannequin

    model = Mannequin("wooden")
    rest = model.rest_pose(dtype=np.float64)
    vertices = model.vertices(rest) @ _BODY_FROM_MANNEQUIN.T
    places = model.joint_transforms(rest)[:, :3, 3] @ _BODY_FROM_MANNEQUIN.T
    names = list(model.joint_names)
    scale = stature / np.ptp(vertices[:, 2])
    floor = np.array([0.0, 0.0, vertices[:, 2].min()])
    carried = _carried(names, list(model.parents))
    return Body(
        MANNEQUIN,
        (vertices - floor) * scale,
        np.asarray(model.faces, dtype=np.int32),
        (np.array([places[names.index(_MANNEQUIN_JOINTS[j])] for j in JOINTS]) - floor) * scale,
        carried[np.asarray(model._skin_joint_indices)].astype(np.int32),
        np.asarray(model._skin_weights, dtype=np.float32),
        (np.array([places[names.index(f"{letter}_Foot")] for letter in "LR"]) - floor) * scale,
        np.zeros(len(vertices), dtype=bool),
    )


def _carried(names: list[str], parents: list[int]) -> np.ndarray:
    """Joint of `JOINTS` that carries each joint of the mannequin."""
    own = {theirs: JOINTS.index(ours) for ours, theirs in _MANNEQUIN_JOINTS.items()}
    found: list[int] = []
    for i, name in enumerate(names):
        found.append(own.get(name, found[parents[i]] if i else 0))
    return np.array(found)
