"""Cameras from control points of known place: the direct linear transformation (Abdel-Aziz & Karara 1971).

u = (L1 x + L2 y + L3 z + L4) / (L9 x + L10 y + L11 z + 1)
v = (L5 x + L6 y + L7 z + L8) / (L9 x + L10 y + L11 z + 1)

The eleven parameters are solved linearly in normalized coordinates, taken apart into lens and place, and refined so that the
squared distances in the image are least. Renderers and narrow calibrations want fewer parameters than eleven, and lenses
another, their distortion: `CONSTRAINTS` says which of them a camera may use, and the refinement finds the best camera within.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import rq
from scipy.optimize import least_squares

from ...camera.model import CameraModel
from ...camera.rig import Camera
from ...errors import CalibrationError
from ...geometry import se3
from ...loaders.rig.control_points import ControlPoints
from .triangulation import across_ray, rays_meet

# Free lens parameters of each constraint; the place always has its six.
CONSTRAINTS = {
    "none": ("fx", "fy", "skew", "cx", "cy"),  # as many as the eleven of the DLT
    "no_skew": ("fx", "fy", "cx", "cy"),
    "square": ("f", "cx", "cy"),
    "radial": ("f", "cx", "cy", "k1"),  # square pixels behind a lens that bends straight lines
    "centered": ("f",),  # the seven that Open Inventor had: one angle of view, and a place
}
MIN_POINTS = 6
_FLAT = 1e-3  # a cloud of points thinner than this fraction of its length is a plane
_RANK = 1e-5  # smallest but one singular value of the design matrix, relative to the largest
LARGEST_M = 200.0  # a volume for people and vehicles; in millimeters it would be 200 000
SMALLEST_M = 0.02
_FAR = 20.0  # times the usual distance from the middle


@dataclass(frozen=True, eq=False)
class DltCalibration:
    """A camera from control points.

    Attributes
    ----------
    camera : lens and place; without distortion but for "radial".
    residuals_px : (n, 2) pixels seen minus pixels of the camera.
    """

    camera: Camera
    residuals_px: np.ndarray

    @property
    def parameters(self) -> np.ndarray:
        """L1..L11 (11,) of a camera without distortion."""
        return dlt_parameters(self.camera)

    @property
    def rms_px(self) -> float:
        """Root mean square distance in the image."""
        return float(np.sqrt((self.residuals_px**2).sum(axis=1).mean()))


def calibrate(
    name: str, points: np.ndarray, pixels: np.ndarray, image_size: tuple[int, int], constraint: str = "none"
) -> DltCalibration:
    """The camera that sees control points in given pixels.

    Parameters
    ----------
    name : of the camera, for its frame and for messages.
    points : (n, 3) world, meters.
    pixels : (n, 2).
    image_size : (width, height).
    constraint : a key of `CONSTRAINTS`.

    Returns
    -------
    The camera and its residuals.

    Raises
    ------
    CalibrationError : fewer than `MIN_POINTS` points, points in one plane, pixels of a mirrored image or of no camera at all.
    """
    if constraint not in CONSTRAINTS:
        raise ValueError(f"expected a constraint of {tuple(CONSTRAINTS)}, got {constraint!r}")
    points, pixels = np.asarray(points, dtype=np.float64), np.asarray(pixels, dtype=np.float64)
    if points.shape != (len(points), 3) or pixels.shape != (len(points), 2):
        raise ValueError(f"expected points (n, 3) and pixels (n, 2), got {points.shape} and {pixels.shape}")
    K, T_world_cam = decompose(solve_linear(name, points, pixels), points, name)
    return _refine(name, points, pixels, image_size, constraint, K, T_world_cam)


def solve_linear(name: str, points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Projection matrix by the linear solution in normalized coordinates.

    Parameters
    ----------
    name : of the camera, for messages.
    points : (n, 3) world, meters.
    pixels : (n, 2).

    Returns
    -------
    (3, 4), of norm one and any sign.
    """
    _check_spread(name, points)
    T_points, T_pixels = _normalization(points), _normalization(pixels)
    x = np.column_stack([points, np.ones(len(points))]) @ T_points.T
    u, v = (np.column_stack([pixels, np.ones(len(pixels))]) @ T_pixels.T)[:, :2].T
    zero = np.zeros_like(x)
    design = np.vstack([np.hstack([x, zero, -u[:, None] * x]), np.hstack([zero, x, -v[:, None] * x])])
    _, singular, vt = np.linalg.svd(design)
    if singular[-2] < _RANK * singular[0]:
        raise CalibrationError(name, "its control points leave the camera undetermined: spread them through the volume")
    P = np.linalg.inv(T_pixels) @ vt[-1].reshape(3, 4) @ T_points
    return P / np.linalg.norm(P)


