"""What a run left behind: from the folder of `track`, or from any bag that holds tracked states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError
from ..loaders.bag.message_types import STATE_COVARIANCE, TRACKED_STATE, stamp_ns_of
from ..loaders.bag.metadata import STORAGE_SUFFIXES
from ..loaders.bag.reader import BagReader
from ..loaders.json_values import read_json
from ..loaders.model.model_yaml import load_model
from ..loaders.motion.trajectory_file import CovarianceTrajectory, read_covariances, read_states
from ..model.articulated import ArticulatedModel
from ..tracking.estimate import PX, Status
from .data import RunData, RunDetails
from .writer import BAG, BODY, COVARIANCES, SMOOTHED, STATES, SUMMARY

TOPIC = "topic"  # in run.json of a body whose states are, beside those of others, in the bag of the folder above


def load_run(path: str | Path, topic: str | None = None) -> RunData:
    """The states of a run folder, of a folder that holds ``bag/``, or of a bag itself.

    Parameters
    ----------
    path : of a run folder, or of a bag.
    topic : topic of the states, where a bag has several; None: the one that ``run.json`` says.

    Returns
    -------
    run : in the order of the stamps.

    Raises
    ------
    FileFormatError : nothing of the kind there, no states, or states of several bodies and no ``topic``.
    """
    path = Path(path)
    if not path.exists():
        raise FileFormatError(path, "(path)", "a run folder or a bag", "nothing there")
    bag = _bag_in(path)
    info = run_info(path)
    topic = topic or topic_of(info)
    if path.is_dir() and (path / STATES).exists():
        run = replace(_from_csv(path / STATES), residual_unit=str(info.get("residual_unit", PX)))
        if bag is not None:
            run = _with_cameras_of(run, _from_bag(bag, topic))
        elif (path / COVARIANCES).exists():  # of a smoothed run
            run = _with_covariances(replace(run, path=path), read_covariances(path / COVARIANCES))
        run = replace(run, path=path)
    elif bag is not None:
        folders = [str(path / name) for name in info.get("bodies") or () if topic is None and (path / name / SUMMARY).is_file()]
        if folders:
            raise FileFormatError(path, "(path)", f"the folder of one body: {', '.join(folders)}", "that of several")
        run = _from_bag(bag, topic)
    else:
        raise FileFormatError(path, "(path)", f"a folder with {STATES} or {BAG}/, or a bag", "neither")
    if not len(run):
        raise FileFormatError(path, "(states)", "at least one tracked state", "none")
    return replace(run, bag=bag, info=info).without_guesses()


def is_run(folder: Path) -> bool:
    """Whether `load_run` finds states in a folder."""
    return (folder / STATES).is_file() or _bag_in(folder) is not None


def _bag_in(path: Path) -> Path | None:
    for candidate in (path, path / BAG):
        if candidate.is_file() and candidate.suffix in STORAGE_SUFFIXES:
            return candidate
        if candidate.is_dir() and any(file.suffix in STORAGE_SUFFIXES for file in candidate.iterdir()):
            return candidate
    above = path.parent / BAG
    return above if path.is_dir() and path != above and topic_of(run_info(path)) and above.is_dir() else None


def topic_of(info: Mapping[str, Any]) -> str | None:
    """Topic of the states, of a ``run.json`` that says it; None: the only one in the bag."""
    return info.get(TOPIC)


def bag_of_run(path: Path) -> Path | None:
    """The bag of a run folder, of the run that a folder of smoothed states is of, or a bag itself; None where there is none."""
    return _bag_in(path) or (_bag_in(path.parent) if path.name == SMOOTHED else None)


def run_info(path: str | Path) -> dict[str, Any]:
    """Content of the ``run.json`` of a run folder, or of a bag in one; empty without one.

    Raises
    ------
    FileFormatError : one that cannot be read.
    """
    path = Path(path)
    return _read_info(file_of_run(path, SUMMARY)) if path.is_dir() else {}


def file_of_run(folder: Path, name: str) -> Path:
    """A file of a run; of a part of one it is that of the run, unless the part has one of its own.

    Parameters
    ----------
    folder : of the run, its bag or its smoothed states.
    name : of the file.

    Returns
    -------
    path : may not be there.
    """
    of_part = folder.name in (SMOOTHED, BAG) and not (folder / name).exists()
    return (folder.parent if of_part else folder) / name


def body_of_run(path: Path, model: ArticulatedModel) -> ArticulatedModel:
    """The body with the clothes that a run has found.

    Parameters
    ----------
    path : of the run.
    model : that was tracked.

    Returns
    -------
    seen : of `BODY`; ``model`` where the run has found none.
    """
    file = file_of_run(path, BODY)
    seen = load_model(file) if file.is_file() else model
    return seen if seen.chain.dof_names == model.chain.dof_names else model


def _read_info(path: Path) -> dict[str, Any]:
    if not path.exists():
        return {}
    info = read_json(path)
    if not isinstance(info, dict):
        raise FileFormatError(path, "(content)", "a JSON object", info)
    return info


def _from_csv(path: Path) -> RunData:
    states = read_states(path)
    rows = states.rows
    for line, row in enumerate(rows, start=2):
        if row.status not in Status.__members__:
            raise FileFormatError(path, f"line {line}, column 'status'", f"one of {list(Status.__members__)}", row.status)
    run = RunData(
        path=path,
        dof_names=states.dof_names,
        stamps_ns=states.stamps_ns,
        status=np.array([Status[row.status] for row in rows], dtype=int),
        values=states.values,
        residual=np.array([row.residual for row in rows]),
        iterations=np.array([row.iterations for row in rows], dtype=int),
        cameras=(),
        camera_residuals=np.zeros((len(rows), 0)),
        camera_samples=np.zeros((len(rows), 0), dtype=int),
    )
    return _in_order(run)


def _from_bag(path: Path, topic: str | None) -> RunData:
    with BagReader(path) as reader:
        topics = (topic,) if topic else reader.topics_of_type(TRACKED_STATE)
        if len(topics) != 1:
            problem = ", ".join(topics) or "none"
            raise FileFormatError(path, "topics", f"one topic of type {TRACKED_STATE} (or give its name)", problem)
        found = reader.topic(topics[0])
        if found.type_name != TRACKED_STATE:
            raise FileFormatError(path, found.name, f"messages of type {TRACKED_STATE}", found.type_name)
        messages = state_messages(reader, found.name)
        covariances = _covariances(reader, f"{found.name}_covariance")
    return run_of_messages(path, topics[0], messages, covariances)


def run_of_messages(path: Path, topic: str, messages: Sequence[Any], covariances: Mapping[int, np.ndarray]) -> RunData:
    """The states of messages of type TrackedState, from a bag or from the graph.

    Parameters
    ----------
    path, topic : where they are from, for messages to the user.
    messages : with the fields of the type.
    covariances : (n_dof * n_dof,) by the stamp of the state.

    Returns
    -------
    run : in the order of the stamps, with every camera that was in use at some time.

    Raises
    ------
    FileFormatError : the body or its limbs change.
    """
    first = messages[0] if messages else None
    dof_names = tuple(first.dof_names) if first else ()
    for message in messages:
        if tuple(message.dof_names) != dof_names:
            at = f"other dof_names at {stamp_ns_of(message.header.stamp)} ns"
            raise FileFormatError(path, topic, "one body throughout", at)
    used = sorted(dict.fromkeys(tuple(message.cameras) for message in messages), key=len, reverse=True)  # most of them first
    cameras = tuple(dict.fromkeys(name for names in used for name in names))
    n = len(messages)
    run = RunData(
        path=path,
        dof_names=dof_names,
        stamps_ns=np.array([stamp_ns_of(m.header.stamp) for m in messages], dtype=np.int64),
        status=np.array([m.status for m in messages], dtype=int),
        values=np.array([m.values for m in messages], dtype=np.float64).reshape(n, len(dof_names)),
        residual=np.array([m.residual for m in messages], dtype=np.float64),
        iterations=np.array([m.iterations for m in messages], dtype=int),
        cameras=cameras,
        camera_residuals=_by_camera(messages, cameras, "camera_residuals", np.float64),
        camera_samples=_by_camera(messages, cameras, "camera_samples", np.int64),
        residual_unit=next(filter(None, (str(m.residual_unit) for m in messages)), PX),
        details=_details(path, messages, covariances, len(dof_names)),
    )
    return _in_order(run)


def _by_camera(messages: Sequence[Any], cameras: Sequence[str], field: str, dtype: type[np.generic]) -> np.ndarray:
    """(n, c) of a field with one number for each camera; 0 while a camera was not in use."""
    rows = [dict(zip(message.cameras, getattr(message, field), strict=True)) for message in messages]
    return np.array([[row.get(name, 0) for name in cameras] for row in rows], dtype).reshape(len(rows), len(cameras))


def state_messages(reader: BagReader, topic: str) -> list[Any]:
    """Messages of type TrackedState, in the order of recording.

    Parameters
    ----------
    reader : of the bag.
    topic : name of the states' topic.

    Returns
    -------
    messages : with the fields of the type.

    Raises
    ------
    FileFormatError : the bag is of version 0.1, or damaged.
    """
    if "residual_px" in reader.topic(topic).definition:
        expected = "states under their present names (version 0.1 reads its own runs; or track the recording again)"
        raise FileFormatError(reader.path, topic, expected, "those of version 0.1")
    return [message for _, message in reader.decoded(topic)]


def _covariances(reader: BagReader, topic: str) -> dict[int, np.ndarray]:
    """(n_dof * n_dof,) by the stamp of the state."""
    if topic not in reader.topics or reader.topic(topic).type_name != STATE_COVARIANCE:
        return {}
    return {stamp_ns_of(m.header.stamp): m.covariance for _, m in reader.decoded(topic)}


def _details(path: Path, messages: Sequence[Any], covariances: Mapping[int, np.ndarray], n_dof: int) -> RunDetails:
    judged = [tuple(m.limbs) for m in messages]  # none before the body is found
    n, limbs = len(messages), next(filter(None, judged), ())
    if any(found not in (limbs, ()) for found in judged):
        raise FileFormatError(path, "limbs", "the same limbs throughout", "a change within the bag")
    details = RunDetails.unknown(n, n_dof, limbs)
    for i, m in enumerate(messages):
        if len(m.limb_status):
            details.limb_status[i] = m.limb_status
        details.timings_ms[i] = m.observe_ms, m.optimize_ms, m.total_ms
        covariance = covariances.get(stamp_ns_of(m.header.stamp))
        if covariance is not None and len(covariance) == n_dof**2:
            details.covariances[i] = np.reshape(covariance, (n_dof, n_dof))
    return details


def _in_order(run: RunData) -> RunData:
    """Sorted by stamp; of several states with one stamp the last, as a subscriber keeps it."""
    latest = {int(stamp): i for i, stamp in enumerate(run.stamps_ns)}
    return run.at(np.array([latest[stamp] for stamp in sorted(latest)], dtype=int))


def _with_covariances(run: RunData, known: CovarianceTrajectory) -> RunData:
    if known.dof_names != run.dof_names:
        expected = f"the degrees of freedom of {STATES}"
        raise FileFormatError(run.path / COVARIANCES, "header", expected, ", ".join(known.dof_names))
    row_of = {int(stamp): i for i, stamp in enumerate(known.stamps_ns)}
    rows = np.array([row_of.get(int(stamp), -1) for stamp in run.stamps_ns], dtype=int)
    details = RunDetails.unknown(len(known.stamps_ns), len(run.dof_names))
    return replace(run, details=replace(details, covariances=known.state.astype(np.float32)).at(rows))


def _with_cameras_of(run: RunData, bag: RunData) -> RunData:
    """``run`` with what the CSV does not hold, cameras and details, of the states of the same stamps in the bag."""
    row_of = {int(stamp): i for i, stamp in enumerate(bag.stamps_ns)}
    rows = np.array([row_of.get(int(stamp), -1) for stamp in run.stamps_ns], dtype=int)
    residuals = np.where(rows[:, None] >= 0, bag.camera_residuals[rows], 0.0)
    samples = np.where(rows[:, None] >= 0, bag.camera_samples[rows], 0)
    details = bag.details.at(rows) if bag.details is not None and bag.dof_names == run.dof_names else None
    run = replace(run, cameras=bag.cameras, camera_residuals=residuals, camera_samples=samples)
    return replace(run, residual_unit=bag.residual_unit, details=details)
