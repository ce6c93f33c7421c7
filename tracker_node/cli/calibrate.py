"""``tracker_node calibrate <what>``: each sub-verb is a module ``_calibrate_<what>`` of this package."""

from __future__ import annotations

import argparse
import importlib
import pkgutil

SUMMARY = "make what tracking needs: true camera places, pictures of the empty scene, a person's body, a first pose"
EXAMPLE = "tracker_node calibrate body --trc static.trc --y-up -o person.yaml"

_PREFIX = "_calibrate_"


def subverbs() -> list[str]:
    """Names of the sub-verbs, from the modules of this package."""
    package = importlib.import_module("tracker_node.cli")
    return sorted(m.name.removeprefix(_PREFIX) for m in pkgutil.iter_modules(package.__path__) if m.name.startswith(_PREFIX))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    subparsers = parser.add_subparsers(dest="what", required=True, metavar="{" + ",".join(subverbs()) + "}")
    for name in subverbs():
        module = importlib.import_module(f"tracker_node.cli.{_PREFIX}{name}")
        subparser = subparsers.add_parser(
            name,
            help=module.SUMMARY,
            description=module.SUMMARY,
            epilog=f"example:\n  {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(subparser)
        subparser.set_defaults(run_subverb=module.run)


def run(args: argparse.Namespace) -> int:
    """Run the sub-verb that was asked for."""
    return args.run_subverb(args)
