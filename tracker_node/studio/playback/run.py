"""A finished run with the images that each of its states was made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...errors import TrackerError
from ...loaders.bag.images import only_topic
from ...loaders.bag.message_types import TRACKED_STATE
from ...loaders.bag.reader import BagReader
from ...loaders.motion.trajectory_file import read_states
from ...model.articulated import ArticulatedModel
from ...runs.data import RunData
from ...runs.images import image_bag_of, options_of, rig_from_bag, rig_of_run, source_options_of
from ...runs.load import load_run, state_messages
from ...runs.recorded_sets import RecordedRunStream, RecordedSet, recorded_set
from ...runs.writer import STATES
from ..images import RecordedImages
from ..session import StudioSession


@dataclass(frozen=True, eq=False)
class PlayedRun:
    """A run, opened for the page.

    Attributes
    ----------
    rig : cameras as their images are: those of a bag may have another size than those of the sources.
    images : None where the images of the run cannot be had; ``problem`` says why.
    numbers : for each state the number of its image by camera.
    reasons : for each state why it is not TRACKING.
    """

    data: RunData
    rig: CameraRig
    model: ArticulatedModel
    images: RecordedImages | None
    numbers: tuple[Mapping[str, int], ...]
    reasons: tuple[str, ...]
    problem: str = ""


def open_run(session: StudioSession) -> PlayedRun:
    """The run that a session names.

    Raises
    ------
    TrackerError : no run named, one that cannot be read, or one of another body.
    """
    path, rig, model = session.files.run, session.needed_rig(), session.needed_model()
    if path is None:
        raise TrackerError("this page needs a run: start with --run FOLDER")
    data = load_run(path)
    data.check_model(model, session.files.model or "--model")
    own_rig = session.files.rig is not None and str(session.files.rig.resolve()) == options_of(data.info).get("rig")
    rig = rig_of_run(rig, data.info, other_file=not own_rig)
    sets, reasons = _recorded(data)
    try:
        return _with_images(PlayedRun(data, rig, model, None, (), reasons), sets)
    except TrackerError as error:
        return PlayedRun(data, rig, model, None, tuple({} for _ in range(len(data))), reasons, str(error))


def _recorded(data: RunData) -> tuple[dict[int, RecordedSet], tuple[str, ...]]:
    """The images of every state, by its stamp, and the reasons of the statuses; without a bag nobody has noted the images."""
    if data.bag is None:
        rows = read_states(data.path / STATES).rows
        reason_of, sets = {row.stamp_ns: row.reason for row in rows}, {}
    else:
        with BagReader(data.bag) as reader:
            messages = state_messages(reader, only_topic(reader, TRACKED_STATE, []))
        sets = {found.stamp_ns: found for found in map(recorded_set, messages)}
        reason_of = {recorded_set(message).stamp_ns: str(message.status_reason) for message in messages}
    return sets, tuple(reason_of.get(stamp_ns, "") for stamp_ns in data.stamps_ns.tolist())


def _with_images(run: PlayedRun, sets: Mapping[int, RecordedSet]) -> PlayedRun:
    data, rig = run.data, run.rig
    as_run = replace(source_options_of(data.info, data.path), size=None, shrink=1)  # people see them whole
    if data.bag is None:
        images = RecordedImages(rig, as_run)
        numbers = _by_time(images, data.stamps_ns)
        return replace(run, images=images, numbers=numbers, problem="; ".join(images.problems))
    options, image_bag = None, image_bag_of(data.bag, data.info, rig.names)
    if image_bag is not None:
        rig = rig_from_bag(rig, image_bag)
    else:
        with BagReader(data.bag) as reader:
            options = RecordedRunStream(rig, reader, as_run).source_options
    images = RecordedImages(rig, options)
    made_from = [sets[stamp_ns].images if stamp_ns in sets else () for stamp_ns in data.stamps_ns.tolist()]
    numbered = [{camera: images.number_at(camera, ns) for camera, ns in pairs} for pairs in made_from]
    there = tuple({camera: number for camera, number in found.items() if number is not None} for found in numbered)
    return replace(run, rig=rig, images=images, numbers=there, problem="; ".join(images.problems))


def _by_time(images: RecordedImages, stamps_ns: np.ndarray) -> tuple[Mapping[str, int], ...]:
    """The set nearest in time of each state, for a run that does not list its images."""
    if not images.sets:
        return tuple({} for _ in stamps_ns)
    at = np.array([found.stamp_ns for found in images.sets])
    apart = int(np.median(np.diff(at))) if len(at) > 1 else 0
    nearest = [int(np.abs(at - stamp_ns).argmin()) for stamp_ns in stamps_ns]
    return tuple(
        images.sets[i].numbers if abs(int(at[i]) - int(stamp_ns)) <= apart // 2 else {}
        for i, stamp_ns in zip(nearest, stamps_ns, strict=True)
    )
