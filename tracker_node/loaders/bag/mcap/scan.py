"""Files of bags read from their beginning, without their index."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from .contents import FileContents, RawMessage
from .recovery import scan_mcap
from .sqlite_recovery import scan_sqlite

SCANNERS = {".mcap": scan_mcap, ".db3": scan_sqlite}


def scan(path: Path, contents: FileContents | None = None) -> Iterator[RawMessage]:
    """All messages in the order of the file; schemas, channels and the problems found go to ``contents`` as they come.

    Raises
    ------
    FileFormatError : not a file of this kind, or not readable.
    """
    yield from SCANNERS[path.suffix](path, FileContents() if contents is None else contents)


def survey(path: Path) -> FileContents:
    """Topics and numbers of messages, found by reading the whole file.

    Raises
    ------
    FileFormatError : not a file of this kind, or not readable.
    """
    contents = FileContents()
    for message in scan(path, contents):
        contents.count(message)
    return contents
