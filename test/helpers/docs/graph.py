"""Nodes that pages of the documentation start, and what pages ask of them with ``ros2``."""

import importlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool

from helpers.ros.graph import NodeProcess, Probe
from tracker_node.ros.conversions import stamp_ns_of


def name_of(verb: str, arguments: list[str]) -> str:
    """Of a node, as its command line gives it; of several in one process that which others wait for."""
    usual = "tracker" if verb == "compose" else verb
    return next((word.removeprefix("__node:=") for word in arguments if word.startswith("__node:=")), usual)


@contextmanager
def running_node(probe: Probe, verb: str, arguments: list[str], env: dict[str, str]) -> Iterator[None]:
    """A node that does its work while the block runs, and ends well by Ctrl-C; a player may have come to its end before."""
    assert not any("use_sim_time" in word for word in arguments), "its diagnostics would not be told from earlier ones"
    with _diagnostics_from_now_on(probe) as said:
        process = NodeProcess(verb, *arguments, env=env)
        try:
            works = _works(probe, said, verb, name_of(verb, arguments), process)
            probe.spin_until(lambda: process.ended or works(), f"{verb} at work")
            assert not process.ended or verb == "player", process.err
            yield
            if not process.ended:
                process.interrupt()
            assert process.wait() == 0 and "Traceback" not in process.err, process.err
        finally:
            process.close()


@contextmanager
def _diagnostics_from_now_on(probe: Probe) -> Iterator[dict[str, DiagnosticStatus]]:
    """The latest status of every part on /diagnostics; what an earlier node of the same name has still under way is left out.

    By the stamps, so nodes have to be on the system's clock.
    """
    began_ns = time.time_ns()
    said: dict[str, DiagnosticStatus] = {}

    def keep(message: DiagnosticArray) -> None:
        if stamp_ns_of(message.header.stamp) >= began_ns:
            said.update({status.name: status for status in message.status})

    subscription = probe.node.create_subscription(DiagnosticArray, "/diagnostics", keep, 100)
    try:
        yield said
    finally:
        probe.node.destroy_subscription(subscription)


def _works(probe: Probe, said: dict[str, DiagnosticStatus], verb: str, name: str, process: NodeProcess) -> Callable[[], bool]:
    """Whether the node does what it is for, as it says itself."""
    if verb in ("rectify", "rerun_bridge"):
        return lambda: f"{verb}: ready" in process.out
    if verb == "player":
        return probe.node.create_client(SetBool, f"/{name}/pause").service_is_ready
    if verb in ("tracker", "compose"):
        return lambda: said.get(f"{name}: lifecycle", DiagnosticStatus()).message == "active"
    what = {"recorder": "messages", "camera_ingest": "published"}[verb]

    def counts() -> bool:
        parts = [status for part, status in said.items() if part.startswith(f"{name}: ")]
        numbers = [v.value for status in parts for v in status.values if v.key == what]
        return bool(numbers) and "0" not in numbers

    return counts


def ask(probe: Probe, words: list[str]) -> None:
    """``ros2 service call`` or ``ros2 param set``, asked by a node of ours, since the wheels have no ros2 command."""
    kind, verb, name, what, *rest = words
    given = yaml.safe_load(rest[0]) if rest else {}
    if (kind, verb) == ("service", "call"):
        package, _, service_name = what.split("/")
        service = getattr(importlib.import_module(f"{package}.srv"), service_name)
        answer = probe.ask(service, name, service.Request(**given))
        assert answer.success, (words, answer.message)
    else:
        assert (kind, verb) == ("param", "set"), words
        request = SetParameters.Request(parameters=[Parameter(what, value=given).to_parameter_msg()])
        (result,) = probe.ask(SetParameters, f"{name}/set_parameters", request).results
        assert result.successful, (words, result.reason)
