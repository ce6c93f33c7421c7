"""Report of a calibration from a board: metrics of cameras and of pairs, tables, images of coverage, a page of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ...camera.model import CameraModel
from ...geometry import se3
from ...report.html import PageSection, write_page
from ..points.triangulation import reproject, triangulate
from .adjustment import CLOCK, COEFFICIENTS, N_PLACE, BoardObservations, lens_vector
from .board import BoardView
from .intrinsics import LensCalibration
from .refinement import rows_of, view_errors
from .rig import BoardRig
from .views import CameraViews

_WIDTH = 640  # of an image of coverage
_GOOD, _BAD = (90, 220, 90), (60, 60, 255)  # BGR
_BAD_PX = 1.0
ENOUGH_COVERED = 0.4  # of an image, for a lens that can be relied on
_CELLS = 8  # along the longer side of an image, for the fraction that is covered


def rig_tables(found: BoardRig, seen: Mapping[str, CameraViews]) -> list[PageSection]:
    """Tables of cameras, pairs, lenses and outliers.

    Parameters
    ----------
    found : the calibrated rig.
    seen : what each camera saw.

    Returns
    -------
    One section a table.
    """
    metrics = camera_metrics(found)
    cameras = [
        (
            name, str(c.views), str(len(c.pixels)), f"{c.rms_px:.2f}", f"{c.median_px:.2f}",
            f"{100 * covered(c.pixels, seen[name].image_size):.0f}", f"{1e3 * c.place_sigma_m:.1f}",
            f"{np.degrees(c.turn_sigma_rad):.2f}", f"{1e3 * c.clock_s:+.1f} ± {1e3 * c.clock_sigma_s:.1f}",
            f"{1e3 * c.jitter_s:.1f}",
        )
        for name, c in metrics.items()
    ]  # fmt: skip
    measured = ("images", "corners", "rms px", "median px", "covered %", "place ± mm", "turn ± deg", "later ms", "jitter ms")
    tables = [PageSection("Cameras", table=(("camera", *measured), *cameras))]
    pairs = [(f"{a} {b}", str(n), f"{error:.2f}") for (a, b), (n, error) in pair_metrics(found).items()]
    tables.append(PageSection("Pairs", table=(("cameras", "images", "rms px"), *pairs)))
    for camera in found.rig:
        tables.append(lens_table(camera.name, camera.model, metrics[camera.name].lens_sigma))
    return [*tables, outlier_table(found.outliers)]


def lens_table(name: str, lens: CameraModel, sigma: np.ndarray) -> PageSection:
    """Table of a lens.

    Parameters
    ----------
    name : of the camera.
    lens : the lens.
    sigma : (4 + n,) standard deviations of its `lens_vector`.

    Returns
    -------
    Values in pixels, and coefficients without a unit.
    """
    labels = ("fx", "fy", "cx", "cy", *COEFFICIENTS[lens.distortion_model])
    rows = [
        (label, f"{value:.{2 if i < 4 else 5}f}", f"{s:.{2 if i < 4 else 5}f}")
        for i, (label, value, s) in enumerate(zip(labels, lens_vector(lens), sigma, strict=True))
    ]
    return PageSection(f"Lens of {name} ({lens.distortion_model})", table=(("parameter", "value", "±"), *rows))


def outlier_table(outliers: Sequence[tuple[str, BoardView]]) -> PageSection:
    """Views that were left out."""
    rows = [(name, str(view.image), str(len(view.ids))) for name, view in outliers]
    return PageSection("Views left out, since they fit much worse than the others", table=(("camera", "image", "corners"), *rows))


def coverage_image(seen: CameraViews, pixels: np.ndarray, residuals_px: np.ndarray) -> np.ndarray:
    """All corners over one of the images, from green (fits) to red (a pixel off, or more).

    Parameters
    ----------
    seen : what the camera saw, with an image.
    pixels, residuals_px : (m, 2) corners and their residuals.

    Returns
    -------
    (h, 640, 3) uint8 BGR.
    """
    width, height = seen.image_size
    scale = _WIDTH / width
    image = np.full((round(scale * height), _WIDTH, 3), 40, dtype=np.uint8)
    if seen.image is not None:
        small = cv2.resize(seen.image, image.shape[1::-1], interpolation=cv2.INTER_AREA)
        image = (0.45 * small).astype(np.uint8)
    for pixel, residual in zip(pixels, residuals_px, strict=True):
        fraction = min(1.0, float(np.linalg.norm(residual)) / _BAD_PX)
        color = tuple((1.0 - fraction) * good + fraction * bad for good, bad in zip(_GOOD, _BAD, strict=True))
        center = np.rint(scale * (pixel + 0.5) - 0.5).astype(int)
        cv2.circle(image, (int(center[0]), int(center[1])), 2, color, -1, cv2.LINE_AA)
    return image


def lens_images(found: Mapping[str, LensCalibration], seen: Mapping[str, CameraViews]) -> list[PageSection]:
    """Coverage of single cameras.

    Parameters
    ----------
    found : lenses by camera.
    seen : what each camera saw.

    Returns
    -------
    One section a camera.
    """
    return [
        _image(name, seen[name], np.concatenate([view.pixels for view in c.views]), np.concatenate(c.residuals_px))
        for name, c in found.items()
    ]


def rig_images(found: BoardRig, seen: Mapping[str, CameraViews]) -> list[PageSection]:
    """Coverage of all cameras of a rig.

    Parameters
    ----------
    found : the calibrated rig.
    seen : what each camera saw.

    Returns
    -------
    One section a camera.
    """
    return [_image(name, seen[name], c.pixels, c.residuals_px) for name, c in camera_metrics(found).items()]


def _image(name: str, seen: CameraViews, pixels: np.ndarray, residuals_px: np.ndarray) -> PageSection:
    fraction = 100 * covered(pixels, seen.image_size)
    caption = f"{name}: {len(pixels)} corners, {fraction:.0f} % of the image covered; green fits, red is a pixel off or more"
    return PageSection(text=caption, image=coverage_image(seen, pixels, residuals_px))


def write_images(folder: Path, names: Sequence[str], images: Sequence[PageSection]) -> list[Path]:
    """Write ``coverage_<camera>.png`` files.

    Parameters
    ----------
    folder : where; it is made.
    names : of the cameras.
    images : one section a camera, in the same order.

    Returns
    -------
    The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"coverage_{name}.png" for name in names]
    for file, section in zip(files, images, strict=True):
        assert isinstance(section.image, np.ndarray)
        cv2.imwrite(str(file), section.image)
    return files