def decompose(P: np.ndarray, points: np.ndarray, name: str = "camera") -> tuple[np.ndarray, np.ndarray]:
    """Lens and place of a projection matrix.

    Parameters
    ----------
    P : (3, 4) projection matrix; its scale and sign do not matter.
    points : (n, 3) points that the camera sees, hence in front of it.
    name : of the camera, for messages.

    Returns
    -------
    K (3, 3) with positive focal lengths and K[2, 2] = 1.
    T_world_cam (4, 4), with P proportional to K [R | t].
    """
    P = P * np.sign(np.linalg.det(P[:, :3]))
    K, R = rq(P[:, :3])
    signs = np.diag(np.where(np.diag(K) < 0.0, -1.0, 1.0))
    K, R = K @ signs, signs @ R
    T_cam_world = se3.from_rotation_translation(R, np.linalg.solve(K, P[:, 3]))
    if np.median(se3.apply(T_cam_world, points)[:, 2]) <= 0.0:
        raise CalibrationError(name, "its pixels are those of a mirrored image; count u to the right and v downward")
    return K / K[2, 2], se3.inverse(T_cam_world)


def dlt_parameters(camera: Camera) -> np.ndarray:
    """L1..L11 (11,) of a camera without distortion.

    Raises
    ------
    CalibrationError : the world's origin lies in the plane through the camera that is parallel to its image, where the last
        denominator cannot be made one.
    """
    P = camera.model.K @ camera.T_cam_world[:3]
    if abs(P[2, 3]) < 1e-9:
        raise CalibrationError(camera.name, "the world's origin lies beside the camera, where DLT has no parameters; move it")
    return (P / P[2, 3]).ravel()[:11]


def camera_of_parameters(name: str, parameters: np.ndarray, image_size: tuple[int, int]) -> Camera:
    """The camera of DLT parameters; the world's origin is taken to lie in front of it.

    Parameters
    ----------
    name : of the camera.
    parameters : (11,) L1 to L11.
    image_size : (width, height).

    Returns
    -------
    A camera without distortion.

    Raises
    ------
    CalibrationError : pixels of a mirrored image (or an origin behind the camera), or parameters that are no camera's.
    """
    P = np.append(parameters, 1.0).reshape(3, 4)
    if abs(np.linalg.det(P[:, :3])) < 1e-12 * np.linalg.norm(P[:, :3]):
        raise CalibrationError(name, "its eleven parameters are no camera's (the projection is flat)")
    K, T_world_cam = decompose(P, np.zeros((1, 3)), name)
    return Camera(name, CameraModel(*image_size, K), T_world_cam)


