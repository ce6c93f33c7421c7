"""Better camera poses from two-dimensional joints of whoever was in the room.

Calibrations drift: a tripod is touched, or the calibration came with another lens setting. The joints that a network finds in all
cameras at once are thousands of correspondences; their bundle adjustment shows, and mends, what the calibration has wrong.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...camera.rig import CameraRig
from ...errors import CalibrationError, UnknownNameError
from ...geometry import se3, so3
from ...loaders.keypoints.camera_people import match_files
from ...loaders.keypoints.formats import load_points
from ...observation.keypoints.people import People
from .bundle_adjustment import Adjustment, AdjustmentOptions, PointObservations, adjust
from .triangulation import reproject, triangulate

MIN_POINTS = 20  # fewer do not hold six numbers a camera
SAME_PERSON_PX = 60.0  # median distance beyond which two people are not the same
MIN_JOINTS = 6  # fewer joints in common say too little about who is who


@dataclass(frozen=True)
class CameraChange:
    """What the refinement did for one camera.

    Parameters
    ----------
    rms_before_px, rms_after_px, median_before_px, median_after_px : distance of its 2D points from the projected ones.
    moved_m, turned_rad : how far its center and its axes went, in the world.
    lag_images : by how many images its points come late against the other cameras' (for information; nothing is shifted).
    n_points : how many of its 2D points were used.
    """

    rms_before_px: float
    rms_after_px: float
    median_before_px: float
    median_after_px: float
    moved_m: float
    turned_rad: float
    lag_images: float
    n_points: int


@dataclass(frozen=True)
class Refinement:
    """A refined rig and what changed.

    Parameters
    ----------
    rig : the cameras in their new places, in the world frame of the old ones.
    points, valid : (n_images, n_joints, 3) and (n_images, n_joints): the joints in the world, meters.
    cameras : changes by camera name.
    shift_m : root mean square distance between the joints as triangulated with the old rig and with the new one.
    iterations, converged : of the bundle adjustment.
    """

    rig: CameraRig
    points: np.ndarray
    valid: np.ndarray
    cameras: dict[str, CameraChange]
    shift_m: float
    iterations: int
    converged: bool

    def metrics(self) -> dict[str, float | int]:
        """``refine.<camera>.<key>``, and those of all cameras together."""
        metrics: dict[str, float | int] = {
            "refine.iterations": self.iterations,
            "refine.converged": int(self.converged),
            "refine.joint_shift_mm": 1000.0 * self.shift_m,
        }
        squares, total = {"before": 0.0, "after": 0.0}, 0
        for name, camera in self.cameras.items():
            total += camera.n_points
            for when in squares:
                rms = getattr(camera, f"rms_{when}_px")
                squares[when] += camera.n_points * rms**2
                metrics[f"refine.{name}.rms_{when}_px"] = rms
                metrics[f"refine.{name}.median_{when}_px"] = getattr(camera, f"median_{when}_px")
            metrics[f"refine.{name}.moved_mm"] = 1000.0 * camera.moved_m
            metrics[f"refine.{name}.turned_deg"] = math.degrees(camera.turned_rad)
            metrics[f"refine.{name}.lag_images"] = camera.lag_images
        for when, square in squares.items():
            metrics[f"refine.rms_{when}_px"] = math.sqrt(square / max(total, 1))
        return metrics

    def table(self) -> str:
        """The metrics of each camera as lines, then those of all."""
        lines = [f"{'camera':12} {'joints':>7} {'rms px':>16} {'median px':>16} {'moved':>9} {'turned':>9} {'late':>12}"]
        for name, camera in self.cameras.items():
            rms = f"{camera.rms_before_px:6.2f} -> {camera.rms_after_px:6.2f}"
            median = f"{camera.median_before_px:6.2f} -> {camera.median_after_px:6.2f}"
            moves = f"{1000 * camera.moved_m:6.1f} mm {math.degrees(camera.turned_rad):5.2f} deg {camera.lag_images:z5.2f} images"
            lines.append(f"{name:12} {camera.n_points:7d} {rms} {median} {moves}")
        overall = self.metrics()
        rms = f"{overall['refine.rms_before_px']:.2f} -> {overall['refine.rms_after_px']:.2f} px"
        lines.append(f"all cameras: rms {rms}; the joints move by")
        shift = f"{overall['refine.joint_shift_mm']:.1f} mm (rms)"
        return "\n".join([*lines, f"{shift}, the world frame stays ({self.iterations} iterations)"])


def load_joints(path: str | Path, rig: CameraRig) -> np.ndarray:
    """Joints of one person in the files of any detector (`collect_joints`).

    Parameters
    ----------
    path : file or folder, see `load_points`.
    rig : cameras for the images in which the detector has looked.

    Returns
    -------
    (n_images, n_joints, n_cameras, 3) u, v, confidence.

    Raises
    ------
    UnknownNameError : a camera has no points.
    FileFormatError, CalibrationError : damaged files, or people who do not fit together.
    """
    points = load_points(path, None)
    files = match_files(points, rig.names)
    for camera in rig:
        if camera.name not in files:
            raise UnknownNameError("2D points for camera", camera.name, points)
    found = [points[files[camera.name]].for_images(camera.model.width, camera.model.height) for camera in rig]
    images = sorted(set().union(*found))
    return collect_joints(rig, [[people_table(people.get(image, ())) for image in images] for people in found])


def people_table(people: People) -> np.ndarray:
    """(n_people, n_joints, 3) u, v, confidence."""
    if not people:
        return np.zeros((0, 0, 3))
    return np.array([np.column_stack([person.pixels, person.scores]) for person in people])


def collect_joints(rig: CameraRig, people: Sequence[Sequence[np.ndarray]]) -> np.ndarray:
    """Joints of the one person whom the cameras agree on.

    Parameters
    ----------
    rig : the cameras.
    people : per camera, per image: (n_people, n_joints, 3). Images beyond the shortest camera's are left out.

    Returns
    -------
    (n_images, n_joints, n_cameras, 3) u, v, confidence.

    Raises
    ------
    CalibrationError : for a camera that sees nobody the others see, or whose people have another number of joints.
    """
    n_images = min(len(images) for images in people)
    n_joints = 0
    for camera, images in zip(rig, people, strict=True):
        for group in images:
            if len(group) and n_joints not in (0, group.shape[1]):
                raise CalibrationError(camera.name, f"its people have {group.shape[1]} joints, those before them {n_joints}")
            n_joints = group.shape[1] if len(group) else n_joints
    joints = np.zeros((n_images, n_joints, len(rig), 3))
    for i in range(n_images):
        found, n_cameras = associate_people(rig, [images[i] for images in people])
        if n_cameras >= 2:
            joints[i] = np.swapaxes(found, 0, 1)
    for index, camera in enumerate(rig):
        if np.count_nonzero(joints[:, :, index, 2]) < MIN_POINTS:
            raise CalibrationError(camera.name, "none of its people is seen by another camera; are its points its own?")
    return joints


def refine_rig(
    rig: CameraRig, joints: np.ndarray, options: AdjustmentOptions | None = None, min_confidence: float = 0.3
) -> Refinement:
    """Camera poses that agree with the joints, in the world frame of the given rig.

    The bundle adjustment holds the first camera; the result as a whole is then moved, without change of scale, so that the
    joints lie as near as can be to where the given rig puts them. The world frame, to which recorded data may refer, so
    stays what it was.

    Parameters
    ----------
    rig : cameras for the pixels of the joints.
    joints : (n_images, n_joints, n_cameras, 3): u, v, confidence.
    options : of the bundle adjustment.
    min_confidence : joints below it are not used.

    Returns
    -------
    The refined rig, the joints, and what changed.

    Raises
    ------
    CalibrationError : when fewer than 20 joints are seen by two cameras.
    """
    options = options or AdjustmentOptions()
    n_images, n_joints, n_cameras = joints.shape[:3]
    confidence = np.where(joints[..., 2] >= min_confidence, joints[..., 2], 0.0).reshape(-1, n_cameras)
    observations = PointObservations(joints[..., :2].reshape(-1, n_cameras, 2), confidence)
    if np.count_nonzero(np.count_nonzero(confidence, axis=1) >= 2) < MIN_POINTS:
        raise CalibrationError(", ".join(rig.names), f"fewer than {MIN_POINTS} joints are seen by two cameras")
    before = adjust(rig, observations, replace(options, free_cameras=False))
    after = adjust(rig, observations, options)
    both = before.valid & after.valid
    T_old_new = rigid_alignment(after.points[both], before.points[both])
    transforms = T_old_new @ after.Ts_world_cam
    refined = tuple(replace(camera, T_world_cam=se3.nearest_rigid(T)) for camera, T in zip(rig, transforms, strict=True))
    points = np.where(after.valid[:, None], se3.apply(T_old_new, after.points), 0.0)
    shift = np.linalg.norm(points[both] - before.points[both], axis=-1)
    new_rig = replace(rig, cameras=refined)
    grid, valid = points.reshape(n_images, n_joints, 3), after.valid.reshape(n_images, n_joints)
    lags = _lags(new_rig, grid, valid, after.residuals_px.reshape(n_images, n_joints, n_cameras, 2))
    return Refinement(
        new_rig, grid, valid, _figures(rig, new_rig, confidence, before, after, lags),
        float(np.sqrt(np.mean(shift**2))), after.iterations, after.converged,
    )  # fmt: skip


def rigid_alignment(points: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Rotation and translation between two sets of points (Kabsch), far pairs counting less.

    Each round weights pairs by 1 / (s^2 + d^2), s the median distance: a Cauchy loss.

    Parameters
    ----------
    points, targets : (n, 3).

    Returns
    -------
    T (4, 4) with ``targets`` near T @ ``points``.
    """
    transform, weights = np.eye(4), np.ones(len(points))
    for _ in range(20):
        transform = se3.rigid_fit(points, targets, weights)
        squares = np.sum((se3.apply(transform, points) - targets) ** 2, axis=-1)
        weights = 1.0 / (max(float(np.median(squares)), 1e-12) + squares)
    return transform


