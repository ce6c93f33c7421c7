"""Clothes and girths: where the surface of each part lies beside the model's, as unknowns of the lines.

A part's contour lies outside of its shape by d, and is shifted by o in the axes of its link: four unknowns y = (d, o), meters,
with means m and the inverse covariance P. Along a line the contour moves by a (y - m), a = (k, R^T g): k the pixels of a meter, g
the derivative of the line by a point in the world. With H = sum w a a^T, b = sum w a r and C = sum w G a^T over a part's lines,
w their weights, r their residuals and G their derivatives by the twist of the link, the best y is m - (H + P)^-1 b, and what the
lines say of the twist loses C (H + P)^-1 C^T. A limb whose both sides are seen from all around loses little, a shoulder that is
seen from above most.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...camera.model import NEAR, project_point
from ...compiled.kernels import compiled
from ...render.contour.samples import LINK, SHAPE
from .table import LINE_NU, LINE_NV, LINE_U, LINE_V, MEAN, POINT, PRECISION

N_UNKNOWNS = 4  # how far outside, and the shift


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Where the surfaces of a body's parts are, before the lines of a set are seen.

    Attributes
    ----------
    means : (n_shapes, 4) meters: outside of the shape, and shifted in the axes of its link.
    covariances : (n_shapes, 4, 4) meters^2.
    """

    means: np.ndarray
    covariances: np.ndarray

    @cached_property
    def priors(self) -> np.ndarray:
        """(n_shapes, 4, 4) inverse covariances."""
        return np.linalg.inv(self.covariances)


@compiled
def _line(line, link, Ts_link, camera, row, X):
    """Fill the derivatives ``row`` (4,) of a line by its part's unknowns and ``X`` (3,), its point in the world.

    Whether the point is seen, its pixel, and the line's derivative by that point.
    """
    params, R, t, _ = camera
    T = Ts_link[link]
    for i in range(3):
        X[i] = T[i, 0] * line[POINT] + T[i, 1] * line[POINT + 1] + T[i, 2] * line[POINT + 2] + T[i, 3]
    x = R[0, 0] * X[0] + R[0, 1] * X[1] + R[0, 2] * X[2] + t[0]
    y = R[1, 0] * X[0] + R[1, 1] * X[1] + R[1, 2] * X[2] + t[1]
    z = R[2, 0] * X[0] + R[2, 1] * X[1] + R[2, 2] * X[2] + t[2]
    ok, u, v, ux, uy, uz, vx, vy, vz = project_point(params, x, y, z)
    if not ok or z < NEAR:
        return False, 0.0, 0.0, 0.0, 0.0, 0.0
    nu, nv = line[LINE_NU], line[LINE_NV]
    hx, hy, hz = nu * ux + nv * vx, nu * uy + nv * vy, nu * uz + nv * vz
    h0 = R[0, 0] * hx + R[1, 0] * hy + R[2, 0] * hz
    h1 = R[0, 1] * hx + R[1, 1] * hy + R[2, 1] * hz
    h2 = R[0, 2] * hx + R[1, 2] * hy + R[2, 2] * hz
    row[0] = math.sqrt(params[0] * params[1]) / z
    for i in range(3):
        row[1 + i] = T[0, i] * h0 + T[1, i] * h1 + T[2, i] * h2
    return True, u, v, h0, h1, h2


@compiled
def shift_means(lines, info, n, Ts_link, camera, surfaces):
    """Take what is known of the surfaces off the means of lines.

    Parameters
    ----------
    lines, info, n : of `lines.camera.correspond_camera`, the first ``n`` rows.
    Ts_link, camera : (n_links, 4, 4), and (params, R, t, center).
    surfaces : (n_shapes, 4) meters.
    """
    row, X = np.empty(N_UNKNOWNS), np.empty(3)
    for j in range(n):
        seen, _, _, _, _, _ = _line(lines[j], info[j, LINK], Ts_link, camera, row, X)
        if seen:
            known = surfaces[info[j, SHAPE]]
            lines[j, MEAN] -= row[0] * known[0] + row[1] * known[1] + row[2] * known[2] + row[3] * known[3]


@compiled
def sum_surfaces(lines, info, n, Ts_link, camera, robust_sq, model_variance, share, H, b, C):
    """Add one camera's lines to the sums of the parts.

    Parameters
    ----------
    lines, info, n, Ts_link, camera : see `shift_means`.
    robust_sq, model_variance, share : as weights of lines are made, see `lines.correspondence.linearize_lines`.
    H, b, C : (n_shapes, 4, 4), (n_shapes, 4), (n_shapes, 6, 4), added to.
    """
    row, X, G = np.empty(N_UNKNOWNS), np.empty(3), np.empty(6)
    for j in range(n):
        if lines[j, PRECISION] <= 0.0:
            continue
        seen, u, v, h0, h1, h2 = _line(lines[j], info[j, LINK], Ts_link, camera, row, X)
        if not seen:
            continue
        r = lines[j, LINE_NU] * (u - lines[j, LINE_U]) + lines[j, LINE_NV] * (v - lines[j, LINE_V]) - lines[j, MEAN]
        precision = 1.0 / (1.0 / lines[j, PRECISION] + model_variance)
        ratio = robust_sq / (robust_sq + r * r * precision)
        w, shape = share * precision * ratio * ratio, info[j, SHAPE]
        G[0], G[1], G[2] = h0, h1, h2
        G[3], G[4], G[5] = X[1] * h2 - X[2] * h1, X[2] * h0 - X[0] * h2, X[0] * h1 - X[1] * h0
        for p in range(N_UNKNOWNS):
            wa = w * row[p]
            b[shape, p] += wa * r
            for q in range(N_UNKNOWNS):
                H[shape, p, q] += wa * row[q]
            for i in range(6):
                C[shape, i, p] += wa * G[i]


@dataclass(frozen=True, eq=False)
class SurfaceSums:
    """Sums of lines by part at one state.

    Attributes
    ----------
    H, b, C : (n_shapes, 4, 4), (n_shapes, 4), (n_shapes, 6, 4).
    priors : (n_shapes, 4, 4) inverse covariances of the unknowns.
    links : (n_shapes,) link of each part.
    """

    H: np.ndarray
    b: np.ndarray
    C: np.ndarray
    priors: np.ndarray
    links: np.ndarray

    @cached_property
    def covariances(self) -> np.ndarray:
        """(n_shapes, 4, 4) of the unknowns, the pose known."""
        return np.linalg.inv(self.H + self.priors)

    def of_links(self, n_links: int, between: np.ndarray | None = None) -> np.ndarray:
        """C M C^T, summed by link.

        Parameters
        ----------
        n_links : of the body.
        between : M (n_shapes, 4, 4); None: `covariances`, which gives what the information of the twists loses.

        Returns
        -------
        (n_links, 6, 6)
        """
        M, result = self.covariances if between is None else between, np.zeros((n_links, 6, 6))
        np.add.at(result, self.links, self.C @ M @ np.swapaxes(self.C, 1, 2))
        return result

    def pulls(self, n_links: int) -> np.ndarray:
        """(n_links, 6): what the gradient of each link's twist loses."""
        result = np.zeros((n_links, 6))
        np.add.at(result, self.links, (self.C @ (self.covariances @ self.b[:, :, None]))[:, :, 0])
        return result

    @property
    def cost(self) -> float:
        """What the cost loses by the best unknowns."""
        return float(np.einsum("si,sij,sj->", self.b, self.covariances, self.b))
