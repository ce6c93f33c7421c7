"""The tracker as a ROS node: converts, makes one call into the core, publishes."""

from __future__ import annotations

import time
from collections.abc import Mapping

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.parameter import Parameter

from ..camera.camera_model import CameraModel
from ..errors import TrackerError
from ..model.configuration import State
from ..observation.image_set import ImageSet
from ..tracking.config import TrackerConfig
from ..tracking.estimate import TrackEstimate
from ..tracking.warm_up import warm_up
from .camera_diagnostics import SILENT_S, CameraDiagnostics
from .conversions import camera_model_of
from .diagnostics import ERROR, OK, WARN, Diagnostics
from .image_inbox import ImageInbox, InboxOptions
from .lifecycle import ACTIVE, ManagedNode
from .parameter_overrides import refuse_unknown_qos, unknown_parameters
from .parameters import ConfigParameters, FixedParameter
from .qos_mismatch import QosMismatches
from .tracker_diagnostics import TrackerDiagnostics
from .tracker_options import TrackerMaker, TrackerOptions
from .tracker_outputs import TrackerOutputs
from .tracker_services import TrackerServices
from .tracking_setup import TrackingSetup
from .tracking_worker import TrackingWorker

__all__ = ["TrackerNode", "TrackerOptions"]


class TrackerNode(ManagedNode):
    """Subscribes to the rig's cameras and publishes where the body is.

    Parameters, services and /diagnostics are there from the beginning, the topics once the node is configured.

    Raises
    ------
    TrackerError : parameters that are unknown or out of range; pictures of the empty scene that cannot be used.
    """

    def __init__(self, options: TrackerOptions):
        super().__init__("tracker")
        self._options, self._maker = options, TrackerMaker(options)
        self._diagnostics = Diagnostics(self, options.model.name)
        self._mismatches = QosMismatches(self, self._diagnostics)
        self._parameters_of_node = ConfigParameters(
            self,
            options.config,
            self._on_change,
            cameras=options.rig.names,
            fixed=_fixed_parameters(options),
            check=self._check_change,
        )
        fixed = self._parameters_of_node.fixed
        self._lossless, self._from_topics = bool(fixed["lossless"]), fixed["calibration"] == "camera_info"
        self._worker: TrackingWorker | None = None
        self._outputs: TrackerOutputs | None = None
        self._prepared: TrackingSetup | None = None  # for parameters that are just being set
        self._services_of_node = TrackerServices(
            self, options, lambda: self._worker, lambda: self._parameters_of_node.config.start.enabled
        )
        threshold = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False)
        self._jump = self.get_clock().create_jump_callback(threshold, post_callback=self._on_jump)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._began_s = time.monotonic()
        self._timers_of_node = [
            self.create_timer(1.0, self.report, clock=steady),
            self.create_timer(0.05, self._take_calibrations, clock=steady),
        ]
        self.changed()

    # Life cycle

    def start(self) -> bool:
        """Configure and activate; whether both went well."""
        return self.configure() and self.activate()

    def set_up(self) -> None:
        """Everything that takes time: compiled code, the tracker, the topics."""
        options, cameras = self._options, self._parameters_of_node.cameras
        fixed = self._parameters_of_node.fixed
        self._lenses: dict[str, CameraModel] | None = {} if self._from_topics else None
        self._outputs = TrackerOutputs(self, options.rig, options.model, self._mismatches, str(fixed["frame_prefix"]))
        inbox = InboxOptions(self._lossless, bool(fixed["compressed"]), options.inbox.capacity)
        self._inbox = ImageInbox(self, options.rig.names, inbox, self._mismatches)
        config = self._parameters_of_node.config
        if options.make_tracker is None:
            rig = options.rig.subset(cameras)
            warm_up(rig, options.model, config, options.initial_state, options.occluders, writeable=inbox.compressed)
        self._worker = TrackingWorker(
            self._inbox,
            self._setup(config, cameras),
            self._on_estimate,
            initial_state=options.initial_state or State.neutral(options.model),
            lossless=self._lossless,
            on_error=self.get_logger().error,
        )
        self._told = TrackerDiagnostics(self._diagnostics, options.model)
        self._cameras_told = CameraDiagnostics(self._diagnostics, options.rig, self._inbox, self._from_topics)

    def begin(self) -> None:
        """Listen and track."""
        assert self._worker is not None
        self._inbox.subscribe(self._parameters_of_node.cameras)
        refuse_unknown_qos(self)
        self._cameras_told.restart()
        if self._from_topics and self._worker.rig is not None:
            self._diagnostics.report("calibration", OK, "complete")  # it is kept while inactive
        self._worker.start()

    def pause(self) -> None:
        """Neither listen nor track; what is known is kept."""
        if self._worker is not None:
            self._worker.stop(finish=False)
            self._inbox.subscribe(())

    def tear_down(self) -> None:
        """Forget everything."""
        if self._worker is not None:
            self._inbox.subscribe(())
        if self._outputs is not None:
            self._outputs.close()
        self._worker = self._outputs = None

    def changed(self) -> None:
        """Say so on /diagnostics."""
        if self.state != ACTIVE:
            self._diagnostics.rest(self.state)
        level, said = (ERROR, self.failure) if self.failure else (OK, self.state)
        self._diagnostics.report("lifecycle", level, said, {"state": self.state}, logged=False)  # it is in the log already

    def close(self) -> None:
        """End; what has come in is tracked where nothing may be lost, and what has been said is delivered first."""
        if self._worker is not None and self.state == ACTIVE:
            self._worker.stop()
        if self._outputs is not None:
            self._outputs.wait_until_delivered()
        self.report()

    @property
    def autostart(self) -> bool:
        """Whether the node is to configure and activate itself."""
        return bool(self._parameters_of_node.fixed["autostart"])

    def has_subscribers(self, wanted: Mapping[str, int]) -> bool:
        """Whether outputs (state, pose, joint_states, mask, overlay, target_through_mask) have at least so many subscribers."""
        outputs = self._outputs
        return outputs is not None and all(outputs.subscriber_count(topic) >= count for topic, count in wanted.items())

    @property
    def fatal(self) -> Exception | None:
        """Why the tracking thread has ended by itself."""
        return None if self._worker is None else self._worker.fatal

    def counters(self) -> dict[str, dict[str, int]]:
        """Per camera, what became of its images."""
        return {} if self._worker is None else self._worker.formation.counters

    @property
    def superseded(self) -> int:
        """Image sets that were not tracked since a newer one was there."""
        return 0 if self._worker is None else self._worker.counts.superseded

    # Parameters and calibration

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """As rclpy has it, but unknown parameters are named."""
        return unknown_parameters(self, parameter_list) or super().set_parameters_atomically(parameter_list)

    def _setup(self, config: TrackerConfig, cameras: tuple[str, ...]) -> TrackingSetup:
        rig = self._maker.rig(cameras, self._lenses)
        return TrackingSetup(config, cameras, rig, None if rig is None else self._maker.tracker(rig, config))

    def _check_change(self, config: TrackerConfig, cameras: tuple[str, ...]) -> None:
        """The tracker is made before the parameters are accepted, so that what does not suit the body is refused."""
        self._prepared = None if self._worker is None else self._setup(config, cameras)

    def _on_change(self, config: TrackerConfig) -> None:
        if self._worker is None or self._prepared is None:
            return
        if self.state == ACTIVE:
            self._inbox.subscribe(self._prepared.cameras)
        self._worker.use(self._prepared)
        self._prepared = None

    def _take_calibrations(self) -> None:
        """When all cameras in use have said what their lenses are, tracking begins."""
        if self._worker is None or self.state != ACTIVE or not self._from_topics or self._worker.rig is not None:
            return
        cameras = self._parameters_of_node.cameras
        try:
            self._lenses = {name: camera_model_of(name, info) for name, info in dict(self._inbox.infos).items()}
            lacking = [name for name in cameras if name not in self._lenses]
            setup = None if lacking else self._setup(self._parameters_of_node.config, cameras)
        except TrackerError as error:
            self._diagnostics.report("calibration", ERROR, str(error))
            return
        if setup is not None:
            self._diagnostics.report("calibration", OK, "complete")
            self._worker.use(setup)
        elif time.monotonic() - self._began_s > SILENT_S:
            self._diagnostics.report("calibration", WARN, f"waiting for camera_info of {', '.join(lacking)}")

    # What happens

    def _on_estimate(self, estimate: TrackEstimate, image_set: ImageSet) -> None:
        assert self._worker is not None and self._worker.rig is not None and self._outputs is not None
        self._outputs.publish(estimate, image_set, self._worker.rig)
        if self._worker.counts.tracked == 1:
            self.get_logger().info(f"first image set tracked {time.monotonic() - self._began_s:.2f} s after the start")
        self._told.estimated(estimate, image_set, self._worker.counts, self.get_clock().now().nanoseconds)
        self._cameras_told.contradicted(estimate.faults)

    def _on_jump(self, jump: TimeJump) -> None:
        """Only said: the tracker begins again when stamps go back, at the same image set however the clock's messages come."""
        self.get_logger().warning(f"time went back by {-jump.delta.nanoseconds * 1e-9:.3f} s")
        if self._worker is not None:
            self._told.clock_jumped()

    def report(self) -> None:
        """Once a second: rates, and each camera."""
        self._mismatches.recheck(again=self.state == ACTIVE)
        if self._worker is not None and self.state == ACTIVE:
            self._told.report(self._worker)
            self._cameras_told.report(self._worker, self._parameters_of_node.cameras)


def _fixed_parameters(options: TrackerOptions) -> dict[str, FixedParameter]:
    """What is given at the start, by options or by parameters, which win."""
    calibration = "camera_info" if options.calibration_from_topics else "rig"
    return {
        "autostart": FixedParameter(options.autostart, "configure and activate without being asked"),
        "lossless": FixedParameter(options.inbox.lossless, "track every image set in order, however long it takes"),
        "compressed": FixedParameter(options.inbox.compressed, "subscribe to <cam>/image_raw/compressed"),
        "calibration": FixedParameter(calibration, "where the lenses are taken from", ("rig", "camera_info")),
        "frame_prefix": FixedParameter("", "before the name of the root link on /tf, as robot_state_publisher has it"),
    }
