"""The one console command: ``tracker_node <verb>``.

Each verb is a module of this package, of ``cli.groups`` or of ``cli.nodes``, with ``SUMMARY``, ``EXAMPLE``,
``add_arguments(parser)`` and ``run(args) -> int``. It is imported only when asked for, so offline verbs run without ROS and
``--help`` is quick.
"""

from __future__ import annotations

import argparse
import importlib
import os
import pkgutil
import re
import sys
from functools import cache
from types import ModuleType

from ..errors import TrackerError
from ._last_resort import EX_CLOSED_PIPE, EX_USAGE, closed_pipes, reader_is_gone, threads_say_one_line, unexpected

NODES = ("camera_ingest", "keypoints", "tracker", "compose", "recorder", "player", "pipeline", "rectify", "rerun_bridge")
INTERRUPTED = 130  # as a shell has it


_PACKAGES = ("tracker_node.cli", "tracker_node.cli.groups", "tracker_node.cli.nodes")
_NO_VERBS = ("main", "arguments", "groups", "nodes")


@cache
def _modules() -> dict[str, str]:
    """Verb -> name of its module; that of ``import``, a word of Python's, has an underscore behind it."""
    found = ((package, m.name) for package in _PACKAGES for m in pkgutil.iter_modules(importlib.import_module(package).__path__))
    return {name.rstrip("_"): f"{package}.{name}" for package, name in found if name[0] != "_" and name not in _NO_VERBS}


def verbs() -> list[str]:
    """Names of all verbs, from the modules of this package and of those below it."""
    return sorted(_modules())


def module_of(verb: str) -> str:
    """Name of the module of one of `verbs`."""
    return _modules()[verb]


def parser_of(verb: str, module: ModuleType) -> argparse.ArgumentParser:
    """The parser of a verb's own arguments.

    Parameters
    ----------
    verb : one of `verbs`.
    module : its module, see `module_of`.

    Returns
    -------
    The parser, with description and example.
    """
    parser = _Parser(
        prog=f"tracker_node {verb}",
        description=module.SUMMARY,
        epilog=f"example:\n  {module.EXAMPLE}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.add_arguments(parser)
    return parser


def _overview() -> str:
    lines = ["usage: tracker_node <verb> [options]", "", "verbs:"]
    for verb in verbs():
        module = importlib.import_module(module_of(verb))
        lines.append(f"  {verb:15} {module.SUMMARY.splitlines()[0]}")
    lines += ["", "example:", "  tracker_node track --help"]
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run one verb; a user's mistake is one line on stderr and exit status 2, whatever else ends it one line and 70.

    Parameters
    ----------
    argv : the verb and its arguments; None for those of this process, which a signal then ends with status 0 if it is a node.
    """
    if argv is None and "_ARGCOMPLETE" in os.environ:
        _complete()
    if argv is not None or not sys.argv[1:] or sys.argv[1] not in NODES:
        return _guarded(list(sys.argv[1:] if argv is None else argv))
    from ..ros.ending import Ending, end_now

    with Ending(last=True) as ending:  # before the imports, which take seconds
        status = _guarded(sys.argv[1:])
        status = 0 if status == INTERRUPTED else status
        if ending.hurried.is_set():
            end_now(status)
    return status


def _complete() -> None:
    """Answer a shell that asks, by the script of the verb ``completion``, what may follow; ends the process."""
    import argcomplete

    parser = argparse.ArgumentParser("tracker_node")
    parser.add_argument("--version", action="store_true")
    places, written = parser.add_subparsers(), os.environ.get("COMP_LINE", "").split()
    for verb in verbs():
        module = importlib.import_module(module_of(verb))
        parser_of_verb = places.add_parser(verb, help=module.SUMMARY)
        if verb in written:  # arguments of all would take a second
            module.add_arguments(parser_of_verb)
    argcomplete.autocomplete(parser)


def _guarded(argv: list[str]) -> int:
    verb, rest = (argv[0], argv[1:]) if argv else ("", [])
    try:
        with threads_say_one_line(verb, rest):
            status = _overviewed(argv) if not verb or verb.startswith("-") or verb == "help" else _run(verb, rest)
    except SystemExit as end:  # of argparse
        if closed_pipes():
            return EX_CLOSED_PIPE
        raise end
    except KeyboardInterrupt:
        status = INTERRUPTED
    except BrokenPipeError as error:
        return EX_CLOSED_PIPE if reader_is_gone() else unexpected(verb, rest, error)  # else a connection's
    except Exception as error:
        status = unexpected(verb, rest, error)
    return EX_CLOSED_PIPE if closed_pipes() else status


def _overviewed(argv: list[str]) -> int:
    if argv and argv[0] == "--version":
        from ..version import __version__

        print(f"tracker_node {__version__}")
        return 0
    if not argv or argv[0] in ("-h", "--help", "help"):
        print(_overview())
        return 0
    return _unknown(argv[0])


_RENAMED = {"track_offline": "track", "import_rig": "rig import", "calibrate time": "synchronize"}  # verbs of earlier versions
_RENAMED_OPTIONS = {
    "--through-masks": "--masked-images",
    "--stills": "--background-images",
    "--no-plates": "--no-backgrounds",
    "--border-grey": "--border-gray",
    "--picture": "--image",
    "--marker-share": "--marker-ratio",
}


class _Parser(argparse.ArgumentParser):
    """One that says the present name of an option of version 0.1, and in a line what is wrong."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.register("type", float, _number)  # of all arguments that are of this type

    def error(self, message):
        """A line, as for all that a user does wrong; usage of fifteen lines before it hides it."""
        self.exit(EX_USAGE, f"{self.prog}: error: {message} ({self.prog} --help)\n")

    def parse_known_args(self, args=None, namespace=None):
        # Before anything else is said: what is missing may be what the old name stands for
        for text in args or ():
            old = text.partition("=")[0]
            if old in _RENAMED_OPTIONS and _RENAMED_OPTIONS[old] in self._option_string_actions:
                self.error(f"unknown option {old}: it is {_RENAMED_OPTIONS[old]} now")
        return super().parse_known_args(args, namespace)


def _number(text: str) -> float:
    """A number of the command line; of 1,78 nobody knows in all countries whether it is 1.78 or 178."""
    try:
        return float(text)
    except ValueError:
        pointed = text.replace(",", ".")
        hint = f"; with a point, {pointed}" if re.fullmatch(r"[-+]?\d*,\d+", text) else ""
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}{hint}") from None


