"""Which parameters count as inert: tests that failed, of those that tried one each."""

import json

import pytest

from benchmark.suite import parameters
from tracker_node.tracking.config import describe

REPORT = """<testsuites><testsuite>
<testcase name="one[a.b-region]" time="1"/>
<testcase name="one[a.c-region]" time="1"><failure message="a.c is inert">...</failure></testcase>
<testcase name="one[a.d-region]" time="1"><error message="broken"/></testcase>
</testsuite></testsuites>"""


def test_failures_and_errors_are_inert(tmp_path):
    (tmp_path / "report.xml").write_text(REPORT)
    assert parameters.outcomes(tmp_path / "report.xml") == (["one[a.c-region]", "one[a.d-region]"], 3)


def test_every_parameter_is_tried_or_in_the_list():
    names = parameters.tests_of(parameters.FILE)
    assert len(names) + parameters.exempt_parameters() == len(set(describe()) - {"modalities"})


@pytest.mark.long
def test_tests_that_cannot_run_are_no_result():
    with pytest.raises(RuntimeError, match=r"got status [45]"):
        parameters.failed_tests(["test/tracking/no_such_file.py"])


@pytest.mark.long
def test_the_program_writes_its_keys(tmp_path):
    assert parameters.main(["--quick", "--json", str(tmp_path / "parameters.json")]) == 0
    metrics = json.loads((tmp_path / "parameters.json").read_text())["metrics"]
    assert metrics["house.inert_parameters"] == 0 and metrics["house.tried_parameters"] > 5
