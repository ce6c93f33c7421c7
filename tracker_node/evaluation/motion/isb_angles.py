"""Joint angles of a person as the International Society of Biomechanics recommends them, from the segments of the body model.

A segment's axes are X forward, Y up along it, Z to the right: those of the model's links (x forward, y left, z up in the neutral
pose) renamed. The left side is mirrored in the sagittal plane, so that what holds for the right holds for it too. A joint's
angles are those of the turn from the proximal to the distal segment in three steps, of which the first axis is fixed to the one
and the last to the other (Grood & Suntay, J. Biomech. Eng. 105 (1983) 136-144): the same as three successive turns.

Sources: Wu et al., J. Biomech. 35 (2002) 543-548, for ankle, hip and spine, the knee in the same way after Grood & Suntay; Wu et
al., J. Biomech. 38 (2005) 981-992, for clavicle and arm against the thorax, elbow and wrist; toes, and the two parts of a spine,
in the same way as ankle and spine. Signs are turned where that makes a positive angle do what its name says: successive
right-handed turns would count extension of knee and spine and depression of arm and clavicle positive.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import ModelError
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...runs.motion import RunMotion

# link axes (x forward, y left, z up) of the ISB's X, Y, Z, as columns
LINK_FROM_ISB = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
SIDES = ("right", "left")
_MIRROR = np.diag([1.0, 1.0, -1.0])
_PALM = ("forearm", "hand")  # their X points out of the palm, which faces inward in the model's neutral pose
_PALM_FROM_LINK = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # 90 degrees about Y
_NO_PLANE = 1e-6  # rad of elevation: below, the plane of elevation is put to 0
_NO_TURN = 1e-9  # rad: what rounding makes of an angle that a body does not have
_TRUNK = ("abdomen", "torso", "chest")  # the last one that the body has is its thorax, the one before its lumbar spine


@dataclass(frozen=True)
class _JointAngles:
    """How one joint's angles are named: the turns ``sequence`` about successive axes, times ``signs``."""

    joint: str
    proximal: str
    distal: str
    sequence: str
    names: tuple[str, str, str]
    signs: tuple[float, float, float] = (1.0, 1.0, 1.0)


_BENDS = (-1.0, 1.0, 1.0)
_TRUNK_TABLE = (
    _JointAngles("Spine", "pelvis", "thorax", "ZXY", ("spine_flexion", "spine_bend_right", "spine_turn_left"), _BENDS),
    _JointAngles("Lumbar", "pelvis", "lumbar", "ZXY", ("lumbar_flexion", "lumbar_bend_right", "lumbar_turn_left"), _BENDS),
    _JointAngles("Thorax", "lumbar", "thorax", "ZXY", ("thorax_flexion", "thorax_bend_right", "thorax_turn_left"), _BENDS),
    _JointAngles("Neck", "thorax", "head", "ZXY", ("neck_flexion", "neck_bend_right", "neck_turn_left"), _BENDS),
)
_LIMB_TABLE = (
    _JointAngles("Hip", "pelvis", "thigh", "ZXY", ("hip_flexion", "hip_adduction", "hip_internal_rotation")),
    _JointAngles("Knee", "thigh", "shank", "ZXY", ("knee_flexion", "knee_adduction", "knee_internal_rotation"), (-1.0, 1.0, 1.0)),
    _JointAngles("Ankle", "shank", "foot", "ZXY", ("ankle_dorsiflexion", "ankle_inversion", "ankle_internal_rotation")),
    _JointAngles("Toes", "foot", "toes", "ZXY", ("toes_extension", "toes_inversion", "toes_internal_rotation")),
    _JointAngles(
        "Clavicle", "thorax", "clavicle", "YXZ",
        ("clavicle_protraction", "clavicle_elevation", "clavicle_backward_rotation"), (1.0, -1.0, 1.0),
    ),
    _JointAngles(
        "Shoulder", "thorax", "upper_arm", "YXY",
        ("shoulder_plane_of_elevation", "shoulder_elevation", "shoulder_internal_rotation"), (1.0, -1.0, 1.0),
    ),
    _JointAngles("Elbow", "upper_arm", "forearm", "ZXY", ("elbow_flexion", "elbow_carrying_angle", "elbow_pronation")),
    _JointAngles("Wrist", "forearm", "hand", "ZXY", ("wrist_flexion", "wrist_ulnar_deviation", "wrist_internal_rotation")),
)  # fmt: skip
_CARDAN_SHOULDER = _JointAngles(
    "Shoulder", "thorax", "upper_arm", "ZXY", ("shoulder_flexion", "shoulder_adduction", "shoulder_internal_rotation")
)


