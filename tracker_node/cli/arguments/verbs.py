"""Verbs that are made of others: ``tracker_node <verb> <what>``, each a module of the package ``tracker_node.cli.<verb>``."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import pkgutil
import shlex
from keyword import iskeyword
from pathlib import Path


def subverbs(verb: str) -> list[str]:
    """Names of a verb's sub-verbs: the public modules of its package; none for a verb that is a module itself."""
    package = f"tracker_node.cli.{verb}"
    found = importlib.util.find_spec(package)
    places = (found.submodule_search_locations if found else None) or []
    return sorted(m.name.rstrip("_") for m in pkgutil.iter_modules(places) if not m.name.startswith("_"))


def module_of(verb: str, what: str) -> str:
    """Module of a sub-verb; one that is a word of Python's, such as ``import``, has an underscore behind it.

    Parameters
    ----------
    verb, what : such as ``rig`` and ``import``.

    Returns
    -------
    name : for ``importlib``.
    """
    return f"tracker_node.cli.{verb}.{what}{'_' if iskeyword(what) else ''}"


def add_subverbs(parser: argparse.ArgumentParser, verb: str) -> None:
    """Add the sub-verbs and their arguments; the chosen one is run by `run_subverb`.

    Parameters
    ----------
    parser : of the verb.
    verb : its name.
    """
    names = subverbs(verb)
    subparsers = parser.add_subparsers(dest="what", required=True, metavar="{" + ",".join(names) + "}")
    for name in names:
        module = importlib.import_module(module_of(verb, name))
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


def run_verb(*arguments: str | Path) -> int:
    """Run another verb here, showing the command as a user would give it."""
    from ..main import main

    argv = [str(argument) for argument in arguments]
    print(f"$ tracker_node {shlex.join(argv)}", flush=True)
    return main(argv)
