"""Verbs that are made of others: ``tracker_node <verb> <what>``; the module of the verb lists them as ``SUBVERBS``."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple


class Subverb(NamedTuple):
    """One of the verbs that a verb is made of; ``summary`` and ``example`` are what ``--help`` says."""

    name: str
    summary: str
    example: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


def add_subverbs(parser: argparse.ArgumentParser, subverbs: Iterable[Subverb]) -> None:
    """Add the sub-verbs and their arguments; the chosen one is run by `run_subverb`.

    Parameters
    ----------
    parser : of the verb.
    subverbs : in the order of their names.
    """
    subverbs = tuple(subverbs)
    subparsers = parser.add_subparsers(dest="what", required=True, metavar="{" + ",".join(each.name for each in subverbs) + "}")
    for each in subverbs:
        subparser = subparsers.add_parser(
            each.name,
            help=each.summary,
            description=each.summary,
            epilog=f"example:\n  {each.example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        each.add_arguments(subparser)
        subparser.set_defaults(run_subverb=each.run)


def run_subverb(args: argparse.Namespace) -> int:
    """Run the sub-verb that was asked for."""
    return args.run_subverb(args)


def run_verb(*arguments: str | Path) -> int:
    """Run another verb here, showing the command as a user would give it."""
    from ..main import main

    argv = [str(argument) for argument in arguments]
    print(f"$ tracker_node {shlex.join(argv)}", flush=True)
    return main(argv)
