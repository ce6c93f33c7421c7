"""A recording tracked, of one body."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tracker_node.runs.offline import OfflineRun, run_together


def run_offline(run: OfflineRun, output: Path, progress: Callable[..., None] | None = None) -> dict[str, Any]:
    """Track, and return what ``run.json`` holds."""
    return run_together({run.model.name: run}, {run.model.name: output}, progress)[run.model.name]
