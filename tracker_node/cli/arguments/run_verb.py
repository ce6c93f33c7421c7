"""Another verb run in this process, its command shown as a user would give it."""

from __future__ import annotations

import shlex
from pathlib import Path


def run_verb(*arguments: str | Path) -> int:
    """Run another verb here, showing the command as a user would give it."""
    from ..main import main

    argv = [str(argument) for argument in arguments]
    print(f"$ tracker_node {shlex.join(argv)}", flush=True)
    return main(argv)
