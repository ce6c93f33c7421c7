"""A run in which the body is tracked in no image set: said in a line, with what to do, and an exit status of its own."""

from __future__ import annotations

import sys
from collections.abc import Mapping

EX_NOTHING_TRACKED = 3
TRACKED = ("TRACKING", "DEGRADED")


def nothing_tracked(verb: str, counts: Mapping[str, int], reason: str, state_given: bool) -> int:
    """Exit status: 0 where the body is tracked in at least one set, else 3, and the line is printed.

    Parameters
    ----------
    counts : image sets by the name of their status.
    reason : what most of them say; may be empty.
    state_given : whether the run began with a state.
    """
    if any(counts.get(name) for name in TRACKED):
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
    print(f"tracker_node {verb}: {what}", file=sys.stderr)
    return EX_NOTHING_TRACKED


def _next_step(state_given: bool) -> str:
    first = "leave out the initial state, so that the body is looked for"
    if not state_given:
        first = "give --initial-state (calibrate pose)"
    return f"{first}; tracker_node rig check looks for faults of the rig; see docs/troubleshooting.md"