@dataclass(frozen=True, eq=False)
class JointAngles:
    """Angles of j joints over time.

    ``joints`` like ``LeftKnee``; ``names`` (j) of three angles each, ``left_knee_flexion``; ``radians`` (n, j, 3); ``valid``
    (n, j), where both segments are known. ``turns`` (j, 3): whether the body's joints can change the angle at all.
    """

    joints: tuple[str, ...]
    names: tuple[tuple[str, str, str], ...]
    radians: np.ndarray
    valid: np.ndarray
    turns: np.ndarray

    def columns(self) -> tuple[list[str], np.ndarray, np.ndarray]:
        """Names (k), radians and validity (n, k) of the angles that turn: a knee that is a hinge has no adduction."""
        names = [name for triple, turns in zip(self.names, self.turns, strict=True) for name in np.array(triple)[turns].tolist()]
        valid = np.repeat(self.valid[..., None], 3, axis=2)
        return names, self.radians[:, self.turns], valid[:, self.turns]


def isb_angles(motion: RunMotion) -> JointAngles:
    """Every joint that the body can move, of those that the recommendations name; zeros where the motion is not valid.

    Angles go on over 180 degrees. An arm that hangs along the thorax has no plane of elevation: there only the sum of this angle
    and the internal rotation means anything.

    Raises
    ------
    ModelError : a body without any two neighboring segments of a person.
    """
    return _angles(motion, _TRUNK_TABLE, _LIMB_TABLE)


def cardan_angles(motion: RunMotion) -> JointAngles:
    """As `isb_angles`, but the arm against the thorax as the thigh against the pelvis, as models of OpenSim count it."""
    return _angles(motion, _TRUNK_TABLE, tuple(_CARDAN_SHOULDER if row.joint == "Shoulder" else row for row in _LIMB_TABLE))


