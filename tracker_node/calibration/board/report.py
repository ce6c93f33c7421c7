"""What is told of a calibration from a board: tables, pictures of coverage, a page that needs nothing beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from ...camera.model import CameraModel
from ...report.page import Section, write_page
from ..lens_parameters import COEFFICIENTS, lens_vector
from .board import BoardView
from .detection import CameraViews
from .intrinsics import LensCalibration
from .metrics import camera_figures, covered, pair_figures, rms
from .rig import BoardRig

_WIDTH = 640  # of a picture of coverage
_GOOD, _BAD = (90, 220, 90), (60, 60, 255)  # BGR
_BAD_PX = 1.0


def rig_tables(found: BoardRig, seen: Mapping[str, CameraViews]) -> list[Section]:
    """Cameras, pairs, lenses and outliers."""
    figures = camera_figures(found)
    cameras = [
        (
            name, str(c.views), str(len(c.pixels)), f"{c.rms_px:.2f}", f"{c.median_px:.2f}",
            f"{100 * covered(c.pixels, seen[name].image_size):.0f}", f"{1e3 * c.place_sigma_m:.1f}",
            f"{np.degrees(c.turn_sigma_rad):.2f}", f"{1e3 * c.clock_s:+.1f} ± {1e3 * c.clock_sigma_s:.1f}",
            f"{1e3 * c.jitter_s:.1f}",
        )
        for name, c in figures.items()
    ]  # fmt: skip
    measured = ("images", "corners", "rms px", "median px", "covered %", "place ± mm", "turn ± deg", "later ms", "jitter ms")
    tables = [Section("Cameras", table=(("camera", *measured), *cameras))]
    pairs = [(f"{a} {b}", str(n), f"{error:.2f}") for (a, b), (n, error) in pair_figures(found).items()]
    tables.append(Section("Pairs", table=(("cameras", "images", "rms px"), *pairs)))
    for camera in found.rig:
        tables.append(lens_table(camera.name, camera.model, figures[camera.name].lens_sigma))
    return [*tables, outlier_table(found.outliers)]


def lens_table(name: str, lens: CameraModel, sigma: np.ndarray) -> Section:
    """A lens with its sigmas; in pixels, and coefficients without a unit."""
    labels = ("fx", "fy", "cx", "cy", *COEFFICIENTS[lens.distortion_model])
    rows = [
        (label, f"{value:.{2 if i < 4 else 5}f}", f"{s:.{2 if i < 4 else 5}f}")
        for i, (label, value, s) in enumerate(zip(labels, lens_vector(lens), sigma, strict=True))
    ]
    return Section(f"Lens of {name} ({lens.distortion_model})", table=(("parameter", "value", "±"), *rows))


def outlier_table(outliers: Sequence[tuple[str, BoardView]]) -> Section:
    """Views that were left out."""
    rows = [(name, str(view.image), str(len(view.ids))) for name, view in outliers]
    return Section("Views left out, since they fit much worse than the others", table=(("camera", "image", "corners"), *rows))


def format_table(table: Section) -> str:
    """As text for a terminal, columns aligned."""
    widths = [max(map(len, column)) for column in zip(*table.table, strict=True)]
    lines = []
    for row in table.table:
        first, *others = (cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True)))
        lines.append("  ".join([first, *others]))
    return "\n".join(lines)


def coverage_picture(seen: CameraViews, pixels: np.ndarray, residuals_px: np.ndarray) -> np.ndarray:
    """(h, w, 3) BGR: all corners over one of the images, from green (fits) to red (a pixel off, or more)."""
    width, height = seen.image_size
    scale = _WIDTH / width
    picture = np.full((round(scale * height), _WIDTH, 3), 40, dtype=np.uint8)
    if seen.picture is not None:
        small = cv2.resize(seen.picture, picture.shape[1::-1], interpolation=cv2.INTER_AREA)
        picture = (0.45 * small).astype(np.uint8)
    for pixel, residual in zip(pixels, residuals_px, strict=True):
        share = min(1.0, float(np.linalg.norm(residual)) / _BAD_PX)
        color = tuple((1.0 - share) * good + share * bad for good, bad in zip(_GOOD, _BAD, strict=True))
        center = np.rint(scale * (pixel + 0.5) - 0.5).astype(int)
        cv2.circle(picture, (int(center[0]), int(center[1])), 2, color, -1, cv2.LINE_AA)
    return picture


def lens_pictures(found: Mapping[str, LensCalibration], seen: Mapping[str, CameraViews]) -> list[Section]:
    """Coverage of single cameras."""
    return [
        _picture(name, seen[name], np.concatenate([view.pixels for view in c.views]), np.concatenate(c.residuals_px))
        for name, c in found.items()
    ]


def rig_pictures(found: BoardRig, seen: Mapping[str, CameraViews]) -> list[Section]:
    """Coverage of all cameras of a rig."""
    return [_picture(name, seen[name], c.pixels, c.residuals_px) for name, c in camera_figures(found).items()]


def _picture(name: str, seen: CameraViews, pixels: np.ndarray, residuals_px: np.ndarray) -> Section:
    share = 100 * covered(pixels, seen.image_size)
    caption = f"{name}: {len(pixels)} corners, {share:.0f} % of the image covered; green fits, red is a pixel off or more"
    return Section(text=caption, picture=coverage_picture(seen, pixels, residuals_px))


def write_pictures(folder: Path, names: Sequence[str], pictures: Sequence[Section]) -> list[Path]:
    """``coverage_<camera>.png`` files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"coverage_{name}.png" for name in names]
    for file, section in zip(files, pictures, strict=True):
        assert isinstance(section.picture, np.ndarray)
        cv2.imwrite(str(file), section.picture)
    return files


def write_rig_page(path: str | Path, found: BoardRig, seen: Mapping[str, CameraViews]) -> None:
    """The page of a rig."""
    together = sum(len(instant.views) > 1 for instant in found.instants)
    notes = [
        f"{found.board}. {together} image sets in which several cameras see it; corners fit to"
        f" {rms(found.adjustment.residuals_px):.2f} px (rms). The world is the first camera's place, z up where it is level.",
        "Sigmas take the corners' errors as independent: lower bounds. 'later' is by how much images are later than their stamps"
        " say, beside the first camera; 'jitter' what single images differ by. A pair's error is that of corners triangulated by"
        " these two.",
    ] + [f"{name}: {problem}" for name, camera in seen.items() for problem in camera.problems]
    sections = [*(Section(text=note) for note in notes), *rig_tables(found, seen), *rig_pictures(found, seen)]
    write_page(path, "Rig from a board", sections)
