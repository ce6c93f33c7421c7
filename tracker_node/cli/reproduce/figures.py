"""``tracker_node reproduce figures``: bodies, one match in five panels, plan view (Trewartha et al., Figs 1 to 3)."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "draw both bodies and how far their surfaces lie apart, the five panels of a match, and the plan view of the cameras"
EXAMPLE = "tracker_node reproduce figures --output out/reproduce/figures"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("-o", "--output", default="out/reproduce/figures", metavar="DIR", help="folder of the images (default: %(default)s)")
    add("--rig", metavar="RIG", help="rig.yaml for the plan view (default: the cameras around the wooden cross)")
    add("--quick", action="store_true", help="small images")


def run(args: argparse.Namespace) -> int:
    from ...experiments.figures import draw_figures

    draw_figures(Path(args.output), args.rig, args.quick)
    return 0
