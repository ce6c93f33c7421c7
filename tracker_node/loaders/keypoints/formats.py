"""Which program has written points in images, and where they lie in the folders of other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...errors import FileFormatError, UnknownNameError
from ..whole_file import check_regular
from . import coco, mediapipe, mmpose
from .camera_people import PointsByCamera
from .deeplabcut import load_deeplabcut
from .files import POINTS_BYTES, files_of, read_points_json
from .hdf5 import is_hdf5, open_hdf5
from .openpose import load_openpose
from .sleap import is_analysis, load_sleap

OPENPOSE, MMPOSE, MEDIAPIPE, DEEPLABCUT, SLEAP, COCO = "openpose", "mmpose", "mediapipe", "deeplabcut", "sleap", "coco"
FORMATS = (OPENPOSE, MMPOSE, MEDIAPIPE, DEEPLABCUT, SLEAP, COCO)
_KNOWN = (
    "points of OpenPose or Pose2Sim (JSON), MMPose or RTMPose (JSON), MediaPipe (JSON, CSV), DeepLabCut or anipose (H5, CSV),"
    " SLEAP (analysis H5, CSV), COCO or COCO-WholeBody results (JSON)"
)
_FOLDERS = ("pose", "pose-2d")  # of a project of Pose2Sim, of a session of anipose


def points_folder(path: str | Path) -> Path:
    """Where a project keeps its points in images: its folder ``pose`` (Pose2Sim) or ``pose-2d`` (anipose); or the path itself."""
    path = Path(path)
    return next((path / name for name in _FOLDERS if (path / name).is_dir()), path)


def detect(path: str | Path) -> str:
    """The format of a file, or of the first file in a folder, by its content.

    Raises
    ------
    FileFormatError : no file, or none of these formats.
    MissingExtraError : H5 files, and h5py is not installed.
    """
    files = files_of(path, (".h5", ".csv", ".json"))
    file = next((each for each in files if each.suffix.lower() == ".h5"), files[0])
    check_regular(file, 10 * POINTS_BYTES)
    if is_hdf5(file):
        with open_hdf5(file) as opened:
            return SLEAP if is_analysis(opened) else DEEPLABCUT
    if file.suffix.lower() == ".zip":
        return OPENPOSE
    if file.suffix.lower() == ".csv":
        return _of_header(file)
    if file.suffix.lower() == ".json":
        return _of_json(file)
    raise FileFormatError(file, "(file)", _KNOWN, f"a file *{file.suffix}")


def load_points(path: str | Path, names: Sequence[str] = (), kind: str | None = None) -> PointsByCamera:
    """People in the images of each camera, whatever program has found them.

    Parameters
    ----------
    path : file or folder; the folder of a project of Pose2Sim or anipose will do.
    names : of the points, in the order of a file that has numbers only; empty: those of known detectors, by their number.
    kind : one of `FORMATS`; None: by the content.

    Returns
    -------
    Name of the camera's file or folder -> people by image.

    Raises
    ------
    FileFormatError : naming file and field.
    UnknownNameError : a format that is not known.
    MissingExtraError : H5 files, and h5py is not installed.
    """
    place = points_folder(path)
    kind = detect(place) if kind is None else kind
    if kind == OPENPOSE:
        return load_openpose(place, names)
    if kind == MMPOSE:
        return mmpose.load_mmpose(place, names)
    if kind == MEDIAPIPE:
        return mediapipe.load_mediapipe(place, names)
    if kind == COCO:
        return coco.load_coco(place, names)
    if kind == DEEPLABCUT:
        return load_deeplabcut(place)
    if kind == SLEAP:
        return load_sleap(place)
    raise UnknownNameError("format of points", kind, FORMATS)


def _of_header(file: Path) -> str:
    with open(file, encoding="utf-8", errors="replace") as stream:
        header = tuple(cell.strip().strip('"') for cell in stream.readline(1_000_000).rstrip("\r\n").split(","))
    if header[0] == "scorer":
        return DEEPLABCUT
    if header[:2] == ("track", "frame_idx"):
        return SLEAP
    if mediapipe.is_header(header):
        return MEDIAPIPE
    raise FileFormatError(file, "header", _KNOWN, list(header[:6]))


def _of_json(file: Path) -> str:
    content = read_points_json(file)
    if isinstance(content, dict) and "people" in content:
        return OPENPOSE
    if coco.is_result(content):
        return COCO
    if mmpose.is_video(content) or (isinstance(content, dict) and "instances" in content):
        return MMPOSE
    if isinstance(content, list) and (not content or (isinstance(content[0], dict) and "keypoint_scores" in content[0])):
        return MMPOSE
    if mediapipe.is_landmarks(content):
        return MEDIAPIPE
    raise FileFormatError(file, "(content)", _KNOWN, content)
