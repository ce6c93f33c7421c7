"""Projects of other programs as these programs write them, with known cameras and short videos."""

import pickle
from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np

from helpers.cameras.camera_rigs import circle_rig
from helpers.sources.variable_rate_video import write_video
from tracker_node.camera.rig import CameraRig

RATE_HZ = 25.0
BOARD_MM = 60.0


def rig(n_cameras: int = 3) -> CameraRig:
    """Cameras of 640 x 480 around a place where somebody stands; the world has z up and meters."""
    return circle_rig(n_cameras)


def film(path: Path, size: tuple[int, int] = (640, 480)) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    return write_video(path, [np.full((size[1], size[0], 3), 80 + i, np.uint8) for i in range(3)], RATE_HZ)


def films(folder: Path, names: Iterable[str]) -> None:
    for name in names:
        film(folder / name)


def pose_of(camera, world: np.ndarray, unit: float) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and translation from another world, ``ours = world @ theirs``, of another unit, to the camera."""
    T = camera.T_cam_world @ np.vstack([np.column_stack([world, np.zeros(3)]), [0, 0, 0, 1]])
    return T[:3, :3], T[:3, 3] * unit


def toml_table(title: str, camera, world: np.ndarray, unit: float, lines: Iterable[str] = (), matrix: bool = False) -> str:
    """One camera as aniposelib and the programs that follow it write it; ``matrix``: with a rotation of nine numbers."""
    rotation, translation = pose_of(camera, world, unit)
    turn = rotation.tolist() if matrix else cv2.Rodrigues(rotation)[0].ravel().tolist()
    return "\n".join([
        f"[{title}]", *lines,
        f"matrix = {camera.model.K.tolist()}", f"distortions = {camera.model.distortion.tolist()}",
        f"rotation = {turn}", f"translation = {translation.tolist()}", "",
    ]) + "\n"  # fmt: skip


UPRIGHT, Y_DOWN = np.eye(3), np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Axes of their worlds in ours: the same; y down and z ahead, as of a camera that is the origin."""


def pose2sim(folder: Path, old: bool = False, trial: str = "") -> Path:
    """One trial, or one in a session with a participant whose calibration lies at the top; ``old``: before 0.4."""
    tables = [
        toml_table(
            f"int_{c.name}_img", c, UPRIGHT, 1.0, [f'name = "int_{c.name}_img"', "size = [ 640.0, 480.0]", "fisheye = false"]
        )
        for c in rig()
    ]
    calibration = folder / ("calib-2d" if old else "calibration") / ("Calib_qca.toml" if old else "Calib_scene.toml")
    calibration.parent.mkdir(parents=True)
    calibration.write_text("".join(tables) + "[metadata]\nadjusted = false\nerror = 0.0\n")
    section = "markerAugmentation" if old else "project"
    (folder / "Config.toml").write_text(
        f"[{section}]\nparticipant_height = 1.68\n[project{'.x' if not old else ''}]\nframe_rate = 25\n"
    )
    films(folder / trial / ("raw-2d" if old else "videos"), [f"{c.name}.mp4" for c in rig()])
    return folder


def anipose(folder: Path) -> Path:
    """Two sessions with the calibration of each or of the experiment; names of cameras by an expression."""
    (folder / "day1/session1/calibration").mkdir(parents=True)
    (folder / "calibration").mkdir()
    tables = [
        toml_table(f"cam_{i}", c, Y_DOWN, 1000.0, [f'name = "{"ABC"[i]}"', "size = [ 640, 480,]"]) for i, c in enumerate(rig())
    ]
    for place in (folder, folder / "day1/session1"):
        (place / "calibration/calibration.toml").write_text("".join(tables) + "[metadata]\nadjusted = false\nerror = 0.4\n")
    (folder / "config.toml").write_text("project = 'x'\nnesting = 2\n[triangulation]\ncam_regex = '-cam([A-Z])'\n")
    films(folder / "day1/session1/videos-raw", [f"walk{k}-cam{letter}.mp4" for k in (1, 2) for letter in "ABC"])
    films(folder / "day1/session2/videos-raw", [f"run-cam{letter}.mp4" for letter in "ABC"])
    return folder


