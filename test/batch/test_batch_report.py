"""One report over all trials: means, spreads, and the trial that stands out."""

import json
import math
import re

import numpy as np
import pytest

from tracker_node.batch.report import spread_over, write_batch_report
from tracker_node.batch.work import FAILED_STATE, TRACKED, Outcome


def outcome(name: str, error_mm: float, subject: str = "anna", **others) -> Outcome:
    found = {
        "state": TRACKED, "image_sets": 10, "status_counts": {"TRACKING": 9, "LOST": 1}, "wall_s": 2.0, "version": "1",
        "metrics": {"mpjpe_mm": error_mm, "residual_px": 1.0, "lost_sets": 1, "reacquisition_s_median": None},
        "ranges": {"knee_flexion": (-5.0, 55.0 + error_mm)},
    }  # fmt: skip
    return Outcome(name, subject, **(found | others))


def test_the_spread_is_that_of_a_sample():
    spread = spread_over({"a": 1.0, "b": 2.0, "c": 6.0, "d": None, "e": math.nan})
    assert (spread.n, spread.mean, spread.lowest, spread.highest, spread.outliers) == (3, 3.0, 1.0, 6.0, ())
    assert spread.sd == pytest.approx(np.std([1.0, 2.0, 6.0], ddof=1))
    assert math.isnan(spread_over({"a": 1.0}).sd) and spread_over({}).n == 0


def test_the_trial_that_stands_out_is_named():
    values = {f"t{i}": 10.0 + 0.1 * i for i in range(6)}
    assert spread_over(values).outliers == ()
    assert spread_over(values | {"odd": 14.0}).outliers == ("odd",)
    assert spread_over({f"t{i}": 10.0 for i in range(6)} | {"odd": 10.5}).outliers == ("odd",)  # where all others are alike
    assert spread_over({f"t{i}": 10.0 for i in range(6)}).outliers == ()
    assert spread_over({"a": 1.0, "b": 1.1, "c": 1.2, "odd": 50.0}).outliers == ()  # too few to say so


def test_the_report_shows_trials_means_and_failures(tmp_path):
    outcomes = [outcome(f"t{i}", 10.0 + i, "anna" if i % 2 else "ben") for i in range(4)]
    outcomes.append(Outcome("t9", "ben", FAILED_STATE, "rig.yaml: <no> such file"))
    metrics = write_batch_report(tmp_path, outcomes)
    assert (metrics["batch.trials"], metrics["batch.failed"]) == (5, 1)
    assert metrics["batch.mpjpe_mm_mean"] == 11.5
    assert metrics["batch.mpjpe_mm_sd"] == pytest.approx(np.std([10, 11, 12, 13], ddof=1))
    written = json.loads((tmp_path / "report.json").read_text())["metrics"]
    assert written["batch.mpjpe_mm_mean"] == 11.5 and written["batch.reacquisition_s_median_mean"] is None
    page = (tmp_path / "report.html").read_text()
    assert "t9 failed: rig.yaml: &lt;no&gt; such file" in page and "knee flexion" in page and "Joint error (MPJPE)" in page
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")


def test_means_of_counts_have_a_digit_and_names_lead_to_results(tmp_path):
    """3 and 6 contacts are 4.5 in the mean; a name leads to the page of its trial, or to its folder."""
    counts = {"a b": (3, 0), "c": (6, 1)}
    outcomes = [outcome(name, 1.0, metrics={"contacts_left": n, "lost_sets": lost}) for name, (n, lost) in counts.items()]
    (tmp_path / "a b").mkdir()
    (tmp_path / "a b/report.html").touch()
    metrics = write_batch_report(tmp_path, [*outcomes, Outcome("d", "", FAILED_STATE, "no images")], pdf=False)
    assert (metrics["batch.contacts_left_mean"], metrics["batch.lost_sets_mean"]) == (4.5, 0.5)
    page = (tmp_path / "report.html").read_text()
    row = page[page.index('<td class="">Contacts') :].split("</tr>")[0]
    assert re.findall(r">([\d.]+)</td>", row) == ["2", "4.5", "2.1", "3", "6"]
    assert re.findall(r'<a href="([^"]*)">([^<]*)</a></td>', page) == [("a%20b/report.html", "a b"), ("c/", "c")]


def test_what_matters_comes_first_and_notes_once(tmp_path):
    outcomes = [outcome(f"t{i}", 1.0, notes=("no rate",), status_counts={"TRACKING": 9}) for i in range(4)]
    outcomes.append(outcome("lost", 1.0, notes=("by colors",)))
    outcomes.append(outcome("broken", 1.0, problems=("cam02 broke off",), status_counts={"TRACKING": 9}))
    write_batch_report(tmp_path, outcomes)
    page = (tmp_path / "report.html").read_text()
    said = ["broken: cam02 broke off", "4 trials: no rate", "lost: by colors"]
    assert re.findall(r'<p class="problem">([^<]*)<', page) == said
    assert re.findall(r'class="light (\w+)"', page)[:6] == ["good"] * 4 + ["warn"] * 2
    assert [one.name for one in outcomes if one.is_doubtful] == ["lost", "broken"]


def test_versions_that_differ_are_said(tmp_path):
    write_batch_report(tmp_path, [outcome("a", 1.0), outcome("b", 2.0, version="2")], pdf=False)
    assert "tracked by versions 1 and 2" in (tmp_path / "report.html").read_text()
    assert not (tmp_path / "report.pdf").exists()


def test_a_batch_of_failures_alone_has_a_report(tmp_path):
    metrics = write_batch_report(tmp_path, [Outcome("a", "", FAILED_STATE, "no images")])
    assert metrics == {"batch.trials": 1, "batch.failed": 1}


def test_trials_of_several_bodies_have_a_row_and_means_for_each(tmp_path):
    def pair(name: str, error_mm: float, **other) -> Outcome:
        bodies = {"one": {"TRACKING": 3}, "other": {"LOST": 3}}
        metrics = {"one.mpjpe_mm": error_mm, "one.dof_rms.knee_deg": 1.0, "other.mpjpe_mm": 4321.0, "other.lost_sets": 3}
        return outcome(name, 0.0, by_body=bodies, metrics=metrics, **other)

    (tmp_path / "a/other").mkdir(parents=True)
    (tmp_path / "a/other/report.html").touch()
    metrics = write_batch_report(tmp_path, [pair("a", 6.0), pair("b", 8.0)], pdf=False)
    assert metrics["batch.one.mpjpe_mm_mean"] == 7.0
    page = (tmp_path / "report.html").read_text()
    rows = re.findall(r"<tr>.*?</tr>", page[page.index('<a href="a/one/') - 200 :], re.DOTALL)[:4]
    for row, (link, body, percent, error) in zip(
        rows,
        [("a/one/", "one", "100", "6"), ("a/other/report.html", "other", "0", "4321"), ("b/one/", "one", "100", "8"),
         ("b/other/", "other", "0", "4321")],
        strict=True,
    ):  # fmt: skip
        assert f'href="{link}"' in row and f">{body}<" in row and f">{percent}.0" in row and f">{error}.0" in row
        assert ('light bad"' in row) == (body == "other")
    assert "one: Joint error (MPJPE)" in page and "other: Lost" in page and "a other" in page