def _unknown(verb: str) -> int:
    if verb in _RENAMED:
        print(f"tracker_node: unknown verb '{verb}': it is '{_RENAMED[verb]}' now", file=sys.stderr)
        return EX_USAGE
    print(f"tracker_node: unknown verb '{verb}'; valid: {', '.join(verbs())}", file=sys.stderr)
    return EX_USAGE


def _run(verb: str, rest: list[str]) -> int:
    whole = f"{verb} {rest[0]}" if rest else verb
    if verb not in verbs() or whole in _RENAMED:
        return _unknown(whole if whole in _RENAMED else verb)
    module = importlib.import_module(module_of(verb))
    # Nodes take ROS arguments after their own; argparse must not see them, it would take `-p` or `-r` for ours. Launch appends
    # them to every verb that it starts.
    split = rest.index("--ros-args") if "--ros-args" in rest else len(rest)
    args = parser_of(verb, module).parse_args(rest[:split])
    if verb in NODES:
        args.ros_args = rest[split:]
    try:
        return int(module.run(args) or 0)
    except TrackerError as error:
        print(f"tracker_node {verb}: error: {error}", file=sys.stderr)
    except BrokenPipeError:
        raise
    except OSError as error:  # a file that cannot be written, mostly: readers raise a TrackerError themselves
        where = f"{error.filename}: " if error.filename else ""
        print(f"tracker_node {verb}: error: {where}{error.strerror or error}", file=sys.stderr)
    return EX_USAGE


def node(verb: str) -> int:
    """Run a node as ``ros2 run`` does: with the arguments of this process as its own."""
    sys.argv.insert(1, verb)
    return main()


if __name__ == "__main__":
    sys.exit(main())
