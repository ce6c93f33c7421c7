#!/usr/bin/env python3
"""Every benchmark, one after the other, each in a process of its own; one JSON file for each, and one of all figures.

A program that fails does not stop the others. The exit status is 1 when one has failed, or when two print the same key: a figure
has one program that prints it.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

FOLDER = Path(__file__).resolve().parent


def programs(folder: Path = FOLDER) -> dict[str, Path]:
    """The benchmark programs below a folder by name, such as ``contour/figure``.

    Files that begin with an underscore are helpers.
    """
    found = sorted(path for path in folder.rglob("*.py") if not path.name.startswith("_"))
    return {path.relative_to(folder).with_suffix("").as_posix(): path for path in found}


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="example:\n  python benchmark/_all.py --quick --output out/benchmark",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="fewer trials and seeds")
    parser.add_argument("--output", type=Path, default=Path("out/benchmark"), metavar="FOLDER", help="default: %(default)s")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="only these programs, e.g. core ros/live")
    args = parser.parse_args(arguments)
    known = programs()
    unknown = set(args.only or ()) - set(known)
    if unknown:
        parser.error(f"no such program: {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    chosen = {name: path for name, path in known.items() if not args.only or name in args.only}
    return run_all(chosen, args.output, ["--quick"] if args.quick else [])


def run_all(chosen: Mapping[str, Path], output: Path, options: list[str]) -> int:
    """Run programs; their figures lie in ``output``, all together in ``all.json`` there. Returns the exit status."""
    output.mkdir(parents=True, exist_ok=True)
    failed: list[str] = []
    written: dict[str, Path] = {}
    for name, program in chosen.items():
        print(f"== {name}", flush=True)
        found = output / f"{name}.json"
        found.parent.mkdir(parents=True, exist_ok=True)
        found.unlink(missing_ok=True)  # figures of an earlier run are not this one's
        began = time.monotonic()
        status = subprocess.run([sys.executable, str(program), *options, "--json", str(found)], check=False).returncode
        print(f"== {name}: status {status}, {(time.monotonic() - began) / 60.0:.1f} min", flush=True)
        if status or not found.exists():
            failed.append(f"{name} (status {status}{'' if found.exists() else ', no figures'})")
        if found.exists():
            written[name] = found
    figures, twice = gathered(written)
    (output / "all.json").write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    for line in [*(f"failed: {name}" for name in failed), *twice]:
        print(line, file=sys.stderr)
    return 1 if failed or twice else 0


def gathered(written: dict[str, Path]) -> tuple[dict[str, dict], list[str]]:
    """Figures of several programs by key, and a line for each key that more than one prints.

    Parameters
    ----------
    written : program -> its JSON file.
    """
    figures: dict[str, dict] = {}
    twice: list[str] = []
    for program, path in written.items():
        content = json.loads(path.read_text(encoding="utf-8"))
        for key, value in content["metrics"].items():
            if key in figures:
                twice.append(f"{key}: printed by {figures[key]['program']} and by {program}")
            else:
                figures[key] = {"value": value, "program": program, "command": content["command"]}
    return figures, twice


if __name__ == "__main__":
    sys.exit(main())
