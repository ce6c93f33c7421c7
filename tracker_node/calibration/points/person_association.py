"""Which of the people found in each image is the one that all cameras see."""

from __future__ import annotations

import itertools

import numpy as np

from ...camera.rig import CameraRig
from .triangulation import reproject, triangulate

MIN_JOINTS = 6  # fewer joints in common say too little about who is who


def associate_people(rig: CameraRig, people: list[np.ndarray], threshold_px: float = 60.0) -> tuple[np.ndarray, int]:
    """The person whom most cameras agree on, in one image set.

    Every pair of people in two cameras proposes one: their joints are triangulated, and each other camera joins with whoever lies
    nearest to the projections, if near enough. The proposal with most joints explained wins.

    Parameters
    ----------
    rig : cameras; their poses may be off by what ``threshold_px`` allows.
    people : per camera (n_people, n_joints, 3): u, v, confidence.
    threshold_px : median distance beyond which two people are not the same.

    Returns
    -------
    joints : (n_cameras, n_joints, 3): u, v, confidence of the person; zeros where a camera has not seen them.
    n_cameras : how many cameras see the person, 0 when no two agree.
    """
    n_joints = max((group.shape[1] for group in people if len(group)), default=0)
    best, best_score = np.zeros((len(rig), n_joints, 3)), (0, 0.0)
    for a, b in itertools.combinations(range(len(rig)), 2):
        for first, second in itertools.product(people[a], people[b]):
            joints, score = _complete(rig, people, {a: first, b: second}, n_joints, threshold_px)
            if score > best_score:
                best, best_score = joints, score
    return best, best_score[0]


def _complete(rig, people, chosen: dict[int, np.ndarray], n_joints: int, threshold_px: float):
    """A pair of people, joined by the nearest of every other camera: joints, (number of cameras, minus median distance)."""
    joints = np.zeros((len(rig), n_joints, 3))
    for camera, person in chosen.items():
        joints[camera] = person
    distances = _distances(rig, joints)
    if distances is None or any(_median(distances[c], joints[c]) > threshold_px for c in chosen):
        return joints, (0, 0.0)
    points, valid = _points(rig, joints)
    pixels, visible = reproject([c.model for c in rig], np.array([c.T_world_cam for c in rig]), points)
    for camera in set(range(len(rig))) - set(chosen):
        nearest = threshold_px
        for person in people[camera]:
            common = valid & visible[:, camera] & (person[:, 2] > 0.0)
            if common.sum() >= MIN_JOINTS:
                distance = float(np.median(np.linalg.norm(person[common, :2] - pixels[common, camera], axis=-1)))
                if distance < nearest:
                    nearest, joints[camera] = distance, person
    distances = _distances(rig, joints)
    used = [c for c in range(len(rig)) if joints[c, :, 2].any()]
    if distances is None:
        return joints, (0, 0.0)
    return joints, (len(used), -float(np.mean([_median(distances[c], joints[c]) for c in used])))


def _points(rig, joints):
    models, transforms = [c.model for c in rig], np.array([c.T_world_cam for c in rig])
    return triangulate(models, transforms, np.swapaxes(joints[..., :2], 0, 1), joints[..., 2].T)


def _distances(rig, joints) -> np.ndarray | None:
    """(n_cameras, n_joints) px from the projections of the joints' own triangulation (infinite without); None if too few."""
    points, valid = _points(rig, joints)
    if valid.sum() < MIN_JOINTS:
        return None
    pixels, _ = reproject([c.model for c in rig], np.array([c.T_world_cam for c in rig]), points)
    distances = np.linalg.norm(np.swapaxes(pixels, 0, 1) - joints[..., :2], axis=-1)
    return np.where(valid, distances, np.inf)


def _median(distances: np.ndarray, joints: np.ndarray) -> float:
    known = (joints[:, 2] > 0.0) & np.isfinite(distances)
    return float(np.median(distances[known])) if known.any() else np.inf