def write_rig_page(path: str | Path, found: BoardRig, seen: Mapping[str, CameraViews]) -> None:
    """Write the HTML page of a rig.

    Parameters
    ----------
    path : of the page.
    found : the calibrated rig.
    seen : what each camera saw.
    """
    together = sum(len(time_step.views) > 1 for time_step in found.time_steps)
    notes = [
        f"{found.board}. {together} image sets in which several cameras see it; corners fit to"
        f" {rms(found.adjustment.residuals_px):.2f} px (rms). The world is the first camera's place, z up where it is level.",
        "Sigmas take the corners' errors as independent: lower bounds. 'later' is by how much images are later than their stamps"
        " say, beside the first camera; 'jitter' what single images differ by. A pair's error is that of corners triangulated by"
        " these two.",
    ] + [f"{name}: {problem}" for name, camera in seen.items() for problem in camera.problems]
    sections = [*(PageSection(text=note) for note in notes), *rig_tables(found, seen), *rig_images(found, seen)]
    write_page(path, "Rig from a board", sections)


@dataclass(frozen=True, eq=False)
class CameraMetrics:
    """One camera of a rig.

    Attributes
    ----------
    pixels, residuals_px : (m, 2) of all corners used.
    views : image sets in which it saw the board.
    place_sigma_m, turn_sigma_rad : how well its place is known, relative to the first camera's.
    clock_s, clock_sigma_s : by how much its images are later than they say; ``jitter_s`` rms of single images besides.
    lens_sigma : (4 + n,) of the lens vector.
    """

    pixels: np.ndarray
    residuals_px: np.ndarray
    views: int
    place_sigma_m: float
    turn_sigma_rad: float
    clock_s: float
    clock_sigma_s: float
    jitter_s: float
    lens_sigma: np.ndarray

    @property
    def rms_px(self) -> float:
        return rms(self.residuals_px)

    @property
    def median_px(self) -> float:
        return float(np.median(np.linalg.norm(self.residuals_px, axis=1)))

    @property
    def clock_is_off(self) -> bool:
        """By more than three sigmas and a millisecond."""
        return abs(self.clock_s) > max(3.0 * self.clock_sigma_s, 1e-3)


