"""The studio as people start it: a process that serves pages on the loopback."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from urllib.parse import urlsplit


@dataclass(frozen=True)
class StudioProcess:
    """``url`` lets a browser in; ``origin`` is the server without the token."""

    pid: int
    url: str

    @property
    def origin(self) -> str:
        parts = urlsplit(self.url)
        return f"{parts.scheme}://{parts.netloc}"

    def page(self, name: str) -> str:
        """Address of a page that lets a browser in."""
        return f"{self.origin}/{name}?{urlsplit(self.url).query}"


@contextmanager
def running_studio(*arguments: object, env: dict[str, str] | None = None) -> Iterator[StudioProcess]:
    """``tracker_node studio`` with these arguments; it must end well."""
    command = [sys.executable, "-m", "tracker_node.cli.main", "studio", "--no-browser", *map(str, arguments)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, **(env or {})}
    )
    try:
        first = process.stdout.readline()
        assert "http://" in first, first + process.stderr.read()
        yield StudioProcess(process.pid, first.split()[-1])
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
        assert process.returncode == 0 and "Traceback" not in said, said
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
