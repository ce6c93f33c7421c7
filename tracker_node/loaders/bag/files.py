"""Which files a bag consists of."""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import zstandard

from ...errors import FileFormatError
from ..whole_file import MB, check_regular

SCANNED_SUFFIX = ".mcap"
"""Of files that are read from their beginning, and so in whatever condition."""
STORAGE_SUFFIXES = (SCANNED_SUFFIX, ".db3")
_PIECE, _ZSTD = 1 << 20, b"\x28\xb5\x2f\xfd"
PACKED = ".zstd"  # after the suffix, of files that are compressed as a whole
_UNFINISHED = ("-wal", "-journal")  # what stands beside a SQLite file until its writer has closed it


def storage_files(path: Path) -> list[Path]:
    """Files of a bag, in the order of recording.

    Raises
    ------
    FileFormatError : there are none.
    """
    if path.is_dir():
        files = sorted((file for file in path.iterdir() if _is_storage(file)), key=_in_order)
        if not files:
            raise FileFormatError(path, "(folder)", f"a bag: a folder with {' or '.join(STORAGE_SUFFIXES)} files", "none")
        return files
    if not path.exists():
        raise FileFormatError(path, "(path)", "a bag", "nothing there")
    if path.suffix not in STORAGE_SUFFIXES:
        raise FileFormatError(path, "(path)", f"a bag folder or a {' or '.join(STORAGE_SUFFIXES)} file", path.name)
    return [path]


def unclosed(files: Iterable[Path]) -> list[str]:
    """Names of open transactions beside SQLite ``files``: their last messages are not in the files themselves yet."""
    beside = [Path(f"{file}{end}") for file in files for end in _UNFINISHED]
    return [path.name for path in beside if path.is_file() and path.stat().st_size]


def check_room(files: Iterable[Path]) -> None:
    """Refuse files that are compressed as a whole and, unpacked, need more than half of the room for temporary files.

    Raises
    ------
    FileFormatError : naming the file, the room and the size.
    """
    room = shutil.disk_usage(tempfile.gettempdir()).free // 2
    total = 0
    for file in files:
        check_regular(file, sys.maxsize)
        try:
            with file.open("rb") as stream:
                if stream.read(len(_ZSTD)) != _ZSTD:  # whatever its name is
                    continue
                stream.seek(0)
                reader = zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True)
                while total <= room and (piece := reader.read(_PIECE)):
                    total += len(piece)
        except (zstandard.ZstdError, OSError) as error:
            raise FileFormatError(file, "(file)", "an undamaged compressed file", str(error)) from None
        if total > room:
            half = f"at most {room // MB} MB unpacked, half of the room in {tempfile.gettempdir()} (TMPDIR chooses another)"
            raise FileFormatError(file, "(file)", half, "more")


def _is_storage(file: Path) -> bool:
    return file.is_file() and Path(file.name.removesuffix(PACKED)).suffix in STORAGE_SUFFIXES


def _in_order(file: Path) -> tuple[int, str]:
    """Split bags are numbered: ``run_2.mcap`` comes before ``run_10.mcap``."""
    number = re.search(r"_(\d+)\.", file.name)
    return (int(number[1]) if number else 0, file.name)
