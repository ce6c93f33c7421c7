"""The tracker as a ROS node: converts, makes one call into the core, publishes."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.parameter import Parameter

from ...camera.model import CameraModel
from ...errors import FileFormatError, TrackerError
from ...model.configuration import State
from ...observation.image_set import ImageSet
from ...runs.joint_states import check_use
from ...runs.messages import lens_of
from ...runs.writer import write_body, write_joined
from ...tracking.config import KEYPOINTS, TrackerConfig
from ...tracking.estimate import TrackEstimate
from ..diagnostics import ERROR, OK, WARN, Diagnostics, QosMismatches
from ..ending import hurried
from ..guarded_node import ACTIVE, FINALIZED, ManagedNode
from ..joint_states import JointStateInbox
from ..parameter_overrides import refuse_unknown_qos, unknown_parameters
from .camera_diagnostics import CameraDiagnostics
from .diagnostics import TrackerDiagnostics
from .heap import keep_for_ever
from .image_inbox import ImageInbox
from .keypoint_inbox import KeypointInbox, PointMatching
from .outputs import BodiesOutput, TrackerOutputs
from .parameters import ConfigParameters, FixedParameter
from .services import TrackerServices
from .setup import UNCALIBRATED, SetupBuilder, TrackerMaker, TrackerOptions, TrackingSetup
from .worker import TrackingWorker

__all__ = ["TrackerNode", "TrackerOptions"]
_CALIBRATIONS_S = 30.0  # for cameras that are started after the tracker to say what their lenses are

_FINISH_S = 300.0  # who has asked for it has less patience
PARAMETERS = "parameters"  # the part of /diagnostics that says whether they are in effect
_TELL_S = 5.0  # between two lines of what is compiled
_PATIENCE_S = 5.0  # until lenses that no tracker can be made for are tried again


class TrackerNode(ManagedNode):
    """Subscribes to the rig's cameras and publishes where the body is.

    Parameters, services and /diagnostics are there from the beginning, the topics once the node is configured.

    Raises
    ------
    TrackerError : parameters that are unknown or out of range; images of the background that cannot be used.
    """

    def __init__(self, options: TrackerOptions):
        super().__init__("tracker")
        self._options, self._maker = options, TrackerMaker(options, self._compiled)
        self._told_s = 0.0  # steady time of the last line of that
        self._diagnostics = Diagnostics(self, options.model.name)
        self._mismatches = QosMismatches(self, self._diagnostics)
        self._parameters_of_node = ConfigParameters(
            self,
            options.config,
            self._on_change,
            cameras=options.rig.names,
            fixed=_fixed_parameters(options),
            check=self._check_change,
            ros_args=options.ros_args,
        )
        fixed = self._parameters_of_node.fixed
        self._lossless, self._from_topics = bool(fixed["lossless"]), fixed["calibration"] == "camera_info"
        self._worker: TrackingWorker | None = None
        self._outputs: dict[str, TrackerOutputs] = {}  # by body
        self._bodies: BodiesOutput | None = None  # of all together
        self._joint_states: JointStateInbox | None = None
        self._surfaces: dict[str, np.ndarray | None] = {}  # by body, as its last estimate has them
        self._changes = 0  # of parameters, or lenses, that have come into effect
        self._builder = SetupBuilder(self.get_logger().error)
        self._again_s = 0.0  # steady time from which on a tracker that could not be made is tried again
        self._services_of_node = TrackerServices(
            self, options, lambda: self._worker, lambda: self._parameters_of_node.config.initialization.enabled
        )
        threshold = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False)
        self._jump = self.get_clock().create_jump_callback(threshold, post_callback=self._on_jump)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._began_s = time.monotonic()
        self._timers_of_node = [
            self.create_timer(1.0, self.report, clock=steady),
            self.create_timer(0.05, self._take_setup, clock=steady),
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
        prefix = str(fixed["frame_prefix"])
        self._outputs = {
            name: TrackerOutputs(self, options.rig, body.model, self._mismatches, prefix, name)
            for name, body in options.each.items()
        }
        if options.several:
            models = {name: body.model for name, body in options.each.items()}
            self._bodies = BodiesOutput(self, models, self._mismatches)
        inbox = replace(options.inbox, lossless=self._lossless, compressed=bool(fixed["compressed"]))
        if inbox.compressed and inbox.direct is not None and inbox.direct.cameras >= set(options.rig.names):
            raise FileFormatError("parameters of tracker", "compressed", "false: no image comes from a topic here", True)
        config = self._parameters_of_node.config
        points = PointMatching(config.synchronizer.image_period_s)
        self._inbox = ImageInbox(self, options.rig.names, inbox, self._mismatches, points.came)
        self._keypoints = KeypointInbox(self, points, self._mismatches, self._diagnostics, options.point_names)
        topic = str(fixed["joint_states"])
        if topic and options.several:
            raise FileFormatError("parameters of tracker", "joint_states", "nothing beside several bodies", topic)
        if topic:
            check_use(options.model, config)
        said = JointStateInbox(self, options.model, topic, self._diagnostics, self._mismatches) if topic else None
        self._joint_states = said
        self._maker.prepare(cameras, config)
        self._maker.check(cameras, config)  # loads what a change of parameters needs
        keep_for_ever()
        self._setup_in_use = self._setup(config, cameras, self._lenses)
        self._worker = TrackingWorker(
            self._inbox,
            self._setup_in_use,
            self._on_estimate,
            initial_state=options.initial_state or State.neutral(options.model),
            initial_states={name: body.initial_state or State.neutral(body.model) for name, body in options.each.items()},
            lossless=self._lossless,
            points=points,
            joint_states=said,
            on_error=self.get_logger().error,
        )
        self._tracker_diagnostics = TrackerDiagnostics(self._diagnostics, options.model)
        self._camera_diagnostics = CameraDiagnostics(self._diagnostics, options.rig, self._inbox, self._from_topics)

    def begin(self) -> None:
        """Listen and track."""
        assert self._worker is not None
        self._builder.wait()
        self._use_new_setup()
        self._inbox.subscribe(self._parameters_of_node.cameras)
        self._listen_to_detectors(self._setup_in_use)
        refuse_unknown_qos(self)
        self._camera_diagnostics.restart()
        self._listening_since_s = time.monotonic()
        if self._from_topics and self._setup_in_use.rig is not None:
            self._diagnostics.report("calibration", OK, "complete")  # it is kept while inactive
        self._worker.start()

    def pause(self) -> None:
        """Neither listen nor track; what is known is kept."""
        if self._worker is not None:
            self._worker.stop(finish=False)
            self._inbox.subscribe(())
            self._keypoints.subscribe(())

    def tear_down(self) -> None:
        """Forget everything."""
        self._builder.forget()
        if self._worker is not None:
            self._inbox.subscribe(())
            self._keypoints.subscribe(())
        for outputs in self._outputs.values():
            outputs.close()
        if self._joint_states is not None:
            self._joint_states.close()
        if self._bodies is not None:
            self._bodies.close()
        self._worker = self._joint_states = self._bodies = None
        self._outputs = {}

    def changed(self) -> None:
        """Say so on /diagnostics."""
        if self.state != ACTIVE:
            self._diagnostics.rest(self.state)
        level, said = (ERROR, self.failure) if self.failure else (OK, self.state)
        self._diagnostics.report("lifecycle", level, said, {"state": self.state}, logged=False)  # it is in the log already

    def close(self) -> None:
        """End; what has been said is delivered first. With time, a lossless tracker also tracks what has come in."""
        if self._worker is not None and self.state == ACTIVE:
            self._worker.stop(finish=not hurried(), timeout_s=_FINISH_S)
        for outputs in self._outputs.values():
            outputs.wait_until_delivered()
        self.report()
        self._diagnostics.wait_until_delivered()

    @property
    def autostart(self) -> bool:
        """Whether the node is to configure and activate itself."""
        return bool(self._parameters_of_node.fixed["autostart"])

    def has_subscribers(self, wanted: Mapping[str, int]) -> bool:
        """Whether outputs of `runs.outputs`, by their names after those of bodies, have at least so many subscribers."""

        def have(topic: str, count: int) -> bool:
            body, _, name = topic.rpartition("/")
            of = [self._outputs[body]] if body in self._outputs else list(self._outputs.values())
            return all(outputs.subscriber_count(name) >= count for outputs in of)

        return bool(self._outputs) and all(have(topic, count) for topic, count in wanted.items())

    def write_bodies(self, folder: Path) -> None:
        """Write each body as it was seen last, with its clothes; of several, into a folder of its name."""
        models = {} if self._worker is None else self._worker.models
        for name, body in self._options.each.items():
            model = models.get(name, body.model)
            write_body(folder / name, model, self._surfaces.get(name))
            if model is not body.model:
                write_joined(folder / name, model, name)

    @property
    def has_ended(self) -> bool:
        """Whether it will track no more: its thread has ended by itself, or it is finalized."""
        return self.fatal is not None or self.state == FINALIZED

    @property
    def at_rest(self) -> bool:
        """Whether everything that has come in is tracked."""
        return self._worker is None or not (self._worker.busy or self._inbox.waiting)

    @property
    def fatal(self) -> Exception | None:
        """Why the tracking thread has ended by itself."""
        return None if self._worker is None else self._worker.fatal

    def counters(self) -> dict[str, dict[str, int]]:
        """Per camera, what became of its images."""
        return {} if self._worker is None else self._worker.formation.counters

    @property
    def skipped(self) -> int:
        """Image sets that were not tracked since a newer one was there."""
        return 0 if self._worker is None else self._worker.counts.skipped

    # Parameters and calibration

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """As rclpy has it, but unknown parameters are named, and modalities can be set together with their parameters."""
        with self._parameters_of_node.declared_with(parameter_list):
            refused = self._parameters_of_node.without_effect(parameter_list) or unknown_parameters(self, parameter_list)
            return refused or super().set_parameters_atomically(parameter_list)

    def _compiled(self, done: int, total: int) -> None:
        """At the first start this takes minutes."""
        if time.monotonic() > self._told_s + _TELL_S or done == total:
            self._told_s = time.monotonic()
            self.get_logger().info(f"compiling, once: {done} of {total}")

    def _setup(self, config: TrackerConfig, cameras: tuple[str, ...], lenses: Mapping[str, CameraModel] | None) -> TrackingSetup:
        self._maker.prepare(cameras, config)
        rig = self._maker.rig(cameras, lenses)
        return TrackingSetup(config, cameras, rig, None if rig is None else self._maker.tracker(rig, config))

    def _check_change(self, config: TrackerConfig, cameras: tuple[str, ...]) -> None:
        """What does not suit the body is refused before the parameters are accepted."""
        if self._worker is not None:
            if self._joint_states is not None:
                check_use(self._options.model, config)
            self._maker.check(cameras, config)

    def _on_change(self, config: TrackerConfig) -> None:
        if self._worker is not None:
            self._ask_for_setup()
            self._diagnostics.report(PARAMETERS, OK, "a change is being prepared")

    def _ask_for_setup(self) -> None:
        """For the parameters and lenses of now; what is tracked with stays the same until it is made."""
        parameters, lenses = self._parameters_of_node, self._lenses
        config, cameras = parameters.config, parameters.cameras
        self._builder.ask(lambda: self._setup(config, cameras, lenses))

    def _take_setup(self) -> None:
        if self._worker is None:
            return
        self._use_new_setup()
        self._take_calibrations()

    def _use_new_setup(self) -> None:
        """A tracker that has been made takes the place of the old one, with the next image set."""
        assert self._worker is not None
        try:
            setup = self._builder.taken()
        except TrackerError as error:
            self._again_s = time.monotonic() + _PATIENCE_S
            said = f"those set last cannot be used, the tracker goes on with those before: {error}"
            self._diagnostics.report(PARAMETERS, ERROR, said)
            return
        if setup is None:
            return
        if self.state == ACTIVE:
            self._inbox.subscribe(setup.cameras)
            self._listen_to_detectors(setup)
        self._worker.use(setup)
        self._setup_in_use = setup
        self._changes += 1
        self._diagnostics.report(PARAMETERS, OK, "in effect", {"changes": self._changes})
        if self._from_topics and setup.rig is not None:
            self._diagnostics.report("calibration", OK, "complete")

    def _listen_to_detectors(self, setup: TrackingSetup) -> None:
        """Where points are among the modalities, and only there."""
        wanted = KEYPOINTS in setup.config.modalities
        self._keypoints.subscribe(setup.cameras if wanted else ())
        if not wanted:
            self._keypoints.rest()

    def _take_calibrations(self) -> None:
        """When all cameras in use have said what their lenses are, tracking begins."""
        assert self._worker is not None
        waits = self._builder.busy or time.monotonic() < self._again_s
        if self.state != ACTIVE or not self._from_topics or self._setup_in_use.rig is not None or waits:
            return
        cameras = self._parameters_of_node.cameras
        try:
            self._lenses = {name: lens_of(name, info) for name, info in dict(self._inbox.infos).items()}
        except TrackerError as error:
            self._diagnostics.report("calibration", ERROR, str(error))
            return
        lacking = [name for name in cameras if name not in self._lenses]
        if not lacking:
            self._ask_for_setup()
        else:
            waited_s = time.monotonic() - self._listening_since_s
            said = f"waiting for camera_info of {', '.join(lacking)}"
            level = WARN if waited_s > _CALIBRATIONS_S else OK
            lost = self._worker.counts.idle[UNCALIBRATED].total() if self._lossless else 0
            if lost:
                level, said = ERROR, f"{said}; {lost} images are lost meanwhile, for want of room"
            self._diagnostics.report("calibration", level, said)

    # What happens

    def _on_estimate(self, estimate: TrackEstimate, image_set: ImageSet) -> None:
        assert self._worker is not None and self._worker.rig is not None
        models = self._worker.models
        for name, outputs in self._outputs.items():
            own = self._worker.estimates[name]
            self._surfaces[name] = own.surfaces
            if name in models:
                outputs.use(models[name])
            outputs.publish(own, image_set, self._worker.rig)
        if self._bodies is not None:
            self._bodies.publish(self._worker.estimates, self._worker.rig.world_frame)
        if self._worker.counts.tracked == 1:
            self.get_logger().info(f"first image set tracked {time.monotonic() - self._began_s:.2f} s after the start")
        now_ns = self.get_clock().now().nanoseconds
        self._tracker_diagnostics.estimated(self._worker, image_set, now_ns)
        self._camera_diagnostics.contradicted(estimate.faults)

    def _on_jump(self, jump: TimeJump) -> None:
        """Only said: the tracker begins again when stamps go back, at the same image set however the clock's messages come."""
        self.get_logger().warning(f"time went back by {-jump.delta.nanoseconds * 1e-9:.3f} s")
        if self._worker is not None:
            self._tracker_diagnostics.clock_jumped()

    def report(self) -> None:
        """Once a second: rates, and each camera."""
        self._mismatches.recheck(again=self.state == ACTIVE)
        if self._worker is not None and self.state == ACTIVE:
            self._tracker_diagnostics.report(self._worker)
            self._keypoints.report(self._parameters_of_node.cameras)
            if self._joint_states is not None:
                self._joint_states.report()
            self._camera_diagnostics.report(self._worker, self._parameters_of_node.cameras)


def _fixed_parameters(options: TrackerOptions) -> dict[str, FixedParameter]:
    """What is given at the start, by options or by parameters, which win."""
    calibration = "camera_info" if options.calibration_from_topics else "rig"
    return {
        "autostart": FixedParameter(options.autostart, "configure and activate without being asked"),
        "lossless": FixedParameter(options.inbox.lossless, "track every image set in order, however long it takes"),
        "compressed": FixedParameter(options.inbox.compressed, "subscribe to <cam>/image_raw/compressed"),
        "calibration": FixedParameter(calibration, "where the lenses are taken from", ("rig", "camera_info")),
        "joint_states": FixedParameter(options.joint_states, "topic on which a robot says where its joints are; empty: none"),
        "frame_prefix": FixedParameter("", "before the name of the root link on /tf, as robot_state_publisher has it"),
    }
