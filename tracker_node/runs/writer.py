"""The folder that a run leaves: a bag, three CSV files, ``run.json``, and a folder of smoothed states."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from ..camera.rig import CameraRig
from ..closing import Closing
from ..loaders.bag.message_types import KEYPOINTS, message_of
from ..loaders.bag.metadata import OfferedQos
from ..loaders.bag.writer import BagExistsError, BagWriter
from ..loaders.model.model_yaml import dump_model
from ..loaders.model.urdf_writer import urdf_of
from ..loaders.motion.trajectory_file import (
    CovariancesWriter,
    JointsWriter,
    PosesWriter,
    StateRow,
    StatesWriter,
    VelocitiesWriter,
)
from ..loaders.whole_file import write_whole
from ..model.articulated import ArticulatedModel
from ..model.clothes import with_surfaces
from ..model.configuration import Configuration
from ..observation.image_set import ImageSet
from ..optimize.levenberg_marquardt import clip_to_limits
from ..report.metrics_file import command_line, cpu, versions
from ..tracking.config import MotionConfig, TrackerConfig, flatten
from ..tracking.constraints import resting
from ..tracking.estimate import Status, TrackEstimate
from ..tracking.motion.dynamics import Belief, Dynamics
from ..tracking.motion.smoother import Measurement, Smoother, smoothed_covariance
from .messages import CAMERA_INFO, Content, camera_info, keypoints
from .outputs import BODY_OUTPUTS, CAMERA_OUTPUTS, DESCRIPTION, STRING, Tracked, recorded

BAG, STATES, JOINTS, POSES, SUMMARY = "bag", "states.csv", "joints.csv", "poses.csv", "run.json"
BODY = "body.yaml"  # as it is seen in images
MODEL = "model.yaml"  # of somebody who has joined
SMOOTHED, VELOCITIES, COVARIANCES = "smoothed", "velocities.csv", "covariances.csv"  # a folder, and what is only in it
FLUSH_EVERY = 30  # image sets


def write_summary(folder: Path, summary: dict[str, Any]) -> None:
    """``run.json`` of the run in ``folder``, which is made if it is not there.

    Parameters
    ----------
    folder : of the run.
    summary : what JSON can hold; no NaN.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / SUMMARY, json.dumps(summary, indent=2, allow_nan=False) + "\n")


def asked_of_run(options: Mapping[str, Any], config: TrackerConfig | None, n_expected: int | None) -> dict[str, Any]:
    """What ``run.json`` says of every run from the beginning: how it was asked for, by what and where.

    Parameters
    ----------
    options : by name, as JSON can hold them.
    config : of the tracker; None: its parameters are not known here.
    n_expected : image sets; None if not known.

    Returns
    -------
    To be joined with `counted_sets`, and what else is known at the end.
    """
    return {
        "expected_image_sets": n_expected,
        "options": dict(options),
        **({} if config is None else {"parameters": flatten(config)}),
        "versions": versions(),
        "cpu": cpu(),
        "command": command_line(),
    }


def counted_sets(statuses: Mapping[Status, int]) -> dict[str, Any]:
    """What ``run.json`` says of the image sets of every run; their numbers by status are given."""
    counts = {status.name: statuses.get(status, 0) for status in Status}
    return {"image_sets": sum(counts.values()), "lost_sets": counts[Status.LOST.name], "status_counts": counts}


def run_of_bag(bag: Path) -> Path | None:
    """The folder of a run whose bag this is to be, where `write_summary` writes; None for a bag that stands alone.

    Raises
    ------
    BagExistsError : a run is there.
    """
    if bag.name != BAG:
        return None
    for name in (STATES, SUMMARY):
        if (bag.parent / name).exists():
            raise BagExistsError(bag.parent / name)
    return bag.parent


def write_body(folder: Path, model: ArticulatedModel, surfaces: np.ndarray | None) -> None:
    """Write `BODY`, the body as it is seen in images.

    Parameters
    ----------
    folder : of the run.
    model : that was tracked.
    surfaces : of the last estimate; None where clothes were not followed: nothing is written.
    """
    if surfaces is not None:
        seen = with_surfaces(model, surfaces)
        dump_model(seen, folder / BODY, f"{seen.name} as it was seen last, with its clothes. Units: meters, degrees.")


def write_joined(folder: Path, model: ArticulatedModel, name: str) -> None:
    """Write `MODEL`, the body of somebody who has joined.

    Parameters
    ----------
    folder : of the run, made if it is missing.
    model, name : the body, with lengths found from points; and what it was called.
    """
    folder.mkdir(parents=True, exist_ok=True)
    dump_model(model, folder / MODEL, f"{name} as found. Units: meters, degrees.")


