"""Metrics as a JSON file and as a table: the one format of every program that measures something.

``{"metrics": {key: number}, "command": str, "versions": {name: str}, "cpu": {...}}``, dotted keys.
A metric that could not be measured is ``null`` in the file and ``-`` in the table.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from ..errors import without_password
from ..loaders.json_values import finite
from ..loaders.whole_file import write_whole
from ..version import __version__

PACKAGES = {"numpy": "numpy", "numba": "numba", "scipy": "scipy", "opencv": "opencv-python-headless"}
SIMD_LEVELS = ("avx512f", "avx2", "avx", "sse4_2", "sse2", "asimd", "neon")  # widest first


def write_metrics(path: str | Path, metrics: Mapping[str, float | int]) -> None:
    """Write ``metrics`` with the circumstances they were measured in; folders are made.

    Parameters
    ----------
    path : the JSON file.
    metrics : dotted key -> number; not-a-number and infinity become null.
    """
    content = {
        "metrics": {str(key): _plain(value) for key, value in metrics.items()},
        "command": command_line(),
        "versions": versions(),
        "cpu": cpu(),
    }
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def print_metrics(metrics: Mapping[str, float | int]) -> None:
    """Print ``metrics`` as a table, in their order."""
    print(format_metrics(metrics))


def report_metrics(metrics: Mapping[str, float | int], path: str | Path | None) -> None:
    """Print metrics, and write them to a JSON file where one is named.

    Parameters
    ----------
    metrics : dotted key -> number.
    path : the file, or nothing.
    """
    print_metrics(metrics)
    if path:
        write_metrics(path, metrics)


def format_metrics(metrics: Mapping[str, float | int]) -> str:
    """One line a metric; keys to the left, numbers aligned at the decimal point."""
    if not metrics:
        return "(no metrics)"
    texts = {str(key): _text(value) for key, value in metrics.items()}
    whole = max(len(text.partition(".")[0]) for text in texts.values())
    width = max(len(key) for key in texts)
    return "\n".join(f"{key:<{width}}  {' ' * (whole - len(text.partition('.')[0]))}{text}" for key, text in texts.items())


def today() -> str:
    """Date and time, for whoever reads a report."""
    return datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")


def made_by() -> list[tuple[str, str]]:
    """(label, text) of the circumstances of a report: command, versions, processor."""
    said = ", ".join(f"{key} {value}" for key, value in versions().items())
    return [("command", command_line()), ("versions", said), ("cpu", "{model}, {cores} cores, {simd}".format(**cpu()))]


def command_line() -> str:
    """The command line of this process, to be pasted into a shell; without passwords."""
    program, arguments = Path(sys.argv[0]), [without_password(argument) for argument in sys.argv[1:]]
    if program.parts[-2:] in (("cli", "main.py"), ("tracker_node", "__main__.py")):
        return shlex.join(["tracker_node", *arguments])
    if program.suffix == ".py":
        return shlex.join(["python", os.path.relpath(program), *arguments])
    return shlex.join([program.name, *arguments])


def versions() -> dict[str, str]:
    """Versions of what the metrics depend on; ``commit`` only where the code lies in a git checkout."""
    result = {"tracker_node": __version__, "python": platform.python_version()}
    for name, distribution in PACKAGES.items():
        try:
            result[name] = importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            result[name] = "not installed"
    commit = commit_of(Path(__file__).resolve().parents[2])
    if commit:
        result["commit"] = commit
    return result


def cpu() -> dict[str, str | int]:
    """Model, logical cores that this process may use, and the widest SIMD instruction set."""
    info = _cpuinfo()
    model = info.get("model name") or platform.processor() or platform.machine()
    flags = set((info.get("flags") or info.get("Features") or "").split())
    simd = next((level for level in SIMD_LEVELS if level in flags), "unknown")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return {"model": model, "cores": cores, "simd": simd}


def _cpuinfo() -> dict[str, str]:
    """The first processor's entry of /proc/cpuinfo, empty where there is none."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return {}
    lines = (line.partition(":") for line in text.split("\n\n")[0].splitlines())
    return {key.strip(): value.strip() for key, _, value in lines}


def commit_of(root: Path) -> str | None:
    """Commit of a checkout, with ``-dirty`` when tracked files have changed; None where there is none."""
    if not (root / ".git").exists():
        return None
    try:
        done = subprocess.run(
            # Whoever only asks must not hold the index: `git describe --dirty` does, and leaves its lock where it is cut off
            ["git", "--no-optional-locks", "-C", str(root), "status", "--porcelain=v2", "--branch", "--untracked-files=no"],
            capture_output=True, text=True, timeout=10, check=True,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    lines = done.stdout.splitlines()
    commit = next((line.split()[2][:12] for line in lines if line.startswith("# branch.oid")), None)
    dirty = any(not line.startswith("#") for line in lines)
    return f"{commit}-dirty" if commit and dirty else commit


def _plain(value: float | int) -> float | int | None:
    """A number that JSON has."""
    return int(value) if isinstance(value, (int, np.bool_, np.integer)) else finite(value)


def _text(value: float | int) -> str:
    plain = _plain(value)
    if plain is None:
        return "-"
    if isinstance(plain, int):
        return str(plain)
    if plain == 0.0 or 1e-2 <= abs(plain) < 1e7:
        return f"{plain:.3f}"
    return f"{plain:.3e}"
