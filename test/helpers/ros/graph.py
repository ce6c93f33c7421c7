"""A real ROS graph for tests: a probe in this process, and the nodes as processes of their own."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from tracker_node.ros.conversions import stamp_ns_of
from tracker_node.ros.executor import make_executor
from tracker_node.ros.qos import PROFILE_VARIABLE, images_published, use_fastdds_profile

TIMEOUT_S = 240.0  # generous: compiled code may have to be made first
AGAIN_S = 3.0


class Probe:
    """A node that subscribes, asks and waits."""

    def __init__(self) -> None:
        self.node = Node("probe")
        self._executor = make_executor()
        self._executor.add_node(self.node)
        self.received: dict[str, list] = {}
        self.diagnostics: dict[str, object] = {}
        self._clients: dict = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 100)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.diagnostics.update({status.name: status for status in message.status})

    def add_node(self, node: Node) -> None:
        """Serve another node of this process too."""
        self._executor.add_node(node)

    def listen(self, message_type, topic: str, qos=None) -> list:
        """The list that all messages of a topic will be in."""
        messages = self.received.setdefault(topic, [])
        self.node.create_subscription(message_type, topic, messages.append, qos or images_published(1000))
        return messages

    def spin_until(self, predicate: Callable[[], bool], what: str = "", timeout_s: float = TIMEOUT_S) -> None:
        """Serve until the predicate holds; an AssertionError says what did not happen."""
        until_s = time.monotonic() + timeout_s
        while not predicate():
            assert time.monotonic() < until_s, f"did not happen within {timeout_s:g} s: {what or predicate}"
            self._executor.spin_once(timeout_sec=0.05)

    def ask(self, service_type, name: str, request):
        """The answer of a service.

        A node that has not found this client yet sends its answer to nobody. So it is asked again, what changes something much
        later, as a change may take its time; the first answer counts.
        """
        client = self._client(service_type, name)
        until_s, reads = time.monotonic() + TIMEOUT_S, service_type.__name__.startswith(("Get", "List", "Describe"))
        asked: list = []
        while not any(future.done() for future in asked):
            assert time.monotonic() < until_s, f"no answer of {name} within {TIMEOUT_S:g} s"
            asked.append(client.call_async(request))
            again_s = time.monotonic() + (AGAIN_S if reads else TIMEOUT_S / 4)
            self.spin_until(lambda until=again_s: any(f.done() for f in asked) or time.monotonic() > until)
        return next(future.result() for future in asked if future.done())

    def _client(self, service_type, name: str):
        """One client per service and node."""
        if name in self._clients and self._clients[name].service_is_ready():
            return self._clients[name]
        if name not in self._clients:
            self._clients[name] = self.node.create_client(service_type, name)
        self.spin_until(self._clients[name].service_is_ready, f"service {name}")
        if service_type is not GetParameters:
            self.until_known(name.rpartition("/")[0])
        return self._clients[name]

    def until_known(self, node: str) -> None:
        """Until a node knows all clients and publishers of now: it hears of them in the order in which they were made."""
        name = f"{node}/get_parameters"
        if (before := self._clients.pop(name, None)) is not None:
            self.node.destroy_client(before)
        later = self._clients[name] = self.node.create_client(GetParameters, name)
        tried_s = time.monotonic() + AGAIN_S
        self.spin_until(lambda: later.service_is_ready() or time.monotonic() > tried_s)
        if later.service_is_ready():  # else the service is not called after its node
            self.ask(GetParameters, name, GetParameters.Request())

    def close(self) -> None:
        self.node.destroy_node()
        self._executor.shutdown()


@contextmanager
def ros_context() -> Iterator[None]:
    """rclpy in this process, with the transport that the nodes use."""
    before = os.environ.get(PROFILE_VARIABLE)
    use_fastdds_profile()
    rclpy.init(args=["test"], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        rclpy.try_shutdown()
        if before is None:
            del os.environ[PROFILE_VARIABLE]


class NodeProcess:
    """``tracker_node <verb>`` as a process; its output is kept."""

    def __init__(self, *arguments: str | Path, env: dict[str, str] | None = None):
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tracker_node.cli.main", *map(str, arguments)],
            env={**os.environ, **(env or {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self._parts: dict[str, list[str]] = {"out": [], "err": []}
        self._readers = [
            threading.Thread(target=self._read, args=(self._process.stdout, "out"), daemon=True),
            threading.Thread(target=self._read, args=(self._process.stderr, "err"), daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, stream, which: str) -> None:
        for line in stream:
            self._parts[which].append(line)

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def out(self) -> str:
        return "".join(self._parts["out"])

    @property
    def err(self) -> str:
        return "".join(self._parts["err"])

    @property
    def ended(self) -> bool:
        return self._process.poll() is not None

    def interrupt(self, number: int = signal.SIGINT) -> None:
        self._process.send_signal(number)

    def wait(self, timeout_s: float = TIMEOUT_S) -> int:
        """Exit status; fails when it does not end."""
        code = self._process.wait(timeout=timeout_s)
        for reader in self._readers:
            reader.join(timeout=5.0)
        return code

    def close(self) -> None:
        """For the end of a test: whatever is left goes, children too."""
        if not self.ended:
            os.killpg(self._process.pid, signal.SIGKILL)
        self.wait()


def stamps(messages: list) -> list[int]:
    """Header stamps in nanoseconds."""
    return [stamp_ns_of(message.header.stamp) for message in messages]


def shared_memory_files() -> set[Path]:
    """Segments of Fast DDS that exist now, of whatever process."""
    return {path for pattern in ("fastrtps_*", "sem.fastrtps_*") for path in Path("/dev/shm").glob(pattern)}


def files_in_use() -> set[Path]:
    """Files in /dev/shm that some process has mapped or open (locks are only open)."""
    found = set()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            text = (process / "maps").read_text()
            opened = [os.readlink(link) for link in (process / "fd").iterdir()]
        except OSError:  # ended, or somebody else's
            continue
        found |= {Path(line[line.index("/dev/shm/") :]) for line in text.splitlines() if "/dev/shm/" in line}
        found |= {Path(target) for target in opened if target.startswith("/dev/shm/")}
    return found


def _segment(path: Path) -> str:
    """Name of the segment or port that a file belongs to: itself, its lock or its semaphore."""
    return path.name.removeprefix("sem.").removesuffix("_mutex").removesuffix("_el").removesuffix("_sl")


def remove_left_segments(before: set[Path]) -> None:
    """Killed processes leave their segments: remove those that are new and in nobody's use.

    A segment without its lock file counts as left by Fast DDS, which then delivers nothing through it any more.
    """
    new = shared_memory_files() - before
    used = {_segment(path) for path in files_in_use()}
    for path in new:
        if _segment(path) not in used:
            path.unlink(missing_ok=True)
