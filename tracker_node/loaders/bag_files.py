"""Which files a bag consists of."""

from __future__ import annotations

import re
from pathlib import Path

from ..errors import FileFormatError

STORAGE_SUFFIXES = (".mcap", ".db3")
PACKED = ".zstd"  # after the suffix, of files that are compressed as a whole


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


def _is_storage(file: Path) -> bool:
    return file.is_file() and Path(file.name.removesuffix(PACKED)).suffix in STORAGE_SUFFIXES


def _in_order(file: Path) -> tuple[int, str]:
    """Split bags are numbered: ``run_2.mcap`` comes before ``run_10.mcap``."""
    number = re.search(r"_(\d+)\.", file.name)
    return (int(number[1]) if number else 0, file.name)
