"""``tracker_node rig <what>``: each sub-verb is a module ``_rig_<what>`` of this package."""

from __future__ import annotations

import argparse

from ._subverbs import add_subverbs, run_subverb

SUMMARY = "look after a rig of cameras: find out what is wrong with it, move its world frame, hand it to other programs"
EXAMPLE = "tracker_node rig check rig.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, "rig")


run = run_subverb
