"""Services of a running tracker: set the state, reset, reinitialize, pause."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger
from tracker_msgs.srv import SetState

from ...errors import TrackerError, shown
from ...model.configuration import State, refuse_implausible
from ...tracking.config import KEYPOINTS
from ..conversions import transform_of_pose, values_with_changes
from ..qos import RESULT
from .setup import TrackerOptions
from .worker import TrackingWorker


class TrackerServices:
    """Services of the node, and those of each body: they take effect with the next image set.

    Parameters
    ----------
    worker : what tracks, or None while the node is not configured: requests are refused then.
    looks_for_body : whether a body is searched at all (the parameter ``initialization.enabled``).
    """

    def __init__(
        self, node: Node, options: TrackerOptions, worker: Callable[[], TrackingWorker | None], looks_for_body: Callable[[], bool]
    ):
        self._node, self._options, self._worker, self._looks_for_body = node, options, worker, looks_for_body
        self._services = [
            node.create_service(Trigger, "~/reset", self._guarded(self._on_reset)),
            node.create_service(Trigger, "~/reinitialize", self._guarded(partial(self._on_reinitialize, ""))),
            node.create_service(SetBool, "~/enable", self._guarded(self._on_enable)),
        ]
        self._subscriptions = []
        for body in options.named:
            prefix = f"{body}/" if body else ""
            self._services.append(
                node.create_service(SetState, f"~/{prefix}set_state", self._guarded(partial(self._on_set_state, body)))
            )
            if body:
                again = self._guarded(partial(self._on_reinitialize, body))
                self._services.append(node.create_service(Trigger, f"~/{prefix}reinitialize", again))
            for type_, topic, taken in (
                (PoseWithCovarianceStamped, "initialpose", self._on_initial_pose),
                (PointStamped, "clicked_point", self._on_clicked_point),
            ):
                self._subscriptions.append(node.create_subscription(type_, prefix + topic, partial(taken, body), RESULT))

    def _guarded(self, answer: Callable):
        """A service's callback: ``answer(worker, request)`` says what is to be answered, or raises a `TrackerError`."""

        def callback(request, response):
            try:
                response.message = answer(self._configured(), request)
                response.success = True
            except TrackerError as error:
                response.success, response.message = False, str(error)
            return response

        return callback

    def _configured(self) -> TrackingWorker:
        worker = self._worker()
        if worker is None:
            raise TrackerError("the node is not configured: configure it first")
        return worker

    def _on_reset(self, worker: TrackingWorker, _request: Trigger.Request) -> str:
        worker.reset()
        return ""

    def _on_reinitialize(self, body: str, worker: TrackingWorker, _request: Trigger.Request) -> str:
        if not self._looks_for_body():
            raise TrackerError("the body is not searched: the parameter initialization.enabled is false")
        worker.reinitialize(body=body)
        return ""

    def _on_enable(self, worker: TrackingWorker, request: SetBool.Request) -> str:
        worker.pause(not request.data)
        return "tracking" if request.data else "paused: images are counted and not used"

    def _values_now(self, body: str, worker: TrackingWorker):
        own = self._options.each[body]
        state = worker.start_state(body) or own.initial_state or State.neutral(own.model)
        chain = own.model.chain  # what an earlier request has put at a limit is there
        return State(state.T_world_root, np.clip(state.joint_positions, chain.lower, chain.upper)).to_values()

    def _on_set_state(self, body: str, worker: TrackingWorker, request: SetState.Request) -> str:
        model = self._options.each[body].model
        if not request.dof_names and not request.values:
            raise TrackerError("expected one or more names of degrees of freedom, and a value for each, got none")
        values = values_with_changes(model, self._values_now(body, worker), request.dof_names, request.values)
        refuse_implausible(model, values)
        state = State.from_values(values)
        worker.set_state(state, body)
        beyond = model.chain.beyond_limits(state.joint_positions)
        return f"put at the limit: {'; '.join(beyond)}" if beyond else ""

    def _check_frame(self, frame: str) -> None:
        world = self._options.rig.world_frame
        if frame not in ("", world):
            raise TrackerError(f"expected frame '{world}', got {shown(frame)}")

    def _on_clicked_point(self, body: str, message: PointStamped) -> None:
        """Track the person there."""
        place = np.array([message.point.x, message.point.y, message.point.z])
        try:
            self._check_frame(message.header.frame_id)
            worker = self._configured()
            if KEYPOINTS not in worker.config.modalities or not self._looks_for_body():
                raise TrackerError("a person is chosen by points: set modalities with keypoints, and initialization.enabled")
            if not np.isfinite(place).all():
                raise TrackerError(f"expected a place in meters, got {place.tolist()}")
            worker.reinitialize(place, body)
        except TrackerError as error:
            self._node.get_logger().error(f"clicked_point: {error}")

    def _on_initial_pose(self, body: str, message: PoseWithCovarianceStamped) -> None:
        try:
            self._check_frame(message.header.frame_id)
            worker = self._configured()
            now = State.from_values(self._values_now(body, worker))
            state = State(transform_of_pose(message.pose.pose), now.joint_positions)
            refuse_implausible(self._options.each[body].model, state.to_values())
            worker.set_state(state, body)
        except TrackerError as error:
            self._node.get_logger().error(f"initialpose: {error}")
