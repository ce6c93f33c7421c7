"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: str | Path, suffix: str = "") -> Iterator[Path]:
    """A path to write to in place of ``path``, in the same folder; at the end of the block the file goes there at once.

    Parameters
    ----------
    suffix : end of the temporary name, where the writer asks for one.

    Raises
    ------
    OSError : the file cannot be written, for want of room on the disk, say; what was there before is still there. ``path`` is
        something else than a file.
    """
    path = Path(path).resolve()
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    draft = path.with_name(f".{path.name}.{os.getpid()}{suffix}")
    try:
        try:
            yield draft
            _sync(draft)
            draft.replace(path)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        if error.filename not in (None, str(draft)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error  # the user has not asked for the draft


def write_whole(path: str | Path, text: str) -> None:
    """Replace a text file by another, UTF-8; see `whole_file`."""
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8")


def _sync(path: Path) -> None:
    with path.open("rb") as stream:
        os.fsync(stream.fileno())
