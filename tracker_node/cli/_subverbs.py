"""Verbs that are made of others: ``tracker_node <verb> <what>``, each a module ``_<verb>_<what>`` of this package."""

from __future__ import annotations

import argparse
import importlib
import pkgutil


def subverbs(verb: str) -> list[str]:
    """Names of a verb's sub-verbs, from the modules of this package."""
    package = importlib.import_module("tracker_node.cli")
    prefix = f"_{verb}_"
    return sorted(m.name.removeprefix(prefix) for m in pkgutil.iter_modules(package.__path__) if m.name.startswith(prefix))


def add_subverbs(parser: argparse.ArgumentParser, verb: str) -> None:
    """Let ``parser`` take the sub-verbs and their arguments; the one that is asked for is run by `run_subverb`."""
    names = subverbs(verb)
    subparsers = parser.add_subparsers(dest="what", required=True, metavar="{" + ",".join(names) + "}")
    for name in names:
        module = importlib.import_module(f"tracker_node.cli._{verb}_{name}")
        subparser = subparsers.add_parser(
            name,
            help=module.SUMMARY,
            description=module.SUMMARY,
            epilog=f"example:\n  {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(subparser)
        subparser.set_defaults(run_subverb=module.run)


def run_subverb(args: argparse.Namespace) -> int:
    """Run the sub-verb that was asked for."""
    return args.run_subverb(args)
