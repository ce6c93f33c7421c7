"""What lies in the folder of a recording: videos, calibrations, markers, poses; nothing outside, nor links that lead there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ...errors import TrackerError
from ...loaders.projects import recordings_in, subfolders
from ...loaders.rig.formats import RIG, detect
from ...loaders.source_address import natural
from ...loaders.whole_file import read_text

WORLD_FOLDERS = ("world", "floor")
_NO_RECORDINGS = {"backgrounds", "background", "empty", "stills", "poses", *WORLD_FOLDERS}
_CALIBRATIONS = (".toml", ".yaml", ".yml", ".xml", ".txt", ".csv", ".pickle")
_CONTROL_POINTS, _PLACES = {"camera", "point", "x", "y", "z", "u", "v"}, ("point", "x", "y", "z")


@dataclass(frozen=True)
class Contents:
    """Paths relative to the folder, as a command line there has them.

    Attributes
    ----------
    recordings : folder -> its recordings.
    calibrations : of other programs.
    rigs : rig files under other names than the steps give.
    markers : TRC files.
    control_points : CSV files of points of known place, and where they are seen: also what was clicked on the page Points.
    places : CSV files of the places alone, for that page.
    board_images : folder -> camera -> image.
    poses : saved states.
    """

    recordings: dict[str, tuple[str, ...]]
    calibrations: tuple[str, ...]
    rigs: tuple[str, ...]
    markers: tuple[str, ...]
    control_points: tuple[str, ...]
    places: tuple[str, ...]
    board_images: dict[str, dict[str, str]]
    poses: tuple[str, ...]


def contents_of(folder: Path) -> Contents:
    """What lies in a folder, and in its subfolders.

    Raises
    ------
    TrackerError : it is no folder.
    """
    if not folder.is_dir():
        raise TrackerError(f"{folder}: expected a folder with the videos of a recording")
    places = [folder, *_folders(folder), *(deeper for each in _folders(folder) for deeper in _folders(each))]
    recordings = {}
    for place in places:
        inside = (path for path in recordings_in(place) if _inside(path, folder))
        found = tuple(_name(path, folder) for path in inside if path.name not in _NO_RECORDINGS and not is_run(path))
        if found and place.name not in _NO_RECORDINGS:
            recordings[_name(place, folder)] = found
    kinds = {_name(path, folder): kind for path in _files(folder, places[: 1 + len(_folders(folder))]) if (kind := _kind(path))}
    boards = {
        _name(place, folder): {path.stem: _name(path, folder) for path in _with(place, (".png", ".jpg", ".jpeg"), folder)}
        for place in places
        if place.name in WORLD_FOLDERS
    }
    csv_files = [*_with(folder, (".csv",), folder), *_with(folder / "clicks", (".csv",), folder)]
    tables = {_name(path, folder): _first_line(path) for path in csv_files}
    poses = [*_with(folder / "poses", (".yaml",), folder), *(p for p in (folder / "start.yaml",) if p.is_file())]
    return Contents(
        recordings,
        tuple(name for name, kind in kinds.items() if kind != RIG),
        tuple(name for name, kind in kinds.items() if kind == RIG),
        tuple(_name(path, folder) for path in _with(folder, (".trc",), folder)),
        tuple(name for name, line in tables.items() if _CONTROL_POINTS.issubset(_columns(line))),
        tuple(name for name, line in tables.items() if tuple(line.split(",")[: len(_PLACES)]) == _PLACES),
        {name: images for name, images in boards.items() if images},
        tuple(_name(path, folder) for path in poses),
    )


def is_run(path: Path) -> bool:
    """Whether this is the name of a folder of results: ``run``, ``run_2`` and so on, since none is written over."""
    return re.fullmatch(r"run(_\d+)?", path.name) is not None


def _folders(folder: Path) -> list[Path]:
    inside = (path for path in subfolders(folder) if not path.is_symlink() and not is_run(path))
    return [path for path in inside if not path.name.startswith("-")]


def _inside(path: Path, folder: Path) -> bool:
    """Whether a path lies in the folder, wherever links lead, and is no option on a command line."""
    return path.resolve().is_relative_to(folder.resolve()) and not _name(path, folder).startswith("-")


def _name(path: Path, folder: Path) -> str:
    return str(path.relative_to(folder))


def _with(place: Path, suffixes: tuple[str, ...], folder: Path) -> list[Path]:
    if not place.is_dir():
        return []
    found = (path for path in place.iterdir() if path.suffix.lower() in suffixes and path.is_file())
    return sorted((path for path in found if _inside(path, folder)), key=natural)


def _files(folder: Path, places: list[Path]) -> Iterator[Path]:
    for place in places:
        yield from _with(place, _CALIBRATIONS, folder)


def _kind(path: Path) -> str | None:
    """Format of a calibration; None of other files."""
    try:
        kind = detect(path)
        return None if path.suffix == ".toml" and "matrix" not in read_text(path) else kind
    except TrackerError:
        return None


def _columns(line: str) -> tuple[str, ...]:
    """As a spreadsheet may have written them, so that the command says what it expects where that is not the same."""
    return tuple(re.split("[,;\t]", line.lower().replace(" ", "")))


def _first_line(path: Path) -> str:
    try:
        return read_text(path).removeprefix("\ufeff").split("\n", 1)[0].strip()
    except TrackerError:
        return ""