def rms(residuals_px: np.ndarray) -> float:
    """Root mean square length of residuals (m, 2)."""
    return float(np.sqrt((np.asarray(residuals_px) ** 2).sum(axis=1).mean()))


def camera_metrics(found: BoardRig) -> dict[str, CameraMetrics]:
    """Of all cameras. Sigmas take the corners' errors as independent, and are lower bounds therefore."""
    rows, residuals, state = rows_of(found.rig.names, found.time_steps), found.adjustment.residuals_px, found.state
    result = {}
    for i, name in enumerate(found.rig.names):
        mine = rows.camera == i
        noise = float(1.4826 * np.median(np.abs(residuals[mine])))
        sigma = noise * found.adjustment.sigmas[i]
        seen = [k for k, time_step in enumerate(found.time_steps) if name in time_step.views]
        result[name] = CameraMetrics(
            rows.pixels[mine], residuals[mine], len(seen), float(np.linalg.norm(sigma[:3])), float(np.linalg.norm(sigma[3:6])),
            float(state.clocks_s[i]), float(sigma[CLOCK]), float(np.sqrt(np.mean(state.jitter_s[seen, i] ** 2))), sigma[N_PLACE:],
        )  # fmt: skip
    return result


def late_cameras(found: BoardRig) -> dict[str, float]:
    """Cameras whose clock is off -> by how many seconds their images are later than they say."""
    return {name: each.clock_s for name, each in camera_metrics(found).items() if each.clock_is_off}


def pair_metrics(found: BoardRig) -> dict[tuple[str, str], tuple[int, float]]:
    """(camera, camera) -> image sets with the board in both, and how well the two agree.

    That is the rms distance, in the images of both, from corners triangulated by these two alone; as if both images were of the
    time step, so clocks that have been found do not count.
    """
    names, state = found.rig.names, found.state
    rows, residuals = rows_of(names, found.time_steps), found.adjustment.residuals_px
    pixels = _at_the_time_step(found, rows) - residuals
    table = {
        (int(camera), int(time_step), int(corner)): pixel
        for camera, time_step, corner, pixel in zip(rows.camera, rows.time_step, rows.corner, pixels, strict=True)
    }
    Ts_world_cam = se3.inverse(state.Ts_cam_world)
    result = {}
    for a in range(len(names)):
        for b in range(a + 1, len(names)):
            common = [key[1:] for key in table if key[0] == a and (b, *key[1:]) in table]
            if not common:
                continue
            both = np.array([[table[(i, *key)] for i in (a, b)] for key in common])
            lenses, Ts = [state.lenses[a], state.lenses[b]], Ts_world_cam[[a, b]]
            points, valid = triangulate(lenses, Ts, both, np.ones(both.shape[:2]))
            error = float("nan")
            if valid.any():
                error = rms((reproject(lenses, Ts, points[valid])[0] - both[valid]).reshape(-1, 2))
            result[names[a], names[b]] = len({time_step for time_step, _ in common}), error
    return result


