"""The tracker as a ROS node: converts, makes one call into the core, publishes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import cv2
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.clock import JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.node import Node
from std_srvs.srv import Trigger
from tracker_msgs.srv import SetState

from ..camera.camera_rig import CameraRig
from ..errors import TrackerError
from ..loaders.plate_file import load_plates
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import State
from ..observation.image_set import ImageSet
from ..tracking.config import TrackerConfig
from ..tracking.estimate import Status, TrackEstimate
from ..tracking.observability import unobservable
from ..tracking.tracker import Tracker
from .conversions import camera_model_of, state_of_pose, values_with_changes
from .diagnostics import ERROR, OK, STALE, WARN, Diagnostics, statuses_of
from .image_inbox import ImageInbox, InboxOptions
from .parameters import ConfigParameters
from .qos import RESULT
from .tracker_outputs import TrackerOutputs
from .tracking_worker import Steppable, TrackingWorker

_SILENT_S = 2.0  # a camera without an image for so long is reported
_LEVELS = {Status.INITIALISING: WARN, Status.TRACKING: OK, Status.DEGRADED: WARN, Status.LOST: ERROR}


@dataclass(frozen=True, eq=False)
class TrackerOptions:
    """What a tracker node is made of.

    Parameters
    ----------
    rig, model, config, initial_state, occluders : as for `tracking.tracker.Tracker`; parameters given to the node win over
        ``config``.
    inbox : how images are received; ``inbox.lossless`` also makes every image set be tracked, in order.
    calibration_from_topics : lenses come from ``<cam>/camera_info`` instead of the rig, which gives the places only.
    make_tracker : what tracks; by default the `Tracker`.
    """

    rig: CameraRig
    model: ArticulatedModel
    config: TrackerConfig = field(default_factory=TrackerConfig)
    initial_state: State | None = None
    occluders: ArticulatedModel | None = None
    inbox: InboxOptions = field(default_factory=InboxOptions)
    calibration_from_topics: bool = False
    make_tracker: Callable[[CameraRig, ArticulatedModel, TrackerConfig, State | None], Steppable] | None = None


class TrackerNode(Node):
    """Subscribes to the rig's cameras and publishes where the body is."""

    def __init__(self, options: TrackerOptions):
        super().__init__("tracker")
        self._options = options
        self._rig: CameraRig | None = None
        self._plates = load_plates(options.rig)
        self._quality_problems: dict[str, str] = {}
        self._contradicted: set[str] = set()
        self._last_report: tuple[float, int, dict[str, int]] = (time.monotonic(), 0, {})
        self._diagnostics = Diagnostics(self, options.model.name)
        self._parameters_of_config = ConfigParameters(self, options.config, lambda config: self._worker.reconfigure(config))
        self._outputs = TrackerOutputs(self, options.rig, options.model, self._remember_problem)
        self._inbox = ImageInbox(self, options.rig.names, options.inbox, self._remember_problem)
        self._worker = TrackingWorker(
            self._inbox,
            self._make_tracker,
            self._on_estimate,
            model=options.model,
            config=self._parameters_of_config.config,
            cameras=options.rig.names,
            lossless=options.inbox.lossless,
            on_error=self.get_logger().error,
        )
        self._serve()
        self._began_s = time.monotonic()
        self._timer = self.create_timer(1.0, self.report)
        if options.calibration_from_topics:
            self._calibration_timer = self.create_timer(0.05, self._take_calibrations)
        else:
            self._use_rig(options.rig)

    def start(self) -> None:
        """Begin to track, in a thread."""
        self._worker.start()

    def has_subscribers(self, wanted: Mapping[str, int]) -> bool:
        """Whether outputs (state, pose, joint_states, mask, overlay, target_through_mask) have at least so many subscribers."""
        return all(self._outputs.subscriber_count(topic) >= count for topic, count in wanted.items())

    @property
    def fatal(self) -> Exception | None:
        """Why the tracking thread has ended by itself."""
        return self._worker.fatal

    def counters(self) -> dict[str, dict[str, int]]:
        """Per camera, what became of its images."""
        return self._worker.synchronizer.counters

    @property
    def superseded(self) -> int:
        """Image sets that were not tracked since a newer one was there."""
        return self._worker.counts.superseded

    def close(self) -> None:
        """End the thread; what has been said is delivered first."""
        self._worker.stop()
        self._outputs.wait_until_delivered()
        self.report()

    def _serve(self) -> None:
        self._offered = [
            self.create_service(Trigger, "~/reset", self._on_reset),
            self.create_service(SetState, "~/set_state", self._on_set_state),
        ]
        self._initial_pose = self.create_subscription(PoseWithCovarianceStamped, "initialpose", self._on_initial_pose, RESULT)
        threshold = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False)
        self._jump = self.get_clock().create_jump_callback(threshold, post_callback=self._on_jump)

    # Calibration

    def _use_rig(self, rig: CameraRig) -> None:
        self._rig = rig
        self._worker.set_rig(rig)

    def _take_calibrations(self) -> None:
        """When all cameras have said what their lenses are, tracking begins."""
        infos = dict(self._inbox.infos)
        try:
            lenses = {name: camera_model_of(name, info) for name, info in infos.items()}
        except TrackerError as error:
            self._diagnostics.report("calibration", ERROR, str(error))
            return
        lacking = [name for name in self._options.rig.names if name not in lenses]
        if lacking:
            if time.monotonic() - self._began_s > _SILENT_S:
                self._diagnostics.report("calibration", WARN, f"waiting for camera_info of {', '.join(lacking)}")
            return
        self._calibration_timer.cancel()
        self._diagnostics.report("calibration", OK, "complete")
        cameras = tuple(replace(camera, model=lenses[camera.name]) for camera in self._options.rig)
        self._use_rig(CameraRig(cameras, self._options.rig.world_frame, self._options.rig.lights))

    def _make_tracker(self, rig: CameraRig, config: TrackerConfig, state: State | None) -> Steppable:
        state = self._options.initial_state if state is None else state
        if self._options.make_tracker is not None:
            return self._options.make_tracker(rig, self._options.model, config, state)
        plates = dict(self._plates)
        for camera in rig:
            plate, size = plates.get(camera.name), (camera.model.width, camera.model.height)
            if plate is not None and plate.shape[1::-1] != size:  # the images are published resampled
                plates[camera.name] = cv2.resize(plate, size, interpolation=cv2.INTER_AREA)
        return Tracker(rig, self._options.model, config, plates, state, self._options.occluders)

    # Results

    def _on_estimate(self, estimate: TrackEstimate, image_set: ImageSet) -> None:
        assert self._rig is not None
        self._outputs.publish(estimate, image_set, self._rig)
        if self._worker.counts.tracked == 1:
            self.get_logger().info(f"first image set tracked {time.monotonic() - self._began_s:.2f} s after the start")
        self._report_status(estimate)
        self._report_faults(estimate)

    # Requests

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._worker.reset()
        response.success, response.message = True, ""
        return response

    def _current_values(self):
        latest = self._worker.latest
        if latest is not None:
            return latest.state.to_values()
        return (self._options.initial_state or State.neutral(self._options.model)).to_values()

    def _on_set_state(self, request: SetState.Request, response: SetState.Response) -> SetState.Response:
        try:
            values = values_with_changes(self._options.model, self._current_values(), request.dof_names, request.values)
        except TrackerError as error:
            response.success, response.message = False, str(error)
            return response
        state = State.from_values(values)
        self._worker.set_state(state)
        beyond = self._options.model.chain.beyond_limits(state.joint_positions)
        response.success, response.message = True, f"put at the limit: {'; '.join(beyond)}" if beyond else ""
        return response

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        frame = message.header.frame_id
        if frame not in ("", self._options.rig.world_frame):
            self.get_logger().error(f"initialpose: expected frame '{self._options.rig.world_frame}', got '{frame}'")
            return
        try:
            joints = State.from_values(self._current_values()).joint_positions
            self._worker.set_state(state_of_pose(message.pose.pose, joints))
        except TrackerError as error:
            self.get_logger().error(f"initialpose: {error}")

    def _on_jump(self, jump: TimeJump) -> None:
        self.get_logger().warning(f"time went back by {-jump.delta.nanoseconds * 1e-9:.3f} s: the tracker begins again")
        self._worker.reset()

    # Diagnostics

    def _remember_problem(self, what: str, problem: str) -> None:
        self._quality_problems[what] = problem
        self._diagnostics.report(f"quality of service of {what}", WARN, problem)

    def _report_status(self, estimate: TrackEstimate) -> None:
        counts = self._worker.counts
        values = {
            "image sets tracked": counts.tracked,
            "image sets superseded": counts.superseded,
            "image sets lost": counts.lost,
            "image sets failed": counts.failed,
            "residual [px]": float(estimate.residual_px),
            "total [ms]": float(estimate.timings.total_ms),
        }
        self._diagnostics.report("status", _LEVELS[estimate.status], _said(estimate), values)

    def _report_faults(self, estimate: TrackEstimate) -> None:
        """Cameras that the others contradict, and those that they no longer do."""
        statuses = statuses_of(estimate.faults)
        for camera, (level, said, values) in statuses.items():
            self._diagnostics.report(f"{camera} against the others", level, said, values)
        for camera in self._contradicted - set(statuses):
            self._diagnostics.report(f"{camera} against the others", OK, "agrees with them")
        self._contradicted = set(statuses)

    def _report_untold(self) -> None:
        """What the latest images do not tell of the body, by name; a warning where it is of the body as a whole."""
        latest = self._worker.latest
        if latest is None:
            return
        if latest.information is None:
            self._diagnostics.report("observability", STALE, "the images are not believed")
            return
        names = unobservable(latest.information, self._options.model)
        said = f"the images do not tell: {'; '.join(names)}" if names else "the images tell every degree of freedom"
        whole = any(name.startswith("root") for name in names)
        self._diagnostics.report("observability", WARN if whole else OK, said)

    def report(self) -> None:
        """Once a second: rates, and each camera."""
        now = time.monotonic()
        synchronizer = self._worker.synchronizer
        counters = synchronizer.counters
        before_s, tracked_before, received_before = self._last_report
        elapsed_s = max(now - before_s, 1e-3)
        counts = self._worker.counts
        rate = (counts.tracked - tracked_before) / elapsed_s
        if self._worker.fatal is not None:
            self._diagnostics.report("rate", ERROR, f"the tracking thread has ended: {self._worker.fatal}")
        else:
            level, said = (OK, "tracking") if rate > 0 else (STALE, "no image sets")
            self._diagnostics.report("rate", level, said, {"image sets per second": rate})
        formed = {"complete": synchronizer.sets_complete, "of fewer cameras": synchronizer.sets_incomplete}
        not_formed = {f"not formed, {reason}": n for reason, n in synchronizer.sets_not_formed.items()}
        self._diagnostics.report("image sets", OK, "formed from the images by their stamps", formed | not_formed)
        for name, counter in counters.items():
            received = counter["received"]
            values = {"images per second": (received - received_before.get(name, 0)) / elapsed_s, **counter}
            values["overflowed"] = self._inbox.overflowed[name]
            values["refused"] = counts.refused.get(name, 0)
            self._diagnostics.report(name, *self._camera_verdict(name, now), values)
        self._report_untold()
        self._last_report = (now, counts.tracked, {name: counter["received"] for name, counter in counters.items()})

    def _camera_verdict(self, name: str, now: float) -> tuple[bytes, str]:
        problem = self._worker.counts.problems.get(name)
        if problem:
            return ERROR, problem
        last_s = self._inbox.last_arrival_s.get(name)
        silent_s = now - (self._began_s if last_s is None else last_s)
        if silent_s < _SILENT_S:
            return OK, "waiting for the first image" if last_s is None else "receiving"
        if any(now - other_s < 0.5 * _SILENT_S for other_s in self._inbox.last_arrival_s.values()):
            return ERROR, "has sent no image yet" if last_s is None else "has stopped sending images"
        # While we are at work, a source that waits for our answers is rightly silent.
        return (OK, "waits for the tracker") if self._worker.busy else (STALE, "no camera sends images")


def _said(estimate: TrackEstimate) -> str:
    return estimate.status.name + (f": {estimate.status_reason}" if estimate.status_reason else "")
