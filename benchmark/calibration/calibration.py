#!/usr/bin/env python3
"""How well cameras are calibrated: from a board, from control points, from a tracked body, and their clocks.

Sections, each a function that gives figures: ``board`` (a recorded ChArUco board, four webcams, against the
calibration that came with it), ``synthetic_rig`` (six simulated cameras, corners with 0.3 px of noise, worst camera), ``dlt`` (20
control points, 1 px of noise), ``balancing`` (a real rig refined by 2D joints, judged by them and by a swim
cap), ``offset`` (the clock of a free-running camera; draws a clip first, some minutes).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.calibration._boards import board_section, synthetic_rig_section
from benchmark.calibration._dlt import dlt_section
from benchmark.calibration._time import balancing_section, offset_section

SLOW = ("offset",)


def sections(quick: bool) -> dict[str, Callable[[], dict[str, float | int]]]:
    """All of them by name; quick ones have fewer trials."""
    return {
        "board": partial(board_section, quick),
        "synthetic_rig": partial(synthetic_rig_section, quick),
        "dlt": partial(dlt_section, quick),
        "balancing": balancing_section,
        "offset": offset_section,
    }


def main() -> int:
    args = _arguments()
    figures: dict[str, float | int] = {}
    for name, section in sections(args.quick).items():
        if name in args.only if args.only else not (args.quick and name in SLOW):
            figures |= section()
    report_metrics(figures, args.json)
    return 0


def _arguments() -> argparse.Namespace:
    parser = parser_of(__doc__, "", "fewer trials; without the section offset, unless it is asked for")
    parser.add_argument("--only", nargs="+", choices=list(sections(False)), help="these sections (default: all)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
