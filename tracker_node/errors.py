"""Errors that a user's files, cameras or models can cause.

Misuse of the library by a programmer raises ``ValueError`` or ``TypeError``; whatever comes in from outside and is wrong
raises a `TrackerError` subclass that carries its data. Not converging is a field of a result, never an exception.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


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
    """

    def __init__(self, file: str | Path, field: str, expected: str, got: object):
        self.file, self.field, self.expected, self.got = str(file), field, expected, got
        super().__init__(f"{file}: field '{_cut(field, 300)}': expected {_cut(expected, 2000)}, got {_short(got)}")


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
        self.source, self.problem = str(source), problem
        super().__init__(f"image source '{source}': {problem}")


def _short(value: object, limit: int = 120) -> str:
    return _cut(repr(value), limit)


def _cut(text: str, limit: int) -> str:
    return text if len(text) <= limit else text[: limit - 3] + "..."


def _again(kind: type[TrackerError], args: tuple, values: dict) -> TrackerError:
    """An error as it was, whatever its class asks for to make a new one."""
    error = kind.__new__(kind, *args)
    error.__dict__.update(values)
    return error
