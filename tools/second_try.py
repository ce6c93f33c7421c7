#!/usr/bin/env python3
"""A second try of the tests that failed, one after the other: says which passed only then.

    python tools/second_try.py .pytest_cache/ci/test

The folder is pytest's cache of the first try (``-o cache_dir=...``). The exit status is 0 when every one of them passes now.
It is 1 when one fails again, and when there is nothing to try again: something before the tests failed, or they were not run
to the end.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

SOME_FAILED = 1  # pytest's exit status when the tests were run to the end and some failed


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cache", type=Path, help="the cache folder of the first try")
    cache = parser.parse_args(arguments).cache
    failed = failed_tests(cache)
    if _read(cache / "v/tracker_node/exit_status") != SOME_FAILED or not failed:
        print("== no second try: these are no failures of tests alone")
        return 1
    print(f"== second try of {len(failed)} that failed, one after the other", flush=True)
    status = subprocess.run([sys.executable, "-m", "pytest", "-o", f"cache_dir={cache}", *failed], check=False).returncode
    again = set(failed_tests(cache)) if status else set()
    for name in failed:
        print(f"== {'failed twice' if name in again else 'passed only at the second try'}: {name}")
    return 1 if status else 0


def failed_tests(cache: Path) -> list[str]:
    """Node ids of the tests that failed, as pytest remembers them for ``--last-failed``."""
    return sorted(_read(cache / "v/cache/lastfailed") or {})


def _read(path: Path) -> object:
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


if __name__ == "__main__":
    sys.exit(main())
