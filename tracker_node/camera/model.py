"""One calibrated lens: projection, its derivative, rays, and whether a real lens can be so.

Pixels (u, v) have integer coordinates at pixel centers; camera axes are optical (x right, y down, z forward).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..compiled.kernels import compiled
from . import distortion as _distortion

NEAR = 1e-3  # meters: a point nearer than this, or behind the camera, is not visible

# Layout of the packed parameters that kernels take: fx fy cx cy skew model_id r2_max (unused) k0..k7
N_PARAMS = 8 + _distortion.N_PACKED


@compiled
def project_point(params, x, y, z):
    """Pixel of a point, and its derivative.

    Parameters
    ----------
    params : (`N_PARAMS`,) as `CameraModel.params`.
    x, y, z : meters in the camera frame.

    Returns
    -------
    (valid, u, v, u_x, u_y, u_z, v_x, v_y, v_z), px and px/m; invalid behind the camera or where the lens model folds.
    """
    if z < NEAR:
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    iz = 1.0 / z
    xn, yn = x * iz, y * iz
    if xn * xn + yn * yn > params[6]:
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    xd, yd, a, b, c, d = _distortion.distort(int(params[5]), params[8:], xn, yn)
    fx, fy, skew = params[0], params[1], params[4]
    u = fx * xd + skew * yd + params[2]
    v = fy * yd + params[3]
    u_xn, u_yn = fx * a + skew * c, fx * b + skew * d
    v_xn, v_yn = fy * c, fy * d
    return (
        True, u, v,
        u_xn * iz, u_yn * iz, -(u_xn * xn + u_yn * yn) * iz,
        v_xn * iz, v_yn * iz, -(v_xn * xn + v_yn * yn) * iz,
    )  # fmt: skip


@compiled
def _project_many(params, points, pixels, jacobians, valid):
    for i in range(points.shape[0]):
        ok, u, v, a, b, c, d, e, f = project_point(params, points[i, 0], points[i, 1], points[i, 2])
        valid[i] = ok
        pixels[i, 0], pixels[i, 1] = u, v
        jacobians[i, 0, 0], jacobians[i, 0, 1], jacobians[i, 0, 2] = a, b, c
        jacobians[i, 1, 0], jacobians[i, 1, 1], jacobians[i, 1, 2] = d, e, f


@compiled
def _rays_many(params, pixels, rays, valid):
    for i in range(pixels.shape[0]):
        yd = (pixels[i, 1] - params[3]) / params[1]
        xd = (pixels[i, 0] - params[2] - params[4] * yd) / params[0]
        x, y, ok = _distortion.undistort(int(params[5]), params[8:], xd, yd)
        valid[i] = ok
        norm = np.sqrt(x * x + y * y + 1.0)
        rays[i, 0], rays[i, 1], rays[i, 2] = x / norm, y / norm, 1.0 / norm


@dataclass(frozen=True)
class CameraModel:
    """Intrinsics of one camera.

    Parameters
    ----------
    width, height : image size in pixels.
    K : (3, 3) with focal lengths and principal point in pixels; K[0, 1] is a skew.
    distortion_model : a key of `distortion.MODEL_IDS`.
    distortion : its coefficients.
    """

    width: int
    height: int
    K: np.ndarray
    distortion_model: str = "none"
    distortion: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self):
        K = np.array(self.K, dtype=np.float64)
        if K.shape != (3, 3):
            raise ValueError(f"expected K of shape (3, 3), got {K.shape}")
        if not (K[0, 0] > 0.0 and K[1, 1] > 0.0):
            raise ValueError(f"expected positive focal lengths, got {K[0, 0]} and {K[1, 1]} (K[0] = 0 means uncalibrated)")
        if self.distortion_model not in _distortion.MODEL_IDS:
            raise ValueError(f"expected a distortion model of {sorted(_distortion.MODEL_IDS)}, got {self.distortion_model!r}")
        coefficients = np.array(self.distortion, dtype=np.float64).ravel()
        if coefficients.size not in _distortion.COEFFICIENT_COUNTS[self.distortion_model]:
            raise ValueError(
                f"expected {_distortion.COEFFICIENT_COUNTS[self.distortion_model]} coefficients for {self.distortion_model},"
                f" got {coefficients.size}"
            )
        K.setflags(write=False)
        coefficients.setflags(write=False)
        object.__setattr__(self, "K", K)
        object.__setattr__(self, "distortion", coefficients)
        params = np.zeros(N_PARAMS)
        params[:5] = K[0, 0], K[1, 1], K[0, 2], K[1, 2], K[0, 1]
        params[5] = _distortion.MODEL_IDS[self.distortion_model]
        params[8 : 8 + coefficients.size] = coefficients
        params[6] = _distortion.monotonic_radius(int(params[5]), params[8:]) ** 2
        params.setflags(write=False)
        object.__setattr__(self, "params", params)

    params: np.ndarray = field(init=False, repr=False, compare=False)

    def project(self, points_cam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (..., 2) of points (..., 3) in the camera frame (meters), and a validity mask (...)."""
        pixels, _, valid = self.project_with_jacobian(points_cam)
        return pixels, valid

    def project_with_jacobian(self, points_cam: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixels (..., 2), pixel_D_point (..., 2, 3) in px/m, validity (...). Invalid entries hold zeros."""
        points = np.ascontiguousarray(points_cam, dtype=np.float64)
        shape = points.shape[:-1]
        flat = points.reshape(-1, 3)
        pixels, jacobians = np.empty((len(flat), 2)), np.empty((len(flat), 2, 3))
        valid = np.empty(len(flat), dtype=np.bool_)
        _project_many(self.params, flat, pixels, jacobians, valid)
        return pixels.reshape(*shape, 2), jacobians.reshape(*shape, 2, 3), valid.reshape(shape)

    def rays(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unit directions (..., 3) in the camera frame of pixels (..., 2), and a validity mask (...)."""
        pixels = np.ascontiguousarray(pixels, dtype=np.float64)
        flat = pixels.reshape(-1, 2)
        rays, valid = np.empty((len(flat), 3)), np.empty(len(flat), dtype=np.bool_)
        _rays_many(self.params, flat, rays, valid)
        return rays.reshape(*pixels.shape[:-1], 3), valid.reshape(pixels.shape[:-1])

    def in_image(self, pixels: np.ndarray) -> np.ndarray:
        """True where a pixel (..., 2) lies on the image (half a pixel beyond the outer centers included)."""
        u, v = pixels[..., 0], pixels[..., 1]
        return (u >= -0.5) & (v >= -0.5) & (u < self.width - 0.5) & (v < self.height - 0.5)

    def mapped(self, pixel_map: np.ndarray, width: int, height: int) -> CameraModel:
        """The same lens in other pixels, ``new = pixel_map @ (u, v, 1)``: of resized images, or of a video in pixels of its own.

        Parameters
        ----------
        pixel_map : (2, 3) upper triangular.
        width, height : of the new images, px.

        Returns
        -------
        Lens with another K; distortion works on normalized coordinates and stays.
        """
        pixel_map = np.asarray(pixel_map, dtype=np.float64)
        if pixel_map.shape != (2, 3) or pixel_map[1, 0] != 0.0:
            raise ValueError(f"expected a (2, 3) map without rotation, got {pixel_map.tolist()}")
        full = np.vstack([pixel_map, [0.0, 0.0, 1.0]])
        return replace(self, width=int(width), height=int(height), K=full @ self.K)

    def size_problem(self, image: np.ndarray) -> str:
        """Why an image (height, width[, 3]) is not in the pixels of this calibration; empty if it is."""
        height, width = image.shape[:2]
        if (width, height) == (self.width, self.height):
            return ""
        return f"image size contradicts the calibration: expected {self.width}x{self.height}, got {width}x{height}"

    def resized(self, width: int, height: int) -> CameraModel:
        """The lens after the image is resampled (pixel-center convention of cv2.resize).

        Parameters
        ----------
        width, height : of the resampled image, px.

        Returns
        -------
        Lens with another K.
        """
        sx, sy = width / self.width, height / self.height
        return self.mapped(np.array([[sx, 0.0, 0.5 * sx - 0.5], [0.0, sy, 0.5 * sy - 0.5]]), width, height)

    def turned_clockwise(self) -> CameraModel:
        """The lens of a camera that is turned so that its image appears turned clockwise by a quarter.

        Returns
        -------
        Lens of the camera whose axes are x = -y, y = x of this one: width and height are exchanged.

        Raises
        ------
        ValueError : a lens with a skew, which no turned one has a number for.
        """
        if self.K[0, 1] != 0.0:
            raise ValueError(f"expected a lens without a skew, to be turned; got {self.K[0, 1]:g}")
        K = np.diag([self.K[1, 1], self.K[0, 0], 1.0])
        K[:2, 2] = self.height - 1 - self.K[1, 2], self.K[0, 2]
        coefficients = self.distortion.copy()
        if self.distortion_model in ("plumb_bob", "rational_polynomial"):
            coefficients[2:4] = coefficients[3], -coefficients[2]  # p1 and p2 lie along the image's axes
        return replace(self, width=self.height, height=self.width, K=K, distortion=coefficients)


SHORTEST, LONGEST = 0.01, 1000.0  # focal lengths, in image sides
FARTHEST = 10.0  # the principal point beyond the image, in image sides
LARGEST_COEFFICIENT = 1e6


def plausible(model: CameraModel) -> CameraModel:
    """A lens from outside, if it can be a real one.

    Raises
    ------
    ValueError : naming the value that no lens has, what is expected and what came; numbers that are not finite, too.
    """
    side = float(max(model.width, model.height))
    K = model.K
    _refuse_outside("fx", K[0, 0], SHORTEST * side, LONGEST * side)
    _refuse_outside("fy", K[1, 1], SHORTEST * side, LONGEST * side)
    _refuse_outside("skew", K[0, 1], -LONGEST * side, LONGEST * side)
    _refuse_outside("cx", K[0, 2], -FARTHEST * side, FARTHEST * side)
    _refuse_outside("cy", K[1, 2], -FARTHEST * side, FARTHEST * side)
    for i, coefficient in enumerate(model.distortion):
        _refuse_outside(f"distortion coefficient {i + 1}", coefficient, -LARGEST_COEFFICIENT, LARGEST_COEFFICIENT)
    return model


def _refuse_outside(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name}: expected {low:g} to {high:g}, got {float(value):g}")
