"""``--sources``: where the videos of all cameras are, as one pattern."""

from __future__ import annotations

import argparse
from collections.abc import Iterable


def add_sources_argument(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--sources",
        metavar="PATTERN",
        help="video or image folder of each camera; {name} is its name, {number} counts from 1, as in 'videos/{name}.mp4'",
    )


def sources_by_name(pattern: str | None, names: Iterable[str]) -> dict[str, str | None]:
    """What the pattern says for each camera, numbered from 1; None for all without a pattern.

    Raises
    ------
    SourceError : a pattern with other fields than {name} and {number}, or of a kind of source that is not known.
    """
    from ...loaders.source_address import filled, parse_source

    sources: dict[str, str | None] = dict.fromkeys(names)
    if pattern is None:
        return sources
    for number, name in enumerate(sources, start=1):
        source = filled(pattern, name, number)
        parse_source(source)
        sources[name] = source
    return sources
