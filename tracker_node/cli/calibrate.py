"""``tracker_node calibrate <what>``: each sub-verb is a module ``_calibrate_<what>`` of this package."""

from __future__ import annotations

import argparse

from ._subverbs import add_subverbs, run_subverb

SUMMARY = "make what tracking needs: true camera places, pictures of the empty scene, a person's body, a first pose"
EXAMPLE = "tracker_node calibrate body --trc static.trc --y-up -o person.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, "calibrate")


run = run_subverb