def reconstruct(parameters: np.ndarray, pixels: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points from their pixels in two or more cameras, by least squares in the image.

    Parameters
    ----------
    parameters : (n_cameras, 11).
    pixels : (n_points, n_cameras, 2).
    weights : (n_points, n_cameras), 0 where a camera does not see the point.

    Returns
    -------
    points : (n_points, 3) meters; zeros where invalid.
    valid : (n_points,), False where fewer than two cameras see the point or all their rays are nearly parallel.
    """
    L, weights = np.asarray(parameters, dtype=np.float64), np.asarray(weights, dtype=np.float64)
    rows = L[:, :8].reshape(-1, 2, 4)
    points, normal = np.zeros((len(pixels), 3)), np.zeros((len(pixels), 3, 3))
    for c in range(len(L)):
        seen = weights[:, c] > 0.0
        # A ray is where two planes meet, that of all points with its u and that of those with its v
        planes = rows[c, :, :3] - pixels[seen, c, :, None] * L[c, 8:]
        along = np.cross(planes[:, 0], planes[:, 1])
        normal[seen] += across_ray(along / np.linalg.norm(along, axis=1, keepdims=True), weights[seen, c])
    valid = rays_meet(normal)
    for i in np.flatnonzero(valid):
        weight = np.sqrt(weights[i])[:, None]
        # u (L9 x + L10 y + L11 z + 1) = L1 x + ...: linear, but its residual is too large by the denominator, divided out next
        left = rows[:, :, :3] - pixels[i][:, :, None] * L[:, None, 8:]
        right = pixels[i] - rows[:, :, 3]
        scale = weight
        for _ in range(3):
            points[i] = np.linalg.lstsq((scale[:, :, None] * left).reshape(-1, 3), (scale * right).ravel(), rcond=None)[0]
            scale = weight / (L[:, 8:] @ points[i] + 1.0)[:, None]
    return points, valid


def object_errors_m(cameras: Sequence[Camera], seen: Mapping[str, ControlPoints]) -> np.ndarray:
    """Distances of control points from where the cameras reconstruct them.

    Parameters
    ----------
    cameras : each with its lens; what that bends is made straight first.
    seen : camera -> its control points.

    Returns
    -------
    (k,) meters, of the points that two cameras see; none where the world's origin lies beside a camera, which has no parameters
    then.
    """
    try:
        parameters = np.array([dlt_parameters(camera) for camera in cameras])
    except CalibrationError:
        return np.zeros(0)
    if len(cameras) < 2:
        return np.zeros(0)
    used = [seen[camera.name] for camera in cameras]
    places = {name: place for points in used for name, place in zip(points.names, points.points, strict=True)}
    row = {name: i for i, name in enumerate(places)}
    pixels, weights = np.zeros((len(row), len(used), 2)), np.zeros((len(row), len(used)))
    for c, points in enumerate(used):
        rows = [row[name] for name in points.names]
        pixels[rows, c], weights[rows, c] = _straightened(cameras[c].model, points.pixels), 1.0
    found, valid = reconstruct(parameters, pixels, weights)
    return np.linalg.norm(found - np.array(list(places.values())), axis=1)[valid]


def _straightened(lens: CameraModel, pixels: np.ndarray) -> np.ndarray:
    """Where a lens of the same K, without distortion, would show the points that ``lens`` shows in ``pixels`` (n, 2)."""
    rays, _ = lens.rays(pixels)
    return ((rays / rays[:, 2:]) @ lens.K.T)[:, :2]


def _image_residuals(camera: Camera, points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(n, 2) pixels seen minus those of a camera; as `Camera.project`, but smooth behind the camera too."""
    xyz, lens = se3.apply(camera.T_cam_world, points), camera.model
    xy = xyz[:, :2] / xyz[:, 2:]
    if lens.distortion.size:
        xy *= 1.0 + lens.distortion[0] * (xy**2).sum(axis=1, keepdims=True)
    return pixels - xy @ lens.K[:2, :2].T - lens.K[:2, 2]


def _check_spread(name: str, points: np.ndarray) -> None:
    if len(points) < MIN_POINTS:
        raise CalibrationError(name, f"expected at least {MIN_POINTS} control points, got {len(points)}")
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if singular[1] <= _FLAT * singular[0]:
        raise CalibrationError(
            name, f"its {len(points)} control points lie on one line; a DLT needs points spread through a volume"
        )
    if singular[2] <= _FLAT * singular[0]:
        raise CalibrationError(
            name, f"its {len(points)} control points lie in one plane; a DLT needs points spread through a volume"
        )


def _normalization(values: np.ndarray) -> np.ndarray:
    """Homogeneous map that moves ``values`` (n, d) to mean zero and root mean square length sqrt(d)."""
    mean, d = values.mean(axis=0), values.shape[1]
    scale = np.sqrt(d) / max(float(np.sqrt(((values - mean) ** 2).sum(axis=1).mean())), 1e-12)
    T = np.diag([scale] * d + [1.0])
    T[:d, d] = -scale * mean
    return T


def _refine(
    name: str, points: np.ndarray, pixels: np.ndarray, image_size: tuple[int, int], constraint: str, K: np.ndarray, T: np.ndarray
) -> DltCalibration:
    names, (width, height) = CONSTRAINTS[constraint], image_size
    lens = {"fx": K[0, 0], "fy": K[1, 1], "skew": 0.0, "cx": (width - 1) / 2.0, "cy": (height - 1) / 2.0, "k1": 0.0}
    lens["f"] = np.sqrt(K[0, 0] * K[1, 1])
    if "cx" in names:
        lens["cx"], lens["cy"] = K[0, 2], K[1, 2]
    if "skew" in names:
        lens["skew"] = K[0, 1]
    scales = np.array([1.0 if key == "k1" else lens["f"] for key in names] + [1.0] * 6)
    start = np.array([lens[key] for key in names] + [0.0] * 6) / scales

    def camera_of(x: np.ndarray) -> Camera:
        values = lens | dict(zip(names, (x * scales)[: len(names)], strict=True))
        fx, fy = (values["f"], values["f"]) if "f" in names else (values["fx"], values["fy"])
        if min(fx, fy) <= 0.0:
            raise CalibrationError(name, "its control points fit no camera: was one of them clicked on in the wrong place?")
        K = np.array([[fx, values["skew"], values["cx"]], [0.0, fy, values["cy"]], [0.0, 0.0, 1.0]])
        bent = ("plumb_bob", np.array([values["k1"], 0.0, 0.0, 0.0])) if "k1" in names else ()
        return Camera(name, CameraModel(width, height, K, *bent), T @ se3.exp(x[len(names) :]))

    def residuals(x: np.ndarray) -> np.ndarray:
        return _image_residuals(camera_of(x), points, pixels).ravel()

    solution = least_squares(residuals, start, method="lm", xtol=1e-14, ftol=1e-14)
    return DltCalibration(camera_of(solution.x), solution.fun.reshape(-1, 2))


def check_control_points(name: str, seen: ControlPoints, image_size: tuple[int, int]) -> None:
    """Refuse control points that are wrong by themselves.

    Parameters
    ----------
    name : of the camera, for messages.
    seen : points and pixels of the camera.
    image_size : (width, height).

    Raises
    ------
    CalibrationError : a volume of a size that points to millimeters, one point in another unit than the others, or a pixel that
        is not on the image.
    """
    from_middle = np.linalg.norm(seen.points - np.median(seen.points, axis=0), axis=1)
    usual, far = float(np.median(from_middle)), int(from_middle.argmax())
    if usual > 0.0 and from_middle[far] > _FAR * usual:
        raise CalibrationError(
            name,
            f"control point '{seen.names[far]}' is {from_middle[far] / usual:.0f} times as far from the middle as the others are:"
            " is it in another unit? all places are in meters",
        )
    extent = float(np.ptp(seen.points, axis=0).max())
    if extent > LARGEST_M:
        raise CalibrationError(name, f"its control points span {extent:g} m: are they millimeters? give meters")
    if extent < SMALLEST_M:
        raise CalibrationError(name, f"its control points span {1e3 * extent:g} mm only: are they in meters?")
    outside = np.any((seen.pixels < -0.5) | (seen.pixels > np.array(image_size) - 0.5), axis=1)
    if outside.any():
        i = int(outside.argmax())
        u, v = seen.pixels[i]
        width, height = image_size
        raise CalibrationError(
            name, f"control point '{seen.names[i]}' was seen at pixel ({u:g}, {v:g}), outside of the image of {width}x{height}"
        )