def _at_the_time_step(found: BoardRig, rows: BoardObservations) -> np.ndarray:
    """(m, 2) where the corners are expected, were all images of one time step."""
    result = np.zeros((len(rows.camera), 2))
    for i, (lens, T) in enumerate(zip(found.state.lenses, found.state.Ts_cam_world, strict=True)):
        mine = np.flatnonzero(rows.camera == i)
        boards = found.state.Ts_world_board[rows.time_step[mine]]
        corners = found.board.corners[rows.corner[mine]]
        world = np.einsum("mij,mj->mi", boards[:, :3, :3], corners) + boards[:, :3, 3]
        result[mine] = lens.project(se3.apply(T, world))[0]
    return result


def covered(pixels: np.ndarray, image_size: tuple[int, int]) -> float:
    """Fraction of the image, in cells of an eighth of its longer side, that has corners in it.

    Parameters
    ----------
    pixels : (m, 2) of the corners.
    image_size : (width, height).

    Returns
    -------
    0 to 1.
    """
    cell = max(image_size) / _CELLS
    columns, rows = (int(np.ceil(size / cell)) for size in image_size)
    inside = np.clip((pixels / cell).astype(int), 0, [columns - 1, rows - 1])
    return len(np.unique(inside, axis=0)) / (columns * rows)


def coverage_notes(pixels: Mapping[str, np.ndarray], sizes: Mapping[str, tuple[int, int]]) -> list[str]:
    """Warnings about images whose corners cover too little for a lens.

    Parameters
    ----------
    pixels : camera -> (m, 2) corners.
    sizes : camera -> (width, height).

    Returns
    -------
    A sentence for each such camera.
    """
    notes = []
    for name, corners in pixels.items():
        fraction = covered(corners, sizes[name])
        if fraction < ENOUGH_COVERED:
            notes.append(
                f"corners cover {100 * fraction:.0f} % of the image of {name}: its lens is not known beyond them;"
                " bring the board nearer, and to the borders of the image"
            )
    return notes


def rig_metrics(found: BoardRig) -> dict[str, float | int]:
    """Flat metrics, ``rig.<camera or pair>.<metric>``."""
    residuals = found.adjustment.residuals_px
    metrics: dict[str, float | int] = {
        "rig.sets": len(found.time_steps), "rig.corners": len(residuals), "rig.rms_px": rms(residuals),
        "rig.median_px": float(np.median(np.linalg.norm(residuals, axis=1))), "rig.outliers": len(found.outliers),
        "rig.converged": int(found.adjustment.converged),
    }  # fmt: skip
    for name, c in camera_metrics(found).items():
        metrics |= {
            f"rig.{name}.rms_px": c.rms_px, f"rig.{name}.views": c.views, f"rig.{name}.later_ms": 1e3 * c.clock_s,
            f"rig.{name}.jitter_ms": 1e3 * c.jitter_s, f"rig.{name}.place_sigma_mm": 1e3 * c.place_sigma_m,
        }  # fmt: skip
    for (a, b), (n, error) in pair_metrics(found).items():
        metrics[f"rig.{a}_{b}.sets"], metrics[f"rig.{a}_{b}.rms_px"] = n, error
    return metrics


def worst_views(found: BoardRig, n: int = 5) -> list[tuple[str, int, float]]:
    """The views that fit worst among those used.

    Parameters
    ----------
    found : the calibrated rig.
    n : how many.

    Returns
    -------
    (camera, number of the image, rms px) each, the worst first.
    """
    errors = view_errors(found.time_steps, found.adjustment.residuals_px)
    order = sorted(errors, key=lambda key: -errors[key])[:n]
    return [(name, found.time_steps[k].views[name].image, errors[k, name]) for k, name in order]
