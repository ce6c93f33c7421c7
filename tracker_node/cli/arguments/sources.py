"""``--sources``: where the videos of all cameras are, as one pattern."""

from __future__ import annotations

import argparse


def add_sources_argument(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--sources",
        metavar="PATTERN",
        help="video or image folder of each camera; {name} is its name, {number} counts from 1, as in 'videos/{name}.mp4'",
    )
