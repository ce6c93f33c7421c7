"""Finished runs as a file of Rerun: bodies, cameras, curves, and the images that the states were made from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError, TrackerError
from ..loaders.bag.message_types import TRACKED_STATE
from ..loaders.bag.reader import BagReader
from ..loaders.model.model_yaml import load_model
from ..loaders.recording_yaml import load_recording
from ..loaders.rig.rig_yaml import load_rig
from ..model.articulated import ArticulatedModel
from ..runs.data import RunData
from ..runs.images import file_of, options_of, rig_of_run, run_stream
from ..runs.load import bag_of_run, body_of_run, load_run, run_info, topic_of
from ..runs.writer import BAG, STATES, SUMMARY
from .view import APPLICATION, RerunView, rerun_module, words

_ROWS = 200  # image sets at once
_Found = tuple[str, Path, str | None, str | None]  # name, run, topic of the states, model


@dataclass(frozen=True, eq=False)
class Played:
    """A body of a run: ``topic`` of its states where its bag has those of several."""

    run: RunData
    model: ArticulatedModel
    topic: str | None = None


@dataclass(frozen=True)
class PlaybackFiles:
    """What is played.

    Parameters
    ----------
    runs : folders of runs, folders of several bodies' runs, or bags.
    models, rig : files; empty and None: those that run.json names.
    bodies : recording.yaml whose bodies the states of a bag are of; None: that which run.json names.
    with_images : also the images.
    """

    runs: Sequence[Path]
    models: Sequence[str] = ()
    rig: str | None = None
    bodies: Path | None = None
    with_images: bool = True


def write_rerun_file(files: PlaybackFiles, output: Path, tell: Callable[[str], None]) -> dict[str, int]:
    """Write runs as one ``.rrd`` file.

    Parameters
    ----------
    files : what is played.
    output : the file.
    tell : called with what is missing, a line each.

    Returns
    -------
    Number of image sets by body, and ``images``: of the images.

    Raises
    ------
    MissingExtraError : rerun is not installed.
    TrackerError : a run that cannot be read, or whose model is not known.
    """
    rr = rerun_module()
    played = played_bodies(files)
    first = next(iter(played.values()))
    rig_path = files.rig or file_of(first.run.info, "rig")
    if rig_path is None:
        tell("no cameras and no images: the run does not name its rig; give --rig FILE")
    recording, part = rr.RecordingStream(APPLICATION), output.with_name(f"{output.name}.part")
    output.parent.mkdir(parents=True, exist_ok=True)
    recording.save(part)
    try:
        counts = _play(recording, played, rig_path, files, tell)
        recording.disconnect()
        part.replace(output)
    finally:
        recording.disconnect()
        part.unlink(missing_ok=True)
    return counts


def _play(
    recording: Any, played: Mapping[str, Played], rig_path: str | None, files: PlaybackFiles, tell: Callable[[str], None]
) -> dict[str, int]:
    first = next(iter(played.values()))
    models = {name: each.model for name, each in played.items()}
    begins_ns = min(int(each.run.stamps_ns[0]) for each in played.values())
    rig, stream, reader = None, None, None
    if rig_path is not None:
        rig = rig_of_run(load_rig(rig_path), first.run.info, other_file=rig_path != file_of(first.run.info, "rig"))
        bag = bag_of_run(first.run.path)
        if files.with_images and bag is not None:
            try:
                reader = BagReader(bag)
                rig, stream = run_stream(rig, reader, first.run.info, topic=first.topic)
            except TrackerError as error:
                tell(f"no images: {error}")
        elif files.with_images:
            tell(f"no images: {first.run.path} has no bag, which would list them")
    view = RerunView(recording, models, rig, begins_ns, stream is not None)
    for name, each in played.items():
        for k in range(0, len(each.run), _ROWS):
            view.show(name, each.run.at(np.arange(k, min(k + _ROWS, len(each.run)))))
        for i, stamp_ns in enumerate(each.run.stamps_ns):
            view.say(name, int(stamp_ns), words(each.run, i))
    counts = {name or "body": len(each.run) for name, each in played.items()} | {"images": 0}
    if stream is not None and reader is not None:
        with reader:
            counts["images"] = _play_images(view, stream, played, tell)
    return counts


def _play_images(view: RerunView, stream: Any, played: Mapping[str, Played], tell: Callable[[str], None]) -> int:
    """The images with the outlines of the bodies at the stamp of their set."""
    n = 0
    rows = {name: {int(stamp): i for i, stamp in enumerate(each.run.stamps_ns)} for name, each in played.items()}
    try:
        for image_set in stream:
            for image in image_set.images:
                view.show_image(image.camera, image.stamp_ns, image.bgr)
                n += 1
                for name, each in played.items():
                    if (row := rows[name].get(image_set.stamp_ns)) is not None:
                        view.show_outlines(image.camera, image.stamp_ns, name, each.run, row)
    except TrackerError as error:
        tell(f"images end after {n}: {error}")
    for problem in stream.errors:
        tell(problem)
    return n


def played_bodies(files: PlaybackFiles) -> dict[str, Played]:
    """The bodies of runs by name; of one run alone, "".

    Raises
    ------
    TrackerError : no run there, or one that does not say its model.
    """
    found: list[_Found] = []
    for path in files.runs:
        found += _bodies_in(path, files.bodies)
    if files.models and len(files.models) not in (1, len(found)):
        raise FileFormatError("command line", "--model", f"one, or {len(found)}: one for each body", len(files.models))
    names = _distinct([name for name, *_ in found])
    bodies = {}
    for i, (name, (_, path, topic, named)) in enumerate(zip(names, found, strict=True)):
        run = load_run(path, topic)
        given = files.models[min(i, len(files.models) - 1)] if files.models else None
        file = given or named or file_of(run.info, "model")
        if not file:
            raise TrackerError(f"{path} does not name its body model; give --model FILE")
        model = load_model(file)
        run.check_model(model, file)
        bodies[name if len(found) > 1 else ""] = Played(run, model if given else body_of_run(path, model), topic)
    return bodies


def _bodies_in(path: Path, bodies: Path | None) -> list[_Found]:
    """Each body of a folder of runs, or of a bag with the states of several."""
    bag = bag_of_run(path)
    if bag is None and path.is_dir() and not (path / STATES).exists():
        inner = sorted(each for each in path.iterdir() if (each / STATES).exists() or (each / BAG).exists())
        if inner:
            return [(each.name, each, None, None) for each in inner]
    if topic := topic_of(run_info(path)):
        return [(path.name, path, topic, None)]
    topics: Sequence[str] = ()
    if path.is_dir():  # each has a folder there; a name of those who may join that nobody got has none
        inner = sorted(each for each in path.iterdir() if (each / SUMMARY).is_file())
        found: list[_Found] = [(each.name, each, topic, None) for each in inner if (topic := topic_of(run_info(each)))]
        if found:
            return found
    if bag is not None and not (path / STATES).exists():
        with BagReader(bag) as reader:
            topics = sorted(reader.topics_of_type(TRACKED_STATE))
    if len(topics) < 2:
        return [(path.name, path, None, None)]
    named = bodies or options_of(run_info(path)).get("recording")
    if named is None:
        raise FileFormatError(path, "topics", f"one of type {TRACKED_STATE}, or --bodies recording.yaml", ", ".join(topics))
    models = load_recording(named).models
    found = []
    for topic in topics:
        name = topic.removesuffix("/state").rpartition("/")[2]
        if name not in models:
            raise FileFormatError(named, "bodies", f"'{name}', whose states {path} has", ", ".join(models) or "none")
        found.append((name, path, topic, models[name]))
    return found


def _distinct(names: Sequence[str]) -> list[str]:
    """The names, with a number behind those that are there already."""
    found: list[str] = []
    for name in names:
        tries = (name if k == 1 else f"{name}_{k}" for k in range(1, len(names) + 1))
        found.append(next(each for each in tries if each not in found))
    return found
