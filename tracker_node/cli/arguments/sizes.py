"""Sizes on the command line: of images in pixels, of boards in squares."""

from __future__ import annotations

import argparse
import re

_PAIR = re.compile(r"([0-9]{1,6})x([0-9]{1,6})", re.IGNORECASE)
_IMAGE = "WIDTHxHEIGHT in pixels, such as 640x480"


def image_size(text: str) -> tuple[int, int]:
    """``640x480`` -> (640, 480), for argparse."""
    size = _pair(text)
    if size is None or min(size) < 1:
        raise argparse.ArgumentTypeError(f"expected {_IMAGE}, got '{text}'")
    return size


def size_option(option: str, text: str, expected: str = _IMAGE, least: int = 1, most: int = 10**6) -> tuple[int, int]:
    """The two numbers of an option, each from ``least`` to ``most``.

    Raises
    ------
    FileFormatError : naming the option and what is ``expected`` of it.
    """
    from ...errors import FileFormatError

    size = _pair(text)
    if size is None or not all(least <= number <= most for number in size):
        raise FileFormatError("command line", option, expected, text)
    return size


def _pair(text: str) -> tuple[int, int] | None:
    found = _PAIR.fullmatch(text)
    return (int(found[1]), int(found[2])) if found else None
