"""Command lines, runs and pictures of the programs whose clips are drawn by seed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from benchmark._arguments import parser_of
from benchmark.contour._runs import configured, print_circumstances
from tracker_node.errors import TrackerError
from tracker_node.observation.image_set import ImageSet
from tracker_node.report.metrics_file import report_metrics
from tracker_node.tracking.config import TrackerConfig

Run = TypeVar("Run")
Figures = dict[str, float | int]


def seeded_parser(doc: str | None, example: str, names: Iterable[str] = ()) -> argparse.ArgumentParser:
    """The options that all have; ``example`` follows the folder, ``names`` are what ``--only`` may have."""
    parser = parser_of(doc, f"python benchmark/world/{example}", "one seed")
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


def runs_of(
    args: argparse.Namespace, names: Iterable[str], run: Callable[[str, int, Path | None], Iterable[Run]]
) -> Iterator[tuple[str, list[Run]]]:
    """Each kind of clip with its runs of all seeds; ``run``: of name, seed, and how its pictures' names begin."""
    for name in names:
        found: list[Run] = []
        for seed in seeds_of(args):
            for each in run(name, seed, args.pictures / f"{name}_{seed}" if args.pictures else None):
                found.append(each)
                print(f"{name}, seed {seed}: {each}", file=sys.stderr, flush=True)
        yield name, found


def reported(program: str, args: argparse.Namespace, measure: Callable[[TrackerConfig], Figures], **values: object) -> int:
    """Measure with the parameters asked for, on top of ``values``, and report the figures; the exit status."""
    cv2.setNumThreads(1)
    try:
        figures = measure(configured(args.changes, **values))
    except TrackerError as error:
        print(f"{program}: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def write_picture(one: ImageSet, path: Path) -> None:
    """All images of a set side by side."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.hstack([image.pixels for image in one.images]))
