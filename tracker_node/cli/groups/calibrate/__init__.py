"""Sub-verbs of ``tracker_node calibrate``: cameras, bodies, backgrounds, lights, first poses; each module lists its own."""

from __future__ import annotations

import argparse

from ...arguments.verbs import add_subverbs, run_subverb
from . import body, cameras, refine, robot, scene

SUMMARY = "make what tracking needs: true camera places, images of the background, a person's body, a first pose"
EXAMPLE = "tracker_node calibrate body --trc static.trc --y-up -o person.yaml"

SUBVERBS = tuple(sorted((*body.SUBVERBS, *cameras.SUBVERBS, *refine.SUBVERBS, *robot.SUBVERBS, *scene.SUBVERBS)))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, SUBVERBS)


run = run_subverb
