"""Sub-verbs of ``tracker_node rig``: a rig checked, moved, handed to other programs.

Each public module of this package is a sub-verb, with ``SUMMARY``, ``EXAMPLE``, ``add_arguments`` and ``run``.
"""

from __future__ import annotations

import argparse

from ..arguments.verbs import add_subverbs, run_subverb

SUMMARY = "look after a rig of cameras: find out what is wrong with it, move its world frame, hand it to other programs"
EXAMPLE = "tracker_node rig check rig.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, "rig")


run = run_subverb
