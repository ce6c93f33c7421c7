"""How well the lines of one camera bear a state out, as kernels."""

from __future__ import annotations

import numba as nb

from ...camera.model import project_point
from ...render.contour.generators import OUTER
from ...render.contour.samples import CLASS, LINK, SHAPE
from .table import LINE_NU, LINE_NV, LINE_U, LINE_V, LOG_RATIO, MEAN, POINT, PRECISION

# Rows of the evidence of one camera
EXPECTED, FOUND, CLOSE, CHI2, SUM_LOG_RATIO = range(5)
N_EVIDENCE = 5
_UNSEEN_PX = 1e6  # residual of what the camera cannot see


@nb.njit(cache=True, nogil=True, error_model="numpy")
def line_residuals(lines, info, n, Ts_link, camera, residuals):
    """Residuals of lines at a pose of the body.

    Parameters
    ----------
    lines, info, n : (., `N_LINE_COLUMNS`) and (., `N_INFO_COLUMNS`), the first ``n`` rows.
    Ts_link : (n_links, 4, 4), where the body is.
    camera : (params, R_cam_world, t_cam_world, center).
    residuals : (>= n,) pixels, overwritten; very large where the camera cannot see the point.
    """
    params, R, t, _ = camera
    for j in range(n):
        link, a, b, c = info[j, LINK], lines[j, POINT], lines[j, POINT + 1], lines[j, POINT + 2]
        px = Ts_link[link, 0, 0] * a + Ts_link[link, 0, 1] * b + Ts_link[link, 0, 2] * c + Ts_link[link, 0, 3]
        py = Ts_link[link, 1, 0] * a + Ts_link[link, 1, 1] * b + Ts_link[link, 1, 2] * c + Ts_link[link, 1, 3]
        pz = Ts_link[link, 2, 0] * a + Ts_link[link, 2, 1] * b + Ts_link[link, 2, 2] * c + Ts_link[link, 2, 3]
        ok, u, v, _, _, _, _, _, _ = project_point(
            params, R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + t[0], R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + t[1],
            R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + t[2],
        )  # fmt: skip
        residuals[j] = _UNSEEN_PX
        if ok:
            du, dv = u - lines[j, LINE_U], v - lines[j, LINE_V]
            residuals[j] = lines[j, LINE_NU] * du + lines[j, LINE_NV] * dv - lines[j, MEAN]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def count_evidence(lines, info, n, residuals, model_variance, close_px, evidence):
    """Add the lines of the body's outline to the evidence of its parts.

    Parameters
    ----------
    lines, info, n, residuals : see `line_residuals`.
    model_variance : pixels^2, by which contours are off beyond their noise.
    close_px : residual below which a line counts as `CLOSE`.
    evidence : (`N_EVIDENCE`, n_shapes), added to.
    """
    for j in range(n):
        if info[j, CLASS] != OUTER:
            continue
        shape, precision = info[j, SHAPE], lines[j, PRECISION]
        evidence[EXPECTED, shape] += 1.0
        evidence[SUM_LOG_RATIO, shape] += lines[j, LOG_RATIO]
        if precision > 0.0:
            evidence[FOUND, shape] += 1.0
            evidence[CHI2, shape] += residuals[j] ** 2 / (1.0 / precision + model_variance)
            if abs(residuals[j]) < close_px:
                evidence[CLOSE, shape] += 1.0
