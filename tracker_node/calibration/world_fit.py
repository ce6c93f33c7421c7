"""The world of a rig from what its cameras have seen: control points, a board, axes, a wand, a plumb line.

Axes, points or a board give the frame; a wand its scale; a plumb line its vertical. What the frame does not need of them is a
check: it is reported and changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ..camera.rig import CameraRig
from ..errors import FileFormatError, SourceError, TrackerError
from ..loaders.rig.control_points import load_clicks, load_control_points
from ..loaders.rig.rig_yaml import RigFile, rig_file_of
from .board.board import Board, BoardDetector
from .world_frame import LEAST_M, SeenPoint, onto_axes, onto_points, scaled, seen_points, tilt_deg, upright

_OTHER_UNIT = 5.0  # lengths that differ by such a factor are not of one unit

Clicks = Mapping[str, Mapping[str, np.ndarray]]  # camera -> point -> pixel (2,)


@dataclass(frozen=True, eq=False)
class WorldEvidence:
    """What tells where the world of a rig is; at most one of ``points``, ``axes``, ``board`` and ``up`` gives the frame.

    Parameters
    ----------
    points : CSV file of control points.
    axes : CSV file of clicks on ``origin``, ``x`` and ``y``.
    board, board_images : a board that lies still, and camera -> image file.
    up : (3,) the direction of the present world that becomes z.
    fit_scale : points or a board also give the scale.
    wand, wand_m : CSV file of clicks on its ends, and its length in meters.
    plumb : CSV file of clicks on ``top`` and ``bottom``.
    """

    points: str | Path | None = None
    axes: str | Path | None = None
    board: Board | None = None
    board_images: Mapping[str, str | Path] | None = None
    up: np.ndarray | None = None
    fit_scale: bool = False
    wand: str | Path | None = None
    wand_m: float = 0.0
    plumb: str | Path | None = None

    @property
    def has_frame(self) -> bool:
        """Whether origin or axes are given other than by a plumb line."""
        return any(each is not None for each in (self.points, self.axes, self.board, self.up))


@dataclass(frozen=True)
class PointsFit:
    """How well the points of the rig fit their known places.

    Parameters
    ----------
    n_points, rms_m : their number, and root mean square of their distances after the fit.
    worst, worst_m : name and distance of the worst.
    worst_px : largest distance of a pixel to the point that its rays meet in.
    scale : times which lengths of the rig are those of the points.
    """

    n_points: int
    rms_m: float
    worst: str
    worst_m: float
    worst_px: float
    scale: float


@dataclass(frozen=True, eq=False)
class WandFit:
    """The wand's lengths (n,) in the rig, meters, the factor to its true length, and whether the rig is scaled by that."""

    lengths_m: np.ndarray
    factor: float
    applied: bool

    @property
    def length_m(self) -> float:
        """Median length."""
        return float(np.median(self.lengths_m))


@dataclass(frozen=True, eq=False)
class WorldFit:
    """The rig in its new world, and what was measured on the way; None where there was no such evidence.

    Parameters
    ----------
    rig : with cameras and lights in the new world.
    points : of control points or a board.
    tilt_deg : angle of the plumb line to the z axis of the frame, before it turns it.
    wand : of a wand.
    """

    rig: CameraRig
    points: PointsFit | None = None
    tilt_deg: float | None = None
    wand: WandFit | None = None


def fit_world(rig: CameraRig, evidence: WorldEvidence) -> WorldFit:
    """Change the world of a rig: first its frame, then its vertical, then its scale.

    Parameters
    ----------
    rig : in its present world.
    evidence : of the new one.

    Returns
    -------
    The changed rig, with the residuals of the evidence.

    Raises
    ------
    TrackerError : points that do not fix a frame, are in another unit, or are seen by one camera only; naming them.
    """
    rig, points = _in_frame(rig, evidence)
    rig, tilt = _by_plumb_line(rig, evidence)
    rig, wand = _by_wand(rig, evidence)
    return WorldFit(rig, points, tilt, wand)


def with_world(rig_file: RigFile, rig: CameraRig) -> RigFile:
    """The rig file with other places of cameras and lights.

    Parameters
    ----------
    rig_file : of the same cameras.
    rig : where they are now.

    Returns
    -------
    A copy.
    """
    moved = rig_file.with_extrinsics({camera.name: camera.T_world_cam for camera in rig})
    return moved.model_copy(update={"lights": rig_file_of(rig).lights})