def _figures(old, new, confidence, before: Adjustment, after: Adjustment, lags) -> dict[str, CameraChange]:
    result = {}
    used = (confidence > 0.0) & (before.valid & after.valid)[:, None]
    for i, (a, b) in enumerate(zip(old, new, strict=True)):
        distances = [np.linalg.norm(x.residuals_px[used[:, i], i], axis=-1) for x in (before, after)]
        rms = [float(np.sqrt(np.mean(d**2))) if d.size else 0.0 for d in distances]
        medians = [float(np.median(d)) if d.size else 0.0 for d in distances]
        result[a.name] = CameraChange(
            rms_before_px=rms[0],
            rms_after_px=rms[1],
            median_before_px=medians[0],
            median_after_px=medians[1],
            moved_m=float(np.linalg.norm(a.center - b.center)),
            turned_rad=float(np.linalg.norm(so3.log(a.T_world_cam[:3, :3].T @ b.T_world_cam[:3, :3]))),
            lag_images=lags[i],
            n_points=int(used[:, i].sum()),
        )
    return result


def _lags(rig: CameraRig, points: np.ndarray, valid: np.ndarray, residuals_px: np.ndarray) -> list[float]:
    """Per camera, how many images its points come late: residuals against the image velocity of the projected joints.

    A camera that shows at image i what was at i - lag has residuals (projected - seen) of lag times the velocity.
    """
    result = []
    steady = valid[2:] & valid[1:-1] & valid[:-2]
    for index, camera in enumerate(rig):
        pixels, visible = camera.project(points)
        velocity = 0.5 * (pixels[2:] - pixels[:-2])
        residual = residuals_px[1:-1, :, index]
        seen = steady & visible[1:-1] & np.any(residual != 0.0, axis=-1)
        weights = seen / (64.0 + np.sum(residual**2, axis=-1))
        top = float(np.sum(weights * np.sum(residual * velocity, axis=-1)))
        bottom = float(np.sum(weights * np.sum(velocity**2, axis=-1)))
        result.append(top / bottom if bottom > 0.0 else 0.0)
    return result


