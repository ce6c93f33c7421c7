"""Errors that a user's files, cameras or models can cause.

Misuse of the library by a programmer raises ``ValueError`` or ``TypeError``; whatever comes in from outside and is wrong
raises a `TrackerError` subclass that carries its data. Not converging is a field of a result, never an exception.
"""

from __future__ import annotations

import importlib
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

_LONGEST_VALUE, _LONGEST_TEXT = 120, 300  # of a value in a message, of text: its end is often the cause

_OWN = r"(?!(?:file|bag|v4l2|topic):)"  # kinds of sources that have no passwords
_ADDRESS = re.compile(rf"(?<![\w+.-]){_OWN}[A-Za-z][\w+.-]*:/+|(?:^|(?<=[='\" ]))//")
_BARE = re.compile(rf"(\w+=)?{_OWN}\S*:\S*@\S*")  # user:password@host
_SECRET = re.compile(
    r"[?#]|(?:user|usr|login|name|pwd|psw|pw|pass|token|auth|secret|key|sig|credential|session)[\w.-]*=", re.IGNORECASE
)


class TrackerError(Exception):
    """Base class of every error that a user can mend; can be sent from one process to another."""

    def __reduce__(self):
        return _again, (type(self), self.args, self.__dict__)


class FileFormatError(TrackerError):
    """A file's content is not what the format asks for.

    Parameters
    ----------
    file : path of the file (or a name for an in-memory source).
    field : dotted path of the field, e.g. ``cameras.cam01.K``.
    expected, got : what the format asks for, and what stands there.
    also : further problems of the same file, a sentence each.
    """

    def __init__(self, file: str | Path, field: str, expected: str, got: object, also: Iterable[str] = ()):
        self.file, self.field, self.expected, self.got = str(file), field, expected, got
        first = f"field '{_cut(_in_one_line(field), 300)}': expected {_cut(expected, 2000)}, got {shown(got)}"
        super().__init__(f"{file}: {'; '.join([first, *map(_in_one_line, also)])}")


class WrongKindOfFileError(FileFormatError):
    """A file that is none of the kind that is asked for, but a known other one: a body where a rig should be."""

    def __init__(self, file: str | Path, found: str, wanted: str):
        super().__init__(file, "(file)", wanted, found)
        self.args = (f"{file}: this is {found}, not {wanted}",)


class UnknownNameError(TrackerError):
    """A name that is not in a closed list; the message gives the valid ones."""

    def __init__(self, kind: str, name: str, valid: Iterable[str]):
        self.kind, self.name, self.valid = kind, name, sorted(valid)
        super().__init__(f"unknown {kind} '{name}'; valid: {', '.join(self.valid) or '(none)'}")


class ModelError(TrackerError):
    """A kinematic tree or body that cannot be built (cycle, two roots, dangling parent)."""


class CalibrationError(TrackerError):
    """A camera that is uncalibrated, or whose calibration contradicts its images."""

    def __init__(self, camera: str, problem: str):
        self.camera, self.problem = camera, problem
        super().__init__(f"camera '{camera}': {problem}")


class SourceError(TrackerError):
    """An image source that is missing, unreadable or ended."""

    def __init__(self, source: str | Path, problem: str):
        self.source, self.problem = without_password(str(source)), problem
        super().__init__(f"image source '{self.source}': {problem}")


class MissingExtraError(TrackerError):
    """A package that an optional part needs is not installed; the message names the line that installs it."""

    def __init__(self, package: str, extra: str):
        self.package, self.extra = package, extra
        super().__init__(f"{package} is not installed; pip install 'tracker_node[{extra}]' brings it")


def extra_module(package: str, extra: str) -> Any:
    """The module of a package that only an extra of this package requires.

    Parameters
    ----------
    package : name to import.
    extra : key of ``extras_require`` in setup.py.

    Returns
    -------
    The imported module.

    Raises
    ------
    MissingExtraError : it is not installed.
    """
    try:
        return importlib.import_module(package)
    except ModuleNotFoundError as missing:
        if missing.name != package:
            raise
        raise MissingExtraError(package, extra) from None


def without_password(text: str) -> str:
    """Text for people and files, such as a source, an option or a line of a log: nothing of an address that may be secret.

    User and password go (``rtsp://***@host/video``), and so does all behind a ``?``, a ``#``, or the first ``user=``, ``pwd=``,
    ``token=`` and the like. A password may hold each of these and an ``@``; where that leaves it open which part is the host, all
    of the address goes.
    """
    found = _ADDRESS.search(text)
    if found is None:
        bare = _BARE.fullmatch(text)
        if bare is None:
            return text
        head, rest = bare[1] or "", text[bare.end(1) if bare[1] else 0 :]
    else:
        head, rest = text[: found.end()], text[found.end() :]
    named, at = _SECRET.search(rest), rest.rfind("@")
    if named is not None and at > named.start():
        return f"{head}***"
    if named is not None:
        rest = f"{rest[: named.end()]}***"
    return f"{head}***{rest[at:]}" if at > 0 else head + rest


def shown(value: object) -> str:
    """A value in a message: the beginning of a long one, and its end too where it is text, which may be a reason.

    A part of a file is shown by its fields.
    """
    try:
        fields = getattr(value, "model_dump", None)
        text = without_password(repr(value if fields is None else fields(mode="json", exclude_unset=True)))
        return _cut_in_the_middle(text, _LONGEST_TEXT) if isinstance(value, str) else _cut(text, _LONGEST_VALUE)
    except (RecursionError, ValueError):  # lists in lists without end; a number of thousands of digits
        return f"a {type(value).__name__} that is too long to be shown"


def repeated(names: Iterable[str]) -> list[str]:
    """Names that are there more than once, sorted."""
    return sorted(name for name, n in Counter(names).items() if n > 1)


def _in_one_line(text: str) -> str:
    """A text with line breaks and what else cannot be printed escaped: names in files may be anything."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _cut_in_the_middle(text: str, limit: int) -> str:
    half = (limit - 5) // 2
    return text if len(text) <= limit else f"{text[:half]} ... {text[-half:]}"


def _cut(text: str, limit: int) -> str:
    return text if len(text) <= limit else text[: limit - 3] + "..."


def _again(kind: type[TrackerError], args: tuple, values: dict) -> TrackerError:
    """An error as it was, whatever its class asks for to make a new one."""
    error = kind.__new__(kind, *args)
    error.__dict__.update(values)
    return error
