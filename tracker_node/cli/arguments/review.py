"""What ``tracker_node evaluate`` is given, checked before anything is computed."""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ...evaluation.report.summary import Target


def names_of(runs: Sequence[str], given: Sequence[str]) -> list[str]:
    """The names as given, "run" for a single one, or the names of the folders with a number where they are alike."""
    from ...errors import TrackerError

    if given and (len(given) != len(runs) or len(set(given)) != len(given) or not all(name.strip() for name in given)):
        expected = "one name" if len(runs) == 1 else f"{len(runs)} different names"
        raise TrackerError(f"--name: expected {expected}, got {', '.join(map(repr, given))}")
    if given or len(runs) == 1:
        return list(given) or ["run"]
    names = [Path(run).resolve().stem for run in runs]
    return [name if names.count(name) == 1 else f"{name}{i}" for i, name in enumerate(names, start=1)]


def one_each(runs: Sequence[str], given: Sequence[str], option: str) -> list[str | None]:
    """A file per run: one for all, one for each, or none."""
    from ...errors import TrackerError

    if len(runs) > 1 and len(given) not in (0, 1, len(runs)):
        raise TrackerError(f"{option}: expected one file for all runs or {len(runs)}, got {len(given)}")
    return list(given) if len(given) == len(runs) else [given[-1] if given else None] * len(runs)


def targets_of(texts: Sequence[str]) -> dict[str, Target]:
    """Bounds by the keys of figures."""
    from ...errors import TrackerError
    from ...evaluation.report.summary import parse_target

    try:
        return dict(parse_target(text) for text in texts)
    except ValueError as error:
        raise TrackerError(f"--target: {error}") from None


def lag_of(text: str) -> float | None:
    """A number of images; None where it is to be estimated."""
    from ...errors import TrackerError
    from ...loaders.recording_yaml import MOST_LAG_IMAGES

    if text == "auto":
        return None
    try:
        lag = float(text)
    except ValueError:
        lag = math.nan
    if not abs(lag) <= MOST_LAG_IMAGES:
        raise TrackerError(f"--lag: expected 'auto' or a number of images, at most {MOST_LAG_IMAGES}, got {text!r}")
    return lag


def check_numbers(args: argparse.Namespace) -> None:
    """Raises TrackerError for a number of images that is below zero."""
    from ...errors import TrackerError

    for name in ("image_sets", "first_image", "pictures"):
        value = getattr(args, name)
        if value is not None and value < 0:
            raise TrackerError(f"--{name.replace('_', '-')}: expected 0 or more, got {value}")


def output_folder(output: str | None, runs: Sequence[str]) -> Path:
    """Where the report goes: as given, or the folder of the only run.

    Raises
    ------
    TrackerError : no place for several runs, or one that is no folder, or that nothing can be written to.
    """
    from ...errors import TrackerError

    if len(runs) > 1 and not output:
        raise TrackerError("several runs have no folder in common; give --output DIR")
    run = Path(runs[0])
    folder = Path(output) if output else run if run.is_dir() else run.parent
    there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not there.is_dir() or not os.access(there, os.W_OK):
        raise TrackerError(f"--output: expected a folder that can be written to, got {there}")
    return folder
