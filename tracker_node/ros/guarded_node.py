"""Nodes that no callback can end, and managed ones; what a callback raises is logged once, counted and reported."""

from __future__ import annotations

import functools
import traceback
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import ChangeState
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from ..errors import TrackerError
from .diagnostics import CALLBACKS, ERROR, Diagnostics

NO_ANSWER = "an error in the node, its log has the details"
_KEPT = 1000  # destroyed ends of topics


class CallbackErrors:
    """Exceptions of the callbacks of one node.

    Attributes
    ----------
    count : how many there were.
    diagnostics : where they are reported; made with the first one where the node has none.
    """

    def __init__(self, node: Node):
        self._node = node
        self._seen: Counter[tuple[str, str]] = Counter()
        self.count = 0
        self.diagnostics: Diagnostics | None = None

    def caught(self, where: str, error: Exception) -> None:
        """Count an exception; the log has the details of the first one of its kind.

        Parameters
        ----------
        where : topic, service or timer of the callback.
        error : what it raised.
        """
        kind = (where, type(error).__name__)
        self._seen[kind] += 1
        self.count += 1
        if self._seen[kind] == 1:
            details = "".join(traceback.format_exception(error))
            self._node.get_logger().error(f"error in the callback of {where}, the node goes on\n{details}")
        with suppress(Exception):  # of a node that is being destroyed
            self._report(*kind, str(error))

    def _report(self, where: str, name: str, text: str) -> None:
        if self.diagnostics is None:
            self.diagnostics = Diagnostics(self._node)
        values = {"errors": self.count, "latest": f"{where}: {text}"}
        said = f"{name} in the callback of {where}; the log has the details"
        self.diagnostics.report(CALLBACKS, ERROR, said, values, logged=False)

    def guarded(self, where: str, callback: Callable) -> Callable:
        """A callback that does not raise.

        Parameters
        ----------
        where : topic or timer, for messages.
        callback : that may raise.

        Returns
        -------
        guarded : with the same signature; returns None after an error.
        """

        @functools.wraps(callback)  # rclpy goes by the signature
        def guarded(*arguments: Any) -> Any:
            try:
                return callback(*arguments)
            except Exception as error:
                self.caught(where, error)
                return None

        return guarded

    def guarded_service(self, where: str, callback: Callable) -> Callable:
        """A callback of a service that does not raise.

        Parameters
        ----------
        where : name of the service, for messages.
        callback : that may raise.

        Returns
        -------
        guarded : answers after an error that the request has failed.
        """

        @functools.wraps(callback)
        def guarded(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:
                self.caught(where, error)
                return _failure(type(response)())

        return guarded


class GuardedNode(Node):
    """A node whose callbacks of subscriptions, timers, services and events are guarded.

    An exception that leaves a callback would end the event loop, and with it the process. What is destroyed calls nobody any
    more: the events executor delivers what it has queued for a subscription even after its end, without a reference to it; so
    these are kept for a while. An event of an end of a topic that is queued when that is destroyed ends the process (rclpy issue
    1644): ends that come and go have none.

    Attributes
    ----------
    callback_errors : what the callbacks have raised.
    """

    def __init__(self, *arguments: Any, **options: Any):
        self.callback_errors = CallbackErrors(self)  # the base class makes services
        self._gone: deque[Any] = deque(maxlen=_KEPT)
        super().__init__(*arguments, **options)

    def create_subscription(
        self, msg_type: type, topic: str, callback: Callable, *arguments: Any, event_callbacks: Any = None, **options: Any
    ) -> Subscription:
        """As rclpy has it, guarded.

        Parameters
        ----------
        msg_type : class of the messages.
        topic : name.
        callback : called with each message.
        *arguments : as of rclpy.
        event_callbacks : callbacks of events of the subscription, guarded as well; None: none.
        **options : as of rclpy.

        Returns
        -------
        subscription : of rclpy.
        """
        events = self._guarded_events(topic, event_callbacks or SubscriptionEventCallbacks(use_default_callbacks=False))
        guarded = self.callback_errors.guarded(topic, callback)
        return super().create_subscription(msg_type, topic, guarded, *arguments, event_callbacks=events, **options)

    def create_publisher(
        self, msg_type: type, topic: str, *arguments: Any, event_callbacks: Any = None, **options: Any
    ) -> Publisher:
        """As rclpy has it, its events guarded.

        Parameters
        ----------
        msg_type : class of the messages.
        topic : name.
        *arguments : as of rclpy.
        event_callbacks : callbacks of events of the publisher, guarded as well; None: none.
        **options : as of rclpy.

        Returns
        -------
        publisher : of rclpy.
        """
        events = self._guarded_events(topic, event_callbacks or PublisherEventCallbacks(use_default_callbacks=False))
        return super().create_publisher(msg_type, topic, *arguments, event_callbacks=events, **options)

    def create_service(self, srv_type: type, srv_name: str, callback: Callable, **options: Any) -> Service:
        """As rclpy has it, guarded.

        Parameters
        ----------
        srv_type : class of the service.
        srv_name : name.
        callback : called with request and response; returns the response.
        **options : as of rclpy.

        Returns
        -------
        service : of rclpy.
        """
        return super().create_service(srv_type, srv_name, self.callback_errors.guarded_service(srv_name, callback), **options)

    def create_timer(self, timer_period_sec: float, callback: Callable, *arguments: Any, **options: Any) -> Timer:
        """As rclpy has it, guarded.

        Parameters
        ----------
        timer_period_sec : seconds.
        callback : called without arguments.
        *arguments, **options : as of rclpy.

        Returns
        -------
        timer : of rclpy.
        """
        where = f"a timer of {timer_period_sec:g} s"
        return super().create_timer(timer_period_sec, self.callback_errors.guarded(where, callback), *arguments, **options)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """As rclpy has it; it calls nobody any more."""
        subscription.callback = _nobody
        return self._destroyed(subscription, super().destroy_subscription)

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """As rclpy has it; its events call nobody any more."""
        return self._destroyed(publisher, super().destroy_publisher)

    def destroy_timer(self, timer: Timer) -> bool:
        """As rclpy has it; it calls nobody any more."""
        timer.callback = _nobody
        self._gone.append(timer)
        return super().destroy_timer(timer)

    def _destroyed(self, end: Any, destroy: Callable[[Any], bool]) -> bool:
        self._gone.append(end)
        for handler in end.event_handlers:
            handler.callback = _nobody
        return destroy(end)

    def _guarded_events(self, topic: str, events: Any) -> Any:
        for name, callback in vars(events).items():
            if callable(callback):
                setattr(events, name, self.callback_errors.guarded(f"{topic} ({name})", callback))
        return events


def caught_in_loop(node: Node, error: Exception) -> None:
    """Log and count what the event loop itself raised: a message that cannot be read, an endpoint that is gone.

    Parameters
    ----------
    node : whose loop it is.
    error : what was raised.
    """
    if isinstance(node, GuardedNode):
        node.callback_errors.caught("the event loop", error)
    else:
        node.get_logger().error("".join(traceback.format_exception(error)))


def _nobody(*_: Any) -> None:
    """Is called in the place of a callback whose end of a topic is gone."""


def _failure(response: Any) -> Any:
    if hasattr(response, "success"):
        response.success = False
    for name in ("message", "status_message"):
        if hasattr(response, name):
            setattr(response, name, NO_ANSWER)
    return response


UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED = "unconfigured", "inactive", "active", "finalized"


class ManagedNode(GuardedNode, LifecycleNode):
    """A lifecycle node whose work is in `set_up`, `begin`, `pause` and `tear_down`; what they raise makes the transition fail.

    A failed transition leaves the node in the state it came from: `tear_down` is called after a `set_up` that failed, `pause`
    after such a `begin`. A request that the state does not allow is answered with failure; rclpy's own callback would raise in
    the event loop.

    Attributes
    ----------
    state : one of ``unconfigured``, ``inactive``, ``active``, ``finalized``.
    failure : why the last transition failed; empty after one that did not.
    """

    def __init__(self, name: str):
        super().__init__(name)
        self.state, self.failure = UNCONFIGURED, ""
        unguarded = self._service_change_state.callback

        def change(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
            try:
                return unguarded(request, response)
            except Exception as error:  # of rcl: there is no such transition from here
                wanted = request.transition.label or request.transition.id
                self.get_logger().error(f"transition {wanted} is not possible while {self.state}: {error}")
                response.success = False
                return response

        self._service_change_state.callback = change

    def set_up(self) -> None:
        """unconfigured -> inactive: all heavy work."""

    def begin(self) -> None:
        """inactive -> active."""

    def pause(self) -> None:
        """active -> inactive; what is known is kept."""

    def tear_down(self) -> None:
        """inactive -> unconfigured, or the end; must bear to be called after half of a `set_up`."""

    def changed(self) -> None:
        """Called when ``state`` or ``failure`` has changed."""

    def configure(self) -> bool:
        """Ask for the transition from within the process; whether it was made."""
        return self.state == UNCONFIGURED and self.trigger_configure() == TransitionCallbackReturn.SUCCESS

    def activate(self) -> bool:
        """Ask for the transition from within the process; whether it was made."""
        return self.state == INACTIVE and self.trigger_activate() == TransitionCallbackReturn.SUCCESS

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._attempt("configure", INACTIVE, self.set_up, self.tear_down)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._attempt("activate", ACTIVE, self.begin, self.pause)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._attempt("deactivate", INACTIVE, self.pause)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._attempt("cleanup", UNCONFIGURED, self.tear_down)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        def end() -> None:
            if state.state_id == State.PRIMARY_STATE_ACTIVE:
                self.pause()
            self.tear_down()

        result = self._attempt("shutdown", FINALIZED, end, self.tear_down)
        self.state = FINALIZED  # also where something has failed
        return result

    def _attempt(
        self, name: str, goal: str, work: Callable[[], None], undo: Callable[[], None] = lambda: None
    ) -> TransitionCallbackReturn:
        try:
            work()
        except Exception as error:
            known = isinstance(error, TrackerError)
            self.failure = f"{name} has failed: {error if known else repr(error)}"
            self.get_logger().error(self.failure if known else f"{self.failure}\n{traceback.format_exc()}")
            undo()
            self.changed()
            return TransitionCallbackReturn.FAILURE
        self.state, self.failure = goal, ""
        self.changed()
        return TransitionCallbackReturn.SUCCESS
