"""Command lines and pictures of the programs whose clips are drawn by seed."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from tracker_node.observation.image_set import ImageSet


def parser_of(doc: str, example: str, names: Iterable[str] = ()) -> argparse.ArgumentParser:
    """The options that all have; ``example`` follows the folder, ``names`` are what ``--only`` may have."""
    epilog = f"example:\n  python benchmark/world/{example}"
    parser = argparse.ArgumentParser(
        description=doc.splitlines()[0], epilog=epilog, formatter_class=argparse.RawDescriptionHelpFormatter
    )  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="one seed")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--seeds", nargs="+", type=int, metavar="N", help="of the clips (default: 1 to 5)")
    if names:
        parser.add_argument("--only", nargs="+", metavar="NAME", choices=names, help=f"of {', '.join(names)}")
    parser.add_argument(
        "--set", nargs="+", default=[], metavar="KEY=VALUE", dest="changes", help="parameters of the tracker, e.g. threads=1"
    )
    return parser


def add_pictures(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write two image sets of each clip there")


def seeds_of(args: argparse.Namespace) -> Iterable[int]:
    return args.seeds or range(1, 2 if args.quick else 6)


def write_picture(one: ImageSet, path: Path) -> None:
    """All images of a set side by side."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.hstack([image.pixels for image in one.images]))
