"""Options that runs share: whose body, how ``run.json`` has them; what is said, with what status, where no body is tracked."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import FileFormatError, without_password
from ...loaders.source_address import relocated

if TYPE_CHECKING:
    import numpy as np


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
    import numpy as np

    if args.person is None:
        return None
    place = np.array(args.person)
    if not np.isfinite(place).all():
        raise FileFormatError("command line", "--person", "a place in meters", args.person)
    return place


_FILES = ("rig", "model", "initial_state", "occluders", "config")


def named_options(args: argparse.Namespace) -> dict[str, Any]:
    """The options of a command line by name, files and sources with their whole paths."""
    changed: dict[str, Any] = {name: Path(value) for name in _FILES if (value := getattr(args, name))}
    if getattr(args, "source", None):
        changed["source"] = [(camera, relocated(source, Path.cwd())) for camera, source in args.source]
    return {name: _plain(value) for name, value in {**vars(args), **changed}.items() if not name.startswith("_")}


def _plain(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, str):
        return without_password(value)
    if value == math.inf:
        return "all"
    return str(value.resolve()) if isinstance(value, Path) else value


EX_NOTHING_TRACKED = 3


def nothing_tracked(verb: str, counts: Mapping[str, int], reason: str, state_given: bool, body: str = "") -> int:
    """Say so where the body is tracked in no image set.

    Parameters
    ----------
    verb : that was run.
    counts : image sets by the name of their status.
    reason : what most of them say; may be empty.
    state_given : whether the run began with a state.
    body : name of one of several.

    Returns
    -------
    status : exit status; 0 where the body is tracked in at least one set, else 3.
    """
    from ...tracking.estimate import known_sets

    if known_sets(counts):
        return 0
    n = sum(counts.values())
    if not n:
        what = "no image set was formed, so nothing is tracked: look at the stamps of the cameras and at synchronizer.*"
    elif counts.get("LOST"):
        what = f"the body is LOST in all {n} image sets"
        if counts["LOST"] < n:
            what = f"the body is tracked in none of {n} image sets"
        what += f" (mostly: {reason})" if reason else ""
        likely = "the initial state is not where the body is in the first images" if state_given else "the start was wrong"
        what += f"; likely {likely}, or rig and images do not fit: {_next_step(state_given)}"
    else:
        what = f"the body was found in none of {n} image sets" + (f" ({reason})" if reason else "")
        what += f": {_next_step(state_given)}"
    print(f"tracker_node {verb}: {body and f'{body}: '}{what}", file=sys.stderr)
    return EX_NOTHING_TRACKED


def _next_step(state_given: bool) -> str:
    first = "leave out the initial state, so that the body is searched in the images"
    if not state_given:
        first = "give --initial-state (calibrate pose)"
    return f"{first}; tracker_node rig check finds faults of the rig; see docs/troubleshooting.md"