def check_free(output: Path) -> None:
    """Raises BagExistsError where a folder holds a run already."""
    for name in (BAG, STATES, JOINTS, POSES, SUMMARY, BODY):
        if (output / name).exists():
            raise BagExistsError(output / name)


class RunWriter(Closing):
    """Writes each estimate as it comes; use it in a ``with`` statement.

    Parameters
    ----------
    output : folder, made here; it must not hold a run yet.
    masks : also record ``tracker/<camera>/mask``, the model's silhouette.
    masked_images : also record ``tracker/<camera>/masked_image/compressed``, the image where that is.
    detector : name of what finds people in the images: ``<camera>/keypoints`` holds them, so that the same states can be made
        again; None: they are not recorded. Silhouettes are large and even, hence such a bag is compressed.

    Raises
    ------
    BagExistsError : there is a run in ``output`` already.
    """

    def __init__(
        self,
        output: str | Path,
        rig: CameraRig,
        model: ArticulatedModel,
        *,
        masks: bool = False,
        masked_images: bool = False,
        detector: str | None = None,
    ):
        self.output = Path(output)
        self._rig, self._model, self._detector = rig, model, detector
        requested = ["mask"] * masks + ["masked_image"] * masked_images
        self._of_body, self._of_cameras = recorded(BODY_OUTPUTS, requested), recorded(CAMERA_OUTPUTS, requested)
        self._prefix = "/tracker"  # as the node is called, unless it is renamed
        check_free(self.output)
        self._count = 0
        self._surfaces: np.ndarray | None = None
        with ExitStack() as stack:
            compression = "none" if detector is None else "zstd"
            self.bag = stack.enter_context(BagWriter(self.output / BAG, custom={"model": model.name}, compression=compression))
            chain = model.chain
            self._states = stack.enter_context(StatesWriter(self.output / STATES, chain.dof_names, chain.dof_units))
            self._joints = stack.enter_context(JointsWriter(self.output / JOINTS, model.landmark_names))
            self._poses = stack.enter_context(PosesWriter(self.output / POSES))
            self._stack = stack.pop_all()
        self._announce()

    def _announce(self) -> None:
        """All topics, also when not a single set comes."""
        self.bag.add_topic(f"/{DESCRIPTION}", STRING, OfferedQos(durability="transient_local", depth=1))
        for output in self._of_body:
            self.bag.add_topic(f"{self._prefix}/{output.topic}", output.type_name, OfferedQos())
        for camera in self._rig:
            self.bag.add_topic(f"/{camera.name}/camera_info", CAMERA_INFO, OfferedQos())
            if self._detector is not None:
                self.bag.add_topic(f"/{camera.name}/keypoints", KEYPOINTS, OfferedQos())
            for output in self._of_cameras:
                self.bag.add_topic(f"{self._prefix}/{camera.name}/{output.topic}", output.type_name, OfferedQos())

    def append(self, estimate: TrackEstimate, image_set: ImageSet) -> None:
        """Write one time step to all files; before a state is found, there is no row of joints and poses, and masks are empty.

        Parameters
        ----------
        estimate : what the tracker says of one image set.
        image_set : the images that it was made from.
        """
        configuration, has_state = Configuration(self._model, estimate.state), estimate.status.has_state
        self._surfaces = estimate.surfaces
        if not self._count:
            description = message_of(STRING, {"data": urdf_of(self._model)})
            self.bag.write_message(f"/{DESCRIPTION}", estimate.stamp_ns, description)
        self._write_messages(Tracked(estimate, image_set, self._rig, configuration))
        values = estimate.state.to_values() if has_state else np.full(self._model.n_dof, np.nan)
        self._states.append(row_of(estimate, values))
        if has_state:
            self._joints.append(estimate.stamp_ns, configuration.landmarks_world)
            self._poses.append(estimate.stamp_ns, estimate.state.T_world_root)
        self._count += 1
        if self._count % FLUSH_EVERY == 0:
            self.bag.flush()

    def _write_messages(self, tracked: Tracked) -> None:
        for camera in self._rig:
            image = tracked.image_set.get(camera.name)
            if image is not None:
                info = camera_info(image.stamp_ns, camera.frame_id, camera.model)
                self._write(f"/{camera.name}/camera_info", CAMERA_INFO, tracked, info)
                if image.people is not None and self._detector is not None:
                    people = keypoints(image, camera.frame_id, self._detector)
                    self._write(f"/{camera.name}/keypoints", KEYPOINTS, tracked, people)
            for output in self._of_cameras:
                topic = f"{self._prefix}/{camera.name}/{output.topic}"
                self._write(topic, output.type_name, tracked, output.content(tracked, camera))
        for output in self._of_body:
            self._write(f"{self._prefix}/{output.topic}", output.type_name, tracked, output.content(tracked))

    def _write(self, topic: str, type_name: str, tracked: Tracked, content: Content | None) -> None:
        if content is not None:
            self.bag.write_message(topic, tracked.estimate.stamp_ns, message_of(type_name, content))

    def write_summary(self, summary: dict[str, Any]) -> None:
        """``run.json``."""
        write_summary(self.output, summary)

    def close(self) -> None:
        """Finish every file, and write the body as it is seen in images, where its clothes were followed."""
        self._stack.close()
        write_body(self.output, self._model, self._surfaces)


