"""One trial of another program's project, and which of its videos is which camera's."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...errors import FileFormatError
from ..decoding import IMAGE_SUFFIXES
from ..rig.lens import identifier

VIDEO_SUFFIXES = (".mp4", ".mov", ".avi", ".mkv", ".m4v", ".mpg", ".mpeg", ".webm")


@dataclass(frozen=True)
class ProjectTrial:
    """What a program has recorded at once.

    Attributes
    ----------
    program, name : of the program; of the trial, "" for one that is alone.
    folder : that has the videos.
    calibration : files found for it: of OpenCap one a camera, of others one; none or several where that is not clear.
    videos : what a file says of its camera -> the file; at least one.
    unit : of the calibration, unless its owner says otherwise.
    stature_m : of the person; None: the project does not say.
    stamp_file : times of all images; None: those of the files.
    """

    program: str
    name: str
    folder: Path
    calibration: tuple[Path, ...]
    videos: Mapping[str, Path]
    unit: str = "m"
    stature_m: float | None = None
    stamp_file: Path | None = None


def is_video(path: Path) -> bool:
    return path.suffix.lower() in VIDEO_SUFFIXES and not path.name.startswith(".") and path.is_file()


def natural(text: str | Path) -> list[tuple[int, int, str]]:
    """Key of an order in which ``cam10`` comes after ``cam9``."""
    parts = re.split(r"(\d+)", str(text))
    return [(1, int(part), "") if part.isdigit() else (0, 0, part.lower()) for part in parts if part]


def subfolders(folder: Path) -> list[Path]:
    """Those in a folder, hidden ones left out, in natural order; none where it cannot be read."""
    try:
        return sorted((path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")), key=natural)
    except OSError:
        return []


def videos_in(folder: Path) -> list[Path]:
    """The videos of a folder in natural order; none where it is missing or cannot be read."""
    try:
        return sorted((path for path in folder.iterdir() if is_video(path)), key=natural)
    except OSError:
        return []


def recordings_in(folder: Path) -> list[Path]:
    """The videos of a folder, or else its folders of images, in natural order."""
    return videos_in(folder) or [path for path in subfolders(folder) if has_images(path)]


def has_images(folder: Path) -> bool:
    """Whether image files lie in a folder."""
    try:
        return any(path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith(".") for path in folder.iterdir())
    except OSError:
        return False


def recordings_by_camera(folder: Path, names: Sequence[str], tell: Callable[[str], None]) -> dict[str, Path]:
    """The recording of each camera in a folder, see `videos_by_camera`.

    Parameters
    ----------
    folder : with videos, or folders of images.
    names : of the cameras.
    tell : called with a sentence where the names do not settle it.

    Returns
    -------
    Camera -> recording, of those that have one.
    """
    videos = {path.stem if path.is_file() else path.name: path for path in recordings_in(folder)}
    return videos_by_camera(ProjectTrial("", "", folder, (), videos), names, tell)


def videos_by_camera(trial: ProjectTrial, names: Sequence[str], tell: Callable[[str], None]) -> dict[str, Path]:
    """The video of each camera.

    Parameters
    ----------
    trial : with its videos.
    names : of the cameras in its calibration.
    tell : called with a sentence where the names do not settle it.

    Returns
    -------
    Camera -> video, of those that have one; by equal names, or by the last numbers in the names, or in their order.

    Raises
    ------
    FileFormatError : fewer than two cameras have a video, and the numbers of cameras and videos differ.
    """
    for key in (lambda text: identifier(text).lower(), _number):
        cameras, videos = ({key(name): name for name in found} for found in (names, trial.videos))
        both = [value for value in cameras if value in videos and value is not None]
        if len(cameras) == len(names) and len(videos) == len(trial.videos) and len(both) > 1:
            for name in (cameras[value] for value in cameras if value not in both):
                tell(f"camera {name} has no video in {trial.folder} and is left out")
            return {cameras[value]: trial.videos[videos[value]] for value in both}
    if len(names) != len(trial.videos) or len(names) < 2:
        expected = f"a video for each of the cameras {', '.join(names)}, by its name or its number"
        raise FileFormatError(trial.folder, "(videos)", expected, ", ".join(map(str, trial.videos)))
    files = sorted(trial.videos, key=natural)
    pairs = ", ".join(f"{name}: {trial.videos[file].name}" for name, file in zip(names, files, strict=True))
    tell(f"cameras and videos have different names and are paired in their order: {pairs}")
    return {name: trial.videos[file] for name, file in zip(names, files, strict=True)}


def _number(name: str) -> int | None:
    """The last number of a name: that of the camera in ``int_cam01_img`` and ``rec2_Cam1_synchronized``."""
    found = re.findall(r"\d{1,9}", name)
    return int(found[-1]) if found else None
