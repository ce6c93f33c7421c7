"""Folders of five other programs' projects: which videos and which calibration belong together, trial by trial.

Folders are given at any level: a project, a session, a trial. What a calibration says is read in `loaders.rig`.

=========  =====================================================  ==========================================================
program    calibration                                            videos
=========  =====================================================  ==========================================================
OpenCap    ``Videos/Cam0/cameraIntrinsicsExtrinsics.pickle``      ``Videos/Cam0/InputMedia/TRIAL``; of LabValidation
                                                                  ``VideoData/Session0/Cam0/TRIAL``
Caliscope  ``calibration/extrinsic/capture_volume/`` or, before,  ``recordings/TRIAL/cam_0.mp4``, before ``port_0.mp4``, and
           at the top: ``camera_array.toml``, ``config.toml``     first in folders of the top
FreeMoCap  ``*_camera_calibration.toml``                          ``synchronized_videos``, first ``SyncedVideos``, now
                                                                  ``videos/synchronized``
Anipose    ``calibration/calibration.toml``, there or above       ``videos-raw``; cameras by ``cam_regex`` of ``config.toml``
Pose2Sim   ``calibration/Calib*.toml``, there or above, first     ``videos``, first ``raw-2d``
           ``calib-2d``
=========  =====================================================  ==========================================================
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ..errors import FileFormatError
from .decoding import IMAGE_SUFFIXES
from .rig.opencap_pickle import FILE_NAME
from .source_address import files_of_cameras, natural, rivals
from .whole_file import read_text
from .yaml_file import read_mapping

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
    Camera -> video, of those that have one; by their names, see `files_of_cameras`, or in their order.

    Raises
    ------
    FileFormatError : fewer than two of several cameras have a video, and the numbers of cameras and videos differ; or several
        videos fit a camera.
    """
    found = files_of_cameras(trial.videos, names)
    alike = {name: rivals(trial.videos, name) for name in names if name not in found}
    if len(names) != len(trial.videos) and any(alike.values()):
        name, files = next(each for each in alike.items() if each[1])
        fitting = ", ".join(trial.videos[file].name for file in files)
        raise FileFormatError(trial.folder, "(videos)", f"one for {name} (`rig import --sources` names each)", fitting)
    if len(found) >= min(2, len(names)):
        for name in names:
            if name not in found:
                tell(f"camera {name} has no video in {trial.folder} and is left out")
        return {name: trial.videos[file] for name, file in found.items()}
    if len(names) != len(trial.videos):
        expected = f"a video for each of the cameras {', '.join(names)}, by its name or its number"
        raise FileFormatError(trial.folder, "(videos)", expected, ", ".join(map(str, trial.videos)))
    files = sorted(trial.videos, key=natural)
    pairs = ", ".join(f"{name}: {trial.videos[file].name}" for name, file in zip(names, files, strict=True))
    tell(f"cameras and videos have different names and are paired in their order: {pairs}")
    return {name: trial.videos[file] for name, file in zip(names, files, strict=True)}


_FOLDERS = {  # what a project is known by
    "OpenCap": f"Videos/Cam*/InputMedia and Videos/Cam*/{FILE_NAME}",
    "Caliscope": "recordings/ and calibration/",
    "FreeMoCap": "synchronized_videos/",
    "Anipose": "videos-raw/ and config.toml",
    "Pose2Sim": "videos/ and calibration/, or videos/ and Config.toml",
}
PROGRAMS = tuple(_FOLDERS)
_STAMPS = ("timestamps.csv", "frame_time_history.csv")  # of Caliscope
_LEVELS = 3  # a session, a participant, a trial
_STATURE_M = (0.4, 3.0)


