"""The command line that every benchmark has: ``--quick`` and ``--json``, and its docstring as the help."""

from __future__ import annotations

import argparse
from pathlib import Path


def parser_of(doc: str | None, example: str, quick: str) -> argparse.ArgumentParser:
    """A parser, to which a program adds its own options.

    Parameters
    ----------
    doc : of the program.
    example : a command, or lines of them; may be empty.
    quick : what ``--quick`` does.

    Returns
    -------
    parser : with ``quick`` and ``json``, the path of a file or None.
    """
    epilog = f"example:\n  {example}" if example else None
    parser = argparse.ArgumentParser(description=doc, epilog=epilog, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there, too")
    return parser
