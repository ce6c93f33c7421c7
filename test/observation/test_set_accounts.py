"""Instants without an image set are counted once each, whatever the order in which images fail."""

import pytest

from tracker_node.observation.synchronizer import SetAccounts

T = 10  # tolerance


@pytest.fixture
def accounts():
    return SetAccounts(T, ("missing", "late", "old"))


def test_all_reasons_begin_at_zero(accounts):
    assert accounts.counts == {"missing": 0, "late": 0, "old": 0}


@pytest.mark.parametrize(("apart", "instants"), [(0, 1), (T, 1), (-T, 1), (T + 1, 2), (-T - 1, 2)])
def test_images_of_one_instant_count_once(accounts, apart, instants):
    accounts.failed(1000, "missing")
    assert accounts.counts["missing"] == 1
    accounts.failed(1000 + apart, "missing")
    assert accounts.counts["missing"] == instants


def test_the_first_reason_of_an_instant_counts(accounts):
    accounts.failed(1000, "missing")
    accounts.failed(1003, "old")
    assert accounts.counts == {"missing": 1, "late": 0, "old": 0}


@pytest.mark.parametrize(("apart", "missing"), [(0, 0), (T, 0), (-T, 0), (T + 1, 1), (-T - 1, 1)])
def test_a_set_after_all(accounts, apart, missing):
    accounts.failed(1000, "missing")
    accounts.formed(1000 + apart)
    assert accounts.counts["missing"] == missing
    accounts.formed(5000)
    assert accounts.counts["missing"] == missing


@pytest.mark.parametrize(("apart", "late"), [(0, 0), (T, 0), (-T, 0), (T + 1, 1), (-T - 1, 1)])
def test_late_images_of_an_instant_with_a_set_are_no_instant(accounts, apart, late):
    accounts.formed(1000)
    accounts.late(1000 + apart)
    assert accounts.counts["late"] == late


def test_late_images_of_a_failed_instant_are_no_other(accounts):
    accounts.failed(1000, "missing")
    accounts.late(1005)
    assert accounts.counts == {"missing": 1, "late": 0, "old": 0}
    accounts.formed(2000)  # which settles it
    accounts.late(1005)
    assert accounts.counts == {"missing": 1, "late": 0, "old": 0}


def test_late_images_of_one_unknown_instant_count_once(accounts):
    accounts.formed(1000)
    accounts.late(500)
    accounts.late(505)
    accounts.late(600)
    assert accounts.counts["late"] == 2


def test_time_begins_anew_and_counts_stay(accounts):
    accounts.formed(1000)
    accounts.failed(2000, "old")
    accounts.forget()
    assert accounts.counts == {"missing": 0, "late": 0, "old": 1}
    accounts.late(1000)  # of the new time: nothing is known of it
    accounts.failed(2000, "old")
    assert accounts.counts == {"missing": 0, "late": 1, "old": 2}
    accounts.formed(2000)
    assert accounts.counts["old"] == 1


def test_counts_are_a_copy(accounts):
    accounts.counts["missing"] += 5
    assert accounts.counts["missing"] == 0
