"""Start of a process that holds a node, its event loop, and its clean end.

A node's process ends on SIGINT, SIGTERM, when its work is done, or when the process that started it is gone (`ending`). The heavy
work is never done in the loop: callbacks only enqueue.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Protocol

import rclpy
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from ..parallel import short_switches
from . import ending
from .guarded_node import caught_in_loop
from .qos import PROFILE_VARIABLE, use_fastdds_profile

LOOP_S = 0.1  # how long a signal may go unnoticed


class FinishedBag(Protocol):
    """A bag that is being written."""

    def close(self) -> None: ...

    def abandon(self) -> None: ...


_executors: dict[Node, Executor] = {}


def make_executor() -> Executor:
    """The events executor: a fifth of the processor time of the default one with many cameras."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:  # an early Jazzy
        return SingleThreadedExecutor()
    return EventsExecutor()


@contextmanager
def ros_process(ros_args: list[str] | None = None, *, forced: bool = True) -> Iterator[threading.Event]:
    """rclpy from init to shutdown.

    Our own handlers of signals, because rclpy's tear the context down at once, and what still has to be published could not be. A
    program that is more than a node has no `ending`: it gets its handlers here, and nothing ends it by force.

    Parameters
    ----------
    ros_args : behind ``--ros-args``.
    forced : end the process where an orderly end takes too long (`ending`); False for one that sees to that itself.

    Yields
    ------
    stop : event that SIGINT or SIGTERM sets.
    """
    profile_before = os.environ.get(PROFILE_VARIABLE)
    use_fastdds_profile()
    with ExitStack() as stack:
        stack.enter_context(short_switches())
        process = ending.current()
        if process is None and ending.PARENT_VARIABLE in os.environ:
            process = stack.enter_context(ending.Ending())
        if process is None:
            stop = stack.enter_context(_stop_signals())
        else:
            stop = process.stop
            stack.enter_context(process.orderly(_leave_graph, forced))
        rclpy.init(args=["tracker_node", *(ros_args or [])], signal_handler_options=SignalHandlerOptions.NO)
        try:
            yield stop
        finally:
            _end_executors()
            rclpy.try_shutdown()
            if profile_before is None:
                os.environ.pop(PROFILE_VARIABLE, None)


@contextmanager
def _stop_signals() -> Iterator[threading.Event]:
    stop = threading.Event()
    previous = {}
    for number in (signal.SIGINT, signal.SIGTERM):  # also undoes a SIGINT that was ignored by the shell
        previous[number] = signal.signal(number, lambda *_: stop.set())
    try:
        yield stop
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


@contextmanager
def finished_bag(bag: FinishedBag | None) -> Iterator[None]:
    """While within, the process does not end without the bag's index, whatever ends it."""
    process = ending.current()
    if process is None or bag is None:
        yield
        return
    with process.closing(bag.close, bag.abandon):
        yield


def _leave_graph() -> None:
    """Say goodbye to the others while the event loop is held up, so that they do not wait for this process."""
    for node in list(_executors):
        node.destroy_node()
    rclpy.try_shutdown()


def attach(node: Node, beside: Node | None = None) -> Executor:
    """The event loop of a node; from the first call on, the node is taken off the graph whenever the process ends.

    Parameters
    ----------
    node : whose callbacks the loop runs.
    beside : another one, whose loop it is too; None: the node has a loop of its own.

    Returns
    -------
    executor : the loop.
    """
    if node not in _executors:
        _executors[node] = make_executor() if beside is None else attach(beside)
        _executors[node].add_node(node)
    return _executors[node]


def spin(node: Node, stop: threading.Event, done: Callable[[], bool] = lambda: False) -> None:
    """Run callbacks; may be called again.

    A node keeps its executor from one call to the next: messages that arrive between two executors can go unnoticed. What the
    loop raises is logged and counted, and the loop goes on; callbacks of a `GuardedNode` do not raise.

    Parameters
    ----------
    node : whose callbacks run.
    stop : ends the loop when it is set.
    done : ends the loop when it returns True; asked after every event.
    """
    executor = attach(node)
    while rclpy.ok() and not stop.is_set() and not done():
        try:
            executor.spin_once(timeout_sec=LOOP_S)
        except ExternalShutdownException:
            return
        except Exception as error:  # the executor can be used on: it has lost no more than the one event
            caught_in_loop(node, error)


def _end_executors() -> None:
    while _executors:
        _, executor = _executors.popitem()
        executor.shutdown()
