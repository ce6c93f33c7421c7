"""The drills that matter most, as `faults.py` runs them: a fault is said by name, and the graph goes on by itself."""

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")
pytest.importorskip("tracker_msgs", reason="the interface package is not installed")

from benchmark.faults import faults
from benchmark.faults._graph import Drill, Graph, Outcome, recorded_and_ros, run_drill

DRILLS = {drill.name: drill for drill in faults.drills()}
MOST_IMPORTANT = (
    "camera process killed, started again",
    "tracker killed, started again",
    "recorder killed",
    "image doubled",
    "image data shorter than announced",
    "image of another size",
    "damaged JPEG",
    "clock jumps back",
    "a camera's clock jumps ahead",
    "calibration with NaN",
    "rig in millimeters",
    "a node without ROS",
    "a camera taken out of use while images flow",
    "deactivated and activated while images flow",
    "set_state far beyond the room",
    "lossless, and camera_info does not come",
    "OpenCV calibration nested 100 000 times (YAML)",
    "/dev/zero as a rig",
    "streams with a password",
)
QUICK = "image doubled"  # for every change; the others are long


@pytest.fixture(scope="module")
def recording() -> Iterator[Path]:
    with recorded_and_ros() as folder:
        yield folder


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.long] * (name != QUICK)) for name in MOST_IMPORTANT])
def test_drill(name, recording):
    outcome = run_drill(DRILLS[name], recording)
    if outcome.skipped:
        pytest.skip(outcome.seen)
    assert outcome.expected, outcome.seen


@pytest.mark.long
def test_what_does_not_happen_is_not_as_expected(recording, monkeypatch):
    monkeypatch.setattr("benchmark.faults._graph.TIMEOUT_S", 0.2)

    def inject(graph: Graph) -> Outcome:
        graph.wait_said("nobody", b"\x02", "nothing")
        return Outcome("", "")

    outcome = run_drill(Drill("nothing", "something", inject), recording)
    assert not outcome.expected
    assert "nobody" in outcome.seen


@pytest.mark.long
@pytest.mark.parametrize("error", [OSError("no such\nthing"), AssertionError()])
def test_an_error_is_not_as_expected_either(error, recording):
    def inject(graph: Graph) -> Outcome:
        raise error

    outcome = run_drill(Drill("nothing", "something", inject), recording)
    assert not outcome.expected
    assert outcome.seen == ("OSError: no such" if str(error) else "(without a text)")


@pytest.mark.parametrize(
    ("metrics", "status"),
    [
        ({"faults.as_expected": 4, "faults.total": 4, "faults.skipped": 1}, 0),
        ({"faults.as_expected": 3, "faults.total": 4, "faults.skipped": 0}, 1),
        ({"fuzz.answered": 9, "fuzz.total": 10}, 1),
        ({"fuzz.answered": 10, "fuzz.total": 10, "fuzz_others.answered": 0, "fuzz_others.total": 1}, 1),
    ],
)
def test_the_exit_status_says_whether_all_was_as_expected(metrics, status, monkeypatch):
    monkeypatch.setattr(faults, "drill", lambda only: metrics)
    assert faults.main(["--only", "drills"]) == status


def test_the_documentation_names_the_program_and_every_drill_says_what_it_expects(repository):
    assert "benchmark/faults/faults.py" in (repository / "docs" / "troubleshooting.md").read_text()
    assert all(drill.name and drill.expected for drill in DRILLS.values())
    assert len({drill.name for drill in DRILLS.values()}) == len(DRILLS)
