"""Sections `board` and `synthetic_rig` of the calibration benchmark: rigs from a board, a recorded one and simulated ones."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tracker_node.calibration.board.adjustment import BoardAdjustmentOptions, BoardState, adjust_boards
from tracker_node.calibration.board.board import Board, BoardView
from tracker_node.calibration.board.refinement import BoardRigOptions, rows_of
from tracker_node.calibration.board.report import camera_metrics, rms
from tracker_node.calibration.board.rig import BoardRig, calibrate_rig
from tracker_node.calibration.board.start import place_boards
from tracker_node.calibration.board.views import CameraViews, detect_boards, velocities
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.loaders.images.source import open_source
from tracker_node.loaders.images.stamps import load_stamp_file
from tracker_node.loaders.rig.calibration_toml import load_pose2sim
from tracker_node.synthesis.scenes.scene import looking_at

RECORDING = "caliscope_board/post_optimization"
RECORDED_BOARD = Board("charuco", 4, 5, 0.054, 0.75, "DICT_4X4_1000", inverted=True)
ROOM_BOARD = Board("charuco", 9, 7, 0.09)
NOISE_PX, N_POSES = 0.3, 250
# The three lens models; of distortions that such lenses have
LENSES = {
    "plumb_bob": (-0.12, 0.06, 1e-3, -6e-4, 0.01),
    "rational_polynomial": (0.3, 0.05, 5e-4, -4e-4, 0.01, 0.45, 0.08, 0.01),
    "equidistant": (0.02, -0.01, 0.004, -0.001),
}

Figures = dict[str, float | int]


def board_section(quick: bool = False) -> Figures:
    """The recorded board, by its videos alone, against the calibration that comes with it; empty without the recording.

    Beside it, unless in haste: the same with the lenses of that calibration, with and without faith in the stamps, and what both
    calibrations make of images that had no part in ours.
    """
    folder = Path(os.environ.get("TRACKER_SHARED_DATA", "")) / RECORDING
    if not os.environ.get("TRACKER_SHARED_DATA") or not folder.is_dir():
        print("board: skipped, needs the recording caliscope_board in the folder that TRACKER_SHARED_DATA names")
        return {}
    shipped = load_pose2sim(folder / "camera_array.toml")
    times = {name: load_stamp_file(folder / "timestamps.csv", name) for name in shipped.names}
    sources = {name: open_source(folder / f"{name}.mp4", times_ns=times[name]) for name in shipped.names}
    seen = detect_boards(sources, RECORDED_BOARD)
    found = calibrate_rig(RECORDED_BOARD, seen)
    figures = _against("board", found, shipped)
    for name, camera in camera_metrics(found).items():
        figures |= {f"board.{name}.later_ms": 1e3 * camera.clock_s, f"board.{name}.jitter_ms": 1e3 * camera.jitter_s}
    if quick:
        return figures
    lenses = {camera.name: camera.model for camera in shipped}
    for key, clocks in (("board.shipped_lenses", "free"), ("board.shipped_lenses.exact_stamps", "exact")):
        other = calibrate_rig(RECORDED_BOARD, seen, BoardRigOptions(free_lenses=False, clocks=clocks), lenses)
        figures |= _against(key, other, shipped)
    return figures | _held_out(seen, shipped)


def _held_out(seen: Mapping[str, CameraViews], shipped: CameraRig) -> Figures:
    """Median distances in the middle third of the images, by our calibration from the others, and by the shipped one.

    Board poses and stamps are sought in both cases, lenses and places in neither.
    """
    n = max(view.image for camera in seen.values() for view in camera.views) + 1
    middle = range(n // 3, 2 * n // 3)
    rest = {k: replace(c, views=tuple(v for v in c.views if v.image not in middle)) for k, c in seen.items()}
    held = {k: replace(c, views=tuple(v for v in c.views if v.image in middle)) for k, c in seen.items()}
    names, time_steps = list(seen), calibrate_rig(RECORDED_BOARD, held).time_steps
    figures: Figures = {}
    for key, rig in (("own", calibrate_rig(RECORDED_BOARD, rest).rig), ("shipped", shipped)):
        lenses = tuple(rig[name].model for name in names)
        state = BoardState.at(lenses, np.array([rig[name].T_cam_world for name in names]), np.zeros((0, 4, 4)))
        state = BoardState.at(lenses, state.Ts_cam_world, place_boards(RECORDED_BOARD, names, state, time_steps))
        options = BoardAdjustmentOptions(1.0, free_lenses=False, free_cameras=False)
        rows = rows_of(names, time_steps)
        state = adjust_boards(RECORDED_BOARD.corners, rows, state, options).state
        options = replace(options, free_clocks=True, jitter_sigma_s=BoardRigOptions().stamp_sigma_s)
        for _ in range(3):
            moving = velocities(time_steps, state.Ts_world_board)
            adjustment = adjust_boards(RECORDED_BOARD.corners, rows, state, options, moving)
            state = adjustment.state
        figures[f"board.held_out.{key}_median_px"] = float(np.median(np.linalg.norm(adjustment.residuals_px, axis=1)))
    return figures


def _against(key: str, found: BoardRig, true: CameraRig) -> Figures:
    places, turns, focal = differences(found.rig, true)
    residuals = found.adjustment.residuals_px
    return {
        f"{key}.reprojection_px": rms(residuals),
        f"{key}.reprojection_median_px": float(np.median(np.linalg.norm(residuals, axis=1))),
        f"{key}.position_mm": 1e3 * max(places), f"{key}.angle_deg": float(np.degrees(max(turns))),
        f"{key}.k_percent": 100.0 * max(focal), f"{key}.outliers": len(found.outliers),
        f"{key}.place_sigma_mm": 1e3 * max(c.place_sigma_m for c in camera_metrics(found).values()),
    }  # fmt: skip


def differences(found: CameraRig, true: CameraRig) -> tuple[list[float], list[float], list[float]]:
    """Meters, radians and relative focal lengths by which cameras differ.

    The rigs are laid onto each other first, rigidly, by least squares: a radian counts as much as a meter.
    """
    wanted = np.array([true[name].T_world_cam for name in found.names])
    poses = np.array([camera.T_world_cam for camera in found])
    arms = np.vstack([np.eye(3), -np.eye(3)])
    poses = se3.rigid_fit(*(np.vstack([se3.apply(T, arms) for T in Ts]) for Ts in (poses, wanted))) @ poses
    places = [float(np.linalg.norm(a[:3, 3] - b[:3, 3])) for a, b in zip(poses, wanted, strict=True)]
    turns = [float(np.linalg.norm(so3.log(a[:3, :3].T @ b[:3, :3]))) for a, b in zip(poses, wanted, strict=True)]
    focal = [float(np.abs(np.diag(c.model.K)[:2] / np.diag(true[c.name].model.K)[:2] - 1.0).max()) for c in found]
    return places, turns, focal


def synthetic_rig_section(quick: bool = False) -> Figures:
    """Six cameras of three lens models around a room, corners with 0.3 px of noise; the worst camera, of the median trial."""
    worst: list[tuple[float, ...]] = []
    trials = 1 if quick else 5
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        rig = room()
        found = calibrate_rig(ROOM_BOARD, film(rig, rng), BoardRigOptions(clocks="exact", most_time_steps=N_POSES))
        places, turns, focal = differences(found.rig, rig)
        print(f"  trial {seed}: {[round(1e3 * p, 2) for p in places]} mm, {[round(float(np.degrees(t)), 3) for t in turns]} deg")
        worst.append((100.0 * max(focal), 1e3 * max(places), float(np.degrees(max(turns))), rms(found.adjustment.residuals_px)))
    figures: Figures = {"synthetic_rig.trials": trials}
    for what, values in zip(("k_percent", "position_mm", "angle_deg", "reprojection_px"), np.array(worst).T, strict=True):
        figures[f"synthetic_rig.{what}"] = float(np.median(values))
        figures[f"synthetic_rig.{what}_worst_trial"] = float(values.max())
    return figures


def room(n: int = 6, radius: float = 3.2) -> CameraRig:
    """Cameras on a circle, at three heights, that look at the middle of the volume."""
    cameras = []
    for i in range(n):
        angle = 2.0 * np.pi * i / n + 0.1
        center = np.array([radius * np.cos(angle), radius * np.sin(angle), 1.2 + 0.4 * (i % 3)])
        kind = list(LENSES)[i % len(LENSES)]
        K = np.array([[900.0 + 15 * i, 0.0, 636.0 + 3 * i], [0.0, 902.0 + 15 * i, 402.0 - 4 * i], [0.0, 0.0, 1.0]])
        model = CameraModel(1280, 800, K, kind, np.array(LENSES[kind]))
        cameras.append(Camera(f"cam{i + 1}", model, looking_at(center, np.array([0.0, 0.0, 1.0]))))
    return CameraRig(tuple(cameras))


def film(rig: CameraRig, rng: np.random.Generator, n: int = N_POSES, board: Board = ROOM_BOARD) -> dict[str, CameraViews]:
    """What the cameras see of a board held still in ``n`` places all over the volume, towards one camera or between two."""
    views: dict[str, list[BoardView]] = {name: [] for name in rig.names}
    for i in range(n):
        T_world_board = _held(rig, rng)
        for camera in rig:
            view = _seen(camera, board, T_world_board, i, rng)
            if view is not None:
                views[camera.name].append(view)
    return {c.name: CameraViews((c.model.width, c.model.height), tuple(views[c.name]), n) for c in rig}


def _held(rig: CameraRig, rng: np.random.Generator) -> np.ndarray:
    """T_world_board."""
    place = np.array([*rng.uniform(-1.7, 1.7, 2), rng.uniform(0.3, 2.0)])
    k = int(rng.integers(len(rig)))
    shown: Sequence[Camera] = (rig.cameras[k], rig.cameras[(k + 1) % len(rig)])
    towards = np.mean([c.center for c in shown[: int(rng.integers(1, 3))]], axis=0) - place
    z = towards / np.linalg.norm(towards)
    x = np.cross([0.0, 0.0, 1.0], z)
    x /= np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z]) @ so3.exp(rng.normal(0.0, [0.35, 0.35, 0.6]))
    return se3.from_rotation_translation(R, place)


def _seen(camera: Camera, board: Board, T_world_board: np.ndarray, image: int, rng: np.random.Generator) -> BoardView | None:
    T = camera.T_cam_world @ T_world_board
    if -T[:3, 2] @ T[:3, 3] < 0.35 * np.linalg.norm(T[:3, 3]):  # from behind, or more than 70 degrees aslant
        return None
    pixels, valid = camera.model.project(se3.apply(T, board.corners))
    ids = np.flatnonzero(valid & camera.model.in_image(pixels))
    if len(ids) < 12:
        return None
    noisy = pixels[ids] + NOISE_PX * rng.standard_normal((len(ids), 2))
    return BoardView(round(1e9 * image), ids, noisy, 2.0, image)