def angles_of_segments(rotations: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The angles of `isb_angles` from rotations of segments, of whatever body.

    Parameters
    ----------
    rotations : ``R_world_segment`` (n, 3, 3) by link, ``left_thigh``; axes forward, left, up in the neutral pose.

    Returns
    -------
    Radians (n,) by name, of every joint both of whose segments are given.
    """
    found: dict[str, np.ndarray] = {}
    for side, row, proximal, distal in _pairs(rotations, _TRUNK_TABLE, _LIMB_TABLE):
        turned = rotations[proximal], rotations[distal]
        angles = _decomposed(*turned, row, side == "left", np.ones(len(turned[0]), dtype=np.bool_))
        found.update(zip(_named(row, side), angles.T, strict=True))
    return found


def _angles(motion: RunMotion, trunk: tuple[_JointAngles, ...], limbs: tuple[_JointAngles, ...]) -> JointAngles:
    rotations, links_valid = motion.Ts_world_link()[..., :3, :3], motion.links_valid()
    joints, names, angles, valid, turns = [], [], [], [], []
    poses = _poses(motion.model)
    for side, row, proximal, distal in _pairs(motion.model.chain.links, trunk, limbs):
        if not _moves(motion.model, proximal, distal):
            continue
        pair = [motion.model.chain.link_index(link) for link in (proximal, distal)]
        turned = rotations[:, pair]
        joints.append(side.capitalize() + row.joint)
        names.append(_named(row, side))
        angles.append(_decomposed(turned[:, 0], turned[:, 1], row, side == "left", motion.valid))
        valid.append(links_valid[:, pair].all(axis=1))
        turns.append(_turning(poses[:, pair], row, side == "left"))
    if not joints:
        raise ModelError(f"joint angles: '{motion.model.name}' has no two segments of a person that meet (pelvis, left_thigh...)")
    return JointAngles(tuple(joints), tuple(names), np.stack(angles, axis=1), np.stack(valid, axis=1), np.array(turns))


def _turning(posed: np.ndarray, row: _JointAngles, left: bool) -> np.ndarray:
    """(3,) whether an angle differs between any two poses (n, 2, 3, 3) of the joint's segments."""
    angles = _decomposed(posed[:, 0], posed[:, 1], row, left, np.ones(len(posed), dtype=np.bool_))
    return np.ptp(angles, axis=0) > _NO_TURN


def _poses(model: ArticulatedModel) -> np.ndarray:
    """(n, links, 3, 3) rotations of all links in a few poses that have no joint's angle in common."""
    rng = np.random.default_rng(1)
    poses = [State(np.eye(4), rng.uniform(-0.4, 0.4, model.chain.n_axes)) for _ in range(4)]
    return np.array([Configuration(model, pose).Ts_world_link[:, :3, :3] for pose in poses])


def _named(row: _JointAngles, side: str) -> tuple[str, str, str]:
    first, second, third = (f"{side}_{name}" if side else name for name in row.names)
    return first, second, third


def _pairs(
    names: Iterable[str], trunk: tuple[_JointAngles, ...], limbs: tuple[_JointAngles, ...]
) -> Iterator[tuple[str, _JointAngles, str, str]]:
    """Side, joint, proximal and distal link of every joint of the tables whose links are there."""
    links = _segments(names)
    for side, row in [*(("", row) for row in trunk), *((side, row) for side in SIDES for row in limbs)]:
        proximal, distal = (links.get((side, part)) or links.get(("", part)) for part in (row.proximal, row.distal))
        if proximal is not None and distal is not None:
            yield side, row, proximal, distal


def _segments(names: Iterable[str]) -> dict[tuple[str, str], str]:
    """Link of each (side, segment): the segments of the recommendations under the names that the bodies here use."""
    found = {}
    for link in names:
        side = next((side for side in SIDES if link.startswith(f"{side}_")), "")
        found[side, link.removeprefix(f"{side}_")] = link
    trunk = [link for link in _TRUNK if ("", link) in found]
    if trunk:
        found["", "thorax"] = trunk[-1]
    if len(trunk) > 1:
        found["", "lumbar"] = trunk[-2]
    for side in SIDES:
        if (side, "clavicle") not in found and (side, "shoulder") in found:
            found[side, "clavicle"] = found[side, "shoulder"]
    return found


def _moves(model: ArticulatedModel, proximal: str, distal: str) -> bool:
    """True where ``distal`` hangs on ``proximal`` by joints that turn."""
    chain = model.chain
    link, first = chain.link_index(distal), chain.link_index(proximal)
    turns = 0
    while link not in (first, -1):
        turns += int(chain.axis_count[link])
        link = int(chain.parents[link])
    return link == first and turns > 0


def _decomposed(proximal: np.ndarray, distal: np.ndarray, row: _JointAngles, left: bool, valid: np.ndarray) -> np.ndarray:
    """Angles (n, 3) of a joint between segments turned by ``proximal`` and ``distal`` (n, 3, 3), links' axes."""
    relative = LINK_FROM_ISB.T @ np.swapaxes(proximal, 1, 2) @ distal @ LINK_FROM_ISB
    if left:
        relative = _MIRROR @ relative @ _MIRROR
    relative = _own_axes(row.proximal).T @ relative @ _own_axes(row.distal)
    angles = np.zeros((len(relative), 3))
    angles[valid] = np.unwrap(_turns(relative[valid], row.sequence), axis=0) * row.signs
    return angles


def _own_axes(segment: str) -> np.ndarray:
    return _PALM_FROM_LINK if segment in _PALM else np.eye(3)


def _turns(rotations: np.ndarray, sequence: str) -> np.ndarray:
    angles = Rotation.from_matrix(rotations).as_euler(sequence, suppress_warnings=True)
    if sequence[0] == sequence[2]:  # scipy's middle angle is positive; the arm's elevation is a negative turn about X
        angles = angles * [1.0, -1.0, 1.0] + np.array([np.pi, 0.0, np.pi])
        hangs = np.abs(angles[:, 1]) < _NO_PLANE
        angles[hangs, 2], angles[hangs, 0] = angles[hangs, 0] + angles[hangs, 2], 0.0
        angles[:, [0, 2]] = (angles[:, [0, 2]] + np.pi) % (2.0 * np.pi) - np.pi
    return angles
