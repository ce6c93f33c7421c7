"""Commands of this package as processes of their own, and waiting without guessing."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest


class Process:
    """A command of this package whose output is kept as it comes; start it with the fixture `start`."""

    def __init__(self, *arguments: str):
        command = [sys.executable, "-m", "tracker_node.cli.main", *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line)

    @property
    def text(self) -> str:
        return "".join(self.lines)

    def wait_for(self, text: str, timeout_s: float = 240.0) -> None:
        wait_until(lambda: text in self.text or self.process.poll() is not None, timeout_s, lambda: self.text)
        assert text in self.text, self.text

    def end(self, number: int = signal.SIGINT, timeout_s: float = 30.0) -> int:
        """Send a signal, wait for the end; the exit status."""
        self.process.send_signal(number)
        status = self.process.wait(timeout_s)
        self._reader.join(5.0)
        return status


def wait_until(predicate, timeout_s: float = 240.0, explain=lambda: "") -> None:
    deadline = time.monotonic() + timeout_s
    while not predicate():
        assert time.monotonic() < deadline, explain()
        time.sleep(0.01)


def send(publisher, messages) -> None:
    """Publish once somebody listens, and until all of it has arrived."""
    wait_until(lambda: publisher.get_subscription_count() > 0)
    # The other side must have found us too, and there is no way to ask; what is reliable waits for it by itself.
    time.sleep(0.2 if publisher.qos_profile.reliability.name == "RELIABLE" else 1.0)
    for message in messages:
        publisher.publish(message)
        time.sleep(0.002)
    publisher.wait_for_all_acked()


@pytest.fixture
def start() -> Iterator[Callable[..., Process]]:
    """Starts a `Process`; whatever a test has started is over when the test is."""
    started: list[Process] = []

    def start_process(*arguments: str) -> Process:
        started.append(Process(*arguments))
        return started[-1]

    yield start_process
    for process in started:
        if process.process.poll() is None:
            process.process.kill()
            process.process.wait(10)
