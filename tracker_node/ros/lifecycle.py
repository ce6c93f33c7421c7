"""A managed node that cannot be brought down by a transition: what is not possible is refused, what fails is said and undone."""

from __future__ import annotations

import traceback
from collections.abc import Callable

from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from ..errors import TrackerError
from .guarded_node import GuardedNode

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
