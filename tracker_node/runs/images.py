"""The images of a finished run with its states, taken again as the run took them: its ``run.json`` names bag, cameras, sources
and sizes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..camera.rig import Camera, CameraRig
from ..errors import FileFormatError
from ..loaders.bag.images import image_topics
from ..loaders.bag.reader import BagReader
from ..loaders.images.source import SourceOptions, load_backgrounds, resized_backgrounds
from ..loaders.rig.capture_yaml import changed_settings, split_change
from ..model.articulated import ArticulatedModel
from ..model.configuration import State
from ..observation.image_set import ImageSet
from ..tracking.config import TrackerConfig, describe, from_dict
from ..tracking.estimate import Status
from .config_file import migrated
from .data import RunData
from .image_sets import resampled_rig, rig_of_bag
from .load import topic_of
from .recorded_sets import RecordedRunStream
from .writer import SUMMARY

JOINED_AFTER = "joined_after_sets"  # in run.json: image sets before somebody joined
Info = Mapping[str, Any]
_FIELDS = {name: name for name in ("start", "end", "shrink", "base_stamp_ns")} | {"rate_hz": "rate", "size": "resize"}


def options_of(info: Info) -> Mapping[str, Any]:
    """What a run was asked for, empty where its ``run.json`` does not tell."""
    options = info.get("options")
    return options if isinstance(options, dict) else {}


def file_of(info: Info, key: str) -> str | None:
    """Path of a file of a run, from the top of its ``run.json`` or from its options.

    Parameters
    ----------
    info : content of ``run.json``.
    key : ``rig`` or ``model``.

    Returns
    -------
    None where the run does not name the file.
    """
    for place in (info, info.get("options"), info.get("files")):
        if isinstance(place, dict) and isinstance(place.get(key), str):
            return place[key]
    return None


def first_image_of(info: Info) -> int:
    """Number of the image of the rig's sources that an offline run began with; 0 where its ``run.json`` does not tell.

    The run of somebody who has joined begins with the image set in which that was.
    """
    options, before = options_of(info), info.get(JOINED_AFTER)
    start = options.get("start") if not options.get("bag") else None
    return (start if isinstance(start, int) else 0) + (before if isinstance(before, int) else 0)


def source_options_of(info: Info, path: str | Path = "run") -> SourceOptions:
    """Which images of the sources a run took, with their rate, stamps and size.

    Parameters
    ----------
    info : content of ``run.json``.
    path : of the run, for messages.

    Returns
    -------
    options : those of the run, where it tells none the defaults.

    Raises
    ------
    FileFormatError : options of another kind.
    """
    options, defaults = options_of(info), SourceOptions()
    given = {field: options.get(name) for field, name in _FIELDS.items()}
    values = {field: getattr(defaults, field) if value is None else value for field, value in given.items()}
    try:
        size = None if values["size"] is None else tuple(int(value) for value in values["size"])
        numbers = {field: int(values[field]) for field in ("start", "shrink", "base_stamp_ns")}
        return SourceOptions(**{**values, **numbers, "size": size})
    except (TypeError, ValueError) as error:
        raise FileFormatError(Path(path) / SUMMARY, "options", "start, end, rate and size of images", str(error)) from None


def rig_of_run(rig: CameraRig, info: Info, other_file: bool = False) -> CameraRig:
    """The cameras of a run, of those of a rig, with the sources and capture settings that the command line of the run gave.

    Parameters
    ----------
    rig : cameras of the rig file.
    info : content of ``run.json``.
    other_file : the rig is not from the file of the run: its own sources count.

    Returns
    -------
    rig : of the cameras that the run used.
    """
    options = options_of(info)
    names = [name for name in rig.names if name in (options.get("cameras") or rig.names)]
    sources = {} if other_file else dict(options.get("source") or [])
    changes = [] if other_file else [split_change(text, rig.names) for text in options.get("capture") or []]
    cameras = []
    for camera in (rig[name] for name in names or rig.names):
        own = [(field, value) for target, field, value in changes if target in (None, camera.name)]
        capture = changed_settings(camera.capture, own) if own else camera.capture
        cameras.append(replace(camera, source=sources.get(camera.name, camera.source), capture=capture))
    return replace(rig, cameras=tuple(cameras))


def image_bags_of(bag: Path | None, info: Info, cameras: tuple[str, ...]) -> dict[str, Path]:
    """The bag with the images of each camera, as of `image_bag_of`, each of which is opened once.

    Parameters
    ----------
    bag : of the run.
    info : content of ``run.json``.
    cameras : names, by which topics of images are known.

    Returns
    -------
    paths : by camera; those whose images are in none are not there.
    """
    found: dict[str, Path] = {}
    for path, names in _with_images(bag, info, cameras):
        found = dict.fromkeys(names, path) | found
        if len(found) == len(cameras):
            break  # a later bag need not even be readable
    return found


def _with_images(bag: Path | None, info: Info, cameras: tuple[str, ...]) -> Iterator[tuple[Path, list[str]]]:
    """Bags with images of a run, the likeliest first, and the cameras that have some there; each is opened when asked for."""
    options = options_of(info)
    for candidate in (bag, options.get("bag"), options.get("from_run_bag")):
        if candidate is not None and Path(candidate).exists():
            with BagReader(candidate) as reader:
                names = [name for name in cameras if image_topics(reader, (name,))]
            if names:
                yield Path(candidate), names


def image_bag_of(bag: Path | None, info: Info, cameras: tuple[str, ...]) -> Path | None:
    """The bag with the images of a run: its own, or that which it was tracked in; None where they came from the rig's sources.

    Parameters
    ----------
    bag : of the run.
    info : content of ``run.json``.
    cameras : names, by which topics of images are known.

    Returns
    -------
    path : or None.
    """
    return next((path for path, _ in _with_images(bag, info, cameras)), None)


def rig_from_bag(rig: CameraRig, bag: Path) -> CameraRig:
    """The cameras with a bag as their source, its stamps as they are, and lenses for its images; those it lacks have none.

    Parameters
    ----------
    rig : cameras of the rig file.
    bag : with images of them.

    Returns
    -------
    rig : of the same cameras.
    """
    with BagReader(bag) as reader:
        recorded = set(image_topics(reader, rig.names).values())
        rig = rig_of_bag(rig, reader)
    cameras = (
        Camera(c.name, c.model, c.T_world_cam, source=f"bag:{bag}" if c.name in recorded else None, gain=c.gain, gamma=c.gamma)
        for c in rig
    )
    return replace(rig, cameras=tuple(cameras))


def run_stream(
    rig: CameraRig, reader: BagReader, info: Info, options: SourceOptions | None = None, topic: str | None = None
) -> tuple[CameraRig, RecordedRunStream]:
    """The rig for the images of a run, and its image sets.

    Parameters
    ----------
    rig : of the run, see `rig_of_run`.
    reader : bag with the states of the run.
    info : content of ``run.json``.
    options : of the rig's sources; default: those of the run.
    topic : of the states, where the bag has those of several bodies; None: the one that ``info`` says.

    Returns
    -------
    rig, stream : lenses for the images; the sets that the states were made from.

    Raises
    ------
    TrackerError : images that are gone, or have other stamps.
    """
    bag, topic = image_bag_of(reader.path, info, rig.names), topic or topic_of(info)
    if bag is None:
        options = options or source_options_of(info, reader.path)
        return resampled_rig(rig, options), RecordedRunStream(rig, reader, options, topic)
    if bag == reader.path:
        return rig_of_bag(rig, reader), RecordedRunStream(rig_of_bag(rig, reader), reader, topic=topic)
    other = rig_from_bag(rig, bag)
    return other, RecordedRunStream(other, reader, SourceOptions(), topic)


def config_of_run(info: Info) -> TrackerConfig:
    """The parameters that a run was made with, as far as its ``run.json`` tells.

    Those of version 0.1 have other names, and what no version knows is left out.
    """
    parameters = info.get("parameters")
    if not isinstance(parameters, dict):
        return TrackerConfig()
    known = describe()
    values = {name: value for name, value in migrated(parameters)[0].items() if name in known}
    return from_dict(values, "run.json: parameters")


@dataclass(frozen=True, eq=False)
class RunImages:
    """Chosen image sets of a run, with states and velocities (tangent a second), in the order of time.

    ``begins_s`` is the stamp of the run's first set, ``first_image`` the number of its images in their sources.
    """

    rig: CameraRig
    model: ArticulatedModel
    config: TrackerConfig
    backgrounds: dict[str, np.ndarray]
    sets: tuple[ImageSet, ...]
    states: tuple[State, ...]
    velocities: tuple[np.ndarray, ...]
    begins_s: float
    first_image: int

    def subset(self, rows: np.ndarray) -> RunImages:
        """Only some of the image sets."""
        sets, states, velocities = (tuple(x[i] for i in rows) for x in (self.sets, self.states, self.velocities))
        return replace(self, sets=sets, states=states, velocities=velocities)


def images_of_run(run: RunData, given: CameraRig, model: ArticulatedModel, n_sets: int, config: TrackerConfig) -> RunImages:
    """At most ``n_sets`` image sets spread over a run in which the body was tracked, see `chosen_rows`.

    Parameters
    ----------
    run : with states.
    given : cameras of the run, see `rig_of_run`.
    model : of the run.
    n_sets : at most so many.
    config : parameters of the tracker.

    Returns
    -------
    images : with states and velocities.

    Raises
    ------
    TrackerError : a run without states or without a bag, or whose images are not there.
    """
    if run.bag is None:
        raise FileFormatError(run.path, "(bag)", "the bag of the run, which lists the images of every state", "none")
    chosen = chosen_rows(run, n_sets)
    wanted, images = {int(run.stamps_ns[i]) for i in chosen}, {}
    with BagReader(run.bag) as reader:
        rig, stream = run_stream(given, reader, run.info)
        for image_set in stream:
            if image_set.stamp_ns in wanted:
                images[image_set.stamp_ns] = image_set
                if len(images) == len(wanted):
                    break
    found = [i for i in chosen if int(run.stamps_ns[i]) in images]
    if not found:
        raise FileFormatError(run.path, "(images)", "images of the tracked sets, in its bag or the rig's sources", "none")
    return RunImages(
        rig, model, config, resized_backgrounds(load_backgrounds(given), rig),
        tuple(images[int(run.stamps_ns[i])] for i in found),
        tuple(State.from_values(run.values[i]) for i in found),
        tuple(velocity_at(run, i) for i in found),
        1e-9 * float(run.stamps_ns[0]), int(options_of(run.info).get("start") or 0),
    )  # fmt: skip


def chosen_rows(run: RunData, n: int) -> list[int]:
    """Rows of a run spread over its time, of each stretch the one whose residual is least; lost ones only if all are.

    Parameters
    ----------
    run : with states.
    n : at most so many.

    Returns
    -------
    rows : increasing.
    """
    good = np.flatnonzero(run.status == int(Status.TRACKING))
    if len(good) < min(n, len(run)):
        good = np.flatnonzero(run.tracked)
    if not len(good):
        raise FileFormatError(run.path, "(states)", "image sets in which the body was tracked", run.status_text)
    parts = np.array_split(good, min(n, len(good)))
    return [int(part[np.argmin(run.residual[part])]) for part in parts]


def velocity_at(run: RunData, row: int) -> np.ndarray:
    """(n_dof,) tangent a second at a row of a run, from the rows around it in which the body was tracked.

    Parameters
    ----------
    run : with states.
    row : of one of its image sets.

    Returns
    -------
    velocity : (n_dof,), zero where no other row is near.
    """
    first, last = (beside if 0 <= beside < len(run) and run.tracked[beside] else row for beside in (row - 1, row + 1))
    seconds = 1e-9 * float(run.stamps_ns[last] - run.stamps_ns[first])
    tangent = State.from_values(run.values[last]).difference(State.from_values(run.values[first]))
    return tangent / seconds if seconds > 0.0 else np.zeros_like(tangent)
