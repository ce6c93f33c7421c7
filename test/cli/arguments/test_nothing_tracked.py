"""The line and the exit status of a run in which nothing was tracked."""

import pytest

from tracker_node.cli.arguments.run_images import nothing_tracked

LOOK = "; tracker_node rig check finds faults of the rig; see docs/troubleshooting.md"
WITHOUT, GIVE = (
    f"leave out the initial state, so that the body is searched in the images{LOOK}",
    f"give --initial-state (calibrate pose){LOOK}",
)


@pytest.mark.parametrize(
    "counts", [{"TRACKING": 1, "LOST": 9}, {"DEGRADED": 1}, {"TRACKING": 3, "DEGRADED": 2, "INITIALIZING": 1}]
)
def test_one_tracked_set_is_enough(counts, capsys):
    assert nothing_tracked("track", counts, "dark", True) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("counts", "reason", "given", "line"),
    [
        ({}, "dark", True,
         "no image set was formed, so nothing is tracked: look at the stamps of the cameras and at synchronizer.*"),
        ({"LOST": 0, "TRACKING": 0}, "", False,
         "no image set was formed, so nothing is tracked: look at the stamps of the cameras and at synchronizer.*"),
        ({"LOST": 7, "TRACKING": 0}, "no outline", True,
         "the body is LOST in all 7 image sets (mostly: no outline); likely the initial state is not where the body is in the"
         f" first images, or rig and images do not fit: {WITHOUT}"),
        ({"LOST": 7}, "", False,
         f"the body is LOST in all 7 image sets; likely the start was wrong, or rig and images do not fit: {GIVE}"),
        ({"LOST": 7, "INITIALIZING": 2}, "", False,
         f"the body is tracked in none of 9 image sets; likely the start was wrong, or rig and images do not fit: {GIVE}"),
        ({"INITIALIZING": 4, "LOST": 0}, "nobody there", False,
         f"the body was found in none of 4 image sets (nobody there): {GIVE}"),
        ({"INITIALIZING": 4}, "", True, f"the body was found in none of 4 image sets: {WITHOUT}"),
    ],
)  # fmt: skip
def test_what_was_seen_and_what_to_do(counts, reason, given, line, capsys):
    assert nothing_tracked("pipeline", counts, reason, given) == 3
    assert capsys.readouterr() == ("", f"tracker_node pipeline: {line}\n")
