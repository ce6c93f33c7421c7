"""The demo: what it runs with points and without, and over an earlier one: what that left makes room, other things stay."""

import json
import sys
from argparse import Namespace
from pathlib import Path

import pytest

from tracker_node.cli import demo
from tracker_node.errors import TrackerError
from tracker_node.loaders import fetched_files
from tracker_node.loaders.bag.writer import BagExistsError
from tracker_node.runs.writer import run_of_bag

FIGURES = {"lost_sets": 0, "mpjpe_mm": 39.26, "total_ms_p50": None}


class Demo:
    """In place of tracking only the places of the runs are looked at, as pipeline and track do."""

    def __init__(self, folder: Path):
        self.folder, self.commands = folder, []

    def run(self) -> int:
        return demo.run(Namespace(output=str(self.folder), fresh=False))

    def verb(self, *arguments: str | Path) -> int:
        self.commands.append([str(argument).removeprefix(f"{self.folder}/") for argument in arguments])
        if arguments[0] == "evaluate":
            metrics = {f"balancing{way}.{key}": 0.8 for way in demo.WAYS.values() for key in demo.SHOWN}
            metrics |= {f"balancing_together.{key}": value for key, value in FIGURES.items()}
            (self.folder / "report.json").write_text(json.dumps({"metrics": metrics}))
            return 0
        output = Path(arguments[arguments.index("--output") + 1])
        if arguments[0] == "track":
            output.mkdir()
            (output / "states.csv").touch(exist_ok=False)
            return 0
        return 0 if run_of_bag(output / "bag") else 1


@pytest.fixture
def finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Demo:
    """A folder with a finished run."""
    made = Demo(tmp_path)
    (tmp_path / "bag").mkdir()
    (tmp_path / "sample").mkdir()
    for name in ("r.yaml", "m.yaml"):
        (tmp_path / "sample" / name).touch()
    (tmp_path / "sample/recording.yaml").write_text("{rig: r.yaml, model: m.yaml, output: run, evaluate: {name: balancing}}")
    for name in ("bag/metadata.yaml", "run.json"):
        (tmp_path / name).write_text("{}")
    monkeypatch.setattr(demo, "prepare", lambda folder, fresh: 0)
    monkeypatch.setattr(demo, "run_verb", made.verb)
    monkeypatch.setattr(fetched_files, "pose_weights", lambda points: None)
    monkeypatch.setitem(sys.modules, "ai_edge_litert", sys)  # whether it is installed here or not
    return made


def test_three_ways_use_the_points_of_one_detector_and_are_compared(finished: Demo, capsys: pytest.CaptureFixture) -> None:
    assert finished.run() == 0
    recording = "sample/recording.yaml"
    together, points, contours, comparison = finished.commands
    assert together == ["pipeline", recording, "--config", "sample/tracker_together.yaml", "--output", str(finished.folder),
                        "--no-evaluate"]  # fmt: skip
    assert points == ["track", recording, "--config", "sample/tracker_points.yaml", "--from-run-bag", "bag", "--output", "points",
                      "--no-evaluate"]  # fmt: skip
    assert contours[:3] == ["track", recording, "--config"] and contours[3].endswith("config/balancing.yaml")
    assert contours[4:] == ["--output", "contours", "--no-evaluate"]
    assert comparison[:4] == ["evaluate", "bag", "points", "contours"]
    names = [comparison[i + 1] for i, option in enumerate(comparison) if option == "--name"]
    assert names == ["balancing_together", "balancing_points", "balancing"]
    assert comparison[comparison.index("--rig") + 1].endswith("sample/r.yaml")
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["together", "points", "alone", "contours", "alone"] in lines
    assert ["lost_sets", "0", "0.800", "0.800"] in lines and ["mpjpe_mm", "39.3", "0.800", "0.800"] in lines
    assert ["total_ms_p50", "-", "0.800", "0.800"] in lines


def test_without_the_extra_contours_alone_are_tracked_and_the_line_that_installs_it_is_said(
    finished: Demo, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, "ai_edge_litert", None)
    assert finished.run() == 0
    assert finished.commands == [["pipeline", "sample/recording.yaml", "--output", str(finished.folder)]]
    (said,) = [line for line in capsys.readouterr().out.splitlines() if "contours alone" in line]
    assert "ai_edge_litert is not installed; pip install 'tracker_node[keypoints]' brings it" in said


def test_without_weights_and_network_contours_alone_are_tracked(
    finished: Demo, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    def unreachable(points: None) -> None:
        raise TrackerError("the weights could not be fetched; put them there")

    monkeypatch.setattr(fetched_files, "pose_weights", unreachable)
    assert finished.run() == 0 and len(finished.commands) == 1
    assert "Without points of people, by contours alone: the weights could not be fetched" in capsys.readouterr().out


def test_it_stops_where_a_way_fails(finished: Demo, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.setattr(demo, "run_verb", lambda *arguments: finished.verb(*arguments) or 3 * (arguments[0] == "track"))
    assert finished.run() == 3 and len(finished.commands) == 2
    assert "stopped at 'Tracking by points alone' with status 3" in capsys.readouterr().err


def test_it_runs_again_over_its_own_run_also_where_that_was_killed_early(finished: Demo) -> None:
    assert finished.run() == 0
    assert sorted(path.name for path in finished.folder.iterdir()) == ["contours", "points", "report.json", "sample"]
    (finished.folder / "run.json").write_text("{}")  # written before the first message
    assert finished.run() == 0


def test_an_offline_run_is_left_as_it_is(finished: Demo) -> None:
    (finished.folder / "states.csv").write_text("")
    with pytest.raises(BagExistsError, match=r"states\.csv"):
        finished.run()
    assert (finished.folder / "bag" / "metadata.yaml").exists() and (finished.folder / "run.json").exists()