def freemocap(folder: Path, generation: int = 1) -> Path:
    """Generation 0: pre-alpha; 1: with the names of the calibration's videos; 2: tables named by the camera's number."""
    size = {0: "size = [ 640, 480,]", 1: "size = [ 640, 480,]", 2: "image_size = [640, 480]"}[generation]
    names = [{0: f"{i}", 1: f"calib_session_Cam{i}_synchronized", 2: f"00{i}"}[generation] for i in range(1, 4)]
    titles = names if generation == 2 else [f"cam_{i}" for i in range(3)]
    extra = ["id = '0'", "index = 0", "world_position = [0.0, 0.0, 0.0]"] if generation == 2 else []
    tables = [
        toml_table(f'"{title}"' if generation == 2 else title, c, Y_DOWN, 1000.0, [f'name = "{name}"', size, *extra])
        for title, name, c in zip(titles, names, rig(), strict=True)
    ]
    folder.mkdir(parents=True)
    board = "[metadata.board]\nsquare_length_mm = 58.0\n" if generation == 2 else "[metadata]\ncharuco_square_size = 58.0\n"
    (folder / f"{folder.name}_camera_calibration.toml").write_text("".join(tables) + board)
    place = {0: "SyncedVideos", 1: "synchronized_videos", 2: "videos/synchronized"}[generation]
    films(folder / place, [f"rec_2024-05-01_Camera_00{i}.mp4" if generation == 2 else f"rec1_Cam{i}.mp4" for i in range(1, 4)])
    return folder


def caliscope(folder: Path, generation: int = 2) -> Path:
    """Generation 0: ``config.toml`` and folders at the top; 1: ``camera_array.toml`` at the top; 2: as of 0.7."""
    prefix = "port" if generation == 0 else "cam"
    tables = []
    for i, camera in enumerate(rig()):
        lines = [f"{'port' if generation == 0 else 'cam_id'} = {i}", "size = [640, 480]", "rotation_count = 0", "ignore = false"]
        tables.append(toml_table(f"{'cam_' if generation == 0 else 'cameras.'}{i}", camera, UPRIGHT, 1.0, lines, generation < 2))
    tables.append(f"[{'cam_3' if generation == 0 else 'cameras.3'}]\nsize = [640, 480]\nignore = true\n")  # not calibrated
    place = {0: "config.toml", 1: "camera_array.toml", 2: "calibration/extrinsic/capture_volume/camera_array.toml"}[generation]
    (folder / place).parent.mkdir(parents=True, exist_ok=True)
    top = "CreationDate = 2023-05-06T11:12:27.631355\nfps_recording = 24\n\n" if generation == 0 else ""
    (folder / place).write_text(top + "".join(tables) + "[charuco]\ncolumns = 4\n" * (generation == 0))
    films(folder / "calibration/extrinsic", [f"{prefix}_{i}.mp4" for i in range(3)])
    for trial in ("walking",) if generation == 0 else ("recordings/walking", "recordings/sitting"):
        films(folder / trial, [f"{prefix}_{i}.mp4" for i in range(3)])
    if generation == 2:
        rows = [f"{i},{100.0 + k / RATE_HZ + 0.002 * i}" for k in range(3) for i in range(3)]
        (folder / "recordings/walking/timestamps.csv").write_text("\n".join(["cam_id,frame_time", *rows]) + "\n")
    return folder


WALL, WALL_UPSIDE_DOWN, GROUND = (
    np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
    np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
)
"""Axes of OpenCap's checkerboard in our world: upright on a wall, upside down there, and on the ground."""


def opencap(
    folder: Path,
    board: np.ndarray = WALL,
    lab: bool = False,
    dump: Callable = pickle.dump,
    names: Iterable[str] = ("Cam0", "Cam1", "Cam2"),
) -> Path:
    """A downloaded session, or one of LabValidation."""
    place = folder / ("VideoData/Session0" if lab else "Videos")
    for name, camera in zip(names, rig(), strict=True):
        rotation, translation = pose_of(camera, board, 1000.0)
        values = {
            "distortion": np.append(camera.model.distortion, 0.0)[None], "intrinsicMat": camera.model.K.copy(),
            "imageSize": np.array([[480], [640]]), "rotation": rotation, "translation": translation[:, None],
            "rotation_EulerAngles": cv2.Rodrigues(rotation)[0],
        }  # fmt: skip
        (place / name).mkdir(parents=True)
        with open(place / name / "cameraIntrinsicsExtrinsics.pickle", "wb") as stream:
            dump(values, stream)
        media = place / name if lab else place / name / "InputMedia"
        for trial in ("extrinsics" if lab else "calibration", "neutral", "squats"):
            film(media / trial / f"{trial}.{'avi' if lab else 'mov'}")
        film(media / "squats" / f"squats_sync{'dWithMocap.avi' if lab else '.mp4'}")
    (folder / "sessionMetadata.yaml").write_text(
        "checkerBoard:\n  black2BlackCornersHeight_n: 4\n  black2BlackCornersWidth_n: 5\n  placement: backWall\n"
        "  squareSideLength_mm: 35\ngender_mf: f\nheight_m: 1.62\nmass_kg: 60.0\n"
    )
    return folder