def find_trials(folder: str | Path, calibrated: bool = False) -> list[ProjectTrial]:
    """The trials of a project.

    Parameters
    ----------
    folder : of a project of one of `PROGRAMS`, or a part of it.
    calibrated : a calibration is given beside it, so that folders of videos are enough.

    Returns
    -------
    In natural order, at least one, with different names.

    Raises
    ------
    FileFormatError : no such folder, no project of a known program, or one without videos; settings that cannot be read.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileFormatError(folder, "(folder)", "the folder of a project", "a file" if folder.exists() else "no such folder")
    pose2sim = partial(_pose2sim, calibrated=calibrated)
    finders: tuple[Callable[[Path], list[ProjectTrial]], ...] = (_opencap, _caliscope, _freemocap, _anipose, pose2sim)
    for find in finders:
        if trials := find(folder):
            return trials
    alone = "or videos/" if calibrated else "or videos/ with --calibration"
    expected = f"a project with videos ({'; '.join(f'{program}: {folders}' for program, folders in _FOLDERS.items())}; {alone})"
    raise FileFormatError(folder, "(folder)", expected, ", ".join(path.name for path in subfolders(folder)) or "no folders")


def _opencap(folder: Path) -> list[ProjectTrial]:
    for place in (folder / "Videos", *subfolders(folder / "VideoData"), folder):
        cameras = [path for path in subfolders(place) if (path / FILE_NAME).is_file()]
        if cameras:
            break
    else:
        return []
    stature = _first(_height(above / "sessionMetadata.yaml") for above in _upward(place))
    found: dict[str, dict[str, Path]] = {}
    for camera in cameras:
        media = camera / "InputMedia"
        for trial in subfolders(media if media.is_dir() else camera):
            if trial.name not in ("calibration", "extrinsics") and (video := _best_video(trial)):
                found.setdefault(trial.name, {})[camera.name] = video
    files = tuple(camera / FILE_NAME for camera in cameras)
    return [
        ProjectTrial("OpenCap", name, place, files, videos, stature_m=stature)
        for name, videos in sorted(found.items(), key=lambda item: natural(item[0]))
        if len(videos) > 1
    ]


def _best_video(trial: Path) -> Path | None:
    """Of a trial's files that which OpenCap has made to begin together with those of the other cameras."""
    endings = ("_sync", "_syncdWithMocap", "")
    found = [path for path in videos_in(trial) if not path.stem.endswith("_rotated")]
    return min(found, key=lambda path: next(i for i, end in enumerate(endings) if path.stem.endswith(end)), default=None)


def _height(file: Path) -> float | None:
    return _stature(read_mapping(file).get("height_m")) if file.is_file() else None


def _caliscope(folder: Path) -> list[ProjectTrial]:
    extrinsic = folder / "calibration/extrinsic/capture_volume/camera_array.toml"
    places = (extrinsic, folder / "camera_array.toml", folder / "config.toml")
    calibration = next((path for path in places if path.is_file() and _has_cameras(path)), None)
    if calibration is None:
        return []
    within = folder / "recordings"
    trials = []
    for trial in subfolders(within if within.is_dir() else folder):
        cameras = {path.stem: path for path in videos_in(trial) if re.fullmatch(r"(cam|port)_\d+", path.stem)}
        if cameras and (trial.parent == within or trial.name != "calibration"):
            stamps = next((path for name in _STAMPS if (path := trial / name).is_file()), None)
            trials.append(ProjectTrial("Caliscope", trial.name, trial, (calibration,), cameras, stamp_file=stamps))
    return trials


def _has_cameras(path: Path) -> bool:
    """Whether a settings file of Caliscope holds what it has calibrated: ``[cameras.0]``, or ``[cam_0]`` before 0.2."""
    tables = _toml(path)
    nested = tables.get("cameras", tables)
    return isinstance(nested, dict) and any(isinstance(table, dict) and "matrix" in table for table in nested.values())


def _freemocap(folder: Path) -> list[ProjectTrial]:
    for name in ("synchronized_videos", "videos/synchronized", "SyncedVideos"):
        if videos := videos_in(folder / name):
            own = folder / f"{folder.absolute().name}_camera_calibration.toml"
            found = [own] if own.is_file() else sorted(folder.glob("*calibration*.toml"), key=natural)
            files = {video.stem: video for video in videos}
            return [ProjectTrial("FreeMoCap", "", folder / name, tuple(found), files, unit="mm")]
    return []


