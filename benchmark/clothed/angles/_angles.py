"""Angles of tracked states with their standard deviations, and their errors beside exact ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tracker_node.evaluation.motion.isb_angles import angles_of_segments
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import N_ROOT_DOF

STEP_RAD = 1e-4  # of derivatives by differences
FLEXION, ABDUCTION, AXIAL = "flexion", "abduction", "axial"
TARGETS_DEG = {FLEXION: 2.0, ABDUCTION: 4.0, AXIAL: 8.0}
SURE_DEG = 8.0  # an axial rotation whose own sigma is larger counts as unobservable
KINDS: Mapping[str, str] = {
    "spine_flexion": FLEXION, "spine_bend_right": ABDUCTION, "spine_turn_left": AXIAL,
    "neck_flexion": FLEXION, "neck_bend_right": ABDUCTION, "neck_turn_left": AXIAL,
    "hip_flexion": FLEXION, "hip_adduction": ABDUCTION, "hip_internal_rotation": AXIAL,
    "knee_flexion": FLEXION, "knee_internal_rotation": AXIAL,
    "ankle_dorsiflexion": FLEXION, "ankle_inversion": ABDUCTION,
    "clavicle_protraction": ABDUCTION, "clavicle_elevation": ABDUCTION, "clavicle_backward_rotation": AXIAL,
    "shoulder_plane_of_elevation": AXIAL, "shoulder_elevation": ABDUCTION, "shoulder_internal_rotation": AXIAL,
    "elbow_flexion": FLEXION, "elbow_pronation": AXIAL,
    "wrist_flexion": FLEXION, "wrist_ulnar_deviation": ABDUCTION,
}  # fmt: skip
"""Angle that the body can take -> which target holds. The plane of elevation turns about the thorax's long axis, and has no
meaning in hanging arms."""


def angles_with_sigmas(
    model: ArticulatedModel, states: Sequence[State], covariances: Sequence[np.ndarray]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The ISB angles of states, and what their covariances make of them to first order.

    Parameters
    ----------
    model : the body.
    states, covariances : of n image sets; (n_dof, n_dof) each.

    Returns
    -------
    Angle -> values and standard deviations (n,), radians.
    """
    here = _angles(model, states)
    derivatives = {name: np.zeros((len(states), model.n_dof)) for name in here}
    for k in range(N_ROOT_DOF, model.n_dof):  # the root turns all segments alike
        step = STEP_RAD * np.eye(model.n_dof)[k]
        ahead, back = (_angles(model, [state.retract(sign * step) for state in states]) for sign in (1.0, -1.0))
        for name, D in derivatives.items():
            D[:, k] = wrapped(ahead[name] - back[name]) / (2.0 * STEP_RAD)
    sigmas = {n: np.sqrt([d @ C @ d for d, C in zip(D, covariances, strict=True)]) for n, D in derivatives.items()}
    return {name: (here[name], sigmas[name]) for name in here}


def _angles(model: ArticulatedModel, states: Sequence[State]) -> dict[str, np.ndarray]:
    turned = np.array([Configuration(model, state).Ts_world_link[:, :3, :3] for state in states])
    return angles_of_segments(dict(zip(model.chain.links, turned.swapaxes(0, 1), strict=True)))


def wrapped(radians: np.ndarray) -> np.ndarray:
    """Differences of angles between -pi and pi."""
    return (radians + np.pi) % (2.0 * np.pi) - np.pi


@dataclass(frozen=True, eq=False)
class AngleErrors:
    """Of one angle on one side in one clip.

    Attributes
    ----------
    name : without the side.
    errors, sigmas : (n,) radians, of the image sets with a state.
    """

    name: str
    errors: np.ndarray
    sigmas: np.ndarray

    @property
    def counted(self) -> np.ndarray:
        """(n,) bool: all but axial rotations that are unobservable by their own sigma."""
        return (self.sigmas <= np.radians(SURE_DEG)) | (KINDS[self.name] != AXIAL)

    @property
    def free(self) -> np.ndarray:
        """Errors of the counted sets without their mean."""
        own = self.errors[self.counted]
        return own - own.mean() if len(own) else own


def errors_of(
    found: Mapping[str, tuple[np.ndarray, np.ndarray]], true: Mapping[str, np.ndarray], rows: np.ndarray
) -> list[AngleErrors]:
    """Errors of the angles that have a target.

    Parameters
    ----------
    found : angle -> values and sigmas of the image sets ``rows``, radians.
    true : angle -> values of all image sets.
    rows : (n,) which of them.

    Returns
    -------
    One for each angle and side.
    """
    result = []
    for name in true:
        plain = name.removeprefix("left_").removeprefix("right_")
        if name in found and plain in KINDS:
            values, sigmas = found[name]
            result.append(AngleErrors(plain, wrapped(values - true[name][rows]), sigmas))
    return result


@dataclass(frozen=True)
class AngleFigures:
    """Degrees over all sides and clips: without one constant offset each, raw; fraction of the sets that count."""

    rms_deg: float
    raw_deg: float
    fraction: float
    within_2_sigma: float


def figures(errors: Sequence[AngleErrors]) -> AngleFigures:
    """Of one angle, of all sides and clips."""
    free = np.concatenate([each.free for each in errors])
    raw = np.concatenate([each.errors[each.counted] for each in errors])
    sigmas = np.concatenate([each.sigmas[each.counted] for each in errors])
    n = sum(len(each.errors) for each in errors)
    if not len(free):
        return AngleFigures(float("nan"), float("nan"), 0.0, float("nan"))
    within = float(np.mean(np.abs(free) <= 2.0 * sigmas))
    return AngleFigures(*(float(np.degrees(np.sqrt(np.mean(each**2)))) for each in (free, raw)), len(free) / n, within)
