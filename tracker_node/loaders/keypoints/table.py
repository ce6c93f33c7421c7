"""keypoints.yaml: what the points of a detector are on a body, be it a person, an animal or a robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

from ...errors import FileFormatError
from ...model.articulated import ArticulatedModel
from ...model.humans.human import gait_human
from ...model.humans.keypoints import KeypointTable, LandmarkPoint
from ..file_model import KEYPOINTS, FileModel, are_numbers, checked, floats, is_number, numbers, validate
from ..yaml_file import Inline, read_mapping, write_mapping

_DEFAULT = LandmarkPoint("")


def _is_sigma(value: Any) -> bool:
    each = [value] if is_number(value) else value if are_numbers(value, 3) else [0.0]
    return all(number > 0.0 for number in each)


def _sigma(value: Any) -> tuple[float, ...]:
    return floats([value] * 3 if is_number(value) else value)


class PointEntry(FileModel):
    """One point of the detector.

    ``landmark`` of the body; ``offset`` from it in the axes of its link, and ``sigma``, standard deviation of the offset in these
    axes or in each of them, meters. ``by_leg``: see `LandmarkPoint`.
    """

    landmark: str
    offset: numbers(3) = _DEFAULT.offset  # type: ignore[valid-type]
    sigma: Annotated[
        tuple[float, float, float], checked("a positive number of meters, or three along the axes of the link", _is_sigma, _sigma)
    ] = _DEFAULT.sigma
    by_leg: Annotated[float, checked("a number", is_number, float)] = _DEFAULT.by_leg


class KeypointFile(FileModel):
    """A keypoints.yaml.

    ``points``: name of the detector's point -> what it is. ``names``: all points of the detector in the order of its files, for
    files that have numbers only.
    """

    KIND: ClassVar[str] = KEYPOINTS

    points: dict[str, PointEntry]
    names: tuple[str, ...] = ()


def load_keypoint_table(path: str | Path, model: ArticulatedModel) -> KeypointTable:
    """The table in a file.

    Parameters
    ----------
    path, model : file; body that has the landmarks.

    Returns
    -------
    Name of the detector's point -> what it is on the body.

    Raises
    ------
    FileFormatError : naming file and field; for a landmark that the body lacks with those that it has.
    """
    content, table = _read(path), {}
    has_some = any(entry.landmark in model.landmark_names for entry in content.points.values())
    allowed = {*model.landmark_names, *gait_human().landmark_names}
    for name, entry in content.points.items():
        # What a person may have, but not this body, such as knuckles or a lost foot, is no mistake, unless it has nothing else
        if entry.landmark not in (allowed if has_some else model.landmark_names):
            known = ", ".join(model.landmark_names) or "none"
            raise FileFormatError(path, f"points.{name}.landmark", f"a landmark of {model.name}: {known}", entry.landmark)
        table[name] = LandmarkPoint(entry.landmark, entry.offset, entry.sigma, entry.by_leg)
    return table


def load_point_names(path: str | Path) -> tuple[str, ...]:
    """Names of all points of the detector in the order of its files; empty where the table has none.

    Raises
    ------
    FileFormatError : naming file and field.
    """
    return _read(path).names


def dump_keypoint_table(table: KeypointTable, path: str | Path, names: Sequence[str] = ()) -> None:
    """Write a table.

    Parameters
    ----------
    table, path : table; file.
    names : of all points in the order of the detector's files.
    """
    points = {
        name: Inline(
            landmark=point.landmark, offset=list(point.offset), sigma=list(point.sigma),
            **({"by_leg": point.by_leg} if point.by_leg else {}),
        )
        for name, point in table.items()
    }  # fmt: skip
    write_mapping({"points": points, **({"names": list(names)} if names else {})}, path)


def _read(path: str | Path) -> KeypointFile:
    content = validate(KeypointFile, read_mapping(path), path)
    if not content.points:
        raise FileFormatError(path, "points", "at least one point", "none")
    if len(set(content.names)) != len(content.names):
        raise FileFormatError(path, "names", "each name once", list(content.names))
    lacking = [name for name in content.points if content.names and name not in content.names]
    if lacking:
        raise FileFormatError(path, f"points.{lacking[0]}", f"a point among 'names': {', '.join(content.names)}", lacking[0])
    return content