def row_of(estimate: TrackEstimate, values: np.ndarray) -> StateRow:
    """Row of ``states.csv``: what the tracker says of an image set, and (n_dof,) values, NaN without a state.

    Parameters
    ----------
    estimate : what the tracker says of one image set.
    values : (n_dof,), NaN without a state.

    Returns
    -------
    row : of ``states.csv``.
    """
    return StateRow(
        stamp_ns=estimate.stamp_ns,
        status=estimate.status.name,
        reason=estimate.status_reason,
        values=values,
        score=estimate.score,
        residual=estimate.residual,
        iterations=estimate.iterations,
        evaluations=estimate.evaluations,
    )


class SmoothedWriter(Closing):
    """Takes the tracker's estimates as they come; use it in a ``with`` statement, which ends with all of them written.

    Parameters
    ----------
    output : folder of the run; the files come into ``smoothed`` in it.
    lag_s : seconds after a time step that its estimate uses; infinite: the whole of the recording, which is then
        written at its end.

    Status, reason, residual and score are those of the tracker. What comes before the body is first found has rows
    without a state.
    """

    def __init__(self, output: str | Path, model: ArticulatedModel, motion: MotionConfig, lag_s: float):
        self._model, self._lag_s = model, lag_s
        self._dynamics = Dynamics.of(motion, model.chain, motion.smoother_noise)
        self._rest = resting(model, motion)
        self._smoother = Smoother(self._dynamics, lag_s)
        self._waiting: deque[TrackEstimate] = deque()
        folder, names, units = Path(output) / SMOOTHED, model.chain.dof_names, model.chain.dof_units
        folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            self._states = stack.enter_context(StatesWriter(folder / STATES, names, units))
            self._joints = stack.enter_context(JointsWriter(folder / JOINTS, model.landmark_names))
            self._poses = stack.enter_context(PosesWriter(folder / POSES))
            self._velocities = stack.enter_context(VelocitiesWriter(folder / VELOCITIES, names, units))
            self._covariances = stack.enter_context(CovariancesWriter(folder / COVARIANCES, names))
            self._stack = stack.pop_all()

    def append(self, estimate: TrackEstimate) -> None:
        """One estimate; a stamp that goes backward begins a new recording."""
        if self._waiting and estimate.stamp_ns < self._waiting[-1].stamp_ns:
            self._finish()
        self._waiting.append(estimate)
        self._write(self._smoother.add(Measurement.of(estimate, self._rest)))

    def close(self) -> None:
        """Write what is left, and finish every file."""
        with self._stack:
            self._finish()

    def _finish(self) -> None:
        self._write(self._smoother.finish())
        self._smoother = Smoother(self._dynamics, self._lag_s)

    def _write(self, beliefs: list[Belief | None]) -> None:
        for belief in beliefs:
            estimate = self._waiting.popleft()
            if belief is None:
                self._write_state(estimate, np.full(self._model.n_dof, np.nan))
            else:
                self._write_one(estimate, belief)

    def _write_state(self, estimate: TrackEstimate, values: np.ndarray) -> None:
        self._states.append(row_of(estimate, values))

    def _write_one(self, estimate: TrackEstimate, belief: Belief) -> None:
        stamp_ns, state = estimate.stamp_ns, clip_to_limits(belief.state, self._model.chain)
        self._write_state(estimate, state.to_values())
        self._joints.append(stamp_ns, Configuration(self._model, state).landmarks_world)
        self._poses.append(stamp_ns, state.T_world_root)
        self._velocities.append(stamp_ns, belief.velocity)
        self._covariances.append(stamp_ns, smoothed_covariance(belief, estimate), belief.velocity_covariance)
