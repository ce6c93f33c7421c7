"""``tracker_node calibrate <what>``: each sub-verb is a module ``_calibrate_<what>`` of this package."""

from __future__ import annotations

import argparse
import importlib

SUMMARY = "calibrate bodies, first poses and rigs"
EXAMPLE = "tracker_node calibrate body --trc static.trc --y-up -o subject.yaml"

SUBVERBS = ("body", "pose", "refine")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    subparsers = parser.add_subparsers(dest="what", required=True, metavar="{" + ",".join(SUBVERBS) + "}")
    for name in SUBVERBS:
        module = importlib.import_module(f"tracker_node.cli._calibrate_{name}")
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
