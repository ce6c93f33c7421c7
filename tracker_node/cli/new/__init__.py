"""Sub-verbs of ``tracker_node new``: files that describe work, written from what is there.

Each public module of this package is a sub-verb, with ``SUMMARY``, ``EXAMPLE``, ``add_arguments`` and ``run``.
"""

from __future__ import annotations

import argparse

from ..arguments.verbs import add_subverbs, run_subverb

SUMMARY = "describe a recording, for track, pipeline and batch: write recording.yaml and parameters for what is there"
EXAMPLE = "tracker_node new recording --rig rig_timed.yaml --model person.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, "new")


run = run_subverb