def board_points(
    rig: CameraRig, board: Board, files: Mapping[str, str | Path]
) -> tuple[Clicks, dict[str, np.ndarray]]:  # fmt: skip
    """Corners of a board in one image a camera, those that two cameras or more see.

    Parameters
    ----------
    rig : its cameras.
    board : that lies still.
    files : camera -> image.

    Returns
    -------
    clicks, places : camera -> corner -> pixel (2,); corner -> its place (3,) in the board's frame.

    Raises
    ------
    TrackerError : a board that looks the same upside down, a camera that the rig has not, an image without the board or of
        another size than the camera's, or no corner that two cameras see.
    """
    if board.turns_unseen:
        raise TrackerError("this chessboard looks the same upside down: cameras may not agree on its corners; take another")
    clicks, detector = {}, BoardDetector(board)
    for camera, file in files.items():
        lens, image = rig[camera].model, cv2.imread(str(file))
        if image is None:
            raise SourceError(file, "cannot be read as an image")
        if image.shape[:2] != (lens.height, lens.width):  # a still, where the rig is for videos
            expected = f"expected an image of {lens.width}x{lens.height}, for which the lens of camera '{camera}' is"
            raise SourceError(file, f"{expected}, got {image.shape[1]}x{image.shape[0]}")
        view = detector.find(image)
        if view is None:
            raise SourceError(file, f"no {board} in it")
        clicks[camera] = {f"corner {i}": pixel for i, pixel in zip(view.ids, view.pixels, strict=True)}
    twice = {name for points in clicks.values() for name in points if sum(name in other for other in clicks.values()) > 1}
    if not twice:
        raise TrackerError(f"expected images of the board from two cameras, of the same corners, got {', '.join(files)}")
    clicks = {camera: {n: p for n, p in points.items() if n in twice} for camera, points in clicks.items()}
    return clicks, {f"corner {i}": corner for i, corner in enumerate(board.corners)}


def _in_frame(rig: CameraRig, evidence: WorldEvidence) -> tuple[CameraRig, PointsFit | None]:
    """The rig in the frame of points, axes, a board or a vertical."""
    if evidence.up is not None:
        return upright(evidence.up).rig(rig), None
    if evidence.axes is not None:
        seen = seen_points(rig, load_clicks(evidence.axes))
        change = onto_axes(*(_place(evidence.axes, seen, name) for name in ("origin", "x", "y")))
        return change.rig(rig), None
    if evidence.points is not None:
        return _on_points(rig, *_control_points(evidence.points), evidence.fit_scale)
    if evidence.board is not None:
        return _on_points(rig, *board_points(rig, evidence.board, evidence.board_images or {}), evidence.fit_scale)
    return rig, None


def _control_points(path: str | Path) -> tuple[Clicks, dict[str, np.ndarray]]:
    found = load_control_points(path)
    clicks = {camera: dict(zip(seen.names, seen.pixels, strict=True)) for camera, seen in found.items()}
    places = {name: place for seen in found.values() for name, place in zip(seen.names, seen.points, strict=True)}
    return clicks, places


def _on_points(
    rig: CameraRig, clicks: Clicks, places: Mapping[str, np.ndarray], fit_scale: bool
) -> tuple[CameraRig, PointsFit]:  # fmt: skip
    seen = seen_points(rig, clicks)
    points, targets = np.array([point.place for point in seen.values()]), np.array([places[name] for name in seen])
    scale = onto_points(points, targets, with_scale=True).scale
    if not fit_scale and not 1.0 / _OTHER_UNIT < scale < _OTHER_UNIT:
        problem = "one of them is not in meters; --scale goes by the points"
        raise TrackerError(f"lengths of the rig times {scale:.4g} are those of the points: {problem}")
    change = onto_points(points, targets, fit_scale)
    assert change.residuals_m is not None
    worst = int(np.argmax(change.residuals_m))
    rms_m = float(np.sqrt(np.mean(change.residuals_m**2)))
    worst_px = max(point.worst_px for point in seen.values())
    return change.rig(rig), PointsFit(len(points), rms_m, list(seen)[worst], float(change.residuals_m[worst]), worst_px, scale)


def _by_plumb_line(rig: CameraRig, evidence: WorldEvidence) -> tuple[CameraRig, float | None]:
    """The rig upright, where a plumb line alone gives the vertical."""
    if evidence.plumb is None:
        return rig, None
    seen = seen_points(rig, load_clicks(evidence.plumb))
    up = _place(evidence.plumb, seen, "top") - _place(evidence.plumb, seen, "bottom")
    tilt = tilt_deg(up)
    return (rig if evidence.has_frame else upright(up).rig(rig)), tilt


def _by_wand(rig: CameraRig, evidence: WorldEvidence) -> tuple[CameraRig, WandFit | None]:
    """The rig in the wand's scale, unless control points have set the scale."""
    if evidence.wand is None:
        return rig, None
    seen = seen_points(rig, load_clicks(evidence.wand))
    pairs = [name[:-1] for name in seen if name.endswith("a") and f"{name[:-1]}b" in seen]
    if not pairs:
        raise FileFormatError(evidence.wand, "point", "two ends at least, such as 1a and 1b", list(seen))
    lengths = np.array([np.linalg.norm(seen[f"{pair}a"].place - seen[f"{pair}b"].place) for pair in pairs])
    if np.median(lengths) < LEAST_M:
        raise TrackerError(f"{evidence.wand}: the ends of the wand are at the same place")
    applied = not (evidence.points is not None and evidence.fit_scale)
    fit = WandFit(lengths, evidence.wand_m / float(np.median(lengths)), applied)
    return (scaled(fit.factor).rig(rig) if applied else rig), fit


def _place(path: str | Path, seen: Mapping[str, SeenPoint], name: str) -> np.ndarray:
    if name not in seen:
        raise FileFormatError(path, "point", f"a point named '{name}'", list(seen))
    return seen[name].place
