"""Recordings read from ``recording.yaml``: cameras, body, parameters and images, ready to be tracked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import FileFormatError, TrackerError
from ..loaders.images.source import SourceOptions
from ..loaders.model.model_yaml import load_model
from ..loaders.model.state_yaml import load_state
from ..loaders.recording_yaml import FILES, JoiningEntry, JointStatesEntry, RecordingFile, load_recording
from ..loaders.rig.rig_yaml import load_rig
from ..runs.config_file import config_for
from ..runs.joint_states import JointStateFile
from ..runs.offline import JoiningRun, OfflineRun, Recording
from ..runs.people.detection import DetectionOptions
from ..runs.people.recorded import PointFiles
from ..tracking.together.joining import USUAL, JoiningOptions


def open_recording(path: str | Path) -> Recording:
    """Read ``recording.yaml`` and the files that it names.

    Parameters
    ----------
    path : the file; paths in it are relative to its folder.

    Returns
    -------
    The recording. Its images are read by `track`, or by iterating over ``recording.image_sets()``.

    Raises
    ------
    FileFormatError : naming file and field; also a file that is missing.

    Examples
    --------
    >>> recording = open_recording("recording.yaml")  # doctest: +SKIP
    >>> run = track(recording)  # doctest: +SKIP
    """
    return recording_of(load_recording(path))


def open_bodies(path: str | Path) -> dict[str, Recording]:
    """Read a ``recording.yaml`` of several bodies and the files that it names.

    Parameters
    ----------
    path : the file; paths in it are relative to its folder.

    Returns
    -------
    By the name of the body, the recording as if it were alone; of one body, by the name of its model. Without those who join.

    Raises
    ------
    FileFormatError : naming file and field; also a file that is missing.

    Examples
    --------
    >>> runs = track_bodies(open_bodies("recording.yaml"), "out/two")  # doctest: +SKIP
    """
    return recordings_of(load_recording(path))


def recordings_of(file: RecordingFile) -> dict[str, Recording]:
    """See `open_bodies`, of the content of a ``recording.yaml``."""
    recordings = {name: recording_of(alone) for name, alone in file.each().items()}
    return {name or each.model.name: each for name, each in recordings.items()}


def joining_of(file: RecordingFile, output: Path) -> JoiningRun | None:
    """People who may join, as the content of a ``recording.yaml`` has it; None: nobody does.

    Parameters
    ----------
    file : the content.
    output : folder; the run of who joins goes into a folder of its name there.

    Returns
    -------
    See `JoiningRun`.

    Raises
    ------
    FileFormatError : naming file and field.
    """
    if file.joining is None:
        return None
    alone = file.of_those_who_join()
    recording = recording_of(alone)
    run = OfflineRun(**vars(recording), asked=recording.named_options())
    return joining_run(file.joining, run if alone.config else replace(run, config=USUAL), output)


def joining_run(entry: JoiningEntry, run: OfflineRun, output: Path) -> JoiningRun:
    """People who may join a run.

    Parameters
    ----------
    entry : of a ``recording.yaml``.
    run : of a body that joins, as if it were alone.
    output : folder; the run of who joins goes into a folder of its name there.

    Returns
    -------
    With the model and the parameters of ``run``.

    Raises
    ------
    TrackerError : points are not compared.
    """
    return JoiningRun(JoiningOptions(run.model, run.config, entry.names, entry.gone_s), run, output)


def recording_of(file: RecordingFile) -> Recording:
    """The recording that the content of a ``recording.yaml`` describes, with the files that it names read.

    Raises
    ------
    FileFormatError : naming file and field.
    TrackerError : it is of several bodies.
    """
    if file.model is None:
        got = ", ".join([*file.bodies, *([] if file.joining is None else file.joining.names)])
        raise TrackerError(f"expected a recording of one body, got several: {got}")
    images, points = file.images, file.keypoints
    if points.table is not None and points.files is None:
        raise FileFormatError(points.table, "keypoints.table", "files beside it (without them a detector runs, live)", "none")
    rig, model = load_rig(file.rig), load_model(file.model)
    rig = rig.with_sources(file.sources_of(rig.names))
    return Recording(
        rig=rig.subset(file.cameras) if file.cameras else rig,
        model=model,
        config=config_for(file.config, model, points.files is not None),
        initial_state=load_state(file.initial_state, model) if file.initial_state else None,
        occluders=load_model(file.occluders) if file.occluders else None,
        images=SourceOptions(images.start, images.end, rate_hz=images.rate_hz, size=images.resize, shrink=images.shrink),
        detection=DetectionOptions(_path(points.weights), points.every_sets),
        points=None if points.files is None else PointFiles(Path(points.files), _path(points.table), points.first),
        person=None if file.person is None else np.array(file.person),
        joint_states=None if file.joint_states is None else _joint_states(file.joint_states),
        masks=file.record.masks,
        masked_images=file.record.masked_images,
        output=Path(file.output),
        files={name: str(Path(getattr(file, name)).resolve()) for name in FILES if getattr(file, name)},
    )


def _joint_states(entry: JointStatesEntry) -> JointStateFile:
    return JointStateFile(Path(entry.file), entry.topic)


def _path(name: str | None) -> Path | None:
    return None if name is None else Path(name)