def _anipose(folder: Path) -> list[ProjectTrial]:
    config_file = next((file for above in _upward(folder) if (file := above / "config.toml").is_file()), None)
    if config_file is None:
        return []
    config = _toml(config_file)
    pipeline, pattern = _table(config, "pipeline"), _table(config, "triangulation").get("cam_regex", r"cam([0-9]+)")
    raw, results = str(pipeline.get("videos_raw", "videos-raw")), str(pipeline.get("calibration_results", "calibration"))
    trials = []
    for place in _below(folder, raw):
        calibration = [file for above in _upward(place.parent) if (file := above / results / "calibration.toml").is_file()]
        for rest, videos in _by_name(config_file, str(pattern), videos_in(place)).items():
            name = "_".join(part for part in (*place.parent.relative_to(folder).parts, rest) if part)
            trials.append(ProjectTrial("Anipose", name, place, tuple(calibration[:1]), videos, unit="mm"))
    return trials if len(trials) != 1 else [_alone(trials[0])]


def _by_name(config: Path, pattern: str, videos: Iterable[Path]) -> dict[str, dict[str, Path]]:
    """Videos of one recording have the same name but for the camera's: that name -> camera -> video."""
    try:
        expression = re.compile(pattern)
    except re.error as error:
        raise FileFormatError(config, "triangulation.cam_regex", "a regular expression", f"{pattern} ({error})") from None
    found: dict[str, dict[str, Path]] = {}
    for video in videos:
        if match := expression.search(video.stem):
            camera = (match[1] if expression.groups else match[0]) or ""
            found.setdefault(expression.sub("", video.stem).strip(" _-"), {})[camera.strip()] = video
    return found


def _pose2sim(folder: Path, calibrated: bool) -> list[ProjectTrial]:
    trials = []
    for name in ("videos", "raw-2d"):
        for place in _below(folder, name):
            calibration = _first(_pose2sim_calibration(above) for above in _upward(place.parent))
            configs = [file for above in _upward(place.parent) if (file := above / "Config.toml").is_file()]
            if videos := videos_in(place) if calibration or configs or calibrated else []:
                label = "_".join(place.parent.relative_to(folder).parts)
                stature = _first(_participant_height(_toml(file)) for file in configs)
                files = {video.stem: video for video in videos}
                program = "Pose2Sim" if calibration or configs else "videos"
                trials.append(ProjectTrial(program, label, place, tuple(calibration or ()), files, stature_m=stature))
    return sorted(trials, key=lambda trial: natural(trial.name)) if len(trials) != 1 else [_alone(trials[0])]


def _pose2sim_calibration(folder: Path) -> list[Path] | None:
    for place in (path for path in subfolders(folder) if "calib" in path.name.lower()):
        for pattern in ("Calib*.toml", "*.toml", "*.qca.txt"):
            if found := sorted(place.glob(pattern), key=natural):
                return found
    return None


def _participant_height(config: dict[str, Any]) -> Any:
    """Of one person: in ``[project]``, before 0.10 in ``[markerAugmentation]``."""
    return _first(_stature(_table(config, section).get("participant_height")) for section in ("project", "markerAugmentation"))


def _alone(trial: ProjectTrial) -> ProjectTrial:
    return ProjectTrial(**{**vars(trial), "name": ""})


def _below(folder: Path, name: str, levels: int = _LEVELS) -> Iterator[Path]:
    """Folders of a name in a folder, or in those below it; the folder itself if it has the name."""
    if folder.absolute().name == name:
        yield folder
    elif (folder / name).is_dir():
        yield folder / name
    elif levels:
        for path in subfolders(folder):
            yield from _below(path, name, levels - 1)


def _upward(folder: Path) -> list[Path]:
    """A folder and those above it in a project."""
    folder = folder.absolute()
    return [folder, *list(folder.parents)[:_LEVELS]]


def _toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise FileFormatError(path, "(file)", "a TOML file", str(error)) from error


def _table(values: dict[str, Any], name: str) -> dict[str, Any]:
    table = values.get(name)
    return table if isinstance(table, dict) else {}


def _first(values: Iterable[Any]) -> Any:
    return next((value for value in values if value is not None), None)


def _stature(value: Any) -> float | None:
    return float(value) if type(value) in (int, float) and _STATURE_M[0] <= value <= _STATURE_M[1] else None