def associate_people(rig: CameraRig, people: list[np.ndarray]) -> tuple[np.ndarray, int]:
    """The person whom most cameras agree on, in one image set.

    Every pair of people in two cameras proposes one: their joints are triangulated, and each other camera joins with whoever lies
    nearest to the projections, if near enough. The proposal with most joints explained wins.

    Parameters
    ----------
    rig : cameras; their poses may be off by what `SAME_PERSON_PX` allows.
    people : per camera (n_people, n_joints, 3): u, v, confidence.

    Returns
    -------
    joints : (n_cameras, n_joints, 3): u, v, confidence of the person; zeros where a camera has not seen them.
    n_cameras : how many cameras see the person, 0 when no two agree.
    """
    n_joints = max((group.shape[1] for group in people if len(group)), default=0)
    best, best_score = np.zeros((len(rig), n_joints, 3)), (0, 0.0)
    for a, b in itertools.combinations(range(len(rig)), 2):
        for first, second in itertools.product(people[a], people[b]):
            joints, score = _complete(rig, people, {a: first, b: second}, n_joints)
            if score > best_score:
                best, best_score = joints, score
    return best, best_score[0]


def _complete(rig, people, chosen: dict[int, np.ndarray], n_joints: int):
    """A pair of people, joined by the nearest of every other camera: joints, (number of cameras, minus median distance)."""
    joints = np.zeros((len(rig), n_joints, 3))
    for camera, person in chosen.items():
        joints[camera] = person
    distances = _distances(rig, joints)
    if distances is None or any(_median(distances[c], joints[c]) > SAME_PERSON_PX for c in chosen):
        return joints, (0, 0.0)
    points, valid = _points(rig, joints)
    pixels, visible = reproject([c.model for c in rig], np.array([c.T_world_cam for c in rig]), points)
    for camera in set(range(len(rig))) - set(chosen):
        nearest = SAME_PERSON_PX
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
