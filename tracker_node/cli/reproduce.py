"""``tracker_node reproduce <experiment>``: each experiment is a module ``_reproduce_<experiment>`` of this package."""

from __future__ import annotations

import argparse
import importlib
import pkgutil

SUMMARY = "repeat an experiment of the papers that the trackers come from: its table or figures, beside what was published"
EXAMPLE = "tracker_node reproduce table1 --output out/reproduce/table1"

_PREFIX = "_reproduce_"


def subverbs() -> list[str]:
    """Names of the experiments, from the modules of this package."""
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
    """Run the experiment that was asked for."""
    return args.run_subverb(args)
