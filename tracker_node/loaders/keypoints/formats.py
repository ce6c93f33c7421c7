"""Which program has written points in images, and where they lie in the folders of other programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ...errors import FileFormatError
from ..whole_file import check_regular
from . import animals, coco, mediapipe, openpose
from .camera_people import PeopleOfImages, PointsByCamera
from .files import POINTS_BYTES, camera_keys, files_of, read_points_json
from .hdf5 import is_hdf5, open_hdf5

OPENPOSE, MMPOSE, MEDIAPIPE, DEEPLABCUT, SLEAP, COCO = "openpose", "mmpose", "mediapipe", "deeplabcut", "sleap", "coco"
_BY_FOLDER = {OPENPOSE: openpose.read, MMPOSE: coco.of_mmpose}
_BY_FILE: dict[str, dict[str, Callable[[Path], PeopleOfImages]]] = {  # readers by the ends of names; the first for all others
    MEDIAPIPE: {".json": mediapipe.of_json, ".csv": mediapipe.of_csv},
    DEEPLABCUT: {".h5": animals.of_deeplabcut_hdf5, ".csv": animals.of_deeplabcut_csv},
    SLEAP: {".h5": animals.of_sleap_hdf5, ".csv": animals.of_sleap_csv},
    COCO: {".json": coco.of_coco},
}
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
            return SLEAP if animals.is_analysis(opened) else DEEPLABCUT
    if file.suffix.lower() == ".zip":
        return OPENPOSE
    if file.suffix.lower() == ".csv":
        return _of_header(file)
    if file.suffix.lower() == ".json":
        return _of_json(file)
    raise FileFormatError(file, "(file)", _KNOWN, f"a file *{file.suffix}")


def load_points(path: str | Path, names: Sequence[str] | None = ()) -> PointsByCamera:
    """People in the images of each camera, whatever program has found them.

    Parameters
    ----------
    path : file or folder; the folder of a project of Pose2Sim or anipose will do.
    names : of the points, in the order of a file that has numbers only; empty: those of known detectors, by how many there are;
        None: names do not matter, whatever the detector.

    Returns
    -------
    Name of the camera's file or folder -> people by image.

    Raises
    ------
    FileFormatError : naming file and field.
    MissingExtraError : H5 files, and h5py is not installed.
    """
    place = points_folder(path)
    return {key: images.camera(names) for key, images in _read(place, detect(place)).items()}


def _read(path: Path, kind: str) -> dict[str, PeopleOfImages]:
    if kind in _BY_FOLDER:
        return _BY_FOLDER[kind](path)
    readers = _BY_FILE[kind]
    files = files_of(path, tuple(readers))
    tables = [file for file in files if file.suffix.lower() == ".h5"]  # where a program has written both, they say the same
    first = next(iter(readers.values()))
    return {key: readers.get(file.suffix.lower(), first)(file) for key, file in camera_keys(tables or files).items()}


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
    if coco.is_video(content) or (isinstance(content, dict) and "instances" in content):
        return MMPOSE
    if isinstance(content, list) and (not content or (isinstance(content[0], dict) and "keypoint_scores" in content[0])):
        return MMPOSE
    if mediapipe.is_landmarks(content):
        return MEDIAPIPE
    raise FileFormatError(file, "(content)", _KNOWN, content)
