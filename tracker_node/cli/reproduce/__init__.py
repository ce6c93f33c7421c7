"""Sub-verbs of ``tracker_node reproduce``: the experiments of the papers.

Each public module of this package is a sub-verb, with ``SUMMARY``, ``EXAMPLE``, ``add_arguments`` and ``run``.
"""

from __future__ import annotations

import argparse

from ..arguments.verbs import add_subverbs, run_subverb

SUMMARY = "repeat an experiment of the papers that the trackers come from: its table or figures, beside what was published"
EXAMPLE = "tracker_node reproduce table1 --output out/reproduce/table1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, "reproduce")


run = run_subverb
