"""Animals from SLEAP's analysis files, H5 and CSV: a track is an individual."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..csv_file import CsvTable
from .camera_people import FoundPerson, PeopleOfImages, found_points
from .files import number_or_nan
from .hdf5 import Hdf5File, open_hdf5
from .names import check_names

_FIRST = ("track", "frame_idx", "instance.score")


def is_analysis(opened: Hdf5File) -> bool:
    """Whether an H5 file is an analysis of SLEAP."""
    return opened.has("tracks") and opened.has("node_names")


def of_hdf5(path: Path) -> PeopleOfImages:
    """The individuals of one camera, from an analysis."""
    with open_hdf5(path) as opened:
        names = check_names(opened.names("node_names"), str(path), "node_names")
        tracks = opened.numbers("tracks", 4)
        told = opened.numbers("point_scores", 3) if opened.has("point_scores") else None
    if tracks.shape[1:3] != (2, len(names)):
        tracks = tracks.transpose()  # as Matlab has it
    n_tracks, n_axes, n_names, n_images = tracks.shape
    if (n_axes, n_names) != (2, len(names)):
        raise FileFormatError(path, "tracks", f"individuals x 2 x {len(names)} points x images", str(tracks.shape[::-1]))
    scores = np.ones((n_tracks, n_names, n_images))
    if told is not None:
        if told.shape not in (scores.shape, scores.shape[::-1]):
            raise FileFormatError(path, "point_scores", f"a number for each point {scores.shape}", str(told.shape))
        told = told if told.shape == scores.shape else told.transpose()
        scores = np.where(np.isnan(told), 1.0, told)  # a person has marked the point
    images = PeopleOfImages(str(path))
    images.names = names
    values = np.concatenate([tracks, scores[:, None]], axis=1).transpose(3, 0, 2, 1)
    for image in range(n_images):
        where = f"tracks, image {image}"
        images.look(image, str(path), where)
        for track in values[image]:
            if not np.isnan(track[:, :2]).all():
                images.add_points(image, track, str(path), where)
    return images


def of_csv(file: Path) -> PeopleOfImages:
    """The individuals of one camera."""
    table = CsvTable(file, _FIRST)
    columns = {name: i for i, name in enumerate(table.header)}
    parts = tuple(dict.fromkeys(name.rpartition(".")[0] for name in table.header[len(_FIRST) :]))
    names = check_names(parts, str(file), "header")
    wanted = [f"{name}.{end}" for name in names for end in ("x", "y", "score")]
    lacking = [name for name in wanted if name not in columns]
    if lacking:
        raise FileFormatError(file, "header", "columns x, y, score of each point", f"no {lacking[0]}")
    at, images = [columns[name] for name in wanted], PeopleOfImages(str(file))
    images.names = names
    for row in table.rows():
        where = f"line {row.line}"
        values = np.array([number_or_nan(row, i) for i in at]).reshape(-1, 3)
        values[:, 2] = np.where(np.isnan(values[:, 2]), 1.0, values[:, 2])
        score = number_or_nan(row, 2)
        known = None if np.isnan(score) or score <= 0.0 else min(score, 1.0)
        person = FoundPerson(found_points(values, str(file), where), known)
        images.add(row.integer(1), person, str(file), where)
    return images
