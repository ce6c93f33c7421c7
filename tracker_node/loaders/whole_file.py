"""Files read whole, up to a limit for their kind, so that no file can fill the memory; and files written whole or not at all.

A device or a pipe has no size that could be asked for, and may never end; it is not read.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import FileFormatError

MB = 1_000_000
SETTINGS_BYTES = 16 * MB
"""YAML, TOML and XML: rigs, bodies, poses, parameters, calibrations, robot descriptions."""
JSON_BYTES = 64 * MB
"""JSON: a run's summary, reference masks."""
TABLE_BYTES = 1_000 * MB
"""Tables of numbers: CSV, TRC, MOT, STO, TUM, BVH, stamps, C3D."""
MEDIA_BYTES = 1_000 * MB
"""One image or mesh."""
ARCHIVE_BYTES = 2_000 * MB
"""All files of an archive together, unpacked."""


def check_regular(path: str | Path, limit: int) -> None:
    """Refuse a path that is missing or no regular file, and a file that is too large.

    Parameters
    ----------
    path, limit : file; most bytes that it may have.

    Raises
    ------
    FileFormatError : saying which.
    """
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise FileFormatError(path, "(file)", "an existing file", "no such file") from None
    except (OSError, ValueError) as error:  # a name with a null byte
        raise FileFormatError(path, "(file)", "a readable file", getattr(error, "strerror", None) or str(error)) from None
    if stat.S_ISDIR(status.st_mode):
        raise FileFormatError(path, "(file)", "a readable file", "a folder")
    if not stat.S_ISREG(status.st_mode):
        raise FileFormatError(path, "(file)", "a regular file", "a device, a pipe or a socket")
    if status.st_size > limit:
        raise FileFormatError(path, "(file)", f"at most {_size(limit)}", _size(status.st_size))


def read_bytes(path: str | Path, limit: int = SETTINGS_BYTES) -> bytes:
    """Content of a file.

    Parameters
    ----------
    path, limit : file; most bytes that it may have.

    Returns
    -------
    Bytes.

    Raises
    ------
    FileFormatError : it is missing, unreadable, no regular file, or larger than ``limit`` bytes.
    """
    check_regular(path, limit)
    try:
        with open(path, "rb") as stream:
            content = stream.read(limit + 1)
    except OSError as error:
        raise FileFormatError(path, "(file)", "a readable file", error.strerror or str(error)) from None
    if len(content) > limit:  # it grows, or does not say its size, as those of /proc
        raise FileFormatError(path, "(file)", f"at most {_size(limit)}", "more")
    return content


def read_text(path: str | Path, limit: int = SETTINGS_BYTES, unix_lines: bool = True) -> str:
    """Text of a file, UTF-8.

    Parameters
    ----------
    path, limit : file; most bytes that it may have.
    unix_lines : turn all ends of lines to those of Unix.

    Returns
    -------
    Text.

    Raises
    ------
    FileFormatError : as `read_bytes`, or it is no UTF-8.
    """
    try:
        text = read_bytes(path, limit).decode("utf-8")
    except UnicodeDecodeError as error:
        raise FileFormatError(path, "(file)", "UTF-8 text", f"byte {error.start} is not") from None
    return text.replace("\r\n", "\n").replace("\r", "\n") if unix_lines else text


def _size(n_bytes: int) -> str:
    return f"{n_bytes / MB:,.0f} MB".replace(",", " ") if n_bytes >= 10 * MB else f"{n_bytes / MB:.1f} MB"


@contextmanager
def whole_file(path: str | Path, suffix: str = "") -> Iterator[Path]:
    """A path to write to in place of another; at the end of the block the file goes there at once.

    Parameters
    ----------
    path : file that is written or replaced.
    suffix : end of the temporary name, where the writer asks for one.

    Yields
    ------
    Path in the same folder.

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
            sync(draft)
            draft.replace(path)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        if error.filename not in (None, str(draft)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error  # the user has not asked for the draft


def write_whole(path: str | Path, text: str) -> None:
    """Replace a text file by another, UTF-8; see `whole_file`.

    Parameters
    ----------
    path, text : file; its new content.
    """
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8")


def sync(path: Path) -> None:
    """Have the operating system write a file to the disk."""
    with path.open("rb") as stream:
        os.fsync(stream.fileno())
