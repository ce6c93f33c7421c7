"""Sub-verbs of ``tracker_node bag``: what bags hold, and what can be saved of damaged ones.

Each public module of this package is a sub-verb, with ``SUMMARY``, ``EXAMPLE``, ``add_arguments`` and ``run``.
"""

from __future__ import annotations

import argparse

from ..arguments.verbs import add_subverbs, run_subverb

SUMMARY = "look into bags: what is in one, whether it is sound, and a sound one of what can be read"
EXAMPLE = "tracker_node bag check out/run1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, "bag")


run = run_subverb
