"""``tracker_node bag <what>``: each sub-verb is a module ``_bag_<what>`` of this package."""

from __future__ import annotations

import argparse

from ._subverbs import add_subverbs, run_subverb

SUMMARY = "look into bags: what is in one, whether it is sound, and a sound one of what can be read"
EXAMPLE = "tracker_node bag check out/run1"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, "bag")


run = run_subverb
