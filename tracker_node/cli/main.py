"""The one console command: ``tracker_node <verb>``.

Each verb is a module of this package with ``SUMMARY``, ``EXAMPLE``, ``add_arguments(parser)`` and ``run(args) -> int``. It is
imported only when asked for, so offline verbs run without ROS and ``--help`` is quick.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
import sys

from ..errors import TrackerError

NODES = ("camera_ingest", "tracker", "recorder", "player", "pipeline", "rectify")


def verbs() -> list[str]:
    """Names of all verbs, from the modules of this package."""
    package = importlib.import_module("tracker_node.cli")
    return sorted(m.name for m in pkgutil.iter_modules(package.__path__) if m.name != "main" and not m.name.startswith("_"))


def _parser_of(verb: str, module) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
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
        module = importlib.import_module(f"tracker_node.cli.{verb}")
        lines.append(f"  {verb:15} {module.SUMMARY.splitlines()[0]}")
    lines += ["", "example:", "  tracker_node track_offline --help"]
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run one verb; a user's mistake is one line on stderr and exit status 2."""
    argv = list(sys.argv[1:] if argv is None else argv)
    if not argv or argv[0] in ("-h", "--help", "help"):
        print(_overview())
        return 0
    if argv[0] == "--version":
        from .. import __version__

        print(f"tracker_node {__version__}")
        return 0
    verb, rest = argv[0], argv[1:]
    if verb not in verbs():
        print(f"tracker_node: unknown verb '{verb}'; valid: {', '.join(verbs())}", file=sys.stderr)
        return 2
    module = importlib.import_module(f"tracker_node.cli.{verb}")
    # Nodes take ROS arguments after their own; argparse must not see them, it would take `-p` or `-r` for ours.
    split = rest.index("--ros-args") if verb in NODES and "--ros-args" in rest else len(rest)
    args = _parser_of(verb, module).parse_args(rest[:split])
    if verb in NODES:
        args.ros_args = rest[split:]
    try:
        return int(module.run(args) or 0)
    except TrackerError as error:
        print(f"tracker_node {verb}: error: {error}", file=sys.stderr)
        return 2
    except OSError as error:  # a file that cannot be written, mostly: readers raise a TrackerError themselves
        where = f"{error.filename}: " if error.filename else ""
        print(f"tracker_node {verb}: error: {where}{error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


def camera_ingest() -> int:
    return main(["camera_ingest", *sys.argv[1:]])


def tracker() -> int:
    return main(["tracker", *sys.argv[1:]])


def recorder() -> int:
    return main(["recorder", *sys.argv[1:]])


def player() -> int:
    return main(["player", *sys.argv[1:]])


def pipeline() -> int:
    return main(["pipeline", *sys.argv[1:]])


def rectify() -> int:
    return main(["rectify", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
