"""Errors that no verb answers itself: one line on stderr, the details in a file, exit status 70 (EX_SOFTWARE of sysexits.h)."""

from __future__ import annotations

import os
import platform
import select
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import TextIO

EX_USAGE, EX_SOFTWARE = 2, 70
EX_CLOSED_PIPE = 141  # as a shell reports a process that SIGPIPE has ended
ROS_PACKAGES = {
    *("ament_index_python", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs", "rcl_interfaces"),
    *("rclpy", "rosgraph_msgs", "rosidl_parser", "rpyutils", "sensor_msgs", "std_msgs", "std_srvs", "tf2_msgs", "tf2_ros"),
    *("tracker_msgs", "visualization_msgs"),
}
_LONGEST = 300  # characters of an error's own words in the line


def unexpected(verb: str, arguments: Sequence[str], error: BaseException) -> int:
    """Say in one line what has ended a verb.

    Parameters
    ----------
    verb : that was run.
    arguments : behind it.
    error : that nobody handled.

    Returns
    -------
    status : exit status; 2 where a package is missing, else 70.
    """
    missing = _missing_package(error) if isinstance(error, ImportError) else ""
    if missing:
        _say(f"tracker_node {verb}: error: {missing}")
        return EX_USAGE
    _say(f"tracker_node {verb}: error: {_in_words(error)}; {_details(verb, arguments, error)}")
    return EX_SOFTWARE


@contextmanager
def threads_say_one_line(verb: str, arguments: Sequence[str]) -> Iterator[None]:
    """Report an error that ends a thread as `unexpected` does, in place of a traceback.

    Parameters
    ----------
    verb : that is run.
    arguments : behind it.
    """

    def told(args: threading.ExceptHookArgs) -> None:
        if isinstance(args.exc_value, Exception):
            unexpected(verb, arguments, args.exc_value)

    previous = threading.excepthook
    threading.excepthook = told
    try:
        yield
    finally:
        threading.excepthook = previous


def closed_pipes() -> bool:
    """Whether something that was said could not be written, since nobody reads stdout or stderr any more (``| head``).

    What is left goes nowhere then: Python would complain at its end, about what is still in its buffers.
    """
    return any([_cannot_flush(stream) for stream in (sys.stdout, sys.stderr)])


def reader_is_gone() -> bool:
    """Whether stdout or stderr is a pipe that nobody reads."""
    return any([_cannot_flush(stream) or _has_no_reader(stream) for stream in (sys.stdout, sys.stderr)])


def _cannot_flush(stream: TextIO | None) -> bool:
    try:
        if stream is not None:
            stream.flush()
    except BrokenPipeError:
        _to_nowhere(stream)
        return True
    except (OSError, ValueError):  # a full disk, a closed stream: nobody to tell it to
        pass
    return False


def _to_nowhere(stream: TextIO | None) -> None:
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())  # type: ignore[union-attr]
        os.close(nowhere)


def _has_no_reader(stream: TextIO | None) -> bool:
    with suppress(OSError, ValueError, AttributeError):  # no stream of the system, as in a test
        poll = select.poll()
        poll.register(stream.fileno(), 0)  # type: ignore[union-attr]
        return any(event & select.POLLERR for _, event in poll.poll(0))
    return False


def _missing_package(error: ImportError) -> str:
    """What to do about a package that is not there; empty where that is not what has happened."""
    modules = {(error.name or "").partition(".")[0], *_modules_of(error.__traceback__)}
    here = f"this Python ({sys.executable})"
    if modules & ROS_PACKAGES:
        name = sorted(modules & ROS_PACKAGES)[0]
        what = "make setup brings it, or source a ROS 2 installation and the workspace of tracker_msgs (docs/install.md)"
        return f"needs ROS 2, and {here} cannot import '{name}': {what}; track and evaluate need no ROS"
    if isinstance(error, ModuleNotFoundError) and error.name and not error.name.startswith("tracker_node"):
        package = error.name.partition(".")[0]
        return f"{here} has no package '{package}': make setup, or pip install -r requirements/runtime.txt (docs/install.md)"
    return ""


def _modules_of(trace: TracebackType | None) -> Iterator[str]:
    for frame, _ in traceback.walk_tb(trace):
        yield str(frame.f_globals.get("__name__", "")).partition(".")[0]


def _in_words(error: BaseException) -> str:
    said = " ".join(str(error).split())
    said = said if len(said) <= _LONGEST else f"{said[: _LONGEST // 2]} ... {said[-_LONGEST // 2 :]}"
    kind = type(error).__name__
    if isinstance(error, MemoryError):
        return f"out of memory ({said or kind})"
    return f"an error inside tracker_node ({kind}{': ' if said else ''}{said})"


def _details(verb: str, arguments: Sequence[str], error: BaseException) -> str:
    """Where the details are, in words; written to the folder for temporary files, else to the current one."""
    try:
        text = _report(verb, arguments, error)
        number, path = tempfile.mkstemp(prefix=f"tracker_node_{verb}_", suffix=".txt", text=True)
        with os.fdopen(number, "w", encoding="utf-8", errors="backslashreplace") as stream:
            stream.write(text)
    except Exception as problem:  # out of memory or room: the line itself must come out in any case
        return f"its details cannot be written ({type(problem).__name__}: {problem})"
    return f"please report it with {path}"


def _report(verb: str, arguments: Sequence[str], error: BaseException) -> str:
    from ..errors import without_password

    shown = [without_password(argument) for argument in arguments]
    facts = {
        "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "arguments": repr([verb, *shown]),
        "folder": os.getcwd(),
        "python": f"{platform.python_version()} ({sys.executable})",
        "machine": platform.platform(),
    }
    with suppress(Exception):
        from ..report.metrics_file import versions

        facts |= versions()
    head = "".join(f"{name}: {value}\n" for name, value in facts.items())
    lines = "".join(traceback.format_exception(error)).splitlines()
    return head + "\n" + "".join(f"{without_password(line)}\n" for line in lines)


def _say(line: str) -> None:
    with suppress(OSError, ValueError):
        print(line, file=sys.stderr, flush=True)
