"""Sub-verbs of ``tracker_node calibrate``: cameras, bodies, backgrounds, lights, clocks, first poses.

Each public module of this package is a sub-verb, with ``SUMMARY``, ``EXAMPLE``, ``add_arguments`` and ``run``.
"""

from __future__ import annotations

import argparse

from ..arguments.verbs import add_subverbs, run_subverb

SUMMARY = "make what tracking needs: true camera places, images of the background, a person's body, a first pose"
EXAMPLE = "tracker_node calibrate body --trc static.trc --y-up -o person.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, "calibrate")


run = run_subverb
