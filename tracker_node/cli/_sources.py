"""``--sources``: where the videos of all cameras are, as one pattern."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

from ..errors import SourceError


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
    from ..loaders.source_address import parse_source

    sources: dict[str, str | None] = dict.fromkeys(names)
    if pattern is None:
        return sources
    for number, name in enumerate(sources, start=1):
        try:
            source = pattern.format(name=name, number=number)
        except (LookupError, ValueError, AttributeError) as error:
            raise SourceError(pattern, "expected a pattern with {name} or {number}, e.g. 'videos/cam{number:02}.mp4'") from error
        parse_source(source)
        sources[name] = source
    return sources
