"""``tracker_node migrate``: files of version 0.1 under the present names."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

SUMMARY = "rewrite a parameter file of version 0.1 with the present names; the old file is kept beside it"
EXAMPLE = "tracker_node migrate tracker.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", help="tracker.yaml, plain or as a ROS parameter file")
    parser.add_argument("-o", "--output", metavar="FILE", help="where to write (default: there; the old one to FILE.old)")


def run(args: argparse.Namespace) -> int:
    from ..runs.config_file import migrate_config

    path = Path(args.file)
    output = Path(args.output) if args.output else path
    dropped = migrate_config(path, output)
    kept = f"; the old file is {path.name}.old" if output == path else ""
    print(f"wrote {output}{kept}. Comments are not kept.")
    for name in dropped:
        print(f"left out: {name}, which has no effect with these modalities", file=sys.stderr)
    return 0
