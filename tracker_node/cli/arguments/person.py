"""Which of several people: ``--person``, of every verb that looks for somebody."""

from __future__ import annotations

import argparse

import numpy as np

from ...errors import FileFormatError


def add_person_argument(parser: argparse._ActionsContainer) -> None:
    """``--person X Y Z``.

    Parameters
    ----------
    parser : of a verb, or a group of its arguments.
    """
    parser.add_argument(
        "--person", nargs=3, type=float, metavar=("X", "Y", "Z"),
        help="of several people, the one nearest to this place, meters (default: nearest to where the cameras look)",
    )  # fmt: skip


def place_of_person(args: argparse.Namespace) -> np.ndarray | None:
    """(3,) meters, world, of the command line; None where no person is named.

    Raises
    ------
    FileFormatError : it is not finite.
    """
    if args.person is None:
        return None
    place = np.array(args.person)
    if not np.isfinite(place).all():
        raise FileFormatError("command line", "--person", "a place in meters", args.person)
    return place
