"""The page of a finished run: overlays, status, residuals and angles over time.

A finished run with the images that each of its states was made from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from starlette.routing import BaseRoute

from ...camera.rig import CameraRig
from ...errors import FileFormatError, TrackerError, UnknownNameError
from ...loaders.bag.images import only_topic
from ...loaders.bag.message_types import TRACKED_STATE
from ...loaders.bag.reader import BagReader
from ...loaders.file_model import FileModel
from ...loaders.json_values import finite_list
from ...loaders.motion.trajectory_file import read_states
from ...model.articulated import ArticulatedModel
from ...runs.data import RunData
from ...runs.images import image_bag_of, options_of, rig_from_bag, rig_of_run, source_options_of
from ...runs.load import load_run, state_messages, topic_of
from ...runs.recorded_sets import RecordedRunStream, RecordedSet, recorded_set
from ...runs.writer import STATES
from ...tracking.estimate import LimbStatus, Status
from ..endpoints import get, image, post
from ..images import OutlineDrawer, RecordedImages
from ..session import StudioSession, made_once

_ROTATION = [3, 4, 5]  # columns of the root's rotation vector


class AskedRow(FileModel):
    """A state by its number in the run."""

    row: int


class AskedCurve(FileModel):
    """A degree of freedom by its name."""

    name: str


class PlaybackPage:
    """What the page asks for, each answer as plain values."""

    def __init__(self, session: StudioSession):
        self._session = session

    @made_once
    def _run(self) -> PlayedRun:
        return open_run(self._session)

    @made_once
    def _drawer(self) -> OutlineDrawer:
        return OutlineDrawer(self._run.rig, self._run.model)

    def images(self) -> RecordedImages:
        """Those of the run."""
        if self._run.images is None:
            raise TrackerError(self._run.problem)
        return self._run.images

    def run(self) -> dict[str, Any]:
        """All that does not change from state to state, and what the curves and strips show."""
        run, data, drawer = self._run, self._run.data, self._drawer
        details = data.details
        judged = details is not None and details.limbs
        return {
            "path": str(data.path),
            "problem": run.problem,
            "seconds": np.round((data.stamps_ns - data.stamps_ns[0]) * 1e-9, 6).tolist(),
            "begins_ns": int(data.stamps_ns[0]),
            "status": data.status.tolist(),
            "reasons": run.reasons,
            "statuses": {int(status): status.name.lower() for status in Status},
            "residual": finite_list(data.residual, 3),
            "residual_unit": data.residual_unit,
            "cameras": [{"name": c.name, "width": c.model.width, "height": c.model.height} for c in run.rig],
            "residual_cameras": list(data.cameras),
            "camera_residuals": finite_list(np.where(data.camera_samples > 0, data.camera_residuals, np.nan), 2),
            "numbers": [dict(numbers) for numbers in run.numbers],
            "limbs": list(details.limbs) if judged and details is not None else [],
            "limb_status": details.limb_status.tolist() if judged and details is not None else [],
            "limb_statuses": {int(status): status.name.lower() for status in LimbStatus},
            "dofs": [{"name": name, "unit": unit} for name, unit in zip(data.dof_names, _units(run.model), strict=True)],
            "parts": [{"name": s.name, "color": c} for s, c in zip(run.model.shapes, drawer.colors(), strict=True)],
            "bones": drawer.handles.bones,
        }

    def drawn(self, asked: AskedRow) -> dict[str, Any]:
        """The body of a state in all cameras; nothing where there is no state yet."""
        data = self._run.data
        if not 0 <= asked.row < len(data):
            raise FileFormatError("request", "row", f"a number below {len(data)}", asked.row)
        if not data.has_state[asked.row]:
            return {"cameras": {camera.name: {"parts": [], "handles": []} for camera in self._run.rig}}
        return {"cameras": self._drawer.drawn(data.configuration(self._run.model, asked.row).state)}

    def curve(self, asked: AskedCurve) -> dict[str, Any]:
        """A degree of freedom over the run, degrees or meters."""
        data = self._run.data
        if asked.name not in data.dof_names:
            raise UnknownNameError("degree of freedom", asked.name, data.dof_names)
        i = data.dof_names.index(asked.name)
        if i in _ROTATION:
            values = np.rad2deg(continuous_rotations(data.values[:, _ROTATION])[:, _ROTATION.index(i)])
        elif _units(self._run.model)[i] == "deg":
            values = np.rad2deg(continuous_angles(data.values[:, i]))
        else:
            values = data.values[:, i]
        return {"values": finite_list(values, 5)}


def routes(session: StudioSession) -> Sequence[BaseRoute]:
    """Below ``/api/playback/``."""
    page = PlaybackPage(session)
    return [
        get("/api/playback/run", page.run),
        post("/api/playback/drawn", AskedRow, page.drawn),
        post("/api/playback/curve", AskedCurve, page.curve),
        image("/api/playback/images/{camera}/{number}", page.images),
    ]


def _units(model: ArticulatedModel) -> list[str]:
    return ["m" if unit == "m" else "deg" for unit in model.chain.dof_units]


def continuous_angles(angles: np.ndarray) -> np.ndarray:
    """(n,) radians, each within half a turn of the finite one before; others stay as they are."""
    found, finite = np.array(angles), np.isfinite(angles)
    found[finite] = np.unwrap(angles[finite])
    return found


def continuous_rotations(vectors: np.ndarray) -> np.ndarray:
    """(n, 3) rotation vectors, radians, of the same rotations, each nearest to the finite one before; others stay as they are.

    One rotation has a vector for every number of full turns about its axis, so the components cannot be treated one by one.
    """
    found, before = np.array(vectors), np.zeros(3)
    for i in np.flatnonzero(np.isfinite(vectors).all(axis=1)):
        angle = np.linalg.norm(vectors[i])
        along = vectors[i] if angle > 0.0 else before  # after full turns no axis is left but that of the turns
        axis = along / max(np.linalg.norm(along), np.finfo(float).tiny)
        turns = np.round((before @ axis - angle) / (2.0 * np.pi))
        found[i] = before = vectors[i] + 2.0 * np.pi * turns * axis
    return found


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
        raise session.missing("a run", "--run FOLDER", "Run")
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
            messages = state_messages(reader, topic_of(data.info) or only_topic(reader, TRACKED_STATE, []))
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
            options = RecordedRunStream(rig, reader, as_run, topic_of(data.info)).source_options
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
