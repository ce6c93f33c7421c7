"""``tracker_node migrate``: files of version 0.1 under the present names."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

SUMMARY = "rewrite a recording, rig, body or parameters of version 0.1 with present names; the old one is kept beside"
EXAMPLE = "tracker_node migrate tracker.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file", metavar="FILE", help="recording.yaml, rig.yaml, model.yaml, or tracker.yaml (plain or as a ROS parameter file)"
    )
    parser.add_argument("-o", "--output", metavar="FILE", help="where to write (default: there; the old one to NAME.old)")


def run(args: argparse.Namespace) -> int:
    from ..runs.config_file import migrate

    path = Path(args.file)
    output = Path(args.output) if args.output else path
    dropped = migrate(path, output)
    print(f"wrote {output}{f'; the old one is {path.name}.old' if output == path else ''}")
    for name in dropped:
        print(f"left out: {name}, which has no effect with these modalities", file=sys.stderr)
    return 0
