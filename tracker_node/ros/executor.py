"""Start of a process that holds a node, its event loop, and its clean end.

A node's process ends on SIGINT, SIGTERM, when its work is done, or when the process that started it is gone. The heavy work is
never done in the loop: callbacks only enqueue.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rclpy
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from .qos import PROFILE_VARIABLE, use_fastdds_profile

PARENT_VARIABLE = "TRACKER_NODE_PARENT_PID"  # set by the pipeline for its children: end when it is gone
LOOP_S = 0.1  # how long a signal may go unnoticed

_executors: dict[Node, Executor] = {}


def make_executor() -> Executor:
    """The events executor: a fifth of the processor time of the default one with many cameras."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:  # an early Jazzy
        return SingleThreadedExecutor()
    return EventsExecutor()


@contextmanager
def ros_process(ros_args: list[str] | None = None) -> Iterator[threading.Event]:
    """rclpy from init to shutdown; yields an event that SIGINT or SIGTERM sets.

    Our own handlers, because rclpy's tear the context down at once, and what still has to be published could not be.
    """
    profile_before = os.environ.get(PROFILE_VARIABLE)
    use_fastdds_profile()
    stop = threading.Event()
    previous = {}
    for number in (signal.SIGINT, signal.SIGTERM):  # also undoes a SIGINT that was ignored by the shell
        previous[number] = signal.signal(number, lambda *_: stop.set())
    rclpy.init(args=["tracker_node", *(ros_args or [])], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield stop
    finally:
        _end_executors()
        rclpy.try_shutdown()
        for number, handler in previous.items():
            signal.signal(number, handler)
        if profile_before is None:
            os.environ.pop(PROFILE_VARIABLE, None)


def spin(node: Node, stop: threading.Event, done: Callable[[], bool] = lambda: False) -> None:
    """Run callbacks until ``stop`` is set, ``done`` says so, or the parent process is gone; may be called again.

    A node keeps its executor from one call to the next: messages that arrive between two executors can go unnoticed.
    """
    parent = int(os.environ.get(PARENT_VARIABLE, "0"))
    if node not in _executors:
        _executors[node] = make_executor()
        _executors[node].add_node(node)
    executor = _executors[node]
    try:
        while rclpy.ok() and not stop.is_set() and not done():
            executor.spin_once(timeout_sec=LOOP_S)
            if parent and os.getppid() != parent:
                stop.set()
    except ExternalShutdownException:
        pass


def _end_executors() -> None:
    while _executors:
        _, executor = _executors.popitem()
        executor.shutdown()
