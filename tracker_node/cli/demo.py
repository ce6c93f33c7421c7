"""``tracker_node demo``: a real recording from the package index to a report, in one command."""

from __future__ import annotations

import argparse
import json
import math
import shutil
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from .arguments.recording import evaluation_of, fill_in
from .arguments.verbs import run_verb
from .sample import POINTS, RECORDING, TOGETHER, prepare

SUMMARY = "track a real recording of a person from end to end, by contours, by points and by both, and report"
EXAMPLE = "tracker_node demo --output out/demo"
PICTURES = 3  # of each way: the page stays small
ALONE = ("points", "contours")  # folders of these runs
WAYS = {"together": "_together", "points alone": "_points", "contours alone": ""}
"""Way of tracking -> what its metrics' keys have behind the recording's name; the first is the one that is shown."""
SHOWN = ("lost_sets", "mpjpe_mm", "mpjpe_offset_free_mm", "iou_cam01", "iou_cam02", "iou_cam03", "iou_cam04", "total_ms_p50")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", default="out/demo", metavar="DIR", help="folder to write (default: %(default)s)")
    again = "make rig, backgrounds and body anew, even where they are there already"
    parser.add_argument("--fresh", action="store_true", help=again)


def run(args: argparse.Namespace) -> int:
    folder = Path(args.output)
    began = time.monotonic()

    def done(title: str, stage: Callable[[], int]) -> int:
        print(f"\n== {title} ({time.monotonic() - began:.0f} s)", flush=True)
        status = stage()
        if status != 0:
            print(f"tracker_node demo: stopped at '{title}' with status {status}", file=sys.stderr)
        return status

    if status := done("The recording", partial(prepare, folder / "sample", args.fresh)):
        return status
    if missing := _missing_for_points():
        print(f"Without points of people, by contours alone: {missing}", flush=True)
    _remove_earlier(folder)
    for title, stage in _by_contours(folder) if missing else _three_ways(folder):
        if status := done(title, stage):
            return status
    print(f"\nDone in {time.monotonic() - began:.0f} s.")
    if not missing:
        print(_table(folder))
    print(f"  {folder / 'report.html'}: open it in a browser; {folder / 'report.pdf'}: the same for print")
    print(f"  {folder / 'report.json'}: the metrics")
    print(f"  {folder / 'bag'}: for ros2 bag, PlotJuggler or Foxglove")
    return 0


def _missing_for_points() -> str:
    """Why no points of people can be found here, and what mends it; empty where they can."""
    from ..errors import TrackerError
    from ..loaders.fetched_files import usable_weights

    try:
        usable_weights()
    except TrackerError as error:
        return str(error)
    return ""


def _by_contours(folder: Path) -> list[tuple[str, Callable[[], int]]]:
    pipeline = partial(run_verb, "pipeline", folder / "sample" / RECORDING, "--output", folder)
    return [("Tracking and evaluation", pipeline)]


def _three_ways(folder: Path) -> list[tuple[str, Callable[[], int]]]:
    """Together in a graph, whose detector finds the points; then each alone, the points being those of the bag."""
    from ..loaders.fetched_files import data_file

    sample, (by_points, by_contours) = folder / "sample", (folder / name for name in ALONE)
    recording = sample / RECORDING
    graph = ("pipeline", recording, "--config", sample / TOGETHER, "--output", folder)
    points = ("track", recording, "--config", sample / POINTS, "--from-run-bag", folder / "bag", "--output", by_points)
    # A sample of an earlier version is kept, and its parameters do not say that outlines are compared alone.
    contours = ("track", recording, "--config", data_file("config/balancing.yaml"), "--output", by_contours)
    return [
        ("Tracking by contours and points together", partial(run_verb, *graph, "--no-evaluate")),
        ("Tracking by points alone", partial(run_verb, *points, "--no-evaluate")),
        ("Tracking by contours alone", partial(run_verb, *contours, "--no-evaluate")),
        ("Comparison", partial(_compare, folder)),
    ]


def _compare(folder: Path) -> int:
    args = argparse.Namespace(recording=folder / "sample" / RECORDING, rig=None, model=None, start=None, end=None)
    args.no_evaluate = False
    recording = fill_in(args, {"start": 0})
    assert recording is not None
    runs = dict(zip(WAYS.values(), (folder / "bag", *(folder / name for name in ALONE)), strict=True))
    return run_verb(*evaluation_of(recording, args, runs, folder), "--pictures", str(PICTURES))


def _table(folder: Path) -> str:
    """Figures of the ways side by side."""
    metrics = json.loads((folder / "report.json").read_text(encoding="utf-8"))["metrics"]
    lines = [f"  {'':<22}" + "".join(f"{way:>16}" for way in WAYS)]
    for key in SHOWN:
        values = [metrics[f"balancing{suffix}.{key}"] for suffix in WAYS.values()]
        lines.append(f"  {key:<22}" + "".join(f"{_text(value):>16}" for value in values))
    return "\n".join(lines)


def _text(value: float | None) -> str:
    if value is None or not math.isfinite(value):
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.1f}" if value > 1.0 else f"{value:.3f}"


def _remove_earlier(folder: Path) -> None:
    """Runs of an earlier demo; but not an offline run in the folder itself, over which nothing is written."""
    if (folder / "states.csv").exists():
        return
    bag = folder / "bag"
    if (bag / "metadata.yaml").exists() or (bag.is_dir() and list(bag.glob("*.mcap"))):
        shutil.rmtree(bag)
    for name in ("run.json", "body.yaml"):
        (folder / name).unlink(missing_ok=True)
    for name in ALONE:
        if (folder / name / "states.csv").exists():
            shutil.rmtree(folder / name)
