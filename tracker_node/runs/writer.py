"""The folder that a run leaves: a bag, three CSV files, and ``run.json``."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ..camera.rig import Camera, CameraRig
from ..loaders.bag.message_types import TRACKED_STATE, typestore
from ..loaders.bag.metadata import OfferedQos
from ..loaders.bag.writer import BagExistsError, BagWriter
from ..loaders.model.urdf_writer import urdf_of
from ..loaders.motion.trajectory_file import JointsWriter, PosesWriter, StateRow, StatesWriter
from ..loaders.whole_file import write_whole
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration
from ..observation.image_set import ImageSet
from ..render.draw.masked_image import target_through_mask
from ..render.raycast.raycaster import render_mask
from ..tracking.estimate import TrackEstimate
from . import messages

BAG, STATES, JOINTS, POSES, SUMMARY = "bag", "states.csv", "joints.csv", "poses.csv", "run.json"
DESCRIPTION, STRING = "/robot_description", "std_msgs/msg/String"
FLUSH_EVERY = 30  # image sets


def write_summary(folder: Path, summary: dict[str, Any]) -> None:
    """``run.json`` of the run in ``folder``, which is made if it is not there."""
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / SUMMARY, json.dumps(summary, indent=2, allow_nan=False) + "\n")


class RunWriter:
    """Writes each estimate as it comes; use it in a ``with`` statement.

    Parameters
    ----------
    output : folder, made here; it must not hold a run yet.
    tracker : name before the topics of the tracker.
    masks : also record ``<tracker>/<camera>/mask``, the model's silhouette.
    through_masks : also record ``<tracker>/<camera>/target_through_mask``, the image where that is.

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
        tracker: str = "tracker",
        masks: bool = False,
        through_masks: bool = False,
    ):
        self.output = Path(output)
        self._rig, self._model, self._masks, self._through_masks = rig, model, masks, through_masks
        self._prefix = f"/{tracker.strip('/')}"
        for name in (BAG, STATES, JOINTS, POSES, SUMMARY):
            if (self.output / name).exists():
                raise BagExistsError(self.output / name)
        self._count = 0
        with ExitStack() as stack:
            self.bag = stack.enter_context(BagWriter(self.output / BAG, custom={"model": model.name}))
            chain = model.chain
            self._states = stack.enter_context(StatesWriter(self.output / STATES, chain.dof_names, chain.dof_units))
            self._joints = stack.enter_context(JointsWriter(self.output / JOINTS, model.landmark_names))
            self._poses = stack.enter_context(PosesWriter(self.output / POSES))
            self._stack = stack.pop_all()
        self._announce()

    def _announce(self) -> None:
        """All topics, also when not a single set comes."""
        self.bag.add_topic(DESCRIPTION, STRING, OfferedQos(durability="transient_local", depth=1))
        for end, type_name in (
            ("state", TRACKED_STATE),
            ("pose", "geometry_msgs/msg/PoseWithCovarianceStamped"),
            ("joint_states", "sensor_msgs/msg/JointState"),
        ):
            self.bag.add_topic(f"{self._prefix}/{end}", type_name, OfferedQos())
        for camera in self._rig:
            self.bag.add_topic(f"/{camera.name}/camera_info", "sensor_msgs/msg/CameraInfo", OfferedQos())
            if self._masks:
                self.bag.add_topic(f"{self._prefix}/{camera.name}/mask", "sensor_msgs/msg/Image", OfferedQos())
            if self._through_masks:
                topic = f"{self._prefix}/{camera.name}/target_through_mask"
                self.bag.add_topic(topic, "sensor_msgs/msg/CompressedImage", OfferedQos())

    def append(self, estimate: TrackEstimate, image_set: ImageSet) -> None:
        """One instant to all files; before a state is found, there is no row of joints and poses, and masks are empty."""
        configuration, has_state = Configuration(self._model, estimate.state), estimate.status.has_state
        if not self._count:
            description = typestore().types[STRING](data=urdf_of(self._model))
            self.bag.write_message(DESCRIPTION, estimate.stamp_ns, description)
        self._write_messages(estimate, image_set, configuration)
        self._states.append(
            StateRow(
                stamp_ns=estimate.stamp_ns,
                status=estimate.status.name,
                reason=estimate.status_reason,
                values=estimate.state.to_values() if has_state else np.full(self._model.n_dof, np.nan),
                score=estimate.score,
                residual_px=estimate.residual_px,
                iterations=estimate.iterations,
                evaluations=estimate.evaluations,
            )
        )
        if has_state:
            self._joints.append(estimate.stamp_ns, configuration.landmarks_world)
            self._poses.append(estimate.stamp_ns, estimate.state.T_world_root)
        self._count += 1
        if self._count % FLUSH_EVERY == 0:
            self.bag.flush()

    def _write_messages(self, estimate: TrackEstimate, image_set: ImageSet, configuration: Configuration) -> None:
        stamp_ns, frame_id, prefix = estimate.stamp_ns, self._rig.world_frame, self._prefix
        has_state = estimate.status.has_state
        for camera in self._rig:
            image = image_set.get(camera.name)
            if image is not None:
                info = messages.camera_info_message(image.stamp_ns, camera)
                self.bag.write_message(f"/{camera.name}/camera_info", stamp_ns, info)
            if self._masks:
                pixels = render_mask(configuration, camera) if has_state else _empty_mask(camera)
                mask_stamp_ns = stamp_ns if image is None else image.stamp_ns
                mask = messages.image_message(mask_stamp_ns, camera.frame_id, pixels, "mono8")
                self.bag.write_message(f"{prefix}/{camera.name}/mask", stamp_ns, mask)
            if self._through_masks and image is not None and has_state:
                seen = messages.compressed_message(
                    image.stamp_ns, camera.frame_id, target_through_mask(image.bgr, configuration, camera)
                )
                self.bag.write_message(f"{prefix}/{camera.name}/target_through_mask", stamp_ns, seen)
        self.bag.write_message(f"{prefix}/state", stamp_ns, messages.tracked_state_message(estimate, self._model, frame_id))
        if not estimate.status.known:  # as the node does: these messages cannot say that they are wrong
            return
        self.bag.write_message(f"{prefix}/pose", stamp_ns, messages.pose_message(estimate, frame_id))
        self.bag.write_message(f"{prefix}/joint_states", stamp_ns, messages.joint_state_message(estimate, self._model, frame_id))

    def write_summary(self, summary: dict[str, Any]) -> None:
        """``run.json``."""
        write_summary(self.output, summary)

    def close(self) -> None:
        """Finish every file."""
        self._stack.close()

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def _empty_mask(camera: Camera) -> np.ndarray:
    return np.zeros((camera.model.height, camera.model.width), dtype=np.uint8)
