"""Recording days whose difference is known: on the second day hips and knees move by four fifths."""

import json

import numpy as np
import pytest
from scipy.stats import ttest_ind

from helpers.bodies.stick_person import write_run
from helpers.motion import known_motions as known
from helpers.studio.browser import browser_tab
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.report.days import Day, days_document, days_metrics, difference
from tracker_node.evaluation.review import Truth, review
from tracker_node.evaluation.run_review import runs_in
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.runs.load import load_run

SCALE = 0.8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two walks on Monday, one on Tuesday with another gait."""
    folder = tmp_path_factory.mktemp("days")
    for day, walks in (("monday", ((1.0, 1), (1.0, 2))), ("tuesday", ((SCALE, 3),))):
        for scale, seed in walks:
            motion = known.walk(seconds=5.0, scale=scale, noise_deg=0.3, seed=seed)
            write_run(folder / day / f"walk{seed}", motion)
    dump_model(motion.model, folder / "person.yaml")
    return folder


@pytest.fixture(scope="module")
def days(folder):
    model = known.walk(seconds=0.1).model
    options = {run: EvaluationOptions(run.name, cutoff_hz=6.0) for day in ("monday", "tuesday") for run in runs_in(folder / day)}
    of = {run: review(load_run(run), model, Truth(), option) for run, option in options.items()}
    return [Day(day, [found for run, found in of.items() if run.parent.name == day]) for day in ("monday", "tuesday")]


def test_differences_of_ranges_and_strides_are_those_of_the_walks(days):
    found = days_metrics(days)
    for side, k in (("left", 0), ("right", 1)):
        width = 2.0 * known.KNEE_DEG[k]
        assert found[f"monday.range_{side}_knee_flexion_deg_mean"] == pytest.approx(width, abs=0.4)
        assert found[f"tuesday.range_{side}_knee_flexion_deg_difference"] == pytest.approx((SCALE - 1.0) * width, abs=0.4)
        assert found[f"monday.stride_time_{side}_s_mean"] == pytest.approx(known.STRIDE_S, abs=0.01)
        assert abs(found[f"tuesday.stride_time_{side}_s_difference"]) < 0.01
    assert found["monday.range_left_knee_flexion_deg_n"] >= 2 * found["tuesday.range_left_knee_flexion_deg_n"] - 2 >= 4
    assert found["monday.range_left_knee_flexion_deg_sd"] < 0.4
    assert not any("jump" in key for key in found)


def test_angles_that_the_body_lacks_are_left_out(days):
    """Those that turns about its hinges leave at 1e-14 degrees, as reports of single runs leave them out."""
    still = {"left_knee_adduction", "right_elbow_carrying_angle"}
    assert still <= set(days[0].reviews[0].joint_motion.names)
    compared = [key for key in days_metrics(days) if "range_" in key]
    assert compared and not any(name in key for name in still for key in compared)
    ranges = next(block for block in days_document(days).blocks if block.key == "ranges")
    assert "left knee flexion" in [row[0] for row in ranges.rows]
    assert not still & {str(row[0]).replace(" ", "_") for row in ranges.rows}


def test_curves_of_the_days_and_their_difference(days):
    document = days_document(days)
    charts = {block.title: block for block in document.blocks}
    both, change = charts["Hip flexion, left"], charts["Hip flexion, left: difference"]
    assert [line.label.split(" (")[0] for line in both.lines] == ["monday", "tuesday"]
    assert [np.ptp(line.y) for line in both.lines] == pytest.approx([2 * known.HIP_DEG[0], 2 * SCALE * known.HIP_DEG[0]], abs=0.5)
    (line,) = change.lines
    assert line.y == pytest.approx(both.lines[1].y - both.lines[0].y) and line.y.max() > 0.15 * known.HIP_DEG[0]
    assert line.spread.max() < 1.0 and change.filter == both.filter == "Butterworth, 4th order, no lag, 6 Hz"
    assert [section.title for section in document.sections] == [
        "The motion",
        "Angles over the stride",
        "Days compared",
        "Quality",
    ]
    (ranges,) = [block for block in document.blocks if block.key == "ranges"]
    row = next(row for row in ranges.rows if row[0] == "left knee flexion")
    assert row[-2].value == pytest.approx((SCALE - 1.0) * 2.0 * known.KNEE_DEG[0], abs=0.4) and 0.0 < row[-1].value < 0.6


def test_the_interval_is_that_of_welch():
    rng = np.random.default_rng(4)
    first, other = rng.normal(10.0, 1.0, 9), rng.normal(12.0, 3.0, 6)
    change, half = difference(first, other)
    interval = ttest_ind(other, first, equal_var=False).confidence_interval(0.95)
    assert (change - half, change + half) == pytest.approx((interval.low, interval.high))
    assert np.isnan(difference(first, other[:1])[1]) and difference(first, other[:1])[0] == pytest.approx(other[0] - first.mean())


def test_the_command_reports_on_days_that_are_folders_of_runs(folder, tmp_path):
    names = [str(folder / day) for day in ("monday", "tuesday")]
    given = ["evaluate", *names, "--days", "--model", str(folder / "person.yaml"), "--output", str(tmp_path), "--csv", "--no-pdf"]
    assert main(given) == 0
    metrics = json.loads((tmp_path / "report.json").read_text())["metrics"]
    assert metrics["tuesday.range_left_knee_flexion_deg_difference"] == pytest.approx(-0.2 * 2.0 * known.KNEE_DEG[0], abs=0.4)
    assert (tmp_path / "figures" / "left_knee_flexion_difference.csv").is_file()
    for width in (1400, 390):
        with browser_tab(width) as tab:
            tab.page.goto((tmp_path / "report.html").as_uri())
            tab.page.wait_for_function("document.documentElement.dataset.drawn", timeout=60_000)
            assert tab.page.locator("h2").first.text_content() == "The motion" and tab.errors == []
            assert tab.page.locator("[data-chart] .main-svg").count() >= 8
            assert tab.page.evaluate("document.documentElement.scrollWidth") <= width


def test_days_that_cannot_be_compared_are_refused(folder, tmp_path, capsys):
    monday, output = str(folder / "monday"), ["--output", str(tmp_path)]
    for given, said in (
        ([monday, "--days", *output], "--days: expected two days or more, got 1"),
        ([monday, monday, "--days", "--truth", "x.trc", *output], "--truth: days are compared with each other alone"),
        (
            [monday, str(tmp_path), "--days", "--model", str(folder / "person.yaml"), *output],
            "a run, or a folder with runs in it",
        ),
    ):
        assert main(["evaluate", *given]) == 2
        assert said in capsys.readouterr().err
    with pytest.raises(FileFormatError, match="folder with runs"):
        runs_in(tmp_path)
    assert [path.name for path in runs_in(folder / "monday")] == ["walk1", "walk2"]
    assert [path.parent.name for path in runs_in(folder / "*/walk1")] == ["monday"]
    assert runs_in(folder / "monday" / "walk1") == [folder / "monday" / "walk1"]


def test_days_of_one_of_several_bodies_are_patterns(tmp_path, capsys):
    for day, scale in (("day1", 1.0), ("day2", SCALE)):
        for trial, seed in (("a", 1), ("b", 2)):
            motion = known.walk(seconds=5.0, scale=scale, noise_deg=0.3, seed=seed)
            write_run(tmp_path / day / trial / "anna", motion)
            write_run(tmp_path / day / trial / "ben", known.walk(seconds=2.0))
    dump_model(motion.model, tmp_path / "person.yaml")
    more = ["--days", "--model", str(tmp_path / "person.yaml"), "--no-pdf", "--output", str(tmp_path / "out")]
    assert main(["evaluate", str(tmp_path / "day1"), str(tmp_path / "day2"), *more]) == 2
    assert "of several bodies 'DAY/*/NAME'" in capsys.readouterr().err
    days = [str(tmp_path / day / "*/anna") for day in ("day1", "day2")]
    assert main(["evaluate", *days, *more, "--name", "before", "--name", "after"]) == 0
    said = [line.split(":")[0] for line in capsys.readouterr().err.splitlines() if " states of " in line]
    assert said == ["a_anna", "b_anna"] * 2
